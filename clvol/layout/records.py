"""Records that host and device share: NumPy's dtypes, from which OpenCL's text is made, and their enums."""

from __future__ import annotations

from typing import Any

import numpy as np

from clvol.layout.bsdfs import BSDFS
from clvol.layout.principled import PRINCIPLED


def _record(*fields: tuple[str, str, int]) -> np.dtype[Any]:
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
    (
        "camera_rate",
        "f",
        1,
    ),  # tentative collisions of camera paths, in what majorants ask for (background "expected")
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
    ("transfer", "i", 1),  # first of its three entries in `transfers`; -1: no value is classified
)

GLOW = _record(
    ("emission_density", "f", 3),  # multiplies the volume, where there is one
    ("volume", "i", 1),
)

TRANSFER = _record(
    ("first", "u", 1),  # first entry in `transfer_points`
    ("count", "u", 1),  # of its points, at least 2; 0: what it is for is not made of values
)

PHASE = _record(
    ("kind", "i", 1),  # PHASE_ISOTROPIC, PHASE_HG, …
    ("g", "f", 1),  # of a tabphase or sggx: the bits of an int, its table's distance in records
    ("weight", "f", 1),  # share of the medium's phase function; within a medium, the smallest first
)

EMITTER = _record(
    ("kind", "i", 1),  # EMITTER_CONSTANT, …
    ("select_pdf", "f", 1),  # probability that next-event estimation picks it
    ("cdf", "f", 1),  # of picking it or one from number 1 on that comes before; of number 0: 1
    ("value", "f", 3),  # radiance, irradiance or intensity
    ("vector", "f", 3),  # direction of travel, axis of a spot or projector, an area light's mean normal
    ("position", "f", 3),  # of a point of light, or an area light's middle; up where a horizon cuts a sun
    ("cutoff_angle", "f", 1),  # of a spot, radians; of a projector: `projector_frame` in clvol/tables;
    # of an area light: 1 where it outshines what may be seen beside it (clvol/tables/lamp_edges.py), else 0
    ("beam_width", "f", 1),  # as that; of an area light with a texture: 1 + its number
    ("shape", "i", 1),  # of an area light
    ("area", "f", 1),  # or the solid angle of a sun, or of a projector: `projector_frame`
    ("first", "i", 1),  # of a mesh's entries in `light_faces` and `light_cdf`; else 1 + its texture
    ("primitive", "u", 1),  # first primitive of an area light; of a picture's mean the bits of the float
    ("count", "u", 1),  # of its primitives, which follow each other
)

METER_FACE = _record(
    ("kind", "u", 1),  # METER_TRIANGLE, or METER_SPHERE and so on of the one face that is the shape
    ("count", "u", 1),  # of all faces
    ("cdf", "f", 1),  # share of the area that this face and those before it have
    ("side", "f", 1),  # of a sphere or cylinder: 1, or -1 where it measures inwards
    ("place", "f", 3),  # a corner, or the middle of a sphere or disk, or of a cylinder's lower end
    ("x", "f", 3),  # two edges, or the axes of the shape's space
    ("y", "f", 3),
    ("z", "f", 3),  # the third, or the unit normal of a triangle or disk
)

LIGHT_CACHE = _record(
    ("lower", "f", 3),  # corners of the grid
    ("upper", "f", 3),
    ("cells_per_length", "f", 1),
    ("size", "i", 3),  # cells per axis
    ("typical", "f", 1),  # radiance that half of the singly scattered light does not exceed
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
    ("eta", "f", 3),  # of a conductor; as k: -1 - the number of a texture
    ("k", "f", 3),
    ("distribution", "i", 1),  # DISTRIBUTION_BECKMANN, DISTRIBUTION_GGX
    ("alpha_u", "f", 1),
    ("alpha_v", "f", 1),
    ("nonlinear", "i", 1),
    ("inner_reflectance", "f", 1),  # of a plastic's coat, for diffuse light from inside
    ("specular_weight", "f", 1),  # how often a plastic's coat is sampled, against its base
    ("table", "i", 1),  # of what has more: first entry in `material_tables`
)

TEXTURE = _record(
    ("kind", "i", 1),  # TEXTURE_BITMAP, TEXTURE_CHECKERBOARD
    ("nearest", "i", 1),
    ("wrap", "i", 1),  # WRAP_REPEAT, WRAP_MIRROR, WRAP_CLAMP
    ("first", "u", 1),  # first texel in `texels`, in units of 3 floats; of a volume: its number
    ("size", "i", 2),  # width, height
    ("to_uv", "f", 6),  # two rows of a 2x3 matrix; of a volume: where its first sample is, and how many
    ("color0", "f", 3),  # of a volume: what makes its channels one number; 0 where they stay
    ("color1", "f", 3),
)

ENVMAP = _record(
    ("env_from_world", "f", 12),
    ("world_from_env", "f", 12),
    ("size", "i", 2),  # width, height in texels
)

RENDER = _record(
    ("film_size", "i", 2),
    ("first_pixel", "u", 1),  # of those on the device, in a film that is rendered in bands
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
    ("backdrop", "f", 3),  # what is seen instead of the environment
    ("lens_x", "f", 3),  # radii of a thin lens, see `clvol.tables.camera`
    ("lens_y", "f", 3),
    ("lens_start", "f", 1),
    ("lens_bend", "f", 1),
    ("triangles", "u", 1),  # primitives from this number on are quadrics
)

RECORDS = {
    "Volume": VOLUME,
    "Medium": MEDIUM,
    "Glow": GLOW,
    "Transfer": TRANSFER,
    "Phase": PHASE,
    "Emitter": EMITTER,
    "MeterFace": METER_FACE,
    "LightCache": LIGHT_CACHE,
    "Shape": SHAPE,
    "Quadric": QUADRIC,
    "Material": MATERIAL,
    "Texture": TEXTURE,
    "Envmap": ENVMAP,
    "Render": RENDER,
}

RARE_RECORDS = {"Glow": "CLVOL_HAS_GLOW", "MeterFace": "CLVOL_HAS_METER"}
"""Records that few scenes have, and the macro that says so: what others compile does not hold them."""

RARE_KINDS = {
    "TEXTURE_VOLUME": "CLVOL_HAS_VOLUME_TEXTURES",
    "PHASE_SGGX": "CLVOL_PHASE_SGGX",
    "PHASE_MIXED_SGGX": "CLVOL_PHASE_MIXED_SGGX",
}
"""The same of numbered kinds."""

ENUMS = {
    "SHAPE": ("NONE", "CUBE", "SPHERE"),
    "PHASE": ("ISOTROPIC", "HG", "RAYLEIGH", "TABPHASE", "SGGX", "MIXED_SGGX"),
    "TRANSFER": ("SIGMA_T", "ALBEDO", "EMISSION"),  # in the order of a medium's entries
    "EMITTER": ("CONSTANT", "ENVMAP", "DIRECTIONAL", "POINT", "SPOT", "AREA", "SUN", "PROJECTOR"),
    "METER": ("TRIANGLE", "SPHERE", "DISK", "CYLINDER"),
    "SURFACE": ("MESH", "SPHERE", "DISK", "CYLINDER"),
    "QUADRIC": ("SPHERE", "DISK", "CYLINDER"),
    "MATERIAL": BSDFS,
    "DISTRIBUTION": ("BECKMANN", "GGX"),
    "PRINCIPLED": PRINCIPLED,
    "TEXTURE": ("BITMAP", "CHECKERBOARD", "VOLUME"),
    "WRAP": ("REPEAT", "MIRROR", "CLAMP"),
    "ABSORPTION": ("SAMPLE", "WEIGHT", "MIXED"),
    "ROULETTE": ("DEPTH", "WEIGHT"),
    "PROBABILITY": ("HISTORY", "AVERAGE", "MAX"),
    "COUNTER": ("NEXT_JOB", "JOB_LIMIT", "NON_FINITE", "DONE"),  # DONE: one counter per pass in the ring
}


def enum(family: str, name: str) -> int:
    """Device constant ``FAMILY_NAME``."""
    return [n.upper() for n in ENUMS[family]].index(name.upper())
