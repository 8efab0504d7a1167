"""What a scene uses, found from its records."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, assert_never

from clvol.base.rows import bands
from clvol.planning.features import Features
from clvol.scene import records
from clvol.scene.boundaries import Boundaries, camera_may_be_inside, is_clipped, may_overlap
from clvol.scene.material_facts import (
    bsdf_kinds,
    bsdf_textures,
    color_is_grey,
    has_bitmaps,
    has_bumps,
    has_metal_textures,
    has_rough_textures,
    has_tables,
    has_textures,
    is_textured,
    is_transmissive,
    needs_uvs,
    passes_light,
    reflects,
    samples_lights,
    texture_volumes,
)
from clvol.scene.material_facts import is_grey as bsdf_is_grey
from clvol.scene.materials import Bitmap
from clvol.scene.medium_facts import (
    bounding_kind,
    channels_of,
    classifies,
    is_dark_emitter,
    is_grey,
    is_grey_of,
    is_homogeneous,
    medium_volumes,
    scatters,
)
from clvol.scene.phase import lobe_kind, phase_lobes
from clvol.scene.primitives import QUADRICS, mesh_of
from clvol.scene.sides import bsdf_parts
from clvol.scene.thinness import thin_media

if TYPE_CHECKING:
    from clvol.scene.materials import Bsdf


def find_features(scene: records.Scene, found: Boundaries) -> Features:
    """Inspect a scene; a pure function of its records and of what bounds its media."""
    surfaces = [scene.shapes[n] for n in found.surfaces]
    lamps = [s for s in surfaces if s.emission is not None]
    media = [entry.medium for entry in found.entries]
    shown = [v for s in surfaces for v in texture_volumes(s.bsdf, s.emission)]
    return Features(
        **_place_features(scene, found),
        **_medium_features(media),
        **_volume_features([v for m in media for v in medium_volumes(m)] + shown),
        volume_textures=bool(shown),
        **_surface_features(surfaces),
        **_texture_features(scene, surfaces),
        **_light_features(scene, media, surfaces, lamps),
        passable=any(passes_light(s.bsdf) for s in surfaces)
        or (bool(lamps) and scene.integrator.hide_emitters),
        filter_table=scene.film.rfilter.kind != "box",
        signed_filter=scene.film.rfilter.signed,
        lens=_has_lens(scene.camera),
        parallel_rays=isinstance(scene.camera, records.Orthographic | records.Meter),
        meter=records.measured_shape(scene.camera) is not None,
        depth_limited=scene.integrator.max_depth >= 0,
        shows_depth=scene.integrator.shows_depth,
        hide_emitters=scene.integrator.hide_emitters,
        hide_environment=scene.integrator.hide_emitters or scene.film.backdrop is not None,
        backdrop=any(scene.film.backdrop or ()),
        alpha=scene.film.has_alpha,
    )


def _has_lens(sensor: records.Camera) -> bool:
    """Whether rays start from somewhere on a disk."""
    if isinstance(sensor, records.Meter):
        over_disk = sensor.target is None or (
            isinstance(sensor.target, records.Shape) and sensor.target.kind == "disk"
        )
        return sensor.distant and over_disk
    return isinstance(sensor, records.Perspective) and sensor.aperture_radius > 0


def _place_features(scene: records.Scene, found: Boundaries) -> dict[str, Any]:
    """Where media are, and what bounds them."""
    bounds = {bounding_kind(entry.shape) for entry in found.entries if entry.shape is not None}
    return {
        "clipped": any(is_clipped(e.medium) for e in found.entries) or _clips_homogeneous(found),
        "thin": any(thin_media(scene, found)),
        "media_overlap": may_overlap(scene, found),
        "cubes": "cube" in bounds,
        "spheres": "sphere" in bounds,
        "boundaries": len(found.boundaries),
        "camera_inside": camera_may_be_inside(scene, found),
    }


def _medium_features(media: list[records.Medium]) -> dict[str, Any]:
    """What media are made of, and do to light."""
    varied = [m for m in media if not is_homogeneous(m)]
    emissive = [m for m in media if m.emits]
    glowing = [m for m in media if m.glows]
    lobes = [phase_lobes(m.phase) for m in media]
    phases = {
        lobe_kind(m.phase, lobe) for m, mixture in zip(media, lobes, strict=True) for lobe, _ in mixture
    }
    phases |= {"sggx"} if "mixed_sggx" in phases else set()
    return {
        "media": len(media),
        "homogeneous": any(is_homogeneous(m) for m in media),
        "heterogeneous": bool(varied),
        "chromatic_extinction": any(not is_grey_of(m, "sigma_t") or len(set(m.scale)) > 1 for m in media),
        "coloured_extinction": any(
            isinstance(m.sigma_t, records.GridVolume) and channels_of(m.sigma_t) > 1 for m in media
        ),
        "chromatic_albedo": any(not is_grey_of(m, "albedo") for m in media),
        "chromatic_emission": any(
            m.temperature is not None
            or (m.emission is not None and not is_grey_of(m, "emission"))
            or len(set(m.emission_scale)) > 1
            for m in emissive
        )
        or any(
            (m.emission_density is not None and not is_grey(m.emission_density))
            or len(set(m.emission_density_scale)) > 1
            for m in glowing
        ),
        "albedo_volumes": any(isinstance(m.albedo, records.GridVolume) for m in media),
        "emission": bool(emissive),
        "emission_volumes": any(isinstance(m.emission, records.GridVolume) for m in emissive),
        "glow": bool(glowing),
        "glow_volumes": any(isinstance(m.emission_density, records.GridVolume) for m in glowing),
        "temperature": any(isinstance(m.temperature, records.GridVolume) for m in emissive),
        "transfers": any(m.transfers is not None for m in media),
        "interpolated_transfers": any(map(classifies, media)),
        "only_dark_emitters": bool(varied) and all(map(is_dark_emitter, varied)),
        "phases": tuple(sorted(kind.upper() for kind in phases)),
        "blend": any(len(mixture) > 1 for mixture in lobes),
        "varied_phases": any(m.phase_weight is not None for m in media),
        "varied_flakes": any(m.flakes is not None for m in media),
        "varied_areas": any(m.flakes is not None and isinstance(m.phase, records.Phase) for m in media),
        "scattering": any(map(scatters, media)),
    }


def _volume_features(volumes: list[records.GridVolume]) -> dict[str, Any]:
    """How fields are looked up."""
    return {
        "volumes": len(volumes),
        "trilinear": any(v.filter_type == "trilinear" for v in volumes),
        "nearest": any(v.filter_type == "nearest" for v in volumes),
        "coloured_volumes": any(channels_of(v) > 1 for v in volumes),
    }


def _surface_features(surfaces: list[records.Shape]) -> dict[str, Any]:
    """What rays meet beside media."""
    meshes = [mesh_of(s) for s in surfaces if s.kind not in QUADRICS]
    bsdfs = [s.bsdf for s in surfaces]
    textures = any(has_textures(s.bsdf) or needs_uvs(s.emission) for s in surfaces)
    return {
        "surfaces": len(surfaces),
        "triangles": bool(meshes),
        "quadrics": any(s.kind in QUADRICS for s in surfaces),
        "shading_normals": any(m.normals is not None for m in meshes),
        "vertex_uvs": any(m.uvs is not None for m in meshes) and (textures or any(map(_turns, bsdfs))),
        "bsdfs": tuple(sorted(set().union(*(bsdf_kinds(b) for b in bsdfs)))),
        "chromatic_surfaces": not all(map(bsdf_is_grey, bsdfs)),
        "material_tables": any(map(has_tables, bsdfs)),
        "rough_textures": any(map(has_rough_textures, bsdfs)),
        "metal_textures": any(map(has_metal_textures, bsdfs)),
        "bumps": any(map(has_bumps, bsdfs)),
        "reflecting": any(map(reflects, bsdfs)),
        "samples_at_surfaces": any(map(samples_lights, bsdfs)),
        "transmissive": any(map(is_transmissive, bsdfs)),
    }


def _texture_features(scene: records.Scene, surfaces: list[records.Shape]) -> dict[str, Any]:
    """What surfaces and lights have textures."""
    slides = [e.texture for e in scene.emitters if isinstance(e, records.SpotEmitter) and e.texture]
    thrown = [e.texture for e in scene.emitters if isinstance(e, records.ProjectorEmitter) and e.texture]
    pictures = [*slides, *thrown, *(s.emission for s in surfaces if is_textured(s.emission))]
    bsdfs = [s.bsdf for s in surfaces]
    return {
        "textures": bool(pictures) or any(map(bsdf_textures, bsdfs)),
        "bitmaps": any(map(has_bitmaps, bsdfs)) or any(isinstance(p, Bitmap) for p in pictures),
        "area_textures": any(is_textured(s.emission) for s in surfaces),
        "spot_textures": bool(slides),
    }


def _light_features(
    scene: records.Scene,
    media: list[records.Medium],
    surfaces: list[records.Shape],
    lamps: list[records.Shape],
) -> dict[str, Any]:
    """Where light comes from; `lamps`: the surfaces that shine."""
    kinds = {*map(_emitter_kind, scene.emitters), *map(_lamp_kind, lamps)}
    grey = all(map(_emitter_is_grey, scene.emitters)) and all(
        color_is_grey(s.emission) for s in lamps if s.emission
    )
    sampled = any(m.sample_emitters for m in media) or bool(surfaces)
    return {
        "emitters": len(scene.emitters) + len(lamps),
        "chromatic_light": not grey or len(set(scene.film.backdrop or ())) > 1,
        **dict.fromkeys(kinds, True),
        "samples_lights": bool(scene.emitters or lamps) and sampled,
    }


def _turns(bsdf: Bsdf) -> bool:
    """Whether the direction of its tangents matters."""
    return any(
        side.bend is not None
        or getattr(side.bsdf, "alpha_u", 0) != getattr(side.bsdf, "alpha_v", 0)
        or getattr(side.bsdf, "anisotropic", (0.0,)) != (0.0,)
        for side in bsdf_parts(bsdf)
    )


def _clips_homogeneous(found: Boundaries) -> bool:
    """Boundaries hold a homogeneous medium, which their world box bounds as well: no path strays for ever."""
    held = {b.interior for b in found.boundaries}
    return any(
        e.shape is None and not e.everywhere and e.medium.homogeneous and n in held
        for n, e in enumerate(found.entries)
    )


def _emitter_kind(emitter: records.Emitter) -> str:
    """The feature that stands for a light of this kind."""
    match emitter:
        case records.ConstantEmitter():
            return "constant"
        case records.EnvmapEmitter():
            return "envmap"
        case records.DirectionalEmitter():
            return "directional"
        case records.PointEmitter():
            return "point_lights"
        case records.SpotEmitter():
            return "spot"
        case records.ProjectorEmitter():
            return "projector"
        case records.SunEmitter():
            return "sun"
    assert_never(emitter)


def _lamp_kind(lamp: records.Shape) -> str:
    """The feature that stands for a shape of this kind that shines."""
    return f"area_{lamp.kind}s" if lamp.kind in QUADRICS else "area_meshes"


def _emitter_is_grey(emitter: records.Emitter) -> bool:
    match emitter:
        case records.EnvmapEmitter(radiance=r):
            return all(bool((r[rows] == r[rows, :, :1]).all()) for rows in bands(*r.shape[:2]))
        case records.ConstantEmitter(radiance=value) | records.DirectionalEmitter(irradiance=value):
            return len(set(value)) == 1
        case records.SunEmitter(irradiance=value):
            return len(set(value)) == 1
        case records.PointEmitter(intensity=value):
            return len(set(value)) == 1
        case records.SpotEmitter(intensity=value, texture=slide):
            return len(set(value)) == 1 and (slide is None or color_is_grey(slide))
        case records.ProjectorEmitter(irradiance=picture):
            return color_is_grey(picture)
    assert_never(emitter)
