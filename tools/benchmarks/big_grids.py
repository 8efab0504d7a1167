"""Seeded grids of any size for measurements of loading and memory, written slab by slab."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from collections.abc import Iterator
    from pathlib import Path

SLAB = 32
OCTAVES = (4, 8, 16, 32)


def _weights(positions: np.ndarray, cells: int) -> np.ndarray:
    """Linear interpolation between `cells` + 1 lattice values as a matrix (positions, cells + 1)."""
    lattice = np.arange(cells + 1)
    columns = [np.interp(positions * cells, lattice, column) for column in np.eye(cells + 1)]
    return np.stack(columns, axis=1).astype(np.float32)


def cloud_slabs(size: int, seed: int = 1) -> Iterator[np.ndarray]:
    """A rough cloud, about a third of the cube filled, as float32 slabs (z, size, size) from z = 0 on."""
    random = np.random.default_rng(seed)
    lattices = [random.random((n + 1,) * 3, dtype=np.float32) - np.float32(0.5) for n in OCTAVES]
    centres = ((np.arange(size) + 0.5) / size).astype(np.float32)
    for start in range(0, size, SLAB):
        z = centres[start : start + SLAB]
        away = ((z - 0.5) ** 2)[:, None, None] + ((centres - 0.5) ** 2)[:, None] + (centres - 0.5) ** 2
        density = np.float32(0.35) - np.sqrt(away)
        for cells, lattice in zip(OCTAVES, lattices, strict=True):
            along = _weights(centres, cells)
            noise = np.einsum("zi,yj,xk,ijk->zyx", _weights(z, cells), along, along, lattice, optimize=True)
            density += noise * np.float32(2 / cells**0.5)
        grain = random.random(density.shape, dtype=np.float32)
        yield np.clip(density * 5, 0, 1) * (np.float32(0.5) + np.float32(0.5) * grain)


def noise_slabs(size: int, seed: int = 1) -> Iterator[np.ndarray]:
    """White noise in (½, 1): no empty and no constant brick, the worst case for memory."""
    random = np.random.default_rng(seed)
    for start in range(0, size, SLAB):
        planes = min(SLAB, size - start)
        yield np.float32(0.5) + np.float32(0.5) * random.random((planes, size, size), dtype=np.float32)


def write_npy(path: Path, slabs: Iterator[np.ndarray], size: int) -> None:
    """Write slabs as one float32 array (size, size, size)."""
    array = np.lib.format.open_memmap(path, "w+", np.float32, (size, size, size))
    start = 0
    for slab in slabs:
        array[start : start + len(slab)] = slab
        start += len(slab)
    array.flush()
