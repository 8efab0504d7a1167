"""Textures as device records and texels, each once."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from clvol import layout
from clvol.base.rows import bands
from clvol.errors import SceneError
from clvol.scene.materials import Bitmap, Checkerboard, MeshAttribute, Texture, Varied, VolumeTexture
from clvol.tables.colours import LUMINANCE, luminance, rgb
from clvol.tables.volumes import first_sample
from clvol.volumes.grid import DenseGrid, Grid

if TYPE_CHECKING:
    from collections.abc import Iterable, Mapping

    from clvol.scene.records import ProjectorEmitter, SpotEmitter


def mean_color(texture: Texture) -> float:
    """Mean of a texture over its unit square and its channels; a bitmap's by luminance, as in Mitsuba.

    That of a volume is about the mean of all of it: surfaces may show any part.
    """
    if isinstance(texture, VolumeTexture):
        return float(np.mean(_grid_mean(texture.volume.grid)))
    if isinstance(texture, Bitmap):
        return float(luminance(texture.pixels.mean((0, 1), dtype=np.float64)))
    if isinstance(texture, Checkerboard):
        return 0.5 * float(np.mean(texture.color0) + np.mean(texture.color1))
    return float(np.mean(texture))


def mean_radiance(texture: Texture) -> np.ndarray:
    """Mean colour of a texture over its unit square, float64 (3,)."""
    mean: np.ndarray
    if isinstance(texture, Bitmap):
        mean = texture.pixels.mean((0, 1), dtype=np.float64)
    elif isinstance(texture, Checkerboard):
        mean = np.mean([rgb(texture.color0), rgb(texture.color1)], axis=0)
    elif isinstance(texture, VolumeTexture):
        mean = np.broadcast_to(_grid_mean(texture.volume.grid), 3)
    else:
        mean = rgb(texture)
    return mean


def _grid_mean(grid: Grid) -> np.ndarray:
    """Mean of the samples, float64 (1,) or (3,); of a sparse grid, of all values that it stores."""
    mean: np.ndarray
    if isinstance(grid, DenseGrid):
        mean = grid.values.mean((0, 1, 2), dtype=np.float64)
    else:
        stored = (grid.leaf_values, grid.tile_values, grid.background)
        rows = [values.reshape(-1, grid.channels) for values in stored if values.size]
        mean = np.mean([one.mean(0, dtype=np.float64) for one in rows], axis=0)
    return mean


def lamp_textures(emissions: Iterable[Texture | None]) -> list[Varied]:
    """The textures of area lights, each once, in the order in which they come before all others."""
    return list(dict.fromkeys(e for e in emissions if isinstance(e, Varied)))


def slide(spot: SpotEmitter) -> Bitmap | Checkerboard | None:
    """A spot's texture over the plane one before it, in the frame that the device has round its axis."""
    if spot.texture is None:
        return None
    to_square = np.eye(3)
    to_square[:2, :2] = 0.5 / np.tan(np.radians(spot.cutoff_angle)) * _local_from_plane(spot.to_world)
    to_square[:2, 2] = 0.5
    return replace(spot.texture, to_uv=spot.texture.to_uv @ to_square)


def projector_frame(projector: ProjectorEmitter) -> tuple[float, float, float]:
    """(a, b, r) that take places (x, y) of the plane one before a projector to those of its picture.

    u = ½ + a x + b y and v = ½ + r (a y - b x), in the frame that the device has round its axis.
    """
    width, height = projector.half_sides
    turn = _local_from_plane(projector.to_world)
    a, b = -0.5 / width * turn[0]
    return float(a), float(b), width / height * float(np.sign(np.linalg.det(turn)))


def _local_from_plane(to_world: np.ndarray) -> np.ndarray:
    """Places of the plane one before a light in the device's frame to those in its own, float64 (2, 2)."""
    axes = to_world[:3, :3] / np.linalg.norm(to_world[:3, 2])
    x, y, _ = device_frame(axes[:, 2])
    local: np.ndarray = axes[:, :2].T @ np.stack([x, y], axis=1)
    return local


def device_frame(n: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Orthonormal frame round the unit vector n (Duff et al. 2017), as `to_frame` in cl/core/sampling.h."""
    n = n.astype(np.float32).astype(np.float64)
    s = np.copysign(1.0, n[2])
    a = -1.0 / (s + n[2])
    b = n[0] * n[1] * a
    u = np.array([s * n[0] * n[0] * a + 1.0, s * b, -s * n[0]])
    return u, np.array([b, n[1] * n[1] * a + s, -n[1]]), n


class TextureTable:
    """Collects TEXTURE `records` and their `texels`, float32 (count, 3) each.

    volumes : numbers of grid volumes, by their id().
    """

    def __init__(self, volumes: Mapping[int, int] | None = None) -> None:
        self._volumes = volumes or {}
        self.records: list[np.ndarray] = []
        self.texels: list[np.ndarray] = []
        self._numbers: dict[tuple[Texture, bool], int] = {}
        self._first: dict[tuple[int, bool], int] = {}
        self._used = 0

    def add(self, texture: Texture, as_number: bool = False) -> int:
        """Number of `texture`, or of a colour everywhere.

        `as_number`: of what Mitsuba makes of each colour, the luminance in a bitmap and the mean elsewhere.
        """
        key = (texture, as_number)
        if key not in self._numbers:
            self._numbers[key] = len(self.records)
            varied = Checkerboard(texture, texture) if isinstance(texture, tuple) else texture
            self.records.append(self._record(varied, as_number))
        return self._numbers[key]

    def _record(self, texture: Varied, as_number: bool) -> np.ndarray:
        if isinstance(texture, MeshAttribute):
            what = f"the mesh_attribute '{texture.name}' stands where no mesh gives it a value"
            raise SceneError(what, hint="attributes are for the BSDFs of shapes")
        record = np.zeros((), layout.TEXTURE)
        if isinstance(texture, VolumeTexture):
            return self._of_volume(record, texture, as_number)
        record["to_uv"] = texture.to_uv[:2].reshape(-1)
        if isinstance(texture, Checkerboard):
            record["kind"] = layout.enum("TEXTURE", "CHECKERBOARD")
            for name in ("color0", "color1"):
                color = np.asarray(getattr(texture, name))
                record[name] = np.mean(color) if as_number else np.broadcast_to(color, 3)
            return record
        height, width = texture.pixels.shape[:2]
        record["kind"] = layout.enum("TEXTURE", "BITMAP")
        record["nearest"] = texture.filter_type == "nearest"
        record["wrap"] = layout.enum("WRAP", texture.wrap_mode)
        record["size"] = width, height
        record["first"] = self._add_texels(texture.pixels, as_number)
        return record

    def _of_volume(self, record: np.ndarray, texture: VolumeTexture, as_number: bool) -> np.ndarray:
        """Of one that looks up a volume; a sparse grid has its background beyond its box."""
        volume = texture.volume
        record["kind"], record["first"] = layout.enum("TEXTURE", "VOLUME"), self._volumes[id(volume)]
        record["wrap"] = layout.enum("WRAP", volume.wrap_mode)
        if isinstance(volume.grid, DenseGrid):
            record["to_uv"] = (*first_sample(volume), *volume.grid.values.shape[2::-1])
        if as_number and volume.grid.channels == 3:
            record["color0"] = LUMINANCE
        return record

    def _add_texels(self, pixels: np.ndarray, as_number: bool) -> int:
        """First texel of a picture; the same array under several textures is stored once."""
        key = (id(pixels), as_number)
        if key not in self._first:
            self._first[key] = self._used
            texels = np.ascontiguousarray(pixels, np.float32).reshape(-1, 3)
            if as_number:
                grey = np.empty_like(texels)
                for rows in bands(len(texels), 1):
                    grey[rows] = luminance(texels[rows])[:, None]
                texels = grey
            self.texels.append(texels)
            self._used += len(texels)
        return self._first[key]
