"""The same view on a smaller film: what self-tests and pilots render."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from clvol.scene.records import Film, Scene


def reduced(scene: Scene, pixels: int) -> Scene:
    """The scene on a film scaled so that about `pixels` of it are rendered; itself where it is no larger.

    The view, its crop and its shape stay; the pixel filter stays as wide in pixels.
    """
    film = scene.film
    factor = math.sqrt(pixels / (film.window[2] * film.window[3]))
    return scene if factor >= 1 else replace(scene, film=_scaled(film, factor))


def _scaled(film: Film, factor: float) -> Film:
    width, height = (max(1, round(factor * size)) for size in (film.width, film.height))
    crop = None
    if film.crop is not None:
        x, y = (int(factor * start) for start in film.crop[:2])
        x, y = min(x, width - 1), min(y, height - 1)
        across, down = (max(1, round(factor * extent)) for extent in film.crop[2:])
        crop = (x, y, min(across, width - x), min(down, height - y))
    return replace(film, width=width, height=height, crop=crop)
