"""`clvol.volume_scene`: what the command line does with a volume, for Python."""

from __future__ import annotations

import logging
from typing import TYPE_CHECKING, Any

from clvol.staging.options import OPTIONS
from clvol.staging.source import Source
from clvol.staging.stage import SIZE, SPP, stage

if TYPE_CHECKING:
    from collections.abc import Sequence

    from clvol.scene.records import Scene

log = logging.getLogger("clvol")


def volume_scene(
    volume: Any,
    *,
    density: str | None = None,
    temperature: str | None = None,
    flame: str | None = None,
    colour: str | None = None,
    level_set: str | None = None,
    sanitize: bool | None = None,
    transfer: Any = None,
    density_scale: float | None = None,
    albedo: float | Sequence[float] | None = None,
    anisotropy: float | None = None,
    temperature_scale: float | None = None,
    emission_scale: float | None = None,
    light: str | None = None,
    sun_direction: Sequence[float] | None = None,
    view: str | None = None,
    azimuth: float | None = None,
    elevation: float | None = None,
    distance: float | None = None,
    up: str | None = None,
    ground: bool | None = None,
    background: str | float | Sequence[float] | None = None,
    size: tuple[int, int] = SIZE,
    spp: int = SPP,
) -> Scene:
    """Make a scene of a volume alone: framed, scaled so that it reads well, and lit.

    It is what `clvol render VOLUME` renders and `clvol scene VOLUME` writes. What was chosen is logged to the
    logger "clvol", as information.

    Parameters
    ----------
    volume
        A file's name, an array [z, y, x], a grid of `load_volume`, or a dict of these by name, as
        ``{"density": a, "temperature": b}``.
    density, temperature, flame, colour
        Names of grids, which are found by their usual names otherwise. "none" leaves one out.
    level_set
        "fog" takes the density for a level set, and fills it with fog.
    sanitize
        Take NaN and slightly negative samples as 0. A warning counts them.
    transfer
        A transfer function of the values: the name of a preset ("bone", "muscle", "lung", "mr", "fire",
        "density"), or a dict of `clvol.transfer`'s keywords.
    density_scale
        Extinction of density 1. By default the optical thickness is about 8 at the 90th percentile of the
        rays that the camera sends through the volume.
    albedo
        Share of light that is scattered, or three of them: 0.95, and 0.5 of what burns.
    anisotropy
        Mean cosine of scattering, 0.3 by default.
    temperature_scale, emission_scale
        Kelvin of temperature 1, and how bright it glows (0: not at all).
    light
        "sun", "sky", "studio", "rim", or the file of an environment. The default is "sun", and "rim" for what
        burns.
    sun_direction
        Where the sun, or the main lamp, stands, seen from the volume; by default it goes with the camera.
    view, azimuth, elevation, distance
        A view by name ("front", "back", "left", "right", "top", "three-quarter"), or by degrees round the
        volume from its front and above the horizon. The distance is a factor: 1 fits the picture.
    up
        "y" or "z". It is guessed by who wrote the file.
    ground
        Put it on a floor that takes its shadow.
    background
        Colour behind it, which does not light it: a name, "#rrggbb", or numbers of linear radiance; or
        "transparent".
    size, spp
        Pixels (width, height) of the picture, and samples for each.

    Returns
    -------
    Scene
        What `clvol.render` takes.

    Raises
    ------
    OptionError, VolumeError, SceneError
        An option, file, array or grid that won't do.
    """
    given = dict(locals())
    staged = stage(Source.of(volume), {name: given[name] for name in OPTIONS}, size, spp)
    for line in staged.lines:
        log.info("%s", line)
    return staged.load()
