"""A density in the image of the unit cube: what a scene says of it, and its optical depths in float64.

The two share nothing but the numbers, so that one can be held to the other.  Between the planes of the
samples a trilinear density is a cubic along a ray, and two Gauss-Legendre nodes integrate it exactly.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np

if TYPE_CHECKING:
    from clvol.volumes.grid import SparseGrid

_NODES, _WEIGHTS = np.polynomial.legendre.leggauss(2)


@dataclass(frozen=True, eq=False)
class Block:
    """A medium in the image of the unit cube.

    Parameters
    ----------
    values : float [z, y, x] or [z, y, x, channel], samples at the middles of equal cells and clamped beyond
        them, as in a gridvolume; of no dimension for a homogeneous medium.
    sigma : extinction per unit of length and of density, one number or three.
    place : (4, 4), the unit cube to the world.
    filter_type : trilinear or nearest.
    grid : the same samples as a sparse grid, where the scene is to have that.
    """

    values: np.ndarray
    sigma: tuple[float, ...]
    place: np.ndarray
    filter_type: str = "trilinear"
    grid: SparseGrid | None = None

    @property
    def channels(self) -> int:
        """Of its extinction."""
        return max(len(self.sigma), self.values.shape[3] if self.values.ndim == 4 else 1)

    def shape(self, **medium: Any) -> dict[str, Any]:
        """A cube with the medium inside; keywords are the medium's other parameters."""
        return {
            "type": "cube",
            "to_world": self.place @ CUBE,
            "bsdf": {"type": "null"},
            "interior": self.medium(**medium),
        }

    def medium(self, **more: Any) -> dict[str, Any]:
        """The medium alone."""
        if not self.values.ndim:
            sigma = [float(self.values) * s for s in self.sigma]
            return {"type": "homogeneous", "sigma_t": _colour(sigma), **more}
        volume = {
            "type": "gridvolume",
            "data": self.values if self.grid is None else self.grid,
            "to_world": self.place,
            "filter_type": self.filter_type,
            "raw": True,
        }
        return {"type": "heterogeneous", "sigma_t": volume, "scale": _colour(self.sigma), **more}

    def span(self, o: np.ndarray, d: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Where lines enter and leave the block, (n,) each; equal where they miss it."""
        o, d = self._local(o, d)
        with np.errstate(divide="ignore", invalid="ignore"):
            ends = np.stack([-o / d, (1 - o) / d])
        within = np.where((o >= 0) & (o <= 1), np.inf, -np.inf)  # of lines along a face or between two
        near = np.where(d == 0, -within, ends.min(axis=0)).max(axis=-1)
        far = np.where(d == 0, within, ends.max(axis=0)).min(axis=-1)
        return near, np.maximum(near, far)

    def depth(self, o: np.ndarray, d: np.ndarray, length: np.ndarray | float = np.inf) -> np.ndarray:
        """Optical depths of rays (n, 3) from their origins on, or of that length of them; (n, channels)."""
        enter, leave = self.span(o, d)
        start, end = np.maximum(enter, 0.0), np.minimum(leave, length)
        end = np.maximum(start, end)
        cuts = self.cuts(o, d, start, end)
        half, middle = np.diff(cuts, axis=1) / 2, (cuts[:, 1:] + cuts[:, :-1]) / 2
        total = np.zeros((len(o), self.channels))
        for node, weight in zip(_NODES, _WEIGHTS, strict=True):
            at = o[:, None] + (middle + half * node)[..., None] * d[:, None]
            total += (weight * half[..., None] * self.sigma_t(at)).sum(axis=1)
        return total

    def sigma_t(self, points: np.ndarray) -> np.ndarray:
        """Extinction at points (..., 3) of the block, (..., channels)."""
        if not self.values.ndim:
            return np.broadcast_to(
                float(self.values) * np.array(self.sigma), (*points.shape[:-1], self.channels)
            )
        at = points @ self._inverse[:3, :3].T + self._inverse[:3, 3]
        values = self.values if self.values.ndim == 4 else self.values[..., None]
        count = np.array(values.shape[2::-1])
        if self.filter_type == "nearest":
            x, y, z = np.moveaxis(np.clip((at * count).astype(int), 0, count - 1), -1, 0)
            found: np.ndarray = values[z, y, x] * np.array(self.sigma)
            return found
        p = np.clip(at * count - 0.5, 0, count - 1)
        base = np.minimum(p.astype(int), np.maximum(count - 2, 0))
        f = p - base
        total: np.ndarray = np.zeros((*points.shape[:-1], values.shape[3]))
        for corner in range(8):
            bits = np.array([corner >> axis & 1 for axis in range(3)])
            x, y, z = np.moveaxis(np.minimum(base + bits, count - 1), -1, 0)
            total += values[z, y, x] * np.where(bits, f, 1 - f).prod(axis=-1)[..., None]
        total = total * np.array(self.sigma)
        return total

    def cuts(self, o: np.ndarray, d: np.ndarray, start: np.ndarray, end: np.ndarray) -> np.ndarray:
        """Where the density is not smooth from `start` to `end`, these included, in order; (n, cuts)."""
        ends = [start[:, None], end[:, None]]
        if self.values.ndim:
            local, along = self._local(o, d)
            for axis, count in enumerate(self.values.shape[2::-1]):
                first, last = self._filled[axis]
                planes = np.arange(max(first, 0), min(last, count) + 1) / count
                if self.filter_type != "nearest":
                    planes = planes[:-1] + 0.5 / count
                with np.errstate(divide="ignore", invalid="ignore"):
                    t = (planes - local[:, axis, None]) / along[:, axis, None]
                ends.append(
                    np.where(np.isfinite(t), np.clip(t, start[:, None], end[:, None]), start[:, None])
                )
        return np.sort(np.concatenate(ends, axis=1), axis=1)

    @cached_property
    def _filled(self) -> list[tuple[int, int]]:
        """On x, y and z, from which cell to which samples that are not 0 have a part; not to the last."""
        spots = self.values.any(axis=3) if self.values.ndim == 4 else self.values != 0
        found = []
        for axis in (2, 1, 0):
            where = np.unique(np.nonzero(spots)[axis])
            found.append((int(where[0]) - 1, int(where[-1]) + 2) if len(where) else (0, 1))
        return found

    @property
    def _inverse(self) -> np.ndarray:
        inverse: np.ndarray = np.linalg.inv(self.place)
        return inverse

    def _local(self, o: np.ndarray, d: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        matrix = self._inverse[:3, :3]
        return (o - self.place[:3, 3]) @ matrix.T, d @ matrix.T


CUBE = np.array([[0.5, 0, 0, 0.5], [0, 0.5, 0, 0.5], [0, 0, 0.5, 0.5], [0, 0, 0, 1.0]])
"""Mitsuba's cube, from -1 to 1, to the unit cube."""


def _colour(values: Any) -> Any:
    values = [float(v) for v in values]
    return values[0] if len(values) == 1 else {"type": "rgb", "value": values}
