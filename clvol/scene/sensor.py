"""Sensor, film, reconstruction filter and sampler: what a picture is taken with."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from clvol.scene.reader import Reader
from clvol.scene.records import Film, Perspective, ReconstructionFilter

MAX_SIDE = 65536
MAX_PIXELS = 2**28
FOV_AXES = ("x", "y", "diagonal", "smaller", "larger")
_FILM_DIAGONAL_MM = float(np.hypot(36.0, 24.0))


@dataclass(frozen=True)
class Sampler:
    """Samples per pixel and seed."""

    spp: int = 4
    seed: int = 0


@dataclass(frozen=True, eq=False)
class Sensor:
    """A camera with its film and sampler, as a sensor plugin holds them."""

    camera: Perspective
    film: Film
    sampler: Sampler


def perspective(reader: Reader) -> Sensor:
    """The `perspective` plugin; a focal length is for 35 mm film, along the diagonal."""
    fov, fov_axis = _field_of_view(reader)
    near = reader.number("near_clip", 1e-2, minimum=0.0, open_interval=True)
    far = reader.number("far_clip", 1e4)
    if far <= near:
        reader.fail(f"far_clip ({far:g}) must be beyond near_clip ({near:g})", "far_clip")
    camera = Perspective(
        to_world=_rigid(reader),
        fov=fov,
        fov_axis=fov_axis,
        near_clip=near,
        far_clip=far,
        principal_point_offset=(
            reader.number("principal_point_offset_x", 0.0),
            reader.number("principal_point_offset_y", 0.0),
        ),
    )
    film_node, sampler_node = reader.only_child("film"), reader.only_child("sampler")
    # The medium round the camera is found from the shapes; naming it, as Mitsuba needs, is checked only.
    for _, medium in reader.children("medium"):
        reader.build.build(medium)
    return Sensor(
        camera,
        reader.build.build(film_node) if film_node else Film(),
        reader.build.build(sampler_node) if sampler_node else Sampler(),
    )


def _field_of_view(reader: Reader) -> tuple[float, str]:
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
    if not np.allclose(matrix[:3, :3].T @ matrix[:3, :3], np.eye(3), atol=2e-3):
        reader.fail(
            "to_world of a sensor must not scale or shear", "to_world", "change fov or the distance instead"
        )
    return matrix


def hdrfilm(reader: Reader) -> Film:
    """The `hdrfilm` plugin."""
    width = reader.integer("width", Film.width, 1, MAX_SIDE)
    height = reader.integer("height", Film.height, 1, MAX_SIDE)
    if width * height > MAX_PIXELS:
        reader.fail(
            f"a film of {width} x {height} pixels is too large", "width", f"at most {MAX_PIXELS} pixels"
        )
    for name in ("crop_offset_x", "crop_offset_y", "crop_width", "crop_height"):
        reader.refuse(name)
    if reader.has("pixel_format") and reader.string("pixel_format", "rgb") != "rgb":
        reader.fail(
            f"pixel_format '{reader.string('pixel_format', 'rgb')}' is not supported in this version",
            "pixel_format",
            "supported: rgb",
        )
    reader.string("component_format", "float16", ("float16", "float32", "uint32"))
    reader.ignore("file_format", "banner", "compensate")
    rfilter = reader.only_child("rfilter")
    return Film(
        width,
        height,
        reader.build.build(rfilter) if rfilter else ReconstructionFilter(),
        reader.boolean("sample_border", False),
    )


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


def independent(reader: Reader) -> Sampler:
    """The `independent` sampler."""
    return Sampler(reader.integer("sample_count", 4, 1), reader.integer("seed", 0, 0, 2**32 - 1))
