"""Lights of a scene that are no surface, as records (`clvol.scene.records`)."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

import numpy as np

from clvol.scene.materials import Bitmap

if TYPE_CHECKING:
    from clvol.scene.materials import Checkerboard, Spectrum


@dataclass(frozen=True)
class ConstantEmitter:
    """Environment of the same radiance in every direction."""

    radiance: Spectrum = (1.0,)
    name: str = field(default="", compare=False, repr=False)
    made_from: Any = field(default=None, compare=False, repr=False)  # `Daylight` of a sunsky


@dataclass(frozen=True, eq=False)
class EnvmapEmitter:
    """Lat-long environment.  `radiance`: float32 (height, width, 3), linear, scale included."""

    radiance: np.ndarray
    to_world: np.ndarray
    source: str = ""
    name: str = field(default="", compare=False, repr=False)
    made_from: Any = field(default=None, compare=False, repr=False)  # `Daylight` of a sunsky

    def __repr__(self) -> str:
        return f"<EnvmapEmitter {self.source}: {self.radiance.shape[1]} x {self.radiance.shape[0]}>"


@dataclass(frozen=True)
class DirectionalEmitter:
    """Parallel light from infinity.  `direction` (unit) is where the light travels to."""

    irradiance: Spectrum
    direction: tuple[float, float, float]
    name: str = field(default="", compare=False, repr=False)


@dataclass(frozen=True)
class PointEmitter:
    """Isotropic point light of radiant `intensity` at a world `position`."""

    intensity: Spectrum
    position: tuple[float, float, float]
    name: str = field(default="", compare=False, repr=False)


@dataclass(frozen=True, eq=False)
class SpotEmitter:
    """Point light along local +z of `to_world`.

    It has `intensity` up to `beam_width` off the axis, falling in a straight line with the angle to 0 at
    `cutoff_angle` (both in degrees).  A `texture` over the square round the cone multiplies it.
    """

    intensity: Spectrum
    to_world: np.ndarray
    cutoff_angle: float = 20.0
    beam_width: float = 15.0
    texture: Bitmap | Checkerboard | None = None
    name: str = field(default="", compare=False, repr=False)


@dataclass(frozen=True, eq=False)
class ProjectorEmitter:
    """Point light that throws a picture along local +z of `to_world`, local +x to the picture's left.

    On the plane at a distance of one (local units) across the axis, the picture is `x_fov` degrees wide, and
    brings pi · scale · `irradiance` all over.  It is as high as the texture's pixels say, else a square.
    """

    irradiance: Spectrum | Bitmap | Checkerboard
    scale: float
    to_world: np.ndarray
    x_fov: float
    name: str = field(default="", compare=False, repr=False)

    @property
    def texture(self) -> Bitmap | Checkerboard | None:
        """Its picture, where it is no single colour."""
        return None if isinstance(self.irradiance, tuple) else self.irradiance

    @property
    def half_sides(self) -> tuple[float, float]:
        """Half the width and height of the picture at a distance of one."""
        width = float(np.tan(np.radians(self.x_fov) / 2))
        rows, columns = self.irradiance.pixels.shape[:2] if isinstance(self.irradiance, Bitmap) else (1, 1)
        return width, width * rows / columns


@dataclass(frozen=True)
class SunEmitter:
    """Far disk of even radiance, in front of an environment, which a scene with a sun has.

    irradiance : normal to `sun_direction`, of the whole disk.  sun_direction : unit, towards its middle.
    aperture : degrees from edge to edge.  up : unit, where a horizon cuts the disk; else None.
    """

    irradiance: Spectrum
    sun_direction: tuple[float, float, float]
    aperture: float
    up: tuple[float, float, float] | None = None
    name: str = field(default="", compare=False, repr=False)
    made_from: Any = field(default=None, compare=False, repr=False)  # `Daylight` of a sunsky

    @property
    def solid_angle(self) -> float:
        """Of the whole disk, steradians."""
        return float(4 * np.pi * np.sin(np.radians(self.aperture / 4)) ** 2)


Emitter = (
    ConstantEmitter
    | EnvmapEmitter
    | DirectionalEmitter
    | PointEmitter
    | SpotEmitter
    | ProjectorEmitter
    | SunEmitter
)
"""Lights that are no surface; area lights are shapes with an `emission`."""
