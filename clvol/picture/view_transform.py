"""From linear radiance to what a display shows: a view of a colour configuration, by OpenColorIO.

OpenImageIO carries OpenColorIO with the ACES configurations.  Their default view is ACES 2.0's, which keeps
hues: highlights roll off and fade towards white without turning yellow or salmon on the way.  The environment
variable OCIO names another configuration, as in other programs.
"""

from __future__ import annotations

import logging
import os
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from clvol.errors import OptionError, shown
from clvol.picture.exposure import BRIGHTEST, check_exposure, stops_of

if TYPE_CHECKING:
    from collections.abc import Sequence

log = logging.getLogger("clvol")

BUILT_IN = "ocio://default"
"""The configuration where OCIO names none."""
_LINEAR_REC709 = ("lin_rec709_scene", "Linear Rec.709 (sRGB)", "lin_rec709", "lin_srgb", "Linear Rec.709")
"""What configurations call the space that radiance is in: Rec.709's primaries, linear."""


@dataclass(frozen=True)
class View:
    """How a picture is shown.

    Parameters
    ----------
    exposure : stops that brighten it, or "auto" (`clvol.picture.exposure`).
    display, transform : a display of the colour configuration and a view of it, by name or by a part of it
        that no other has, upper case or lower; None: the configuration's default.
    """

    exposure: float | str = 0.0
    display: str | None = None
    transform: str | None = None

    def resolved(self) -> View:
        """With full names; OptionError for what the configuration lacks, or an impossible exposure."""
        check_exposure(self.exposure)
        config = _config(config_name())
        display = config.getDefaultDisplayName()
        if self.display is not None:
            display = _named(self.display, config.getDisplayNames(), "display")
        transform = config.getDefaultViewName(display)
        if self.transform is not None:
            transform = _named(self.transform, config.getViewNames(display), f"view of display '{display}'")
        return View(self.exposure, display, transform)

    def with_stops(self, image: np.ndarray) -> View:
        """With the stops that "auto" comes to for a picture."""
        return View(stops_of(self.exposure, image), self.display, self.transform)


def config_name() -> str:
    """The colour configuration in force: a file, or one built into OpenColorIO."""
    return os.environ.get("OCIO") or BUILT_IN


def through_view(image: np.ndarray, view: View) -> np.ndarray:
    """Linear radiance (h, w, 3) as a display shows it, float32 from 0 to 1; no NaN may be in it.

    `view` has full names and a number of stops.
    """
    import OpenImageIO as oiio  # noqa: N813

    name = config_name()
    stops = float(view.exposure)
    with np.errstate(over="ignore", under="ignore"):
        linear = np.asarray(image, np.float32) * np.float32(2.0**stops)
    linear = np.ascontiguousarray(np.clip(linear, 0.0, BRIGHTEST))
    height, width, _ = linear.shape
    source = oiio.ImageBuf(oiio.ImageSpec(width, height, 3, oiio.FLOAT))
    source.set_pixels(oiio.ROI(), linear)
    shown_as = oiio.ImageBufAlgo.ociodisplay(
        source, str(view.display), str(view.transform), _linear_space(name), colorconfig=name
    )
    if shown_as.has_error:
        what = f"view '{view.transform}' of display '{view.display}' failed"
        raise OptionError(what, f"OCIO={name}", shown_as.geterror())
    pixels = np.asarray(shown_as.get_pixels(oiio.FLOAT), np.float32)
    return np.clip(np.nan_to_num(pixels, nan=0.0), 0.0, 1.0)


def _config(name: str) -> Any:
    """A colour configuration; OptionError where it cannot be read."""
    import OpenImageIO as oiio  # noqa: N813

    config = oiio.ColorConfig(name)
    reason = config.geterror()
    if reason or not config.getDisplayNames():
        why = " ".join(reason.split()) or "it has no display"
        hint = "unset OCIO for the built-in ACES configuration" if name != BUILT_IN else ""
        raise OptionError(f"the colour configuration cannot be used: {why}", f"OCIO={name}", hint)
    return config


def _linear_space(name: str) -> str:
    """The configuration's name of what radiance is in; else its scene_linear, with a warning."""
    config = _config(name)
    known = set(config.getColorSpaceNames())
    for candidate in _LINEAR_REC709:
        found = config.resolve(candidate)
        if found in known:
            return str(found)
    role = config.getColorSpaceNameByRole("scene_linear")
    if role not in known:
        raise OptionError("the colour configuration has no linear space", f"OCIO={name}")
    log.warning("%s names no linear Rec.709 space: colours are taken for its scene_linear, '%s'", name, role)
    return str(role)


def _named(given: object, known: Sequence[str], what: str) -> str:
    """The one of `known` that is meant; OptionError, with all of them, where that is none or several."""
    text = given.casefold() if isinstance(given, str) else None
    same = [name for name in known if name.casefold() == text]
    parts = [name for name in known if text and text in name.casefold()]
    if len(found := same or parts) == 1:
        return found[0]
    wrong = f"{shown(given)} may be more than one {what}" if found else f"unknown {what}: {shown(given)}"
    raise OptionError(wrong, hint=f"choose among {', '.join(found or known)}")
