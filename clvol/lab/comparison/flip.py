"""FLIP: how different pictures look when one flips between them (Andersson et al. 2020); an extra."""

from __future__ import annotations

from importlib.util import find_spec

import numpy as np

HINT = "pip install 'clvol[flip]' adds FLIP, how different pictures look to the eye."


def has_flip() -> bool:
    """Whether the package is installed."""
    return find_spec("flip_evaluator") is not None


def flip_error(reference: np.ndarray, picture: np.ndarray) -> np.ndarray:
    """The FLIP error of each pixel, 0 to 1, float32 (height, width).

    Seen at the package's own distance, 67 pixels a degree.

    Parameters
    ----------
    reference, picture : float32 (height, width, 3)
        As they are displayed: sRGB, 0 to 1.
    """
    from flip_evaluator import evaluate

    pictures = (np.ascontiguousarray(shown, np.float32) for shown in (reference, picture))
    error, _, _ = evaluate(*pictures, "LDR", applyMagma=False, computeMeanError=False)
    return np.asarray(error, np.float32).reshape(reference.shape[:2])
