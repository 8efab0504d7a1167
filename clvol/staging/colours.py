"""Colours as users say them: CSS's names and #rrggbb, as linear radiance."""

from __future__ import annotations

import re

import numpy as np

from clvol.scene.spectra import srgb_to_linear

NAMES = {
    "black": "#000000",
    "grey": "#808080",
    "silver": "#c0c0c0",
    "white": "#ffffff",
    "red": "#ff0000",
    "orange": "#ffa500",
    "yellow": "#ffff00",
    "lime": "#00ff00",
    "green": "#008000",
    "olive": "#808000",
    "teal": "#008080",
    "cyan": "#00ffff",
    "skyblue": "#87ceeb",
    "blue": "#0000ff",
    "navy": "#000080",
    "purple": "#800080",
    "magenta": "#ff00ff",
    "pink": "#ffc0cb",
    "brown": "#a52a2a",
    "maroon": "#800000",
}
"""As CSS and matplotlib have them; these are all of CSS's basic ones, and some more."""
_ALSO = {"gray": "grey", "aqua": "cyan", "fuchsia": "magenta"}


def radiance_of(text: str) -> tuple[float, ...] | None:
    """A name in any case, #rrggbb or #rgb (sRGB) as linear radiance; None for what is none of them."""
    name = text.strip().lower()
    code = NAMES.get(_ALSO.get(name, name), name)
    if re.fullmatch("#[0-9a-f]{3}", code):
        code = "#" + "".join(2 * digit for digit in code[1:])
    if not re.fullmatch("#[0-9a-f]{6}", code):
        return None
    encoded = np.array([int(code[n : n + 2], 16) for n in (1, 3, 5)], np.float32) / 255
    found = tuple(srgb_to_linear(encoded).tolist())
    return found[:1] if len(set(found)) == 1 else found
