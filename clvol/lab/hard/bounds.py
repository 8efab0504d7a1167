"""Majorants that are far too low: weights make up for it, and what has none refuses."""

from __future__ import annotations

import numpy as np

from clvol.lab.hard import scenes
from clvol.lab.hard.block import Block
from clvol.lab.hard.case import Case
from clvol.lab.hard.places import AHEAD, EYE

GROUP = "bounds that do not hold"
BLOCK = Block(np.random.default_rng(4).random((5, 6, 4)) + 0.2, (1.0,), np.eye(4))
SCALE = 0.3
CASES = (
    Case(
        "majorants of 0.3 of themselves, before a sky",
        GROUP,
        lambda: scenes.through([BLOCK], EYE, AHEAD),
        lambda: scenes.transmitted([BLOCK], EYE, AHEAD),
        "float64 quadrature of the optical depth",
        spp=8192,
        majorant_scale=SCALE,
        note="analog techniques refuse; elsewhere a bound that does not hold is a silent bias",
    ),
    Case(
        "majorants of 0.3 of themselves, in the sun",
        GROUP,
        lambda: scenes.sunlit([BLOCK], EYE, AHEAD),
        lambda: scenes.scattered([BLOCK], EYE, AHEAD),
        "float64 quadrature of single scattering",
        spp=8192,
        majorant_scale=SCALE,
    ),
)
