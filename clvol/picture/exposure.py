"""How bright a picture is shown: a number of stops, or what a photographer would choose for it."""

from __future__ import annotations

import math

import numpy as np

from clvol.errors import OptionError, shown

MOST_STOPS = 100.0
"""Exposures beyond it are no pictures, and overflow."""
BRIGHTEST = np.float32(1e30)
"""Radiance above it is shown as bright as this, which is white; its square root would still be a float32."""
AUTO = "auto"
GREY = 0.18
"""What a picture's mean is shown as: middle grey."""
HIGHLIGHTS = (1.0, 6.0)
"""Between these the brightest 2 % are kept: as bright as paper, and not so bright that all is white."""
_DARKEST = 2.0**-10
"""Of the highlights: what is darker counts as not lit, so that a black background does not decide."""
_LUMINANCE = np.array([0.2126, 0.7152, 0.0722])


def check_exposure(exposure: float | str) -> None:
    """OptionError for what is neither "auto" nor a number of stops up to `MOST_STOPS`, either way."""
    if isinstance(exposure, str) and exposure == AUTO:
        return
    number = math.nan if isinstance(exposure, bool) else exposure
    if not (isinstance(number, int | float | np.number) and abs(number) <= MOST_STOPS):
        raise OptionError(
            f"exposure {shown(exposure)} is not a number from {-MOST_STOPS:g} to {MOST_STOPS:g} stops",
            hint=f"or '{AUTO}'",
        )


def stops_of(exposure: float | str, image: np.ndarray) -> float:
    """The number of stops itself, or what "auto" comes to for a picture."""
    check_exposure(exposure)
    return auto_exposure(image) if isinstance(exposure, str) else float(exposure)


def auto_exposure(image: np.ndarray) -> float:
    """Stops for linear radiance (h, w, 3) as a photographer would choose them.

    The geometric mean of the luminance of what is lit becomes middle grey, as far as the brightest 2 % of it
    then stay within `HIGHLIGHTS`: snow stays white, and a flame keeps its shape.  0 where nothing is lit.
    A film needs one exposure for all its frames: that of one of them.
    """
    luminance = np.asarray(image, np.float64) @ _LUMINANCE
    lit = luminance[np.isfinite(luminance) & (luminance > 0)]
    if not lit.size:
        return 0.0
    bright = float(np.quantile(lit, 0.98))
    mean = float(np.exp(np.log(lit[lit >= bright * _DARKEST]).mean()))
    low, high = (limit / bright for limit in HIGHLIGHTS)
    return float(np.clip(np.log2(np.clip(GREY / mean, low, high)), -MOST_STOPS, MOST_STOPS))
