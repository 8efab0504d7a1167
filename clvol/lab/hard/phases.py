"""Henyey-Greenstein functions from straight on to straight back."""

from __future__ import annotations

import numpy as np

from clvol.lab.hard import scenes
from clvol.lab.hard.case import Case
from clvol.lab.hard.rays import NARROW
from clvol.lab.hard.thickness import AHEAD, EYE, block

GROUP = "phase functions"


def _lit(g: float, turn: float) -> Case:
    """Lit at an angle `turn` from straight back: the peak of a negative g is there."""
    sun = np.array([np.sin(turn), 0.0, np.cos(turn)])
    return Case(
        f"sunlit cube, g = {g:g}, {turn:g} from the axis",
        GROUP,
        lambda: scenes.sunlit([block(2.0)], EYE, AHEAD, g=g, sun=sun, fov=NARROW),
        lambda: scenes.slab_light(2.0, sun=sun),
        "closed form; the irradiance is 1 / p, the phase function in float64",
        rounding=1e-5 if abs(g) < 0.9999 else 5e-4,
        note="1 + g² - 2 g cos in float32 has no digit left here" if turn < 0.1 and abs(g) > 0.99 else "",
    )


def _furnace(g: float) -> Case:
    return Case(
        f"furnace, g = {g:g}",
        GROUP,
        lambda: scenes.furnace(
            [block(4.0)], EYE, AHEAD, albedo=1.0, emission=1.0, phase={"type": "hg", "g": g}
        ),
        lambda: np.ones(1),
        "energy: nothing shows",
        spp=256,
    )


CASES = (
    *(_lit(g, 0.3) for g in (0.0, 1e-8, -1e-8, 0.999, -0.999, 0.99999, -0.99999)),
    *(_lit(g, 1e-3) for g in (0.999, 0.99999, -0.999, -0.99999)),
    *(_furnace(g) for g in (0.999, -0.999, 0.99999, -0.99999)),
)
