"""What a BSDF does, as far as it decides which code a scene needs; pure functions of the records."""

from __future__ import annotations

from typing import TYPE_CHECKING

from clvol.layout import BSDF_FACTS, PRINCIPLED_NUMBERS
from clvol.scene.materials import (
    Bitmap,
    Bsdf,
    BumpMap,
    Checkerboard,
    Conductor,
    NormalMap,
    RoughConductor,
    RoughDielectric,
    Texture,
    Varied,
    VolumeTexture,
)
from clvol.scene.sides import Mixture, Side, bsdf_looks, bsdf_parts, bsdf_weights, side_kind

if TYPE_CHECKING:
    from clvol.scene.records import GridVolume

_COLORS = (
    *("reflectance", "diffuse_reflectance", "specular_reflectance", "specular_transmittance"),
    "base_color",
)
_REFRACT = {"DIELECTRIC", "ROUGH_DIELECTRIC", "PRINCIPLED_GLASS", "PRINCIPLED_THIN"}
_NUMBERS = ("alpha_u", "alpha_v", *PRINCIPLED_NUMBERS)
_TABLES = {"ROUGH_PLASTIC", "PRINCIPLED", "PRINCIPLED_GLASS", "PRINCIPLED_THIN", "BLEND", "BENT"}


def _colors(side: Side) -> list[Texture]:
    return [getattr(side.bsdf, name) for name in _COLORS if hasattr(side.bsdf, name)]


def _indices(side: Side) -> list[Texture]:
    """Of a metal, eta and k."""
    bsdf = side.bsdf
    return [bsdf.eta, bsdf.k] if isinstance(bsdf, Conductor | RoughConductor) else []


def _numbers(side: Side) -> list[Texture | float]:
    """What may be textures beside colours."""
    return [getattr(side.bsdf, name) for name in _NUMBERS if hasattr(side.bsdf, name)]


def color_is_grey(color: Texture) -> bool:
    """Whether all channels are alike, of a texture everywhere."""
    if isinstance(color, Bitmap):
        return bool((color.pixels == color.pixels[..., :1]).all())
    if isinstance(color, VolumeTexture):
        return color.volume.grid.channels == 1
    if isinstance(color, Checkerboard):
        return color_is_grey(color.color0) and color_is_grey(color.color1)
    return len(set(color)) == 1


def bsdf_bends(bsdf: Bsdf) -> list[NormalMap | BumpMap]:
    """The normal maps and bump maps in it."""
    return list(dict.fromkeys(side.bend for side in bsdf_parts(bsdf) if side.bend is not None))


def _bend_map(bend: NormalMap | BumpMap) -> Varied:
    """The texture that bends a surface; normals that are the same everywhere need one too."""
    if isinstance(bend, BumpMap):
        return bend.texture
    normals = bend.normalmap
    return normals if isinstance(normals, Varied) else Checkerboard(normals, normals)


def has_bumps(bsdf: Bsdf) -> bool:
    """Whether a surface is bent by heights, whose slopes are per unit of (u, v)."""
    return any(isinstance(bend, BumpMap) for bend in bsdf_bends(bsdf))


def bsdf_kinds(bsdf: Bsdf) -> set[str]:
    """Names in `layout.BSDFS` of what is on either side."""
    kinds = {side_kind(side.bsdf) for side in bsdf_parts(bsdf)}
    kinds |= {"BLEND"} if any(isinstance(look, Mixture) for look in bsdf_looks(bsdf)) else set()
    return kinds | ({"BENT"} if bsdf_bends(bsdf) else set())


def is_grey(bsdf: Bsdf) -> bool:
    """Whether it treats all channels alike; opacities always do."""
    return all(color_is_grey(c) for side in bsdf_parts(bsdf) for c in (*_colors(side), *_indices(side)))


def passes_light(bsdf: Bsdf) -> bool:
    """Whether light may go straight on: null, a mask, a thin dielectric.  Shadow rays look at those."""
    return any(
        side.opacities or side_kind(side.bsdf) in ("NULL", "THIN_DIELECTRIC") for side in bsdf_parts(bsdf)
    )


def is_transmissive(bsdf: Bsdf) -> bool:
    """Whether light may be scattered to the other side: a dielectric that is not thin, or principled."""
    return bool(bsdf_kinds(bsdf) & _REFRACT)


def reflects(bsdf: Bsdf) -> bool:
    """Whether there is a surface at all, that is anything but null."""
    return bsdf_kinds(bsdf) != {"NULL"}


def samples_lights(bsdf: Bsdf) -> bool:
    """Whether it has more than delta lobes, so that light can be sampled for it."""
    return not all(BSDF_FACTS[kind].smooth for kind in bsdf_kinds(bsdf))


def bsdf_textures(bsdf: Bsdf) -> list[Varied]:
    """Its textures, opacities included, in no particular order."""
    sides = bsdf_parts(bsdf)
    found = [t for s in sides for t in (*_colors(s), *_indices(s), *_numbers(s), *s.opacities)]
    found += bsdf_weights(bsdf) + [_bend_map(bend) for bend in bsdf_bends(bsdf)]
    return [t for t in found if isinstance(t, Varied)]


def is_textured(color: Texture | None) -> bool:
    """Whether a colour varies over a surface."""
    return isinstance(color, Varied)


def needs_uvs(color: Texture | None) -> bool:
    """Whether a colour is one over (u, v)."""
    return isinstance(color, Varied) and not isinstance(color, VolumeTexture)


def texture_volumes(bsdf: Bsdf, emission: Texture | None) -> list[GridVolume]:
    """The volumes that textures of a surface look up."""
    return [t.volume for t in (*bsdf_textures(bsdf), emission) if isinstance(t, VolumeTexture)]


def has_rough_textures(bsdf: Bsdf) -> bool:
    """Whether a microfacet model's roughness has a texture (that of principled ones is in a table)."""
    sides = [s.bsdf for s in bsdf_parts(bsdf) if isinstance(s.bsdf, RoughDielectric | RoughConductor)]
    return any(isinstance(a, Varied) for s in sides for a in (s.alpha_u, s.alpha_v))


def has_metal_textures(bsdf: Bsdf) -> bool:
    """Whether a metal's eta or k has a texture."""
    return any(isinstance(t, Varied) for side in bsdf_parts(bsdf) for t in _indices(side))


def has_textures(bsdf: Bsdf) -> bool:
    """Whether anything about it is a texture over (u, v)."""
    return any(map(needs_uvs, bsdf_textures(bsdf)))


def has_bitmaps(bsdf: Bsdf) -> bool:
    """Whether any of its textures has texels."""
    return any(isinstance(t, Bitmap) for t in bsdf_textures(bsdf))


def has_tables(bsdf: Bsdf) -> bool:
    """Whether it needs `material_tables`."""
    return bool(bsdf_kinds(bsdf) & _TABLES)
