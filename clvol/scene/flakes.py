"""The `sggx` phase function: microflakes whose normals are those of an ellipsoid (Heitz et al. 2015)."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from clvol.scene.nodes import Node
from clvol.scene.records import GridVolume, Phase, PhaseFunction
from clvol.scene.tabulated import numbers
from clvol.volumes.grid import DenseGrid

if TYPE_CHECKING:
    from clvol.scene.reader import Reader

NAMES = "S_xx, S_yy, S_zz, S_xy, S_xz, S_yz"
THINNEST = 1e-8
"""Smallest eigenvalue of S as a share of the largest: single precision tells none smaller."""
LARGEST = 1e6
"""Largest eigenvalue of S."""


def sggx(reader: Reader) -> Phase:
    """The `sggx` plugin: `S`, a volume of six channels that are everywhere the same, or (ours) six numbers.

    The extinction along a direction w is sigma_t times sqrt(w S w), as in Mitsuba.
    """
    if not reader.has("S"):
        reader.fail(f"an sggx needs S, a volume of six channels: {NAMES}")
    values = _of_volume(reader) if isinstance(reader.node["S"], Node) else numbers(reader, "S")
    if len(values) != 6:
        reader.fail(f"S of an sggx has six numbers, {NAMES}; got {len(values)}", "S")
    if fault := _fault(values):
        reader.fail(f"S of an sggx {fault}", "S")
    return Phase("sggx", flakes=values)


def _of_volume(reader: Reader) -> tuple[float, ...]:
    found = reader.children("volume", "S")
    if not found:
        reader.refuse_plugin("S", "a gridvolume of six channels")
    volume = reader.build(found[0][1])
    if not isinstance(volume, GridVolume) or not isinstance(volume.grid, DenseGrid):
        reader.fail("S of an sggx must be a gridvolume of six channels", "S", f"they are {NAMES}")
    samples = volume.grid.values.reshape(-1, volume.grid.channels)
    if (samples != samples[:1]).any():
        what = "an sggx whose S varies from place to place is not supported"
        reader.unsupported(what, "S", "give a volume whose samples are all the same")
    return tuple(samples[0].astype(np.float64).tolist())


def _fault(values: tuple[float, ...]) -> str:
    if not np.isfinite(values).all():
        return "must be finite"
    eigenvalues = np.linalg.eigvalsh(flake_matrix(values))
    if not eigenvalues[0] > THINNEST * eigenvalues[-1]:
        least = f"its eigenvalues are {', '.join(f'{value:.4g}' for value in eigenvalues)}"
        return f"must be positive definite; {least}"
    if eigenvalues[-1] > LARGEST:
        return f"has an eigenvalue of {eigenvalues[-1]:.4g}, and may have {LARGEST:g}"
    return ""


def flake_matrix(values: tuple[float, ...]) -> np.ndarray:
    """The symmetric matrix S of six numbers, float64 (3, 3)."""
    xx, yy, zz, xy, xz, yz = values
    return np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])


def largest_area(phase: PhaseFunction) -> float:
    """The most by which a medium's extinction is multiplied in any direction."""
    if not isinstance(phase, Phase) or phase.flakes is None:
        return 1.0
    return float(np.sqrt(np.linalg.eigvalsh(flake_matrix(phase.flakes))[-1]))
