"""What a scene uses, as far as it decides which code, buffers and stages are needed."""

from __future__ import annotations

from dataclasses import asdict, dataclass

import numpy as np

from clvol.base.rows import bands
from clvol.scene import records
from clvol.scene.boundaries import (
    Boundaries,
    camera_may_be_inside,
    find_boundaries,
    is_clipped,
    may_overlap,
)
from clvol.scene.material_facts import (
    bsdf_kinds,
    bsdf_sides,
    bsdf_textures,
    has_bitmaps,
    has_tables,
    is_grey,
    is_transmissive,
    passes_light,
    reflects,
    samples_lights,
)
from clvol.scene.materials import Bsdf
from clvol.scene.phase import phase_lobes
from clvol.scene.primitives import canonical_mesh
from clvol.scene.thinness import thin_media
from clvol.volumes.grid import DenseGrid

QUADRICS = ("sphere", "disk", "cylinder")
FLAT = ("cube", "rectangle")
"""Kinds of shape that are met as quadrics, and as triangles; a "mesh" has its own."""


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
    thin: bool = False
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
    dark_emission: bool = False
    trilinear: bool = False
    nearest: bool = False
    coloured_volumes: bool = False
    cubes: bool = False
    spheres: bool = False
    phases: tuple[str, ...] = ()
    blend: bool = False
    scattering: bool = False
    emitters: int = 0
    constant: bool = False
    envmap: bool = False
    directional: bool = False
    point_lights: bool = False
    spot: bool = False
    area_meshes: bool = False
    area_spheres: bool = False
    area_disks: bool = False
    area_cylinders: bool = False
    samples_lights: bool = False
    surfaces: int = 0
    triangles: bool = False
    quadrics: bool = False
    shading_normals: bool = False
    vertex_uvs: bool = False
    bsdfs: tuple[str, ...] = ()
    chromatic_surfaces: bool = False
    textures: bool = False
    bitmaps: bool = False
    material_tables: bool = False
    reflecting: bool = False
    samples_at_surfaces: bool = False
    passable: bool = False
    transmissive: bool = False
    boundaries: int = 0
    camera_inside: bool = False
    filter_table: bool = False
    signed_filter: bool = False
    lens: bool = False
    depth_limited: bool = False
    hide_emitters: bool = False

    @classmethod
    def from_scene(cls, scene: records.Scene) -> Features:
        """Inspect a scene; the result is a pure function of the records."""
        found = find_boundaries(scene)
        media = [entry.medium for entry in found.entries]
        volumes = [v for m in media for v in medium_volumes(m)]
        emitters = scene.emitters
        homogeneous = [is_homogeneous(m) for m in media]
        kinds = {type(e) for e in emitters}
        surfaces = [scene.shapes[n] for n in found.surfaces]
        lamps = [s for s in surfaces if s.emission is not None]
        grey_light = all(_emitter_is_grey(e) for e in emitters) and all(
            len(set(s.emission)) == 1 for s in lamps
        )
        bounds = {bounding_kind(entry.shape) for entry in found.entries if entry.shape is not None}
        emissive = [m for m in media if m.emits]
        lobes = [phase_lobes(m.phase) for m in media]
        phases = {lobe.kind for mixture in lobes for lobe, _ in mixture}
        return cls(
            media=len(media),
            volumes=len(volumes),
            homogeneous=any(homogeneous),
            heterogeneous=not all(homogeneous),
            clipped=any(is_clipped(m) for m in media) or _clips_homogeneous(found),
            thin=any(thin_media(scene, found)),
            media_overlap=may_overlap(scene, found),
            chromatic_extinction=any(not _is_grey(m.sigma_t) or len(set(m.scale)) > 1 for m in media),
            coloured_extinction=any(
                isinstance(m.sigma_t, records.GridVolume) and channels_of(m.sigma_t) > 1 for m in media
            ),
            chromatic_albedo=any(not _is_grey(m.albedo) for m in media),
            chromatic_light=not grey_light,
            chromatic_emission=any(
                m.temperature is not None or not _is_grey(m.emission) or len(set(m.emission_scale)) > 1
                for m in emissive
            ),
            albedo_volumes=any(isinstance(m.albedo, records.GridVolume) for m in media),
            emission=bool(emissive),
            emission_volumes=any(isinstance(m.emission, records.GridVolume) for m in emissive),
            temperature=any(isinstance(m.temperature, records.GridVolume) for m in emissive),
            dark_emission=not all(homogeneous)
            and all(_glows_in_the_dark(m) for m in media if not is_homogeneous(m)),
            trilinear=any(v.filter_type == "trilinear" for v in volumes),
            nearest=any(v.filter_type == "nearest" for v in volumes),
            coloured_volumes=any(channels_of(v) > 1 for v in volumes),
            cubes="cube" in bounds,
            spheres="sphere" in bounds,
            phases=tuple(sorted(kind.upper() for kind in phases)),
            blend=any(len(mixture) > 1 for mixture in lobes),
            scattering=any(_scatters(m) for m in media),
            **_surface_features(scene, found, surfaces, lamps),
            emitters=len(emitters) + len(lamps),
            constant=records.ConstantEmitter in kinds,
            envmap=records.EnvmapEmitter in kinds,
            directional=records.DirectionalEmitter in kinds,
            point_lights=records.PointEmitter in kinds,
            spot=records.SpotEmitter in kinds,
            samples_lights=bool(emitters or lamps)
            and (any(m.sample_emitters for m in media) or bool(surfaces)),
            filter_table=scene.film.rfilter.kind != "box",
            signed_filter=scene.film.rfilter.signed,
            lens=scene.sensor.aperture_radius > 0,
            depth_limited=scene.integrator.max_depth >= 0,
            hide_emitters=scene.integrator.hide_emitters,
        )

    @property
    def area(self) -> bool:
        """Surfaces that are lights."""
        return self.area_meshes or self.area_spheres or self.area_disks or self.area_cylinders

    @property
    def near_lights(self) -> bool:
        """Lights at a finite distance."""
        return self.point_lights or self.spot or self.area

    @property
    def stretches(self) -> bool:
        """A ray is walked stretch by stretch, from surface to surface or through several media."""
        return self.media > 1 or (self.media > 0 and self.surfaces > 0)

    @property
    def boundary_words(self) -> int:
        """32-bit words that hold a path's bits of the boundaries it is inside of."""
        return -(-self.boundaries // 32)

    def found(self) -> str:
        """One line that names what is there, for the log."""
        return ", ".join(
            name if value is True else f"{name} {value}" for name, value in asdict(self).items() if value
        )


def _surface_features(
    scene: records.Scene, found: Boundaries, surfaces: list[records.Shape], lamps: list[records.Shape]
) -> dict[str, object]:
    """What rays meet beside media."""
    meshes = [
        canonical_mesh(s.kind) if s.kind in FLAT else s.mesh for s in surfaces if s.kind not in QUADRICS
    ]
    bsdfs = [s.bsdf for s in surfaces]
    textures = any(bsdf_textures(b) for b in bsdfs)
    return {
        "surfaces": len(surfaces),
        "triangles": bool(meshes),
        "quadrics": any(s.kind in QUADRICS for s in surfaces),
        "shading_normals": any(m.normals is not None for m in meshes),
        "vertex_uvs": any(m.uvs is not None for m in meshes) and (textures or any(map(_turns, bsdfs))),
        "bsdfs": tuple(sorted(set().union(*(bsdf_kinds(b) for b in bsdfs)))),
        "chromatic_surfaces": not all(map(is_grey, bsdfs)),
        "textures": textures,
        "bitmaps": any(map(has_bitmaps, bsdfs)),
        "material_tables": any(map(has_tables, bsdfs)),
        "reflecting": any(map(reflects, bsdfs)),
        "samples_at_surfaces": any(map(samples_lights, bsdfs)),
        "passable": any(map(passes_light, bsdfs)) or (bool(lamps) and scene.integrator.hide_emitters),
        "transmissive": any(map(is_transmissive, bsdfs)),
        "boundaries": len(found.boundaries),
        "camera_inside": camera_may_be_inside(scene, found),
        "area_meshes": any(s.kind not in QUADRICS for s in lamps),
        "area_spheres": any(s.kind == "sphere" for s in lamps),
        "area_disks": any(s.kind == "disk" for s in lamps),
        "area_cylinders": any(s.kind == "cylinder" for s in lamps),
    }


def _turns(bsdf: Bsdf) -> bool:
    """Whether the direction of its tangents matters."""
    sides = [side.bsdf for side in bsdf_sides(bsdf) if side is not None]
    return any(getattr(b, "alpha_u", 0) != getattr(b, "alpha_v", 0) for b in sides)


def _clips_homogeneous(found: Boundaries) -> bool:
    """Boundaries hold a homogeneous medium, which their world box bounds as well: no path strays for ever."""
    held = {b.interior for b in found.boundaries}
    return any(
        e.shape is None and not e.everywhere and e.medium.homogeneous and n in held
        for n, e in enumerate(found.entries)
    )


def medium_volumes(medium: records.Medium) -> list[records.GridVolume]:
    """Grid volumes of a medium: sigma_t, albedo and, where it emits, emission and temperature."""
    emission = (medium.emission, medium.temperature) if medium.emits else ()
    return [v for v in (medium.sigma_t, medium.albedo, *emission) if isinstance(v, records.GridVolume)]


def is_homogeneous(medium: records.Medium) -> bool:
    """Whether sigma_t is the same everywhere inside (the albedo may still vary)."""
    return isinstance(medium.sigma_t, records.ConstVolume)


def bounding_kind(shape: records.Shape) -> str:
    """What bounds the medium in a shape's interval: "cube", "sphere", or "none" where the volume's box, which
    clips the medium anyway, lies within the shape."""
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


def _glows_in_the_dark(medium: records.Medium) -> bool:
    """Emits, and absorbs at least as much as it scatters, everywhere."""
    dark = isinstance(medium.albedo, records.ConstVolume) and max(medium.albedo.value) <= 0.5
    return medium.emits and dark


def _emitter_is_grey(emitter: records.Emitter) -> bool:
    if isinstance(emitter, records.EnvmapEmitter):
        r = emitter.radiance
        return all(bool((r[rows] == r[rows, :, :1]).all()) for rows in bands(*r.shape[:2]))
    value = {
        records.ConstantEmitter: "radiance",
        records.DirectionalEmitter: "irradiance",
        records.PointEmitter: "intensity",
        records.SpotEmitter: "intensity",
    }[type(emitter)]
    return len(set(getattr(emitter, value))) == 1
