"""Mixtures of BSDFs as lists of parts, in the floats that cl/bsdf/blend.h reads."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from clvol.scene.materials import Varied
from clvol.scene.sides import mixed_parts

if TYPE_CHECKING:
    from collections.abc import Callable

    from clvol.scene.sides import Factor, Mixture, Side
    from clvol.tables.textures import TextureTable


def blend_entries(
    mixture: Mixture, number: Callable[[Side | None], int], textures: TextureTable
) -> np.ndarray:
    """How many parts there are, and of each its material, constant share and textures; float32 (k,).

    number : the number of a side's material, -1 for what is black.
    """
    parts = list(mixed_parts(mixture))
    rows = [_row(number(side), factors, textures) for side, factors in parts]
    return np.array([len(parts), *(value for row in rows for value in row)], np.float32)


def _row(material: int, factors: tuple[Factor, ...], textures: TextureTable) -> list[float]:
    share, varied = 1.0, []
    for weight, rest in factors:
        if isinstance(weight, Varied):
            texture = textures.add(weight, as_number=True)
            varied.append(-1 - texture if rest else texture)
        else:
            mean = float(np.mean(weight))
            share *= 1 - mean if rest else mean
    return [material, share, len(varied), *varied]
