"""How thick and how bright a volume is along the rays of a camera, on the host, from coarse means."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from clvol.scene.records import GridVolume
from clvol.staging.framing import half_tangents

if TYPE_CHECKING:
    from clvol.scene.records import Volume
    from clvol.staging.coarse import Coarse
    from clvol.staging.framing import View

ACROSS, ALONG = 48, 96
"""Rays along the longer side of the picture, and places along each of them."""
SEEN = 0.01
"""Share of the greatest thickness below which a ray misses the volume for all that is seen of it."""
PERCENTILE = 90.0
WANTED = 8.0
"""Optical thickness at that percentile of the rays: a body with light edges that is not black inside."""


@dataclass(frozen=True, eq=False)
class Rays:
    """Places in the world along rays through a box, (rays, places, 3), and the length of each, (rays,)."""

    places: np.ndarray
    lengths: np.ndarray

    @classmethod
    def through(cls, box: np.ndarray, view: View, size: tuple[int, int]) -> Rays:
        """Those of a camera that meet the box (2, 3)."""
        tx, ty = half_tangents(*size)
        columns, rows = (max(round(ACROSS * side / max(size)), 1) for side in size)
        u = (np.arange(columns) + 0.5) / columns * 2 - 1
        v = (np.arange(rows) + 0.5) / rows * 2 - 1
        x, y = np.meshgrid(tx * u, ty * v)
        local = np.stack([x, y, np.ones_like(x)], axis=-1).reshape(-1, 3)
        directions = local @ view.to_world[:3, :3].T
        directions /= np.linalg.norm(directions, axis=1, keepdims=True)
        directions[directions == 0] = 1e-30
        bounds = (box[:, None] - view.eye) / directions
        near = np.maximum(bounds.min(axis=0).max(axis=1), 0.0)
        far = bounds.max(axis=0).min(axis=1)
        meets = far > near
        near, far, directions = near[meets], far[meets], directions[meets]
        t = near[:, None] + (far - near)[:, None] * (np.arange(ALONG) + 0.5) / ALONG
        return cls(view.eye + t[..., None] * directions[:, None], (far - near) / ALONG)

    def sample(self, volume: Volume, means: Coarse) -> np.ndarray:
        """Values of a volume at the places, float64 (rays, places)."""
        assert isinstance(volume, GridVolume)
        inverse = np.linalg.inv(volume.index_to_world)
        index = self.places.reshape(-1, 3) @ inverse[:3, :3].T + inverse[:3, 3]
        return means.at(index).reshape(self.places.shape[:2]).astype(np.float64)


def thickness(density: np.ndarray, rays: Rays) -> float:
    """Integral of the density along the ray at the percentile of those that meet anything; 0 if none does."""
    whole = density.sum(axis=1) * rays.lengths
    return _percentile(whole)


def glow(emitted: np.ndarray, sigma_t: np.ndarray, rays: Rays) -> float:
    """Radiance at the percentile of rays that see any, of what is `emitted` per length behind `sigma_t`."""
    depth = np.cumsum(sigma_t, axis=1) - sigma_t / 2
    arriving = emitted * np.exp(-depth * rays.lengths[:, None])
    return _percentile(arriving.sum(axis=1) * rays.lengths)


def _percentile(values: np.ndarray) -> float:
    seen = values[values > SEEN * values.max(initial=0.0)]
    return float(np.percentile(seen, PERCENTILE)) if seen.size else 0.0
