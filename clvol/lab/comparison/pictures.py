"""Pictures of a comparison, as PNG bytes, pixel for pixel: renders and their errors."""

from __future__ import annotations

import io
from typing import TYPE_CHECKING

import numpy as np

from clvol.lab.comparison.equal_time import display
from clvol.lab.comparison.relative import level

if TYPE_CHECKING:
    from clvol.lab.comparison.figures import Figures
    from clvol.lab.comparison.findings import Findings


def picture(image: np.ndarray) -> bytes:
    """Linear radiance, tone-mapped; what is not finite in magenta."""
    return _pixels(display(image))


def error_scales(findings: Findings) -> tuple[float, float]:
    """What the error and FLIP images of pictures at equal time end at.

    99 of 100 pixels of the noisiest are below.
    """
    flips = [f.picture.flip for f in findings.figures if f.picture.flip is not None]
    return _largest([f.picture.error for f in findings.figures]), _largest(flips)


def error_picture(error: np.ndarray, scale: float) -> bytes:
    """Errors from 0 (black) to `scale` (pale yellow)."""
    return _mapped("magma", error / scale)


def round_scales(findings: Findings) -> tuple[float, float]:
    """The same of a round's relative RMS error, and of the relative difference of the mean of all rounds."""
    spreads = [_spread(f, findings) for f in findings.figures]
    return _largest(spreads), _largest([np.abs(_difference(f, findings)) for f in findings.figures])


def round_pictures(figures: Figures, findings: Findings, scales: tuple[float, float]) -> list[bytes]:
    """Where a round is noisy, and where the mean of all rounds is too bright (red) or too dark (blue)."""
    noisy = error_picture(_spread(figures, findings), scales[0])
    return [noisy, _mapped("RdBu_r", _difference(figures, findings) / scales[1] / 2 + 0.5)]


def _largest(errors: list[np.ndarray]) -> float:
    known = [np.quantile(error[np.isfinite(error)], 0.99) for error in errors if np.isfinite(error).any()]
    return max(float(max(known, default=0.0)), 1e-12)


def _spread(figures: Figures, findings: Findings) -> np.ndarray:
    images, truth = figures.measured.images, findings.reference
    squares = sum((image - truth.image) ** 2 for image in images) / len(images) - truth.variance
    error: np.ndarray = np.sqrt(np.maximum(squares, 0.0).mean(axis=-1)) / level(truth.image)
    return error


def _difference(figures: Figures, findings: Findings) -> np.ndarray:
    truth = findings.reference.image
    error: np.ndarray = (figures.image - truth).mean(axis=-1) / level(truth)
    return error


def _mapped(name: str, values: np.ndarray) -> bytes:
    """Numbers from 0 to 1 by one of matplotlib's colour maps."""
    import matplotlib

    return _pixels(matplotlib.colormaps[name](np.clip(values, 0, 1))[..., :3])


def _pixels(colours: np.ndarray) -> bytes:
    """Colours from 0 to 1 as a PNG."""
    from matplotlib.image import imsave

    stream = io.BytesIO()
    imsave(stream, np.rint(255 * colours).astype(np.uint8), format="png")
    return stream.getvalue()
