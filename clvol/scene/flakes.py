"""The `sggx` phase function: microflakes whose normals are those of an ellipsoid (Heitz et al. 2015)."""

from __future__ import annotations

from typing import TYPE_CHECKING
from weakref import WeakKeyDictionary

import numpy as np

from clvol.scene.nodes import Node
from clvol.scene.records import GridVolume, Phase, PhaseFunction
from clvol.scene.tabulated import numbers
from clvol.volumes.grid import DenseGrid

if TYPE_CHECKING:
    from collections.abc import Iterator

    from clvol.scene.reader import Reader
    from clvol.scene.records import Volume

NAMES = "S_xx, S_yy, S_zz, S_xy, S_xz, S_yz"
THINNEST = 1e-8
"""Smallest eigenvalue of S as a share of the largest: single precision tells none smaller."""
FLATTEST = 1e-5
"""The same of a grid, whose S is interpolated in single precision."""
LARGEST = 1e6
"""Largest eigenvalue of S."""
_CHUNK = 1 << 16
_areas: WeakKeyDictionary[GridVolume, tuple[float, float]] = WeakKeyDictionary()


def sggx(reader: Reader) -> Phase:
    """The `sggx` plugin: `S`, a volume of six channels, or (ours) six numbers.

    The extinction along a direction w is sigma_t times sqrt(w S w), as in Mitsuba.
    """
    if not reader.has("S"):
        reader.fail(f"an sggx needs S, a volume of six channels: {NAMES}")
    values = _of_volume(reader) if isinstance(reader.node["S"], Node) else numbers(reader, "S")
    if isinstance(values, GridVolume):
        return Phase("sggx", flakes=values)
    if len(values) != 6:
        reader.fail(f"S of an sggx has six numbers, {NAMES}; got {len(values)}", "S")
    if fault := fault_of_matrix(values):
        reader.fail(f"S of an sggx {fault}", "S")
    return Phase("sggx", flakes=values)


def _of_volume(reader: Reader) -> tuple[float, ...] | GridVolume:
    """The matrices in a grid: six numbers where they are all the same."""
    found = reader.children("volume", "S")
    if not found:
        reader.refuse_plugin("S", "a gridvolume of six channels")
    volume: Volume = reader.build(found[0][1])
    if not isinstance(volume, GridVolume) or not isinstance(volume.grid, DenseGrid):
        reader.fail("S of an sggx must be a gridvolume of six channels", "S", f"they are {NAMES}")
    if volume.grid.channels != 6 or _is_even(volume.grid):
        return tuple(volume.grid.values.reshape(-1, volume.grid.channels)[0].astype(np.float64).tolist())
    if fault := fault_of_flakes(volume.grid):
        reader.fail(f"S of an sggx {fault}", "S")
    return volume


def _is_even(grid: DenseGrid) -> bool:
    samples = grid.values
    return bool((samples == samples[:1, :1, :1]).all())


def fault_of_matrix(values: tuple[float, ...]) -> str:
    """What is wrong with six numbers as S, "" if nothing."""
    if not np.isfinite(values).all():
        return "must be finite"
    return _fault_of_eigenvalues(np.linalg.eigvalsh(flake_matrix(values)), THINNEST)


def _fault_of_eigenvalues(found: np.ndarray, thinnest: float) -> str:
    if not found[0] > thinnest * found[-1]:
        least = f"its eigenvalues are {', '.join(f'{value:.4g}' for value in found)}"
        return f"must be positive definite; {least}"
    if found[-1] > LARGEST:
        return f"has an eigenvalue of {found[-1]:.4g}, and may have {LARGEST:g}"
    return ""


def fault_of_flakes(grid: DenseGrid) -> str:
    """What is wrong with the first sample that won't do; a matrix of zeros is nothing, and will."""
    shape = grid.values.shape[:3]
    for first, samples in _chunks(grid):
        if not np.isfinite(samples).all():
            return "must be finite"
        found = np.linalg.eigvalsh(flake_matrix(samples))
        some = samples.any(axis=-1)
        wrong = some & ~((found[:, 0] > FLATTEST * found[:, -1]) & (found[:, -1] <= LARGEST))
        if wrong.any():
            n = int(wrong.argmax())
            z, y, x = np.unravel_index(first + n, shape)
            said = _fault_of_eigenvalues(found[n], FLATTEST)
            ratio = f", and the smallest more than {FLATTEST:g} of the largest" if "definite" in said else ""
            return f"{said}{ratio}, at [{z}, {y}, {x}]"
    return ""


def _chunks(grid: DenseGrid) -> Iterator[tuple[int, np.ndarray]]:
    """The samples of a grid, float64 (n, 6), a bounded number at a time, and which is the first."""
    flat = grid.values.reshape(-1, grid.channels)
    for first in range(0, len(flat), _CHUNK):
        yield first, flat[first : first + _CHUNK].astype(np.float64)


def flake_matrix(values: tuple[float, ...] | np.ndarray) -> np.ndarray:
    """The symmetric matrix S of six numbers, float64 (3, 3); of rows of them, (n, 3, 3)."""
    xx, yy, zz, xy, xz, yz = np.moveaxis(np.asarray(values, np.float64), -1, 0)
    rows = ((xx, xy, xz), (xy, yy, yz), (xz, yz, zz))
    matrix: np.ndarray = np.stack([np.stack(row, axis=-1) for row in rows], axis=-2)
    return matrix


def area_bounds(phase: PhaseFunction) -> tuple[float, float]:
    """The least and most by which a medium's extinction is multiplied in any direction, at any place.

    In a mixture it is not multiplied at all, as in Mitsuba.
    """
    if not isinstance(phase, Phase) or phase.flakes is None:
        return 1.0, 1.0
    if not isinstance(phase.flakes, GridVolume):
        return _bounds(np.linalg.eigvalsh(flake_matrix(phase.flakes))[None])
    if phase.flakes not in _areas:
        assert isinstance(phase.flakes.grid, DenseGrid)
        parts = [_bounds(np.linalg.eigvalsh(flake_matrix(part))) for _, part in _chunks(phase.flakes.grid)]
        _areas[phase.flakes] = min(least for least, _ in parts), max(most for _, most in parts)
    return _areas[phase.flakes]


def _bounds(eigenvalues: np.ndarray) -> tuple[float, float]:
    """Of areas, from eigenvalues (n, 3) of S: those of a mean of matrices lie between."""
    return float(np.sqrt(max(eigenvalues.min(), 0.0))), float(np.sqrt(eigenvalues.max()))


def largest_area(phase: PhaseFunction) -> float:
    """The most by which a medium's extinction is multiplied in any direction."""
    return area_bounds(phase)[1]
