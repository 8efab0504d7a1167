"""Combinations that cannot be right: every refusal is one sentence on why, and one on what to use."""

from __future__ import annotations

from typing import TYPE_CHECKING

from clvol.errors import OptionError, option
from clvol.planning import registry

if TYPE_CHECKING:
    from collections.abc import Mapping

    from clvol.planning.choices import Choices
    from clvol.planning.features import Features


def refuse_impossible(features: Features, choices: Choices, chosen: Mapping[str, str]) -> None:
    """Raise OptionError for a combination that cannot be right, saying why and what to use."""
    technique, transmittance = chosen["technique"], chosen["transmittance"]
    tracker, estimator = registry.TECHNIQUES[technique], registry.TRANSMITTANCES[transmittance]
    if transmittance == "none" and (features.directional or features.lit_by_points):
        raise OptionError(
            "transmittance 'none' cannot render point, spot and directional lights, nor projectors",
            hint="only next-event estimation reaches them: use ratio",
        )
    marches = features.heterogeneous and (tracker.biased or estimator.biased)
    if choices.step is not None and not marches:
        raise nothing_marches()
    if not features.heterogeneous:
        return  # closed forms take the place of every technique and transmittance
    used = [("technique", technique, tracker, "weighted-delta")]
    if features.samples_lights and features.scattering:
        used.append(("transmittance", transmittance, estimator, "ratio"))
    if features.interpolated_transfers and chosen["lookup"] == "stochastic":
        raise OptionError(
            "stochastic look-ups would bias a transfer function, which classifies interpolated values",
            hint=f"use {option('lookup', 'exact')}, or a volume with filter_type nearest",
        )
    for family, name, choice, instead in used:
        if choices.majorant_scale < 1 and choice.needs_bound:
            raise OptionError(
                f"{family} {name!r} is biased where bounds are too low, as by {option('majorant_scale')} "
                "below 1",
                hint=f"use one that carries weights, such as {instead}",
            )
        if features.interpolated_transfers and choice.interpolated:
            raise OptionError(
                f"{family} {name!r} integrates interpolated samples, and a transfer function makes something "
                "else of them",
                hint=f"use {instead}, or a volume with filter_type nearest",
            )
        if features.varied_areas and choice.interpolated:
            raise OptionError(
                f"{family} {name!r} integrates interpolated samples, of which microflakes that differ from "
                "place to place make another extinction",
                hint=f"use {instead}",
            )
        if chosen["lookup"] == "stochastic" and not choice.linear:
            raise OptionError(
                f"stochastic look-ups would bias {family} {name!r}, which is not linear in the density",
                hint=f"use {option('lookup', 'exact')}",
            )


def nothing_marches() -> OptionError:
    """The error about a step that nothing takes."""
    hint = f"choose {option('technique', 'marching')} or {option('transmittance', 'marching')}"
    return OptionError(f"{option('step')} is for ray marching, and nothing marches here", hint=hint)


MOST_STEPS = 1e5
"""Marching steps across the scene beyond which a step is taken for a mistake."""


def refuse_fine_step(step: float | None, radius: float) -> None:
    """Raise OptionError for a marching step that would never get across the scene."""
    if step is not None and 2 * radius / step > MOST_STEPS:
        raise OptionError(
            f"step {step:g} is too fine: {2 * radius / step:.2g} steps across the scene",
            hint=f"give at least {2 * radius / MOST_STEPS:.2g}",
        )
