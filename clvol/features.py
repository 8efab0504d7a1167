"""What a scene uses, as far as it decides which code, buffers and stages are needed."""

from __future__ import annotations

from dataclasses import asdict, dataclass

import numpy as np

from clvol.scene import records
from clvol.scene.phase import phase_lobes
from clvol.volumes.grid import DenseGrid


def _is_grey(volume: records.Volume) -> bool:
    if isinstance(volume, records.ConstVolume):
        return len(set(volume.value)) == 1
    return channels_of(volume) == 1


def channels_of(volume: records.GridVolume) -> int:
    """Channels of a grid volume: 1 or 3."""
    return volume.grid.values.shape[-1] if isinstance(volume.grid, DenseGrid) else 1


@dataclass(frozen=True)
class Features:
    """What a scene contains, as far as it decides which code, buffers and stages are needed."""

    media: int = 0
    volumes: int = 0
    homogeneous: bool = False
    heterogeneous: bool = False
    clipped: bool = False
    media_overlap: bool = False
    chromatic_extinction: bool = False
    coloured_extinction: bool = False
    chromatic_albedo: bool = False
    chromatic_light: bool = False
    chromatic_emission: bool = False
    albedo_volumes: bool = False
    emission: bool = False
    emission_volumes: bool = False
    temperature: bool = False
    trilinear: bool = False
    nearest: bool = False
    coloured_volumes: bool = False
    cubes: bool = False
    spheres: bool = False
    isotropic: bool = False
    hg: bool = False
    rayleigh: bool = False
    blend: bool = False
    scattering: bool = False
    emitters: int = 0
    constant: bool = False
    envmap: bool = False
    directional: bool = False
    point_lights: bool = False
    samples_lights: bool = False
    filter_table: bool = False
    depth_limited: bool = False
    hide_emitters: bool = False

    @classmethod
    def from_scene(cls, scene: records.Scene) -> Features:
        """Inspect a scene; the result is a pure function of the records."""
        media = scene_media(scene)
        volumes = [v for m in media for v in medium_volumes(m)]
        emitters = scene.emitters
        homogeneous = [is_homogeneous(m) for m in media]
        kinds = {type(e) for e in emitters}
        grey_light = all(_emitter_is_grey(e) for e in emitters)
        shapes = [s for s in scene.shapes if s.interior is not None]
        bounds = {bounding_kind(s) for s in shapes}
        emissive = [m for m in media if m.emits]
        lobes = [phase_lobes(m.phase) for m in media]
        phases = {lobe.kind for mixture in lobes for lobe, _ in mixture}
        return cls(
            media=len(media),
            volumes=len(volumes),
            homogeneous=any(homogeneous),
            heterogeneous=not all(homogeneous),
            clipped=any(is_clipped(m) for m in media),
            media_overlap=_may_overlap(shapes),
            chromatic_extinction=any(not _is_grey(m.sigma_t) or len(set(m.scale)) > 1 for m in media),
            coloured_extinction=any(
                isinstance(m.sigma_t, records.GridVolume) and channels_of(m.sigma_t) > 1 for m in media
            ),
            chromatic_albedo=any(not _is_grey(m.albedo) for m in media),
            chromatic_light=not grey_light,
            chromatic_emission=any(m.temperature is not None or not _is_grey(m.emission) for m in emissive),
            albedo_volumes=any(isinstance(m.albedo, records.GridVolume) for m in media),
            emission=bool(emissive),
            emission_volumes=any(isinstance(m.emission, records.GridVolume) for m in emissive),
            temperature=any(isinstance(m.temperature, records.GridVolume) for m in emissive),
            trilinear=any(v.filter_type == "trilinear" for v in volumes),
            nearest=any(v.filter_type == "nearest" for v in volumes),
            coloured_volumes=any(channels_of(v) > 1 for v in volumes),
            cubes="cube" in bounds,
            spheres="sphere" in bounds,
            isotropic="isotropic" in phases,
            hg="hg" in phases,
            rayleigh="rayleigh" in phases,
            blend=any(len(mixture) > 1 for mixture in lobes),
            scattering=any(_scatters(m) for m in media),
            emitters=len(emitters),
            constant=records.ConstantEmitter in kinds,
            envmap=records.EnvmapEmitter in kinds,
            directional=records.DirectionalEmitter in kinds,
            point_lights=records.PointEmitter in kinds,
            samples_lights=bool(emitters) and any(m.sample_emitters for m in media),
            filter_table=scene.film.rfilter.kind != "box",
            depth_limited=scene.integrator.max_depth >= 0,
            hide_emitters=scene.integrator.hide_emitters,
        )

    def found(self) -> str:
        """One line that names what is there, for the log."""
        return ", ".join(
            name if value is True else f"{name} {value}" for name, value in asdict(self).items() if value
        )


def scene_media(scene: records.Scene) -> list[records.Medium]:
    """Media of the scene, one per bounding shape, in the order of the shapes."""
    return [shape.interior for shape in scene.shapes if shape.interior is not None]


def medium_volumes(medium: records.Medium) -> list[records.GridVolume]:
    """Grid volumes of a medium: sigma_t, albedo and, where it emits, emission and temperature."""
    emission = (medium.emission, medium.temperature) if medium.emits else ()
    return [v for v in (medium.sigma_t, medium.albedo, *emission) if isinstance(v, records.GridVolume)]


def is_homogeneous(medium: records.Medium) -> bool:
    """Whether sigma_t is the same everywhere inside (the albedo may still vary)."""
    return isinstance(medium.sigma_t, records.ConstVolume)


def is_clipped(medium: records.Medium) -> bool:
    """Whether the box of the sigma_t volume bounds the medium beside its shape."""
    if medium.homogeneous:
        return False
    return not isinstance(medium.sigma_t, records.GridVolume) or medium.sigma_t.clipped


def bounding_kind(shape: records.Shape) -> str:
    """What bounds the shape's medium: "cube", "sphere", or "none" where the volume's box, which clips the
    medium anyway, lies within the shape."""
    medium = shape.interior
    if not is_clipped(medium):
        return shape.kind
    volume = medium.sigma_t
    if isinstance(volume, records.GridVolume):
        lower, upper, box_to_world = volume.lower, volume.upper, volume.index_to_world
    else:
        lower, upper, box_to_world = np.zeros(3), np.ones(3), volume.to_world
    corners = np.array([(*np.where(bits, upper, lower), 1.0) for bits in np.ndindex(2, 2, 2)]).T
    local = (np.linalg.inv(shape.to_world) @ box_to_world @ corners)[:3]
    reach = np.linalg.norm(local, axis=0) if shape.kind == "sphere" else np.abs(local)
    return "none" if reach.max() <= 1 + 1e-6 else shape.kind


def _scatters(medium: records.Medium) -> bool:
    albedo = medium.albedo.value if isinstance(medium.albedo, records.ConstVolume) else (1.0,)
    return bool((np.array(albedo) * np.array(medium.scale) > 0).any())


def _emitter_is_grey(emitter: records.Emitter) -> bool:
    if isinstance(emitter, records.EnvmapEmitter):
        r = emitter.radiance
        return bool((r[..., 0] == r[..., 1]).all() and (r[..., 0] == r[..., 2]).all())
    value = {
        records.ConstantEmitter: "radiance",
        records.DirectionalEmitter: "irradiance",
        records.PointEmitter: "intensity",
    }[type(emitter)]
    return len(set(getattr(emitter, value))) == 1


def shape_bounds(shape: records.Shape) -> tuple[np.ndarray, np.ndarray]:
    """Axis-aligned world bounds (lower, upper) of a cube or sphere, float64 (3,)."""
    linear, centre = shape.to_world[:3, :3], shape.to_world[:3, 3]
    if shape.kind == "sphere":
        extent = np.sqrt((linear**2).sum(axis=1))
    else:
        extent = np.abs(linear).sum(axis=1)
    return centre - extent, centre + extent


def _may_overlap(shapes: list[records.Shape]) -> bool:
    """Conservative: whether the world boxes of any two medium bounds intersect."""
    if len(shapes) < 2:
        return False
    lower, upper = (np.array(b) for b in zip(*(shape_bounds(s) for s in shapes), strict=True))
    meet = ((lower[:, None] < upper[None]) & (upper[:, None] > lower[None])).all(axis=2)
    return bool(np.triu(meet, 1).any())
