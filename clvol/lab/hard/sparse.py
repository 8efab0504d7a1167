"""Vacuum, zero majorants and controls, single voxels, checkerboards."""

from __future__ import annotations

from functools import cache

import numpy as np

from clvol.lab.hard import scenes
from clvol.lab.hard.block import Block
from clvol.lab.hard.case import Case
from clvol.volumes.grid import SparseGrid

GROUP = "vacuum and spikes"
EYE, AHEAD = (0.47, 0.52, -2.0), (0.1, 0.05, 1.0)
WIDE = 512
SPIKE = 252, 250, 261
"""The voxel that holds something, x y z."""
TO_UNIT = np.array([[1, 0, 0, 0.5], [0, 1, 0, 0.5], [0, 0, 1, 0.5], [0, 0, 0, WIDE]]) / WIDE
"""Its grid to the unit cube."""


@cache
def one_voxel() -> Block:
    """512³ samples of which one is not 0."""
    values = np.zeros((8, 8, 8), np.float32)
    origin = np.array(SPIKE) // 8 * 8
    x, y, z = SPIKE - origin
    values[z, y, x] = 1.0
    grid = SparseGrid(
        origin[None].astype(np.int32),
        values[None, ..., None],
        np.full((1, 64), 255, np.uint8),
        np.empty((0, 3), np.int32),
        np.empty(0, np.int32),
        np.empty((0, 1), np.float32),
        np.empty(0, bool),
        np.zeros(1, np.float32),
        TO_UNIT,
        np.array([[0, 0, 0], [WIDE - 1] * 3], np.int32),
    )
    dense = np.zeros((WIDE, WIDE, WIDE), np.int8)
    dense[SPIKE[2], SPIKE[1], SPIKE[0]] = 1
    return Block(dense, (2000.0,), np.eye(4), grid=grid)


TO_SPIKE = (np.array(SPIKE) + 0.7) / WIDE
FROM = TO_SPIKE - np.array([0.31, 0.12, 2.0])


def half_empty() -> Block:
    """Density in the upper half of z alone, above cells whose majorant is 0."""
    values = np.zeros((32, 8, 8))
    values[16:] = np.random.default_rng(5).random((16, 8, 8))
    return Block(values, (6.0,), np.eye(4))


def checkerboard(filter_type: str) -> Block:
    """0 and 1e4 by turns: every control is 0."""
    return Block(np.indices((8, 8, 8)).sum(axis=0) % 2.0, (1e4,), np.eye(4), filter_type)


def nothing() -> Block:
    """All samples 0."""
    return Block(np.zeros((9, 9, 9)), (1e3,), np.eye(4))


def _pair(name: str, make, eye, ahead, spp: int = 1024, **more) -> tuple[Case, Case]:  # type: ignore[no-untyped-def]
    return (
        Case(
            f"{name}, before a sky",
            GROUP,
            lambda: scenes.through([make()], eye, ahead, **more),
            lambda: scenes.transmitted([make()], eye, ahead),
            "float64 quadrature of the optical depth",
            spp,
        ),
        Case(
            f"{name}, in the sun",
            GROUP,
            lambda: scenes.sunlit([make()], eye, ahead, **more),
            lambda: scenes.scattered([make()], eye, ahead),
            "float64 quadrature of single scattering",
            spp,
        ),
    )


CASES = (
    *_pair("a volume of zeros", nothing, EYE, AHEAD, 16),
    *_pair("half of the volume empty", half_empty, EYE, AHEAD),
    *_pair("one dense voxel in 512³", one_voxel, FROM, TO_SPIKE - FROM, fov=1e-4),
    *_pair("checkerboard of 0 and 1e4, trilinear", lambda: checkerboard("trilinear"), EYE, AHEAD, fov=1e-4),
    *_pair("checkerboard of 0 and 1e4, nearest", lambda: checkerboard("nearest"), EYE, AHEAD, fov=1e-4),
)
