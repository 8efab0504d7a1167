"""Textures: colours over a surface, and how a BSDF reads a parameter that may be one."""

from __future__ import annotations

from numbers import Real
from typing import TYPE_CHECKING

import numpy as np

from clvol.base.rows import bands
from clvol.scene.files import find_parameter
from clvol.scene.image import image_from_array, read_image
from clvol.scene.materials import Bitmap, Checkerboard, Roughness, Texture, VolumeTexture
from clvol.scene.medium import own_volume, sane
from clvol.scene.nodes import Node
from clvol.scene.reader import BRIGHTEST
from clvol.scene.records import ConstVolume, GridVolume
from clvol.scene.volume import largest_value, limited
from clvol.volumes import check_coefficients

if TYPE_CHECKING:
    from clvol.scene.reader import Reader

NEGLIGIBLE = 1e-4
"""How far texels may lie beyond 0..1: rounding of converted pictures, which is cut."""


def bitmap(reader: Reader) -> Bitmap:
    """The `bitmap` plugin: a picture from a file or an array.  What it is for bounds its values."""
    reader.ignore(accel=bool, format=str)
    if reader.has("filename") == reader.has("bitmap"):
        reader.fail("a bitmap texture needs either a filename or a bitmap (array)")
    raw = reader.boolean("raw", False)
    if reader.has("filename"):
        place, source = "filename", str(find_parameter(reader, "filename"))
        pixels = read_image(source, reader.node.place(place), raw)
    else:
        place = source = "bitmap"
        pixels = image_from_array(reader.array(place), reader.node.place(place), raw)
    if fault := check_texels(pixels, BRIGHTEST):
        reader.fail(fault, place)
    return Bitmap(
        pixels,
        _to_uv(reader),
        reader.string("filter_type", "bilinear", ("bilinear", "nearest")),
        reader.string("wrap_mode", "repeat", ("repeat", "mirror", "clamp")),
        source,
    )


def check_texels(pixels: np.ndarray, maximum: float = 1.0) -> str:
    """Cut what is beyond 0..`maximum` by rounding, in place; what is wrong with the others, "" if nothing."""
    for rows in bands(*pixels.shape[:2]):
        band = pixels[rows]
        broken = ~((band >= -NEGLIGIBLE) & (band <= maximum + NEGLIGIBLE))
        if broken.any():
            row, column = np.argwhere(broken)[0][:2]
            shown, row = band[row, column].tolist(), rows.start + row
            return f"texels must be in [0, {maximum:g}]; at row {row}, column {column} there is {shown}"
        np.clip(band, 0, maximum, out=band)
    return ""


def checkerboard(reader: Reader) -> Checkerboard:
    """The `checkerboard` plugin: `color0` where u and v lie in like halves of their units, else `color1`."""
    for name in ("color0", "color1"):
        if not reader.is_value(name):
            reader.refuse_plugin(name, "a number, an rgb or a spectrum (no texture in a texture)")
    color0, color1 = (
        reader.color(name, value, maximum=BRIGHTEST) for name, value in (("color0", 0.4), ("color1", 0.2))
    )
    return Checkerboard(color0, color1, _to_uv(reader))


def volume(reader: Reader) -> Texture:
    """The `volume` plugin: what its volume holds at the points of the surface, in the world."""
    looked_up = sane(reader, own_volume(reader, "volume", "a volume"))
    if isinstance(looked_up, ConstVolume):
        return looked_up.value
    check_coefficients(looked_up.grid, "the volume of a texture")
    if (largest := largest_value(looked_up)) > BRIGHTEST:
        reader.fail(f"a texture's values are at most {BRIGHTEST:g}, the volume reaches {largest:g}", "volume")
    return VolumeTexture(looked_up)


def texture(reader: Reader, name: str, default: float, maximum: float = 1.0) -> Texture:
    """Parameter `name`: a number, rgb or spectrum in [0, maximum], or a texture.

    Raises
    ------
    SceneError
        Another plugin, or a value out of range.
    """
    if reader.is_value(name):
        return reader.color(name, default, maximum=maximum)
    reader.has(name)
    found = reader.children("texture", name)
    if not found:
        reader.refuse_plugin(name, "a number, an rgb, a spectrum or a texture")
    picture: Texture = reader.build(found[0][1])
    if isinstance(picture, VolumeTexture) and maximum < largest_value(picture.volume) <= maximum + NEGLIGIBLE:
        cut = limited(picture.volume, maximum)
        assert isinstance(cut, GridVolume)
        return VolumeTexture(cut)
    if maximum <= BRIGHTEST and (fault := _beyond(picture, maximum)):
        reader.fail(f"'{name}' of {reader.kind} '{reader.type}': {fault}", name)
    return picture


def _beyond(picture: object, maximum: float) -> str:
    """What of a texture is beyond a maximum, "" if nothing; texels that are so by rounding are cut."""
    if isinstance(picture, Bitmap) and picture.pixels.max() > maximum:
        return check_texels(picture.pixels, maximum)
    if isinstance(picture, Checkerboard) and max(*picture.color0, *picture.color1) > maximum:
        return f"colors must be in [0, {maximum:g}]"
    if isinstance(picture, VolumeTexture) and (largest := largest_value(picture.volume)) > maximum:
        return f"values must be in [0, {maximum:g}], the volume reaches {largest:.9g}"
    if isinstance(picture, tuple) and max(picture) > maximum:  # of a constvolume
        return f"values must be in [0, {maximum:g}], the volume has {max(picture):.9g}"
    return ""


def share(reader: Reader, name: str) -> Texture:
    """A share that must be given: a number, which is cut to [0, 1] as Mitsuba does, a colour or a texture."""
    if not isinstance(reader.node.get(name), Real):
        return texture(reader, name, 0.5)
    return (number_share(reader, name),)


def number_share(reader: Reader, name: str) -> float:
    """A share that is a number, which is cut to [0, 1] as Mitsuba does."""
    given = reader.number(name, 0.5)
    if not 0 <= given <= 1:
        reader.approximated("the nearest number from 0 to 1, as in Mitsuba", name)
    return min(max(given, 0.0), 1.0)


def roughness(reader: Reader, name: str, default: Roughness) -> Roughness:
    """A roughness: a number >= 0, or a texture of them."""
    if not reader.has(name):
        return default
    if reader.is_value(name):
        return reader.number(name, 0.0, minimum=0.0)
    found = texture(reader, name, 0.0)
    return float(np.mean(found)) if isinstance(found, tuple) else found  # a colour of a constvolume


def constant(reader: Reader, name: str, default: float, minimum: float) -> float:
    """A number >= `minimum` that Mitsuba may take from a texture, and clvol may not."""
    if isinstance(reader.node.get(name), Node) and not reader.is_value(name):
        reader.refuse_plugin(name, "a number (no texture here)")
    return reader.number(name, default, minimum=minimum)


def _to_uv(reader: Reader) -> np.ndarray:
    """The 3x3 part of `to_uv` (3x3, or 4x4 without its z) that moves (u, v)."""
    given = reader.raw("to_uv")
    given = getattr(given, "matrix", given)
    if np.shape(given) == (3, 3):
        matrix = np.asarray(given)
        if matrix.dtype.kind not in "iuf" or not np.isfinite(matrix).all() or (matrix[2] != (0, 0, 1)).any():
            reader.fail("to_uv must be finite, with a last row of 0 0 1", "to_uv")
        return matrix.astype(np.float64)
    return reader.transform("to_uv")[np.ix_([0, 1, 3], [0, 1, 3])]
