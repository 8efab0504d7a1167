"""Rays along axes, in planes, through edges and corners, on boundaries, and hardly oblique."""

from __future__ import annotations

import numpy as np

from clvol.lab.hard import scenes
from clvol.lab.hard.block import Block
from clvol.lab.hard.case import Case

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


def _pair(name: str, o: tuple[float, ...], d: tuple[float, ...], fov: float) -> tuple[Case, ...]:
    through = Case(
        f"before a sky: {name}",
        GROUP,
        lambda: scenes.through([BLOCK], o, d, fov=fov),
        lambda: scenes.transmitted([BLOCK], o, d),
        "float64 quadrature of the optical depth",
    )
    lit = Case(
        f"in the sun: {name}",
        GROUP,
        lambda: scenes.sunlit([BLOCK], o, d, fov=fov),
        lambda: scenes.scattered([BLOCK], o, d),
        "float64 quadrature of single scattering",
    )
    return through, lit


CASES = tuple(case for name, ray in RAYS.items() for case in _pair(name, *ray))
