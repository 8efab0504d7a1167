"""Lat-long environments as distributions over their texels, for importance sampling."""

from __future__ import annotations

import numpy as np


def luminance(rgb: np.ndarray) -> np.ndarray:
    """Rec. 709 luminance of (..., 3) linear sRGB."""
    return rgb @ np.array([0.212671, 0.715160, 0.072169])


def envmap_distribution(radiance: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Marginal cdf over rows, float32 (h,), and conditional cdfs over columns, float32 (h - 1, w + 1).

    The cell (x, y) spans texel columns x, x + 1 (wrapped) and rows y, y + 1, and is weighted by the mean
    luminance of its corners times the sine of its polar angle.  `radiance`: float (h, w, 3), h ≥ 2.
    """
    height, width, _ = radiance.shape
    y = luminance(radiance.astype(np.float64))
    y = y + np.roll(y, -1, axis=1)
    cells = y[:-1] + y[1:]
    cells *= np.sin((np.arange(height - 1) + 0.5) * np.pi / (height - 1))[:, None]
    if not cells.any():
        cells[:] = 1.0
    rows = cells.sum(axis=1)
    conditional = np.zeros((height - 1, width + 1))
    np.cumsum(cells, axis=1, out=conditional[:, 1:])
    conditional /= np.where(rows > 0, rows, 1.0)[:, None]
    conditional[:, -1] = 1.0
    marginal = np.concatenate([[0.0], np.cumsum(rows) / rows.sum()])
    marginal[-1] = 1.0
    return marginal.astype(np.float32), conditional.astype(np.float32)
