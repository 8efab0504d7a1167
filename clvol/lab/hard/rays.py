"""Rays along axes, in planes, through edges and corners, on boundaries, and hardly oblique."""

from __future__ import annotations

from functools import cache
from typing import TYPE_CHECKING, Any

import numpy as np

from clvol.lab.hard import scenes, splits
from clvol.lab.hard.block import Block
from clvol.lab.hard.case import Case

if TYPE_CHECKING:
    from collections.abc import Callable

GROUP = "rays"
SIDE = 17
LUMPS = np.random.default_rng(8).random((SIDE, SIDE, SIDE))
BLOCK = Block(LUMPS, (4.0,), np.eye(4))
VOXEL, BRICK, SAMPLE = 4 / SIDE, 8 / SIDE, 8.5 / SIDE
"""A face between cells of the grid, one between bricks, a plane of samples."""
NARROW = 1e-30
"""Field of view, degrees: every ray is the same one to the last bit."""
RAYS = {
    "along z": ((0.4, 0.3, -1.0), (0.0, 0.0, 1.0), NARROW),
    "against z": ((0.4, 0.3, 2.0), (0.0, 0.0, -1.0), NARROW),
    "along x, components -0": ((-1.0, 0.3, 0.4), (1.0, -0.0, -0.0), NARROW),
    "in a plane of voxels": ((VOXEL, 0.3, -1.0), (0.0, 0.2, 1.0), NARROW),
    "in a plane of bricks": ((BRICK, 0.3, -1.0), (0.0, 0.2, 1.0), NARROW),
    "in a plane of samples": ((SAMPLE, 0.3, -1.0), (0.0, 0.2, 1.0), NARROW),
    "along an edge of bricks": ((BRICK, BRICK, -1.0), (0.0, 0.0, 1.0), NARROW),
    "along an edge of samples": ((SAMPLE, SAMPLE, -1.0), (0.0, 0.0, 1.0), NARROW),
    "through all corners": ((-1.0, -1.0, -1.0), (1.0, 1.0, 1.0), NARROW),
    "through corners, backwards": ((2.0, 2.0, -1.0), (-1.0, -1.0, 1.0), NARROW),
    "from a face": ((0.4, 0.3, 0.0), (0.1, 0.2, 1.0), 1e-2),
    "from a face, outwards": ((0.4, 0.3, 1.0), (0.1, 0.2, 1.0), 1e-2),
    "from a corner": ((0.0, 0.0, 0.0), (0.5, 0.7, 1.0), 1e-2),
    "from a sample": ((SAMPLE, SAMPLE, SAMPLE), (0.5, 0.7, 1.0), 1e-2),
    "grazing a plane of bricks, slope 1e-6": ((BRICK - 5e-7, 0.3, -0.5), (1e-6, 0.2, 1.0), 1e-30),
    "grazing, slope 1e-12": ((BRICK, 0.3, -1.0), (1e-12, 0.2, 1.0), 1e-30),
    "a component of 1e-38": ((0.4, 0.3, -1.0), (1e-38, 0.2, 1.0), NARROW),
    "a denormal component": ((0.4, 0.3, -1.0), (1e-41, -1e-43, 1.0), NARROW),
    "field of view 1e-4 degrees": ((0.4, 0.3, -1.0), (0.1, 0.2, 1.0), 1e-4),
    "in a face of the box": ((0.0, 0.3, -1.0), (0.0, 0.2, 1.0), NARROW),
    "in an edge of the box": ((0.0, 0.0, -1.0), (0.0, 0.0, 1.0), NARROW),
}
"""Origin, direction, field of view."""


Ray = tuple[Any, Any, float]


def _pair(name: str, block: Callable[[], Block], ray: Callable[[], Ray]) -> tuple[Case, ...]:
    def through() -> dict[str, Any]:
        o, d, fov = ray()
        return scenes.through([block()], o, d, fov=fov)

    def sunlit() -> dict[str, Any]:
        o, d, fov = ray()
        return scenes.sunlit([block()], o, d, fov=fov)

    return (
        Case(
            f"before a sky: {name}",
            GROUP,
            through,
            lambda: scenes.transmitted([block()], *ray()[:2]),
            "float64 quadrature of the optical depth",
        ),
        Case(
            f"in the sun: {name}",
            GROUP,
            sunlit,
            lambda: scenes.scattered([block()], *ray()[:2]),
            "float64 quadrature of single scattering",
        ),
    )


def _split(name: str, side: int, ray: Callable[[Block], tuple[Any, Any]]) -> tuple[Case, ...]:
    """Of a ray that is found in the tree, when it is asked for."""
    block = cache(lambda: splits.lumps(side))
    return _pair(name, block, cache(lambda: (*ray(block()), NARROW)))


def _fixed(name: str, ray: Ray) -> tuple[Case, ...]:
    return _pair(name, lambda: BLOCK, lambda: ray)


CASES = (
    *(case for name, ray in RAYS.items() for case in _fixed(name, ray)),
    *_split("in the plane where the kd-tree splits first", 32, splits.in_split),
    *_split("in such a plane, at 2/3, which no float is", 24, splits.in_split),
    *_split("along the line where two splits of the kd-tree meet", 32, splits.in_two_splits),
)
