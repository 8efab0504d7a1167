"""What the device sees: every record, path-state field, queue and kernel argument, described once.

Python dtypes and the OpenCL text are both made from the tables here; a test compares sizes and
offsets on the device.  No value of a scene belongs here, only its shape.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from clvol.planning import registry
from clvol.planning.config import KernelConfig
from clvol.scene.materials import BSDFS
from clvol.tables.blackbody import BINS, MIDDLE_KELVIN

_C_TYPES = {"f": "float", "i": "int", "u": "uint"}


def _record(*fields: tuple[str, str, int]) -> np.dtype:
    """A dtype of 4-byte scalars and small arrays, so that C and NumPy agree without padding rules."""
    return np.dtype(
        [(name, f"{kind}4", (count,)) if count > 1 else (name, f"{kind}4") for name, kind, count in fields]
    )


VOLUME = _record(
    ("world_to_index", "f", 12),  # 3x4 rows; sample (i, j, k) sits at index position (i, j, k)
    ("size", "i", 3),  # samples per axis, at least 2
    ("channels", "i", 1),
    ("bricks", "i", 3),  # top grid: bricks of 8³ cells per axis
    ("top_offset", "i", 1),  # first entry in `tops`
    ("brick_offset", "u", 1),  # first brick in `bricks`, in units of 729 floats
    ("nearest", "i", 1),  # 1: nearest sample, 0: trilinear
    ("levels", "i", 1),  # the top grid is a tree of so many levels; 0: an array
)

MEDIUM = _record(
    ("shape_from_world", "f", 12),
    ("shape_kind", "i", 1),  # SHAPE_NONE (the box alone, or boundaries bound it), SHAPE_CUBE, SHAPE_SPHERE
    ("presence", "i", 1),  # how often it is present outside every boundary
    ("homogeneous", "i", 1),
    ("thin", "i", 1),  # so thin beside the scene that rays are measured from close by
    ("clipped", "i", 1),  # 1: also bounded by box_lower..box_upper under box_from_world
    ("box_from_world", "f", 12),
    ("box_lower", "f", 3),
    ("box_upper", "f", 3),
    ("sigma_t", "f", 3),  # homogeneous: the coefficient; heterogeneous: multiplies the volume
    ("march_step", "f", 1),  # world length of a step of ray marching
    ("albedo", "f", 3),  # used where albedo_volume < 0
    ("sigma_t_volume", "i", 1),
    ("albedo_volume", "i", 1),
    ("phase_first", "i", 1),  # first entry in `phases`
    ("phase_count", "i", 1),
    ("sample_emitters", "i", 1),
    ("background", "f", 3),  # about what a ray inside will see: control of the weights' noise
    ("emits", "i", 1),
    ("emission", "f", 3),  # multiplies emission_volume and the blackbody, where there are any
    ("emission_volume", "i", 1),
    ("temperature_volume", "i", 1),
    ("temperature_scale", "f", 1),
    ("temperature_offset", "f", 1),
    ("majorant", "f", 1),  # greatest of the cells', for the whole medium; sigma_t multiplies it
    ("bound", "f", 1),  # the same, and a bound also where majorant_scale makes majorants none
    ("cells", "i", 3),  # majorant cells per axis
    ("cell_offset", "i", 1),  # first row in `majorants`, `controls` and `residuals`
    ("cell_size", "f", 1),  # edge of a majorant cell in index units
    ("kd_root", "i", 1),  # first entry in `kd_nodes`
    ("links_first", "i", 1),  # first entry in `majorant_links`
    ("links_levels", "i", 1),  # and levels of that tree
)

PHASE = _record(
    ("kind", "i", 1),  # PHASE_ISOTROPIC, PHASE_HG, PHASE_RAYLEIGH
    ("g", "f", 1),
    ("weight", "f", 1),  # share of the medium's phase function; within a medium, the smallest first
)

EMITTER = _record(
    ("kind", "i", 1),  # EMITTER_CONSTANT, …
    ("select_pdf", "f", 1),  # probability that next-event estimation picks it
    ("cdf", "f", 1),  # of picking it or one from number 1 on that comes before; of number 0: 1
    ("value", "f", 3),  # radiance, irradiance or intensity
    ("vector", "f", 3),  # direction of travel, position, or a spot's axis
    ("position", "f", 3),  # of a spot
    ("cutoff_angle", "f", 1),  # of a spot, radians
    ("beam_width", "f", 1),  # of a spot, radians
    ("shape", "i", 1),  # of an area light
    ("area", "f", 1),
    ("first", "i", 1),  # of a mesh's entries in `light_faces` and `light_cdf`
    ("primitive", "u", 1),  # first primitive of an area light
    ("count", "u", 1),  # of its primitives, which follow each other
)

SHAPE = _record(
    ("kind", "i", 1),  # SURFACE_MESH, SURFACE_SPHERE, SURFACE_DISK, SURFACE_CYLINDER
    ("flip", "i", 1),  # 1: normals point the other way
    ("front", "i", 1),  # its material seen from the side of the normal; -1: black
    ("back", "i", 1),
    ("emitter", "i", 1),  # its area light, or -1
    ("boundary", "i", 1),  # number of the boundary of media that it is, or -1
    ("normals", "i", 1),  # 1: vertices carry normals
    ("uvs", "i", 1),  # 1: vertices carry (u, v)
    ("local_from_world", "f", 12),  # of quadrics
    ("world_from_local", "f", 12),
)

QUADRIC = _record(
    ("local_from_world", "f", 12),
    ("kind", "i", 1),  # QUADRIC_SPHERE, QUADRIC_DISK, QUADRIC_CYLINDER
    ("shape", "u", 1),
)

MATERIAL = _record(
    ("kind", "i", 1),  # MATERIAL_DIFFUSE, …
    ("opacity", "f", 1),  # of a mask, else 1
    ("opacity_texture", "i", 1),  # textures: -1 where the number beside it is all
    ("reflectance", "f", 3),  # diffuse, or the base of a plastic
    ("reflectance_texture", "i", 1),
    ("specular", "f", 3),  # specular_reflectance
    ("specular_texture", "i", 1),
    ("transmittance", "f", 3),  # specular_transmittance
    ("transmittance_texture", "i", 1),
    ("ior", "f", 1),  # int_ior / ext_ior
    ("eta", "f", 3),  # of a conductor
    ("k", "f", 3),
    ("distribution", "i", 1),  # DISTRIBUTION_BECKMANN, DISTRIBUTION_GGX
    ("alpha_u", "f", 1),
    ("alpha_v", "f", 1),
    ("nonlinear", "i", 1),
    ("inner_reflectance", "f", 1),  # of a plastic's coat, for diffuse light from inside
    ("specular_weight", "f", 1),  # how often a plastic's coat is sampled, against its base
    ("table", "i", 1),  # of a rough plastic: first entry in `material_tables`
)

TEXTURE = _record(
    ("kind", "i", 1),  # TEXTURE_BITMAP, TEXTURE_CHECKERBOARD
    ("nearest", "i", 1),
    ("wrap", "i", 1),  # WRAP_REPEAT, WRAP_MIRROR, WRAP_CLAMP
    ("first", "u", 1),  # first texel in `texels`, in units of 3 floats
    ("size", "i", 2),  # width, height
    ("to_uv", "f", 6),  # two rows of a 2x3 matrix
    ("color0", "f", 3),
    ("color1", "f", 3),
)

ENVMAP = _record(
    ("env_from_world", "f", 12),
    ("world_from_env", "f", 12),
    ("size", "i", 2),  # width, height in texels
)

RENDER = _record(
    ("film_size", "i", 2),
    ("seed", "u", 2),
    ("first_sample", "u", 1),
    ("pass_samples", "u", 1),  # samples per pixel in a full pass
    ("pass_jobs", "u", 1),  # jobs in a full pass
    ("ring_passes", "u", 1),  # passes that may be in flight together
    ("last_pass", "u", 1),  # index of the pass of last_samples samples
    ("last_samples", "u", 1),
    ("max_depth", "u", 1),
    ("rr_depth", "u", 1),
    ("emitters", "u", 1),
    ("media", "u", 1),
    ("filter_radius", "f", 1),
    ("filter_bins", "i", 1),
    ("sample_border", "i", 1),
    ("camera_eye", "f", 3),
    ("camera_position", "f", 3),  # pixel (0, 0)'s corner on the plane rays start from
    ("camera_dx", "f", 3),  # one pixel to the right, on that plane
    ("camera_dy", "f", 3),
    ("camera_base", "f", 3),  # direction through pixel (0, 0)'s corner, not normalised
    ("camera_base_dx", "f", 3),
    ("camera_base_dy", "f", 3),
    ("camera_forward", "f", 3),
    ("camera_far", "f", 1),  # depth of the far plane beyond the plane rays start from
    ("lens_x", "f", 3),  # radii of a thin lens, see `clvol.tables.camera`
    ("lens_y", "f", 3),
    ("lens_start", "f", 1),
    ("lens_bend", "f", 1),
    ("triangles", "u", 1),  # primitives from this number on are quadrics
)

RECORDS = {
    "Volume": VOLUME,
    "Medium": MEDIUM,
    "Phase": PHASE,
    "Emitter": EMITTER,
    "Shape": SHAPE,
    "Quadric": QUADRIC,
    "Material": MATERIAL,
    "Texture": TEXTURE,
    "Envmap": ENVMAP,
    "Render": RENDER,
}

ENUMS = {
    "SHAPE": ("NONE", "CUBE", "SPHERE"),
    "PHASE": ("ISOTROPIC", "HG", "RAYLEIGH"),
    "EMITTER": ("CONSTANT", "ENVMAP", "DIRECTIONAL", "POINT", "SPOT", "AREA"),
    "SURFACE": ("MESH", "SPHERE", "DISK", "CYLINDER"),
    "QUADRIC": ("SPHERE", "DISK", "CYLINDER"),
    "MATERIAL": BSDFS,
    "DISTRIBUTION": ("BECKMANN", "GGX"),
    "TEXTURE": ("BITMAP", "CHECKERBOARD"),
    "WRAP": ("REPEAT", "MIRROR", "CLAMP"),
    "QUEUE": ("GENERATE", "INTERSECT", "MEDIUM", "SHADE", "SHADOW"),
    "EVENT": ("ESCAPE", "COLLISION", "SURFACE", "WALK", "SHADOW"),
    "ABSORPTION": tuple(registry.ABSORPTIONS),
    "PROBABILITY": tuple(registry.PROBABILITIES),
    "CONTROL": ("NEXT_JOB", "JOB_LIMIT", "NON_FINITE", "DONE"),  # DONE: one counter per pass in the ring
}
COUNTER_STRIDE = 16  # queue counters of a group, padded to a cache line


def enum(family: str, name: str) -> int:
    """Device constant ``FAMILY_NAME``."""
    return [n.upper() for n in ENUMS[family]].index(name.upper())


@dataclass(frozen=True)
class PathField:
    """One 4-byte field of a path slot: its C type, what it holds, and whether this scene needs it."""

    name: str
    kind: str
    meaning: str
    needed: bool = True


def _legs(prefix: str, needed: bool) -> list[PathField]:
    """Where a walk stands that goes on in the next wave; the place is a sum of two floats."""
    return [
        PathField(f"{prefix}leg", "u", "legs that the walk has behind it", needed),
        PathField(f"{prefix}walked", "f", "ray parameter that it has come to", needed),
        PathField(f"{prefix}walked_rest", "f", "what rounding took from it", needed),
    ]


def path_fields(config: KernelConfig) -> list[PathField]:
    """The fields that a slot holds for `config`, in order (4 bytes each)."""
    features = config.features
    spectrum = range(config.spectrum)
    fields = [
        PathField("origin_x", "f", "start of the ray, world space"),
        PathField("origin_y", "f", "start of the ray, world space"),
        PathField("origin_z", "f", "start of the ray, world space"),
        PathField("direction_x", "f", "unit direction of travel"),
        PathField("direction_y", "f", "unit direction of travel"),
        PathField("direction_z", "f", "unit direction of travel"),
        *(PathField(f"beta_{c}", "f", "path weight") for c in spectrum),
        *(PathField(f"radiance_{c}", "f", "radiance gathered so far") for c in spectrum),
        PathField("pixel", "u", "pixel index y * width + x"),
        PathField("sample", "u", "sample index within the pixel"),
        PathField("job", "u", "where in `results` the path ends up; NO_JOB: the slot is empty"),
        PathField("bounce", "u", "scatterings so far"),
        PathField("event", "u", "what shade has to handle: EVENT_*"),
        *(
            PathField(name, "u", f"{meaning}, of the path (if a picture shows them) or the slot", needed)
            for name, meaning, needed in (
                ("lookups", "density look-ups", features.heterogeneous),
                ("tentative", "tentative collisions", features.media > 0),
                ("real", "real collisions", features.media > 0),
                ("cells", "majorant cells crossed", features.heterogeneous),
                ("violations", "look-ups above their majorant", features.heterogeneous),
            )
        ),
        PathField(
            "sample_weight", "f", "what the pixel filter multiplies the result by", features.signed_filter
        ),
        PathField("channel", "u", "the one channel this path follows", config.one_channel_per_path),
        PathField("pdf", "f", "density of the last direction; 0 where MIS does not apply", config.mis),
        PathField("medium", "i", "medium of the collision", features.media > 1),
        *_legs("", features.heterogeneous),
        PathField(
            "interval_end",
            "f",
            "ray parameter where the walk ends",
            features.media > 0 and not features.stretches,
        ),
        PathField("hit_t", "f", "ray parameter of the surface hit, infinite if none", features.surfaces > 0),
        PathField("hit_primitive", "u", "primitive that was hit", features.surfaces > 0),
        PathField("hit_u", "f", "where on it", features.triangles),
        PathField("hit_v", "f", "where on it", features.triangles),
        PathField("stretch", "u", "surfaces passed since the last scattering", features.passable),
        PathField("after_t", "f", "ray parameter of the last surface passed", features.passable),
        PathField("after_primitive", "u", "primitive of the last surface passed", features.passable),
        *(
            PathField(f"inside_{word}", "u", "a bit for each boundary the path is inside of")
            for word in range(features.boundary_words)
        ),
        PathField(
            "eta_squared", "f", "squared index of what the path is in, for roulette", features.transmissive
        ),
        PathField("shadow_x", "f", "direction to the light", config.nee),
        PathField("shadow_y", "f", "direction to the light", config.nee),
        PathField("shadow_z", "f", "direction to the light", config.nee),
        PathField("shadow_distance", "f", "distance to the light", config.nee and features.near_lights),
        PathField("shadow_primitive", "u", "primitive of the light's point", config.nee and features.area),
        *(
            PathField(
                f"shadow_origin_{axis}", "f", "start of the shadow ray", config.nee and features.surfaces > 0
            )
            for axis in "xyz"
        ),
        *(
            PathField(f"shadow_inside_{word}", "u", "a bit for each boundary it starts inside of", config.nee)
            for word in range(features.boundary_words)
        ),
        *(
            PathField(
                f"shadow_{c}",
                "f",
                "light of next-event estimation, where it is not attenuated yet",
                config.nee,
            )
            for c in spectrum
        ),
        PathField("next", "u", "queue that waits for the path when its shadow ray is through", config.nee),
        *_legs("shadow_", config.nee and features.heterogeneous),
        PathField(
            "shadow_medium",
            "u",
            "medium it is in",
            config.nee and features.heterogeneous and features.media > 1,
        ),
        *(
            PathField(
                f"shadow_{name}", kind, meaning, config.nee and features.heterogeneous and features.passable
            )
            for name, kind, meaning in (
                ("stretch", "u", "surfaces that it has passed"),
                ("after_t", "f", "ray parameter of the last of them"),
                ("after_primitive", "u", "primitive of the last of them"),
            )
        ),
        *(PathField(name, "f", "what a picture of the first hit shows") for name in first_hit_fields(config)),
        PathField("cut", "u", "statistics of the slot: paths ended by max_depth", features.depth_limited),
        PathField("cut_energy", "f", "statistics of the slot: weight of those paths", features.depth_limited),
        PathField("largest_weight", "f", "largest weight of the path or the slot", features.media > 0),
        PathField(
            "exhausted",
            "u",
            "statistics of the slot: walks ended by a loop's bound",
            features.heterogeneous or features.passable,
        ),
    ]
    return [field for field in fields if field.needed]


SLOT_STATISTICS = {
    "tentative": np.sum,
    "real": np.sum,
    "cells": np.sum,
    "violations": np.sum,
    "cut": np.sum,
    "cut_energy": np.sum,
    "largest_weight": np.max,
    "exhausted": np.sum,
}
"""Fields that a slot keeps from path to path, unless a picture shows them, and how those of slots combine."""


def path_counts(config: KernelConfig) -> tuple[str, ...]:
    """Counts that are kept per path and summed per pixel: look-ups, and what `config.aov` shows."""
    shown = {"lookups", *config.aov} | ({"tentative", "real"} if "null" in config.aov else set())
    shown |= {"cells"} if "efficiency" in config.aov else set()
    kept = {field.name for field in path_fields(config)}
    return tuple(name for name in registry.COUNTS if name in shown and name in kept)


def counts_per_path(config: KernelConfig) -> int:
    """Numbers that a finished path writes beside its radiance: counts, and its largest weight if shown."""
    return len(path_counts(config)) + shows_weight(config)


def first_hit_fields(config: KernelConfig) -> list[str]:
    """Numbers kept per path for pictures of the first hit, in order; a position comes with its weight."""
    fields = []
    for name in config.first_hit:
        fields += [f"{name}_{c}" for c in range(registry.FIRST_HIT[name][1])]
        fields += ["met"] if name == "position" else []
    return fields


def shows_weight(config: KernelConfig) -> bool:
    """Whether the largest weight is kept per path: `config.aov` shows it."""
    return "largest_weight" in config.aov and config.features.media > 0


def slot_fields(config: KernelConfig) -> list[str]:
    """Statistics that slots keep for themselves."""
    per_path = {*path_counts(config), *(("largest_weight",) if shows_weight(config) else ())}
    return [f.name for f in path_fields(config) if f.name in SLOT_STATISTICS and f.name not in per_path]


@dataclass(frozen=True)
class Argument:
    """One kernel argument: a buffer (or scalar) that this scene needs."""

    name: str
    c_type: str
    needed: bool = True

    @property
    def is_pointer(self) -> bool:
        return self.c_type.startswith("__global")


def arguments(config: KernelConfig) -> list[Argument]:
    """Arguments of every stage kernel, in order: state and queues first, then what the scene holds."""
    features = config.features
    table = [
        Argument("render", "__global const Render *"),
        Argument("state", "__global uint *"),
        Argument("slot_stride", "uint"),
        Argument("queues", "__global uint *"),
        Argument("counts", "__global uint *"),
        Argument("control", "__global uint *"),
        Argument("results", "__global float *"),
        Argument("result_counts", "__global uint *", counts_per_path(config) > 0),
        Argument("result_firsts", "__global float *", bool(config.first_hit)),
        Argument("pixel_list", "__global const uint *", config.pixel_list),  # pixel, its samples so far
        Argument("sobol", "__global const uint *", config.sampler == "sobol"),
        Argument("media", "__global const Medium *", features.media > 0),
        Argument("boundary_masks", "__global const uint *", features.boundaries > 0),
        Argument("volumes", "__global const Volume *", features.volumes > 0),
        Argument("tops", "__global const int *", features.volumes > 0),
        Argument("bricks", "__global const float *", features.volumes > 0),
        Argument("majorants", "__global const float *", config.walks_majorants and config.majorant == "grid"),
        Argument("majorant_links", "__global const int *", config.walks_majorants and config.tree_grid),
        Argument(
            "kd_nodes", "__global const uint2 *", config.walks_majorants and config.majorant == "kdtree"
        ),
        Argument("controls", "__global const float *", config.needs_controls),
        Argument("residuals", "__global const float *", config.needs_residuals),
        Argument("blackbody", "__global const float *", features.temperature),
        Argument("phases", "__global const Phase *", features.scattering),
        Argument("emitters", "__global const Emitter *", features.emitters > 0),
        Argument("bvh_nodes", "__global const float8 *", features.surfaces > 0),
        Argument("bvh_triangles", "__global const float8 *", features.surfaces > 0),
        Argument("quadrics", "__global const Quadric *", features.quadrics),
        Argument("shapes", "__global const Shape *", features.surfaces > 0),
        Argument("faces", "__global const uint *", features.triangles),  # 3 vertices and the shape
        Argument("vertices", "__global const float *", features.triangles),
        Argument("normals", "__global const float *", features.shading_normals),
        Argument("uvs", "__global const float *", features.vertex_uvs),
        Argument("materials", "__global const Material *", features.surfaces > 0),
        Argument("textures", "__global const Texture *", features.textures),
        Argument("texels", "__global const float *", features.bitmaps),
        Argument("material_tables", "__global const float *", features.material_tables),
        Argument("light_faces", "__global const uint *", features.area_meshes),
        Argument("light_cdf", "__global const float *", features.area_meshes),
        Argument("envmap", "__global const Envmap *", features.envmap),
        Argument("env_texels", "__global const float *", features.envmap),
        Argument("env_marginal", "__global const float *", features.envmap),
        Argument("env_conditional", "__global const float *", features.envmap),
        Argument("filter_cdf", "__global const float *", features.filter_table),
    ]
    return [argument for argument in table if argument.needed]


def record_text(name: str, dtype: np.dtype) -> str:
    """C struct of a record dtype."""
    lines = []
    for field in dtype.names:
        base, shape = dtype[field].base, dtype[field].shape
        suffix = f"[{shape[0]}]" if shape else ""
        lines.append(f"    {_C_TYPES[base.kind]} {field}{suffix};")
    return "typedef struct {\n" + "\n".join(lines) + f"\n}} {name};"


def layout_text(config: KernelConfig) -> str:
    """OpenCL text of every record, enum, path-state accessor and the stage argument list."""
    parts = [record_text(name, dtype) for name, dtype in RECORDS.items()]
    for family, names in ENUMS.items():
        parts += [f"#define {family}_{name.upper()} {value}" for value, name in enumerate(names)]
    parts += [f"#define QUEUE_COUNT {len(ENUMS['QUEUE'])}", f"#define COUNTER_STRIDE {COUNTER_STRIDE}u"]
    args = arguments(config)
    parts.append("typedef struct {\n" + "\n".join(f"    {a.c_type} {a.name};" for a in args) + "\n} Scene;")
    parts.append("#define CLVOL_ARGUMENTS " + ", ".join(f"{a.c_type} {a.name}_" for a in args))
    parts.append("#define CLVOL_SCENE {" + ", ".join(f"{a.name}_" for a in args) + "}")
    for index, field in enumerate(path_fields(config)):
        at = f"scene->state[{index}u * scene->slot_stride + slot]"
        get, put = (f"as_float({at})", "as_uint(value)") if field.kind == "f" else (at, "(uint)(value)")
        if field.kind == "i":
            get = f"(int){at}"
        c_type = _C_TYPES[field.kind]
        slot = "const Scene *scene, uint slot"
        parts += [
            f"/* {field.meaning} */",
            f"INLINE {c_type} path_{field.name}({slot}) {{ return {get}; }}",
            f"INLINE void set_path_{field.name}({slot}, {c_type} value) {{ {at} = {put}; }}",
        ]
    parts += _counts_text(config)
    parts += _inside_text(config) + _first_hit_text(config)
    return "\n".join(parts) + "\n"


def _first_hit_text(config: KernelConfig) -> list[str]:
    """How what a path first meets is begun, recorded and written."""
    fields = first_hit_fields(config)
    values = {"depth_0": "depth", "met": "met"} | {
        f"{name}_{c}": f"{name}.{axis}"
        for name in ("normal", "albedo", "position")
        for c, axis in enumerate("xyz")
    }
    reset = " ".join(f"set_path_{name}(scene, slot, 0.0f);" for name in fields)
    record = " ".join(f"set_path_{name}(scene, slot, {values[name]});" for name in fields)
    write = " ".join(
        f"scene->result_firsts[place * {len(fields)}u + {n}u] = path_{name}(scene, slot);"
        for n, name in enumerate(fields)
    )
    slot, place = "const Scene *scene, uint slot", "size_t place"
    values = "float depth, float3 normal, float3 albedo, float3 position, float met"
    return [
        f"#define CLVOL_FIRST_HIT_FIELDS {len(fields)}u",
        f"INLINE void reset_first_hit({slot}) {{ {reset} }}",
        f"INLINE void record_first_hit({slot}, {values}) {{ {record} }}",
        f"INLINE void write_first_hit({slot}, {place}) {{ {write} }}",
    ]


def _inside_text(config: KernelConfig) -> list[str]:
    """How a path's bits of boundaries, and its shadow ray's, are read and written as an Inside."""
    words, slot = config.features.boundary_words, "const Scene *scene, uint slot"
    prefixes = ("inside", "shadow_inside") if config.nee else ("inside",)
    parts = [f"typedef struct {{ uint word[{max(words, 1)}]; }} Inside;"]
    for prefix in prefixes:
        read = " ".join(f"inside.word[{w}] = path_{prefix}_{w}(scene, slot);" for w in range(words))
        write = " ".join(f"set_path_{prefix}_{w}(scene, slot, inside.word[{w}]);" for w in range(words))
        parts += [
            f"INLINE Inside get_{prefix}({slot}) {{ Inside inside; {read} return inside; }}",
            f"INLINE void set_{prefix}({slot}, Inside inside) {{ {write} }}",
        ]
    return parts


def _counts_text(config: KernelConfig) -> list[str]:
    """How a path's counts are begun and written; its largest weight, if it is kept, comes last."""
    counts, weight = path_counts(config), shows_weight(config)
    reset = [f"set_path_{name}(scene, slot, 0);" for name in counts]
    write = [
        f"scene->result_counts[place * CLVOL_RESULT_COUNTS + {n}u] = path_{name}(scene, slot);"
        for n, name in enumerate(counts)
    ]
    if weight:
        reset.append("set_path_largest_weight(scene, slot, 1.0f);")
        write.append(
            f"scene->result_counts[place * CLVOL_RESULT_COUNTS + {len(counts)}u]"
            " = as_uint(path_largest_weight(scene, slot));"
        )
    return [
        f"#define CLVOL_PATH_COUNTS {len(counts)}u",
        f"#define CLVOL_RESULT_COUNTS {counts_per_path(config)}u",
        f"#define CLVOL_PEAKS {1 + weight}",
        f"#define BLACKBODY_BINS {BINS}",
        f"#define BLACKBODY_MIDDLE {MIDDLE_KELVIN}f",
        "INLINE void reset_counts(const Scene *scene, uint slot) { " + " ".join(reset) + " }",
        "INLINE void write_counts(const Scene *scene, uint slot, size_t place) { " + " ".join(write) + " }",
    ]
