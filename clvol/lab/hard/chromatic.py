"""Channels that are attenuated a thousand and a million times differently, and channels without anything."""

from __future__ import annotations

import numpy as np

from clvol.lab.hard import scenes
from clvol.lab.hard.block import Block
from clvol.lab.hard.case import Case
from clvol.lab.hard.thickness import AHEAD, EVEN, EYE

GROUP = "chromatic media"


def _lit(
    name: str, depths: tuple[float, ...], albedo: tuple[float, ...] = (1.0,), spp: int = 4096, note: str = ""
) -> Case:
    block = Block(EVEN, depths, np.eye(4))
    colour = {"type": "rgb", "value": list(albedo)} if len(albedo) > 1 else albedo[0]
    return Case(
        f"sunlit cube, {name}",
        GROUP,
        lambda: scenes.sunlit([block], EYE, AHEAD, albedo=colour),
        lambda: scenes.slab_light(depths, albedo),
        "closed form: Chandrasekhar 1960, single scattering of a slab",
        spp=spp,
        note=note,
    )


def _through(name: str, depths: tuple[float, ...]) -> Case:
    values = 0.2 + np.random.default_rng(3).random((5, 6, 7))
    block = Block(values, depths, np.eye(4))
    return Case(
        f"before a sky, {name}",
        GROUP,
        lambda: scenes.through([block], EYE, AHEAD),
        lambda: scenes.transmitted([block], EYE, AHEAD),
        "float64 quadrature of the optical depth",
        spp=4096,
    )


FEW = (
    "of the thinnest channel one path in 10,000 shows anything: the case has samples for hundreds of these "
    "by every way"
)
CASES = (
    _lit("channels 1 : 1e3", (10.0, 0.1, 0.01)),
    _lit("channels 1 : 1e6", (100.0, 0.1, 1e-4), spp=1 << 17, note=FEW),
    _lit("a channel without extinction", (2.0, 0.5, 0.0)),
    _lit("albedo 0 in one channel", (2.0, 1.0, 0.5), (1.0, 0.5, 0.0)),
    _through("channels 1 : 1e3", (3.0, 0.1, 0.003)),
    _through("channels 1 : 1e6", (3.0, 0.01, 3e-6)),
    _through("a channel without extinction", (3.0, 1.0, 0.0)),
)
