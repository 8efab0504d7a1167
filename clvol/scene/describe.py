"""What a volume or a scene contains, in lines of text: the answers of `clvol info`."""

from __future__ import annotations

import re
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from clvol.base.memory import format_bytes
from clvol.errors import VolumeError
from clvol.scene import records
from clvol.scene.materials import (
    Blend,
    Bsdf,
    BumpMap,
    Dielectric,
    FrontOnly,
    Mask,
    NormalMap,
    Null,
    TwoSided,
)
from clvol.scene.tabulated import mean_cosine
from clvol.scene.vocabulary import listed
from clvol.volumes import GridInfo, read_volume
from clvol.volumes.grid import DenseGrid, Grid, SparseGrid
from clvol.volumes.listing import box_of, list_grids
from clvol.volumes.read import SPARSE, list_sparse, read_sparse

if TYPE_CHECKING:
    from collections.abc import Iterator

    from clvol.scene.materials import Texture

MOST_FILES = 20
"""Names of files that are listed."""


def describe_volume(path: str, grid: str | None = None) -> list[str]:
    """Every grid of a volume file, or the one named; VolumeError where the file cannot be read."""
    if grid is not None or Path(path).suffix.lower() not in SPARSE:
        names = [] if grid is not None else [listed.name for listed in list_grids(path)]
        if len(names) > 1:
            return [line for name in names for line in _named_lines(path, name)]
        return describe_grid(read_volume(path, grid))
    stored = list_sparse(path)
    lines = [line for number, info in enumerate(stored) for line in _stored_lines(path, number, info)]
    return lines or [f"{path}: it has no grids"]


def _named_lines(path: str, name: str) -> Iterator[str]:
    """One of several arrays of a file; what cannot be a volume says why."""
    try:
        yield from describe_grid(read_volume(path, name))
    except VolumeError as error:
        yield f"{name}: cannot be rendered, {error.what}"


def _stored_lines(path: str, number: int, stored: GridInfo) -> Iterator[str]:
    if stored.unreadable:
        yield f"{stored.name}: cannot be rendered, {stored.unreadable}"
    else:
        yield from describe_grid(read_sparse(path, number))
    precision = " in half precision" if stored.half else ""
    compression = ", ".join(stored.compression) or "no compression"
    kind = f", {stored.kind}" if stored.kind else ""
    yield f"  stored   {stored.value_type}{precision}, {compression}, {stored.transform}{kind}"
    if stored.parent:
        yield f"  shared   its tree is that of {stored.parent}"


def describe_grid(grid: Grid) -> list[str]:
    """Name, size, box, value range, sum and memory of one grid; a line each."""
    return list(_dense_lines(grid) if isinstance(grid, DenseGrid) else _sparse_lines(grid))


def _dense_lines(grid: DenseGrid) -> Iterator[str]:
    depth, height, width, channels = grid.values.shape
    plural = "s" if channels > 1 else ""
    yield f"{grid.name or 'grid'}: dense, {width} x {height} x {depth} samples, {channels} channel{plural}"
    yield f"  box      {_box(grid.box)}"
    yield from _value_lines(Statistics.of(grid.values))
    yield f"  memory   {format_bytes(grid.values.nbytes)}"


def _sparse_lines(grid: SparseGrid) -> Iterator[str]:
    stored = (grid.leaf_origins, grid.leaf_values, grid.leaf_active, grid.tile_origins, grid.tile_values)
    background = f", background {_spectrum(tuple(grid.background))}"
    if grid.active_voxels == 0:
        yield f"{grid.name}: sparse, no active voxels{background}: there is nothing to render"
    else:
        lower, upper = grid.active_box
        size = upper - lower + 1
        share = grid.active_voxels / int(size.astype(np.int64).prod())
        channels = f", {grid.channels} channels" if grid.channels > 1 else ""
        yield f"{grid.name}: sparse, {size[0]} x {size[1]} x {size[2]} samples in the active box{channels}"
        yield f"  box      {_box(grid.active_box)} (index)"
        yield f"           {_box(box_of(grid.active_box, grid.index_to_world))} (world)"
        yield (
            f"  active   {grid.active_voxels:,} voxels, {100 * share:.3g} % of the box; "
            f"{len(grid.leaf_origins):,} leaves, {int(grid.tile_active.sum()):,} active tiles"
        )
        yield from _value_lines(active_statistics(grid), background)
    yield f"  memory   {format_bytes(sum(array.nbytes for array in stored))}"


@dataclass(frozen=True)
class Statistics:
    """Range (nan, nan of none) and sum of the finite samples; how many there are in all, NaN and infinite."""

    low: float
    high: float
    total: float
    count: int
    nan: int
    infinite: int

    @classmethod
    def of(cls, values: np.ndarray, each: np.ndarray | None = None) -> Statistics:
        """Of values that stand for one sample each, or for so many."""
        count, nan, infinite = (
            int(np.count_nonzero(chosen) if each is None else each[chosen].sum())
            for chosen in (np.ones(values.shape, bool), np.isnan(values), np.isinf(values))
        )
        if nan or infinite:
            finite = np.isfinite(values)
            values, each = values[finite], None if each is None else each[finite]
        if not values.size:
            return cls(np.nan, np.nan, 0.0, count, nan, infinite)
        total = np.sum(values if each is None else values * each, dtype=np.float64)
        return cls(float(values.min()), float(values.max()), float(total), count, nan, infinite)

    def __add__(self, other: Statistics) -> Statistics:
        low, high = np.fmin(self.low, other.low), np.fmax(self.high, other.high)
        counts = (
            getattr(self, name) + getattr(other, name) for name in ("total", "count", "nan", "infinite")
        )
        return Statistics(float(low), float(high), *counts)


def _value_lines(found: Statistics, more: str = "") -> Iterator[str]:
    extent = "none finite" if np.isnan(found.low) else f"{_number(found.low)} to {_number(found.high)}"
    broken = [f"{n:,} {what}" for n, what in ((found.nan, "NaN"), (found.infinite, "infinite")) if n]
    counted = f"; {' and '.join(broken)} of {found.count:,}" if broken else ""
    yield f"  values   {extent}{more}{counted}"
    yield f"  sum      {_number(found.total)}{' of the others' if broken else ''}"


def active_statistics(grid: SparseGrid) -> Statistics:
    """Of the active samples, of all channels; a tile counts with all of its own.

    The mask's bit order is OpenVDB's, x slowest, while the values lie z slowest.
    """
    bits = np.unpackbits(grid.leaf_active, axis=1, bitorder="little").astype(bool)
    active = bits.reshape(-1, 8, 8, 8).transpose(0, 3, 2, 1)
    tiles = grid.tile_values[grid.tile_active]
    each = np.broadcast_to(grid.tile_sizes[grid.tile_active, None].astype(np.int64) ** 3, tiles.shape)
    return Statistics.of(grid.leaf_values[active]) + Statistics.of(tiles, each)


def describe_scene(scene: records.Scene) -> list[str]:
    """Camera, film, integrator, media and lights of a scene; a line or two each."""
    return list(_scene_lines(scene))


def _scene_lines(scene: records.Scene) -> Iterator[str]:
    film, integrator = scene.film, scene.integrator
    for camera in scene.sensor.parts if isinstance(scene.sensor, records.Batch) else (scene.sensor,):
        yield f"camera   {_camera(camera)}"
    crop = f", of them {film.crop[2]} x {film.crop[3]} from {_point(film.crop[:2])}" if film.crop else ""
    rfilter = _filter(film.rfilter)
    yield f"film     {film.width} x {film.height} pixels{crop}, {rfilter} filter, {scene.spp} spp"
    depth = "unlimited" if integrator.max_depth < 0 else str(integrator.max_depth)
    choices = "".join(f", {key} {value}" for key, value in integrator.choices.items())
    if integrator.shows_depth:
        yield "paths    none: the picture is the distance to the first surface"
    else:
        yield f"paths    max_depth {depth}, rr_depth {integrator.rr_depth}{choices}"
    for shape in scene.shapes:
        yield f"shape    {_shape(shape)}"
    for emitter in scene.emitters:
        yield f"light    {_emitter(emitter)}"
    if scene.files:
        yield f"files    {listed(scene.files, MOST_FILES)}"


def _camera(sensor: records.Camera) -> str:
    position = _point(sensor.to_world[:3, 3])
    inside = f", in {_medium(sensor.medium)}" if sensor.medium else ""
    if isinstance(sensor, records.IrradianceMeter):
        name = f" {sensor.shape.name!r}" if sensor.shape.name else ""
        return f"irradiance of the {sensor.shape.kind}{name}{inside}"
    if isinstance(sensor, records.Orthographic):
        width = _number(2 * float(np.linalg.norm(sensor.to_world[:3, 0])))
        return f"orthographic at {position}, {width} wide{inside}"
    if isinstance(sensor, records.Meter):
        return _meter(sensor) + inside
    fov = _number(sensor.fov)
    if not sensor.aperture_radius:
        return f"perspective at {position}, field of view {fov} degrees{inside}"
    radius, distance = _number(sensor.aperture_radius), _number(sensor.focus_distance)
    lens = f"aperture radius {radius}, in focus at {distance}"
    return f"thin lens at {position}, field of view {fov} degrees, {lens}{inside}"


def _meter(sensor: records.Meter) -> str:
    along = f"along {_point(sensor.to_world[:3, 2])}"
    if not sensor.distant:
        return f"radiance at {_point(sensor.to_world[:3, 3])} {along}"
    if isinstance(sensor.target, records.Shape):
        return f"radiance {along} from far away, on the mean over a {sensor.target.kind}"
    at = "the scene" if sensor.target is None else _point(sensor.target)
    return f"radiance {along} from far away, towards {at}"


def _filter(rfilter: records.ReconstructionFilter) -> str:
    if rfilter.kind == "mitchell":
        return f"mitchell (B {_number(rfilter.b)}, C {_number(rfilter.c)})"
    return rfilter.kind


def _shape(shape: records.Shape) -> str:
    """What a shape is, is made of, emits and bounds; an invisible surface is not mentioned."""
    parts = [f"{shape.kind} {shape.name!r}" if shape.name else shape.kind]
    if shape.mesh:
        parts[0] += f" of {len(shape.mesh.faces):,} triangles ({shape.mesh.source})"
    if shape.flip_normals:
        parts.append("normals flipped")
    if not isinstance(shape.bsdf, Null):
        parts.append(_bsdf(shape.bsdf))
    if shape.emission:
        parts.append(f"radiance {_radiance(shape.emission)}")
    if shape.exterior:
        parts.append(f"exterior: {_medium(shape.exterior)}")
    if shape.interior:
        parts.append(f"interior: {_medium(shape.interior)}")
    return ", ".join(parts if len(parts) > 1 else [*parts, "empty"])


def _bsdf(bsdf: Bsdf) -> str:
    """A BSDF's name, and what is inside a wrapper."""
    name = re.sub("(?<=[a-z])(?=[A-Z])", " ", type(bsdf).__name__).lower()
    match bsdf:
        case Dielectric(thin=True):
            return "thin dielectric"
        case FrontOnly():
            return f"{_bsdf(bsdf.front)} from outside"
        case TwoSided():
            back = "" if bsdf.back is bsdf.front else f" and {_bsdf(bsdf.back)}"
            return f"two sided ({_bsdf(bsdf.front)}{back})"
        case Mask():
            return f"mask ({_bsdf(bsdf.nested)})"
        case NormalMap() | BumpMap():
            return f"{name} ({_bsdf(bsdf.nested)})"
        case Blend():
            share = f"{_spectrum(bsdf.weight)} of it " if isinstance(bsdf.weight, tuple) else "by a texture "
            return f"blend ({_bsdf(bsdf.first)}, and {share}{_bsdf(bsdf.second)})"
    return name


def _medium(medium: records.Medium) -> str:
    return (
        f"{'homogeneous' if medium.homogeneous else 'heterogeneous'} medium: "
        f"sigma_t {_made(medium, 'sigma_t')} times {_spectrum(medium.scale)}, "
        f"albedo {_made(medium, 'albedo')}, phase {_phase(medium.phase)}{_emission(medium)}{_glow(medium)}"
    )


def _phase(phase: records.PhaseFunction) -> str:
    if isinstance(phase, records.BlendPhase):
        by = phase.weight
        share = f"by {_volume(by)}" if isinstance(by, records.GridVolume) else f"{_number(by)} of it"
        return f"blend ({_phase(phase.first)}, and {share} {_phase(phase.second)})"
    if phase.table is not None:
        mean = _number(round(mean_cosine(phase.table), 4))
        return f"{phase.kind} ({len(phase.table.values)} values, mean cosine {mean})"
    if isinstance(phase.flakes, records.GridVolume):
        return f"{phase.kind} (S {_volume(phase.flakes)})"
    if phase.flakes is not None:
        return f"{phase.kind} (S {_point(phase.flakes)})"
    return phase.kind + (f" (g {_number(phase.g)})" if phase.kind == "hg" else "")


def _emission(medium: records.Medium) -> str:
    factors = [f"emission {_made(medium, 'emission')}"] if medium.emission else []
    if medium.temperature:
        offset, scale = _number(medium.temperature_offset), _number(medium.temperature_scale)
        factors.append(f"a blackbody of ({_volume(medium.temperature)} - {offset}) times {scale} kelvin")
    if not factors:
        return ""
    return f", emits {' times '.join(factors)} times {_spectrum(medium.emission_scale)}"


def _glow(medium: records.Medium) -> str:
    if medium.emission_density is None:
        return ""
    scale = _spectrum(medium.emission_density_scale)
    return f", emits {_volume(medium.emission_density)} times {scale} per length whatever its extinction"


def _made(medium: records.Medium, role: str) -> str:
    """A coefficient, and what it is made of the values of."""
    transfer, volume = medium.transfer(role), _volume(getattr(medium, role))
    return volume if transfer is None else f"by {len(transfer.values)} points from the values of {volume}"


def _volume(volume: records.Volume) -> str:
    if isinstance(volume, records.ConstVolume):
        return _spectrum(volume.value)
    grid = volume.grid
    if isinstance(grid, DenseGrid):
        size = "x".join(str(count) for count in grid.values.shape[2::-1])
    else:
        size = "x".join(str(count) for count in grid.active_box[1] - grid.active_box[0] + 1)
    return f"{volume.source or grid.name or 'grid'} ({size})"


def _emitter(emitter: records.Emitter) -> str:
    match emitter:
        case records.ConstantEmitter():
            return f"constant, radiance {_spectrum(emitter.radiance)}"
        case records.EnvmapEmitter():
            height, width = emitter.radiance.shape[:2]
            return f"envmap {emitter.source} ({width} x {height})"
        case records.DirectionalEmitter():
            return (
                f"directional, irradiance {_spectrum(emitter.irradiance)}, along {_point(emitter.direction)}"
            )
        case records.PointEmitter():
            return f"point, intensity {_spectrum(emitter.intensity)}, at {_point(emitter.position)}"
        case records.SpotEmitter():
            position, axis = emitter.to_world[:3, 3], emitter.to_world[:3, 2]
            return (
                f"spot, intensity {_spectrum(emitter.intensity)}, at {_point(position)}, along "
                f"{_point(axis / np.linalg.norm(axis))}, to {_number(emitter.cutoff_angle)} degrees"
            )
        case records.ProjectorEmitter():
            position, axis = emitter.to_world[:3, 3], emitter.to_world[:3, 2]
            return (
                f"projector, irradiance {_radiance(emitter.irradiance)} times {_number(emitter.scale)}, at "
                f"{_point(position)}, along {_point(axis / np.linalg.norm(axis))}, "
                f"{_number(emitter.x_fov)} degrees wide"
            )
        case records.SunEmitter():
            return (
                f"sun, irradiance {_spectrum(emitter.irradiance)}, towards "
                f"{_point(emitter.sun_direction)}, {_number(emitter.aperture)} degrees wide"
            )


def _radiance(emission: Texture) -> str:
    return _spectrum(emission) if isinstance(emission, tuple) else "by a texture"


def _box(box: np.ndarray) -> str:
    return f"{_point(box[0])} to {_point(box[1])}"


def _point(values: np.ndarray | tuple[float, ...]) -> str:
    return f"({', '.join(_number(value) for value in values)})"


def _spectrum(values: tuple[float, ...]) -> str:
    return _number(values[0]) if len(values) == 1 else _point(values)


def _number(value: float) -> str:
    return f"{float(value):.7g}"
