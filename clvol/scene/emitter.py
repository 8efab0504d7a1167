"""Emitters: environments, parallel light, point lights, spots and shapes that emit."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from clvol.base.rows import bands
from clvol.scene.files import find_parameter
from clvol.scene.image import image_from_array, read_image
from clvol.scene.materials import Bitmap, Checkerboard, MeshAttribute, Texture, VolumeTexture
from clvol.scene.reader import BRIGHTEST, Reader
from clvol.scene.records import (
    ConstantEmitter,
    DirectionalEmitter,
    EnvmapEmitter,
    PointEmitter,
    ProjectorEmitter,
    SpotEmitter,
)
from clvol.scene.sensor import field_of_view, x_field_of_view
from clvol.scene.texture import texture
from clvol.scene.transforms import keeps_angles

MOST_INTENSE = 1e30
"""Largest intensity of a light that is a point, which may be far away: the Sun's is 3e25 W/sr."""

LARGEST_SCALE = 1e14
"""Of a projector, times `BRIGHTEST` and pi below `MOST_INTENSE`."""

NEGLIGIBLE = 1e-5
"""Share of the brightest value down to which negative values are rounding (colours out of the gamut)."""


@dataclass(frozen=True, eq=False)
class AreaLight:
    """What an `area` emitter adds to the shape it is in."""

    radiance: Texture


def constant(reader: Reader) -> ConstantEmitter:
    """The `constant` plugin: the same radiance from everywhere."""
    accept_common(reader)
    reader.transform()  # turns nothing, and is allowed on every emitter
    return ConstantEmitter(reader.color("radiance", 1.0, light=True, maximum=BRIGHTEST))


def envmap(reader: Reader) -> EnvmapEmitter:
    """The `envmap` plugin: a lat-long image, from a file or an array, Y up under `to_world`.

    Slightly negative values, which converted photographs have, become 0 (see `NEGLIGIBLE`).
    """
    accept_common(reader)
    reader.ignore(mis_compensation=bool)
    if reader.has("filename") == reader.has("bitmap"):
        reader.fail("an envmap needs either a filename or a bitmap (array)")
    if reader.has("filename"):
        source = str(find_parameter(reader, "filename"))
        radiance = read_image(source, reader.node.place("filename"))
        place = "filename"
    else:
        source = place = "bitmap"
        radiance = image_from_array(reader.array("bitmap"), reader.node.place("bitmap"))
    if radiance.shape[0] < 3 or radiance.shape[1] < 2:
        reader.fail(
            f"an envmap has at least 2 x 3 pixels, got {radiance.shape[1]} x {radiance.shape[0]}", place
        )
    with np.errstate(over="ignore"):
        scale = np.float32(reader.number("scale", 1.0, minimum=0.0))
    if fault := check_radiance(radiance, scale):
        reader.fail(fault, place, f"at most {BRIGHTEST:g}")
    to_world = reader.transform()
    if not keeps_angles(to_world):
        reader.fail("to_world of an envmap must not stretch or shear it", "to_world", "rotate it only")
    return EnvmapEmitter(radiance, to_world, source)


def check_radiance(radiance: np.ndarray, scale: np.float32) -> str:
    """Multiply a picture by `scale` and take slightly negative values as 0, in place; else what is wrong."""
    with np.errstate(over="ignore", invalid="ignore"):  # what is not finite is told below
        largest = radiance.max() * scale
    for rows in bands(*radiance.shape[:2]):
        band = radiance[rows]
        with np.errstate(over="ignore", invalid="ignore"):
            band *= scale
        broken = ~np.isfinite(band) | (band < -NEGLIGIBLE * largest) | (band > BRIGHTEST)
        if broken.any():
            row, column = np.argwhere(broken)[0][:2]
            row += rows.start
            return f"radiance must be finite and >= 0; it is not at row {row}, column {column}"
        np.maximum(band, 0, out=band)
    return ""


def directional(reader: Reader) -> DirectionalEmitter:
    """The `directional` plugin: light travels along `direction`, or along `to_world`'s local +z."""
    accept_common(reader)
    irradiance = reader.color("irradiance", 1.0, light=True, maximum=BRIGHTEST)
    if reader.has("direction") and reader.has("to_world"):
        reader.fail("give either direction or to_world, not both", "to_world")
    direction = reader.vector("direction", reader.transform()[:3, 2])
    length = np.linalg.norm(direction)
    if length == 0:
        reader.fail("direction is zero", "direction")
    return DirectionalEmitter(irradiance, tuple((direction / length).tolist()))


def point(reader: Reader) -> PointEmitter:
    """The `point` plugin: at `position`, or at the origin of `to_world`."""
    accept_common(reader)
    intensity = reader.color("intensity", 1.0, light=True, maximum=MOST_INTENSE)
    if reader.has("position") and reader.has("to_world"):
        reader.fail("give either position or to_world, not both", "to_world")
    position = reader.vector("position", reader.transform()[:3, 3])
    return PointEmitter(intensity, tuple(position.tolist()))


def spot(reader: Reader) -> SpotEmitter:
    """The `spot` plugin: a cone of light along local +z, which fades from `beam_width` to `cutoff_angle`."""
    accept_common(reader)
    intensity = reader.color("intensity", 1.0, light=True, maximum=MOST_INTENSE)
    cutoff = reader.number("cutoff_angle", 20.0, minimum=0.0, maximum=180.0)
    if cutoff == 0:
        reader.fail("a cutoff_angle of 0 leaves no light", "cutoff_angle")
    beam = reader.number("beam_width", 0.75 * cutoff, minimum=0.0)
    if beam > cutoff:
        reader.fail(f"beam_width ({beam:g}) must not exceed cutoff_angle ({cutoff:g})", "beam_width")
    to_world = reader.transform()
    if not keeps_angles(to_world):
        reader.fail("to_world of a spot must not stretch or shear it", "to_world", "change cutoff_angle")
    return SpotEmitter(intensity, to_world, cutoff, beam, _slide(reader, cutoff))


def _slide(reader: Reader, cutoff: float) -> Bitmap | Checkerboard | None:
    """The texture that a spot projects."""
    if not reader.has("texture"):
        return None
    found = None if reader.is_value("texture") else texture(reader, "texture", 1.0, BRIGHTEST)
    if type(found) not in (Bitmap, Checkerboard):  # as attributes of meshes are
        reader.fail("the texture of a spot must be a bitmap or a checkerboard", "texture")
    if cutoff >= 90:
        reader.fail("a spot with a texture has a cutoff_angle below 90", "cutoff_angle")
    assert isinstance(found, Bitmap | Checkerboard)
    return found


def projector(reader: Reader) -> ProjectorEmitter:
    """The `projector` plugin: a perspective camera backwards, whose picture is `irradiance` times `scale`."""
    accept_common(reader)
    irradiance = _colour_or_texture(reader, "irradiance", volumes=False)
    assert not isinstance(irradiance, VolumeTexture)
    scale = reader.number("scale", 1.0, minimum=0.0, maximum=LARGEST_SCALE)
    rows, columns = irradiance.pixels.shape[:2] if isinstance(irradiance, Bitmap) else (1, 1)
    x_fov = x_field_of_view(*field_of_view(reader), columns / rows)
    to_world = reader.transform()
    if not keeps_angles(to_world):
        reader.fail("to_world of a projector must not stretch or shear it", "to_world", "change fov")
    return ProjectorEmitter(irradiance, scale, to_world, float(np.degrees(x_fov)))


def area(reader: Reader) -> AreaLight:
    """The `area` plugin, which makes the shape round it a light: of one radiance, or of a texture of them."""
    accept_common(reader)
    return AreaLight(_colour_or_texture(reader, "radiance", volumes=True))


def _colour_or_texture(reader: Reader, name: str, volumes: bool) -> Texture:
    """What a light is everywhere, or by a texture; `volumes`: which may be of a volume."""
    if reader.is_value(name):
        return reader.color(name, 1.0, light=True, maximum=BRIGHTEST)
    found = texture(reader, name, 1.0, BRIGHTEST)
    if isinstance(found, MeshAttribute) or (isinstance(found, VolumeTexture) and not volumes):
        known = "a bitmap, a checkerboard or a volume" if volumes else "a bitmap or a checkerboard"
        reader.refuse_plugin(name, f"a number, an rgb, a spectrum, {known}")
    return found


def directionalarea(reader: Reader) -> AreaLight:
    """The `directionalarea` plugin, which path tracers do not see: none meets its one direction by chance."""
    accept_common(reader)
    if reader.is_value("radiance"):
        reader.color("radiance", 1.0, light=True, maximum=BRIGHTEST)
    else:
        texture(reader, "radiance", 1.0, BRIGHTEST)
    reader.approximated("black, as Mitsuba's path tracers see it: its one direction is met by no chance")
    return AreaLight((0.0,))


def accept_common(reader: Reader) -> None:
    """Accept what every emitter may carry: a share of the samples, and the medium that it is in.

    The medium is found from the shapes (Mitsuba's path tracers do not look at it).
    """
    if reader.number("sampling_weight", 1.0, minimum=0.0) == 0:
        reader.fail("sampling_weight is 0: Mitsuba never samples such a light", "sampling_weight")
    medium = reader.only_child("medium")
    if medium is not None:
        reader.build(medium)
