"""Optical thickness from 1e-8 to 1e6, and albedos from 0 to 1."""

from __future__ import annotations

import numpy as np

from clvol.lab.hard import scenes
from clvol.lab.hard.block import Block
from clvol.lab.hard.case import Case

GROUP = "optical thickness"
EYE, AHEAD = (0.47, 0.52, -2.0), (0.0, 0.0, 1.0)
EVEN = np.ones((4, 4, 4))


def block(depth: float) -> Block:
    """A unit cube of that optical thickness, as a grid, in which every technique tracks."""
    return Block(EVEN, (depth,), np.eye(4))


def _lit(depth: float) -> Case:
    return Case(
        f"sunlit cube, thickness {depth:g}",
        GROUP,
        lambda: scenes.sunlit([block(depth)], EYE, AHEAD),
        lambda: scenes.slab_light(depth),
        "closed form: Chandrasekhar 1960, single scattering of a slab",
        spp=16384 if depth < 0.1 else 1024,
    )


def _solid(depth: float) -> Case:
    solid = Block(np.array(1.0), (depth,), np.eye(4))
    return Case(
        f"homogeneous sunlit cube, thickness {depth:g}",
        GROUP,
        lambda: scenes.sunlit([solid], EYE, AHEAD),
        lambda: scenes.slab_light(depth),
        "closed form, as above",
    )


def _glowing(depth: float) -> Case:
    return Case(
        f"glowing dark cube, thickness {depth:g}",
        GROUP,
        lambda: scenes.furnace([block(depth)], EYE, AHEAD, albedo=0.0, emission=1.0) | {"sky": BLACK},
        lambda: -np.expm1(-np.atleast_1d(depth)),
        "closed form: L_e (1 - exp(-tau))",
        note="a path tracer that gathers emission at collisions alone shows black here" * (depth < 1e-4),
    )


BLACK = {"type": "constant", "radiance": 0.0}


def _albedo(albedo: float) -> Case:
    return Case(
        f"furnace, albedo {albedo:.6g}",
        GROUP,
        lambda: scenes.furnace([block(4.0)], EYE, AHEAD, albedo=albedo, emission=1.0),
        lambda: np.ones(1),
        "Kirchhoff: what emits as it absorbs does not show in radiance 1",
    )


CASES = (
    *(_lit(depth) for depth in (1e-2, 1.0, 1e2, 1e4, 1e6)),
    *(_solid(depth) for depth in (1e4, 1e6)),
    *(_glowing(depth) for depth in (1e-8, 1e-5, 1e-2, 1e5)),
    *(_albedo(albedo) for albedo in (0.0, 1e-6, 0.999999, 1.0)),
    Case(
        "white cube in a furnace, thickness 100: 1.8e3 scatterings a path",
        GROUP,
        lambda: scenes.furnace([block(100.0)], (0.5, 0.5, 0.5), AHEAD, albedo=1.0, emission=1.0),
        lambda: np.ones(1),
        "energy: every path leaves with all of its weight",
        spp=8,
        note="depth limits and roulette by colour darken such media elsewhere",
    ),
)
