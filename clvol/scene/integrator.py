"""Integrators: path length limits, and the estimator choices a scene may carry."""

from __future__ import annotations

from clvol.scene.reader import Reader
from clvol.scene.records import Integrator

CHOICES = ("technique", "transmittance", "majorant", "lookup", "absorption", "probability", "control")
"""Parameters handed on as strings; what they may say is for the registry of techniques to judge."""


def volpath(reader: Reader) -> Integrator:
    """The `volpath` and `volpathmis` plugins, which have the same parameters and the same expectation."""
    reader.ignore("samples_per_pass", "block_size")
    return Integrator(
        max_depth=reader.integer("max_depth", -1, -1),
        rr_depth=reader.integer("rr_depth", 5, 1),
        hide_emitters=reader.boolean("hide_emitters", False),
        choices={name: reader.string(name, "") for name in CHOICES if reader.has(name)},
    )
