"""Lat-long environments as distributions over their texels, for importance sampling."""

from __future__ import annotations

import numpy as np

from clvol.base.rows import bands
from clvol.tables.colours import luminance


def envmap_distribution(radiance: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Marginal cdf over rows, float32 (h,), and conditional cdfs over columns, float32 (h - 1, w + 1).

    The cell (x, y) spans texel columns x, x + 1 (wrapped) and rows y, y + 1, and is weighted by the mean
    luminance of its corners times the sine of its polar angle.  `radiance`: float (h, w, 3), h ≥ 2.
    Sums are in double, over a band of rows at a time.
    """
    height, width, _ = radiance.shape
    conditional = np.zeros((height - 1, width + 1), np.float32)
    rows = np.empty(height - 1)
    for band in bands(height - 1, width):
        conditional[band, 1:], rows[band] = _row_cdfs(_cells(radiance, band))
    if not rows.any():
        for band in bands(height - 1, width):
            conditional[band, 1:], rows[band] = _row_cdfs(np.ones((band.stop - band.start, width)))
    conditional[:, -1] = 1.0
    marginal = np.concatenate([[0.0], np.cumsum(rows) / rows.sum()])
    marginal[-1] = 1.0
    return marginal.astype(np.float32), conditional


def _cells(radiance: np.ndarray, band: slice) -> np.ndarray:
    """Weights of the cells of some rows, float64 (rows, w)."""
    height = len(radiance)
    y = luminance(radiance[band.start : band.stop + 1].astype(np.float64))
    y = y + np.roll(y, -1, axis=1)
    cells: np.ndarray = y[:-1] + y[1:]
    sine = np.sin((np.arange(band.start, band.stop) + 0.5) * np.pi / (height - 1))
    cells *= sine[:, None]
    return cells


def _row_cdfs(cells: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Cumulative share of each cell in its row, and the rows' sums."""
    rows = cells.sum(axis=1)
    return np.cumsum(cells, axis=1) / np.where(rows > 0, rows, 1.0)[:, None], rows
