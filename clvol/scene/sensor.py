"""Sensor, film, reconstruction filter and sampler: what a picture is taken with."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from clvol.scene.nodes import NAMELESS
from clvol.scene.reader import BRIGHTEST
from clvol.scene.records import (
    Batch,
    Camera,
    Film,
    Meter,
    Orthographic,
    Perspective,
    ReconstructionFilter,
    Sampler,
    Sensor,
    Shape,
    ShapeMeter,
)
from clvol.scene.transforms import frame, stays_round, translate

if TYPE_CHECKING:
    from clvol.scene.reader import Reader

MAX_SIDE = 65536
MAX_PIXELS = 2**28
FOV_AXES = ("x", "y", "diagonal", "smaller", "larger")
BOX = ReconstructionFilter("box", 0.5, 0.0)
"""Of pictures in which filters make no difference."""
IN_A_SHAPE = "put it into the shape whose irradiance it measures"
_FILM_DIAGONAL_MM = float(np.hypot(36.0, 24.0))


def perspective(reader: Reader) -> Sensor:
    """The `perspective` plugin; a focal length is for 35 mm film, along the diagonal."""
    camera = _pinhole(reader)
    reader.ignore(focus_distance=float)  # everything is sharp
    offset = (reader.number("principal_point_offset_x", 0.0), reader.number("principal_point_offset_y", 0.0))
    return _sensor(reader, replace(camera, principal_point_offset=offset))


def thinlens(reader: Reader) -> Sensor:
    """The `thinlens` plugin: a perspective camera that is sharp at one depth, by default the far plane's.

    An aperture of radius 0 is a pinhole.
    """
    camera = _pinhole(reader)
    if not reader.has("aperture_radius"):
        reader.fail("a thinlens needs an aperture_radius", hint="in world units; 0 is a pinhole")
    aperture = reader.number("aperture_radius", 0.0, minimum=0.0)
    focus = reader.number("focus_distance", camera.far_clip, minimum=0.0, open_interval=True)
    return _sensor(reader, replace(camera, aperture_radius=aperture, focus_distance=focus))


def _pinhole(reader: Reader) -> Perspective:
    """What every perspective camera has: its place, field of view, near and far plane."""
    fov, fov_axis = field_of_view(reader)
    return Perspective(_rigid(reader), fov, fov_axis, *_clip(reader))


def orthographic(reader: Reader) -> Sensor:
    """The `orthographic` plugin: parallel rays; `to_world` scales the film, which is 2 wide without."""
    reader.ignore(focus_distance=float)
    return _sensor(reader, Orthographic(reader.transform(), *_clip(reader)))


def radiancemeter(reader: Reader) -> Sensor:
    """The `radiancemeter` plugin: one ray, of `origin` and `direction` or local +z of `to_world`."""
    if reader.has("to_world"):
        to_world = _rigid(reader)
        for name in ("origin", "direction"):
            if reader.has(name):
                reader.vector(name, (0.0, 0.0, 0.0))
                reader.approximated("not given: to_world says it, as in Mitsuba", name)
    elif reader.has("origin") != reader.has("direction"):
        given = "origin" if reader.has("origin") else "direction"
        reader.fail("origin and direction of a radiancemeter go together", given)
    else:
        to_world = translate(reader.vector("origin", (0.0, 0.0, 0.0))) @ _along(reader)
    return _meter(reader, Meter(to_world))


def distant(reader: Reader) -> Sensor:
    """The `distant` plugin: what leaves the scene against a direction, on the mean over a `target`."""
    if reader.has("direction") and reader.has("to_world"):
        reader.fail("give either direction or to_world, not both", "to_world")
    to_world = _rigid(reader) if reader.has("to_world") else _along(reader)
    target: np.ndarray | Shape | None = None
    shapes = reader.children("shape", "target")
    if shapes:
        target = reader.build(shapes[0][1])
        if not isinstance(target, Shape):
            what = f"the target of a distant sensor must be one shape, not a '{shapes[0][1].type}'"
            reader.unsupported(what, "target", "take one shape of it, as Mitsuba does")
        if target.kind == "cylinder" and not stays_round(target.to_world):
            reader.fail("a cylinder that is a target must not be stretched across or sheared", "target")
    elif reader.has("target"):
        target = reader.vector("target", (0.0, 0.0, 0.0))
    if reader.only_child("medium"):
        what = "a distant sensor starts outside of all shapes, and takes no medium"
        reader.unsupported(what, reader.children("medium")[0][0])
    return _meter(reader, Meter(to_world, True, target))


def irradiancemeter(reader: Reader) -> ShapeMeter:
    """The `irradiancemeter` plugin, which stands in a shape; its film may have any size, all of one mean."""
    if reader.has("to_world"):
        reader.fail("an irradiancemeter has the to_world of the shape that it is in", "to_world")
    _shutter(reader)
    film, sampler, medium = map(reader.only_child, ("film", "sampler", "medium"))
    return ShapeMeter(
        replace(reader.build(film) if film else Film(), rfilter=BOX),
        reader.build(sampler) if sampler else Sampler(),
        reader.build(medium) if medium else None,
        reader.node.id,
    )


def _along(reader: Reader) -> np.ndarray:
    """A turn that takes local +z to `direction`, which is +z without."""
    direction = reader.vector("direction", (0.0, 0.0, 1.0))
    length = np.linalg.norm(direction)
    if length == 0:
        reader.fail("direction is zero", "direction")
    return frame(direction / length)


def _meter(reader: Reader, meter: Meter) -> Sensor:
    """`meter` with its film, of one pixel; filters make no difference there."""
    sensor = _sensor(reader, meter)
    width, height = sensor.film.width, sensor.film.height
    if (width, height) != (1, 1):
        reader.fail(
            f"the film of a {reader.type} has 1 x 1 pixels, not {width} x {height}",
            next((name for name, _ in reader.children("film")), ""),
            "give its film a width and a height of 1",
        )
    return replace(sensor, film=replace(sensor.film, rfilter=BOX))


def _clip(reader: Reader) -> tuple[float, float]:
    """The distances of the near and the far plane."""
    near = reader.number("near_clip", 1e-2, minimum=0.0, open_interval=True)
    far = reader.number("far_clip", 1e4)
    if far <= near:
        reader.fail(f"far_clip ({far:g}) must be beyond near_clip ({near:g})", "far_clip")
    return near, far


def _sensor(reader: Reader, camera: Camera | Batch) -> Sensor:
    """`camera` with the film and sampler inside the sensor."""
    _shutter(reader)
    film_node, sampler_node = reader.only_child("film"), reader.only_child("sampler")
    if not isinstance(camera, Batch) and (medium := reader.only_child("medium")):
        camera = replace(camera, medium=reader.build(medium))
    return Sensor(
        camera,
        reader.build(film_node) if film_node else Film(),
        reader.build(sampler_node) if sampler_node else Sampler(),
    )


def _shutter(reader: Reader) -> None:
    """Nothing moves, so that times of exposure change nothing; pictures have the colours of the eye."""
    if reader.number("shutter_close", 0.0) < reader.number("shutter_open", 0.0):
        reader.fail("shutter_close must not be before shutter_open", "shutter_close")
    reader.refuse("srf", "pictures are linear sRGB")


def batch(reader: Reader) -> Sensor:
    """The `batch` plugin: its sensors side by side on its film, each on as many columns.

    A shape among them stands for the irradiancemeter in it.  One that is not in the scene is only measured.

    Their own films and samplers are superseded by those of the batch, but for fields of view: as in Mitsuba
    one that is not along x is what it comes to along x on the sensor's own film.
    """
    cameras, names = [], []
    found = {**dict(reader.children("sensor")), **dict(reader.children("shape"))}
    for key, node in ((key, found[key]) for key, _ in reader.node.parameters() if key in found):
        inside = reader.build(node)
        if isinstance(inside, ShapeMeter):
            hint = f"{IN_A_SHAPE}, and the shape into the batch"
            reader.fail("an irradiancemeter of a batch stands in a shape", key, hint)
        if not isinstance(inside, Sensor):
            inside = _measured(reader, inside, key)
        camera = inside.camera
        if isinstance(camera, Batch):
            reader.fail("a batch takes no other batch", key, "put its sensors into this one")
        if isinstance(camera, Perspective):
            fov = math.degrees(field_of_view_x(camera, inside.film))
            camera = replace(camera, fov=fov, fov_axis="x")
        cameras.append(camera)
        names.append(node.id or ("" if key.startswith(NAMELESS) else key))
    if not cameras:
        reader.fail("a batch needs at least one sensor inside")
    made = _sensor(reader, Batch(tuple(cameras), tuple(names)))
    if fault := batch_fault(made.film, len(cameras)):
        reader.fail(fault)
    return made


def _measured(reader: Reader, record: object, key: str) -> Sensor:
    """The sensor in a shape."""
    if not isinstance(record, Shape) or record.meter is None:
        reader.fail("a shape in a batch needs an irradiancemeter inside", key)
    return record.meter.on(record)


def batch_fault(film: Film, count: int) -> str:
    """Why `count` pictures cannot stand side by side on a film; "" where they can."""
    if film.crop:
        return "the film of a batch takes no crop window"
    if film.width % count:
        return f"the width of a batch's film, {film.width}, must be a multiple of its {count} sensors"
    return ""


def field_of_view(reader: Reader) -> tuple[float, str]:
    """(degrees, axis) from `fov` and `fov_axis`, or from a focal length."""
    if reader.has("fov"):
        if reader.has("focal_length"):
            reader.fail("give either fov or focal_length, not both", "focal_length")
        fov = reader.number("fov", 0.0, minimum=0.0, maximum=180.0, open_interval=True)
        return fov, reader.string("fov_axis", "x", FOV_AXES)
    text = reader.string("focal_length", "50mm")
    if reader.has("fov_axis"):
        reader.fail("fov_axis goes with fov; a focal length is always along the diagonal", "fov_axis")
    try:
        millimetres = float(text.removesuffix("mm"))
    except ValueError:
        millimetres = np.nan
    if not (np.isfinite(millimetres) and millimetres > 0):
        reader.fail(f"focal_length must be like '50mm', got '{text}'", "focal_length")
    return float(2 * np.rad2deg(np.arctan(_FILM_DIAGONAL_MM / (2 * millimetres)))), "diagonal"


def _rigid(reader: Reader) -> np.ndarray:
    """`to_world`, which for a camera may turn, move and mirror, but not scale."""
    matrix = reader.transform()
    if not is_rigid(matrix):
        reader.fail(
            "to_world of a sensor must not scale or shear", "to_world", "change fov or the distance instead"
        )
    return matrix


def is_rigid(matrix: np.ndarray) -> bool:
    """Whether a 4x4 transform may be a camera's: it turns, moves and mirrors, and nothing else."""
    return bool(np.allclose(matrix[:3, :3].T @ matrix[:3, :3], np.eye(3), atol=2e-3))


def field_of_view_x(sensor: Perspective, film: Film) -> float:
    """Horizontal field of view in radians, from a field of view along any axis."""
    return x_field_of_view(sensor.fov, sensor.fov_axis, film.width / film.height)


def x_field_of_view(fov: float, axis: str, aspect: float) -> float:
    """As `field_of_view_x`, of a picture `aspect` times as wide as high; `fov` in degrees along `axis`."""
    if axis == "smaller":
        axis = "x" if aspect <= 1 else "y"
    elif axis == "larger":
        axis = "x" if aspect >= 1 else "y"
    tangent = math.tan(math.radians(fov) / 2)
    if axis == "y":
        tangent *= aspect
    elif axis == "diagonal":
        tangent *= aspect / math.hypot(aspect, 1.0)
    return 2 * math.atan(tangent)


def film_fault(width: int, height: int) -> str:
    """What is wrong with a film of so many pixels; "" for one that can be rendered."""
    if not (1 <= width <= MAX_SIDE and 1 <= height <= MAX_SIDE):
        return f"each side of a film has 1 to {MAX_SIDE} pixels, not {width} x {height}"
    return f"a film of {width} x {height} pixels is too large" if width * height > MAX_PIXELS else ""


def hdrfilm(reader: Reader) -> Film:
    """The `hdrfilm` plugin."""
    width = reader.integer("width", Film.width, 1, MAX_SIDE)
    height = reader.integer("height", Film.height, 1, MAX_SIDE)
    if fault := film_fault(width, height):
        reader.fail(fault, "width", f"at most {MAX_PIXELS} pixels")
    component_format = None
    if reader.has("component_format"):
        component_format = reader.string("component_format", "float32", ("float16", "float32"))
    reader.ignore(file_format=str, banner=bool, compensate=bool)
    rfilter = reader.only_child("rfilter")
    return Film(
        width,
        height,
        reader.build(rfilter) if rfilter else ReconstructionFilter(),
        reader.boolean("sample_border", False),
        _crop(reader, width, height),
        reader.string("pixel_format", Film.pixel_format, ("rgb", "rgba")),
        reader.color("backdrop", 0.0, light=True, maximum=BRIGHTEST) if reader.has("backdrop") else None,
        component_format=component_format,
    )


def _crop(reader: Reader, width: int, height: int) -> tuple[int, int, int, int] | None:
    """The part of the film that is rendered; None for all of it."""
    crop = []
    for axis, side, size in (("x", "width", width), ("y", "height", height)):
        offset = reader.integer(f"crop_offset_{axis}", 0, 0)
        length = reader.integer(f"crop_{side}", size, 1)
        if offset + length > size:
            reader.fail(
                f"the crop window reaches beyond the film: crop_offset_{axis} {offset} and "
                f"crop_{side} {length} exceed its {side} {size}",
                f"crop_{side}" if reader.has(f"crop_{side}") else f"crop_offset_{axis}",
            )
        crop += [offset, length]
    x, columns, y, rows = crop
    return None if (columns, rows) == (width, height) else (x, y, columns, rows)


def box(reader: Reader) -> ReconstructionFilter:
    """The `box` filter: one pixel wide, as in Mitsuba (which has no radius to set)."""
    return ReconstructionFilter("box", radius=0.5, stddev=0.0)


def tent(reader: Reader) -> ReconstructionFilter:
    """The `tent` filter of half-width `radius`."""
    radius = reader.number("radius", 1.0, minimum=0.0, maximum=16.0, open_interval=True)
    return ReconstructionFilter("tent", radius=radius, stddev=0.0)


def gaussian(reader: Reader) -> ReconstructionFilter:
    """The `gaussian` filter, cut off at four standard deviations."""
    stddev = reader.number("stddev", 0.5, minimum=0.0, maximum=4.0, open_interval=True)
    return ReconstructionFilter("gaussian", radius=4 * stddev, stddev=stddev)


def mitchell(reader: Reader) -> ReconstructionFilter:
    """The `mitchell` filter with its parameters `B` and `C`, from 0 to 1 (Mitchell and Netravali 1988)."""
    b, c = (reader.number(name, 1 / 3, minimum=0.0, maximum=1.0) for name in "BC")
    return ReconstructionFilter("mitchell", radius=2.0, stddev=0.0, b=b, c=c)


def catmullrom(reader: Reader) -> ReconstructionFilter:
    """The `catmullrom` filter, which is Mitchell and Netravali's with B = 0 and C = ½."""
    return ReconstructionFilter("mitchell", radius=2.0, stddev=0.0, b=0.0, c=0.5)


def lanczos(reader: Reader) -> ReconstructionFilter:
    """The `lanczos` filter: a sinc under the main lobe of a wider one, as far as that has `lobes`."""
    return ReconstructionFilter("lanczos", radius=float(reader.integer("lobes", 3, 1, 16)), stddev=0.0)


def independent(reader: Reader) -> Sampler:
    """The `independent` sampler."""
    return Sampler(reader.integer("sample_count", 4, 1), reader.integer("seed", 0, 0, 2**32 - 1))


SAMPLERS_BEFORE = ("halton", "hammersley", "sobol")
"""Those of Mitsuba before version 2."""
OTHER_SAMPLERS: dict[str, dict[str, type]] = {
    "stratified": {"jitter": bool},
    "multijitter": {"jitter": bool},
    "orthogonal": {"strength": int, "jitter": bool},
    "ldsampler": {"dimension": int},
    **{name: {"scramble": int} for name in SAMPLERS_BEFORE},
}
"""Mitsuba's other samplers, and their own parameters, by type."""


def other_sampler(reader: Reader) -> Sampler:
    """One of `OTHER_SAMPLERS`: its sample count and seed; how samples are drawn is a choice of the render."""
    reader.ignore(**OTHER_SAMPLERS[reader.type])
    reader.approximated("clvol's own sampler, of the same sample count")
    return independent(reader)
