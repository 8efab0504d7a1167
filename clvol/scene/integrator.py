"""Integrators: path length limits, and the estimator choices a scene may carry."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

from clvol.scene.records import Integrator

if TYPE_CHECKING:
    from clvol.scene.reader import Reader

CHOICES = (
    "technique",
    "transmittance",
    "majorant",
    "lookup",
    "absorption",
    "gathering",
    "roulette",
    "background",
    "probability",
    "control",
    "sampler",
    "shadow_cache",
    "light_choice",
    "next_event",
    "lanes",
)
"""Parameters handed on as strings; what they may say is for the registry of techniques to judge."""


@dataclass(frozen=True)
class Chosen:
    """An integrator, and whether it looks into media; `name` is the plugin's."""

    integrator: Integrator
    media: bool = True
    name: str = "volpath"


def volpath(reader: Reader) -> Chosen:
    """The `volpath` and `volpathmis` plugins, which have the same parameters and the same expectation."""
    choices = {name: reader.string(name, "") for name in CHOICES if reader.has(name)}
    return Chosen(_limits(reader, choices), True, reader.type)


def path(reader: Reader) -> Chosen:
    """The `path` plugin, for scenes without media."""
    return Chosen(_limits(reader, {}), False, reader.type)


def moment(reader: Reader) -> Chosen:
    """The `moment` plugin: every render measures its variance, so it is the integrator inside."""
    inner = reader.only_child("integrator")
    if inner is None:
        reader.fail("a moment integrator holds another one, this one is empty", hint="volpath, for instance")
    chosen: Chosen = reader.build(inner)
    return chosen


def _limits(reader: Reader, choices: dict[str, str]) -> Integrator:
    reader.ignore(samples_per_pass=int, block_size=int)
    return Integrator(
        max_depth=reader.integer("max_depth", -1, -1),
        rr_depth=reader.integer("rr_depth", 5, 1),
        hide_emitters=reader.boolean("hide_emitters", False),
        choices=choices,
    )
