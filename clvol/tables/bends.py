"""Normal maps and bump maps, in the floats that cl/stages/bend.h reads."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from clvol.scene.materials import BumpMap, NormalMap

if TYPE_CHECKING:
    from clvol.tables.textures import TextureTable


def bend_entries(
    bend: NormalMap | BumpMap, material: int, mirrored: bool, textures: TextureTable
) -> np.ndarray:
    """What bends the surface of a material; float32 (7,)."""
    heights = isinstance(bend, BumpMap)
    scale = bend.scale if isinstance(bend, BumpMap) else 1.0
    texture = bend.texture if isinstance(bend, BumpMap) else bend.normalmap
    number = textures.add(texture, as_number=heights)
    flags = (bend.flip_invalid_normals, bend.use_shadowing_function, mirrored)
    return np.array([material, heights, number, scale, *flags], np.float32)
