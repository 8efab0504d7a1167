"""A scene round a volume, and what was chosen for it in a line each."""

from __future__ import annotations

from dataclasses import dataclass, replace
from types import SimpleNamespace
from typing import TYPE_CHECKING, Any

import numpy as np

from clvol.scene.loader import load_staged
from clvol.scene.records import GridVolume
from clvol.scene.transforms import rotate, scale, translate
from clvol.scene.views import check_size
from clvol.staging.fixed import Fixed
from clvol.staging.framing import FOV, Axes, View, frame, revolved
from clvol.staging.lights import environment_file, look_emitters
from clvol.staging.looks import LOOKS
from clvol.staging.medium import ALBEDO, DARK, Grids, choose_scales, medium
from clvol.staging.options import TRANSPARENT, VIEWS, checked
from clvol.staging.said import said
from clvol.staging.thickness import Rays

if TYPE_CHECKING:
    from collections.abc import Mapping

    from clvol.scene.records import Scene
    from clvol.staging.source import Field, Source

SIZE = (512, 512)
"""Of the picture, in pixels."""
SPP = 256
"""Samples per pixel where nothing else ends the render."""
MAX_DEPTH, RR_DEPTH = 128, 16
DIMMED = 0.4
"""What all light is multiplied by where the volume glows by itself."""
FLOOR, FLOOR_SIZE = 0.12, 40.0
"""Reflectance of the floor, and its radius in diagonals of the box."""


@dataclass(frozen=True, eq=False)
class Staged:
    """A scene description, what was chosen for it in a line each, and what was read for it."""

    description: dict[str, Any]
    lines: tuple[str, ...]
    fixed: Fixed
    source: Source

    def load(self) -> Scene:
        """The scene, ready to be rendered."""
        name = "" if self.source.path is None else self.source.name
        return load_staged(self.description, name, self.source.grids, self.source.files)


def stage(
    source: Source,
    given: Mapping[str, Any],
    size: tuple[int, int] = SIZE,
    spp: int = SPP,
    fixed: Fixed | None = None,
    turn: float | None = None,
) -> Staged:
    """Describe the scene of a volume.

    Parameters
    ----------
    given : options of `clvol.staging.options`; None for those that are not.
    size, spp : pixels (width, height) of the picture, and samples for each.
    fixed : what other frames of the sequence have, else chosen for this volume.
    turn : degrees by which a turntable has been turned; None where there is none.
    """
    options, size = checked(given), check_size(size)
    grids = Grids.of(source, options, of_sequence=fixed is not None)
    fixed = fixed or Fixed.of(source, grids, options)
    grids = grids.between(fixed.limits, options.transfer)
    if fixed.flames and grids.flame is None:
        grids = grids.dark()
    settle(options, fixed)
    axes, view = camera(fixed, options, size, turn)
    rays = measured_rays(fixed, options, size, turn)
    if fixed.scales is None:
        fixed = replace(fixed, scales=choose_scales(grids, options, rays, fixed.peak))
    assert fixed.scales is not None
    hidden = {"hide_emitters": True} if options.background == TRANSPARENT else {}
    description: dict[str, Any] = {
        "type": "scene",
        "integrator": {"type": "volpath", "max_depth": MAX_DEPTH, "rr_depth": RR_DEPTH, **hidden},
        "sensor": sensor(view, fixed.box, size, spp, options.background),
        **lights(options, axes, view.azimuth, DIMMED if fixed.burns else 1.0),
        **({"floor": floor(fixed.box, axes)} if options.ground else {}),
    }
    if not grids.density.empty:
        description["volume"] = bounds(grids.density) | {"interior": medium(grids, options, fixed.scales)}
    lines = tuple(said(grids, options, view, rays, fixed, fixed.scales))
    return Staged(description, lines, fixed, source)


def settle(options: SimpleNamespace, fixed: Fixed) -> None:
    """Fill in what is usual for what burns, and for what does not."""
    options.light = options.light or ("rim" if fixed.burns else "sun")
    options.albedo = options.albedo or ((DARK,) if fixed.burns else (ALBEDO,))


def measured_rays(
    fixed: Fixed, options: SimpleNamespace, size: tuple[int, int], turn: float | None = None
) -> Rays:
    """Rays through all of the volume, from where it fits the picture, however close the camera is."""
    fitting = SimpleNamespace(**vars(options) | {"distance": 1.0})
    return Rays.through(fixed.box, camera(fixed, fitting, size, turn)[1], size)


def camera(
    fixed: Fixed, options: SimpleNamespace, size: tuple[int, int], turn: float | None = None
) -> tuple[Axes, View]:
    """The directions of the world, and the camera; on a turntable it goes round what it sees."""
    axes, (azimuth, elevation) = Axes.of(fixed.up[0]), angles(options)
    if turn is None:
        return axes, frame(fixed.points, axes, azimuth, elevation, size, options.distance)
    centre = fixed.box.mean(axis=0)
    view = frame(revolved(fixed.points, axes, centre), axes, azimuth, elevation, size, options.distance)
    about = translate(centre) @ rotate(axes.up, turn) @ translate(-centre)
    return axes, replace(view, to_world=about @ view.to_world, azimuth=azimuth + turn)


def angles(options: SimpleNamespace) -> tuple[float, float]:
    """Azimuth and elevation of the camera; what is left of a pair of angles is that of the usual view."""
    azimuth, elevation = VIEWS[options.view]
    return (
        azimuth if options.azimuth is None else options.azimuth,
        elevation if options.elevation is None else options.elevation,
    )


def sensor(
    view: View,
    box: np.ndarray,
    size: tuple[int, int],
    spp: int,
    background: str | tuple[float, ...] | None,
) -> dict[str, Any]:
    """The camera's plugin with its film."""
    film: dict[str, Any] = {
        "type": "hdrfilm",
        "width": size[0],
        "height": size[1],
        "rfilter": {"type": "box"},
    }
    if background == TRANSPARENT:
        film["pixel_format"] = "rgba"
    elif background is not None:
        film["backdrop"] = {"type": "rgb", "value": list(np.broadcast_to(np.asarray(background), 3))}
    reach = view.distance + float(np.linalg.norm(box[1] - box[0]))
    return {
        "type": "perspective",
        "fov": FOV,
        "fov_axis": "larger",
        "near_clip": 1e-3 * reach,
        "far_clip": 1e3 * reach,
        "to_world": view.to_world,
        "film": film,
        "sampler": {"type": "independent", "sample_count": spp},
    }


def lights(options: SimpleNamespace, axes: Axes, azimuth: float, dimmed: float) -> dict[str, Any]:
    """Those of the look, or of the file."""
    sun = None if options.sun_direction is None else np.array(options.sun_direction)
    if options.light not in LOOKS:
        return {"environment": environment_file(options.light, axes, azimuth)}
    return look_emitters(options.light, axes, azimuth, sun, dimmed)


def floor(box: np.ndarray, axes: Axes) -> dict[str, Any]:
    """A disk right below the box."""
    diagonal = float(np.linalg.norm(box[1] - box[0]))
    centre = box.mean(axis=0)
    below = centre - axes.up * ((box[1] - box[0]) @ axes.up / 2 + 1e-3 * diagonal)
    turn = np.eye(4)  # the disk's normal is its local z
    turn[:3, :3] = np.stack([axes.right, -axes.front, axes.up], axis=1)
    return {
        "type": "disk",
        "to_world": translate(below) @ turn @ scale(FLOOR_SIZE * diagonal),
        "bsdf": {"type": "diffuse", "reflectance": {"type": "rgb", "value": FLOOR}},
    }


def bounds(density: Field) -> dict[str, Any]:
    """A cube without a surface round all of the density."""
    volume = density.volume
    assert isinstance(volume, GridVolume)
    lower, upper = volume.lower, volume.upper
    to_world = volume.index_to_world @ translate((lower + upper) / 2) @ scale((upper - lower) / 2)
    return {"type": "cube", "to_world": to_world, "bsdf": {"type": "null"}}
