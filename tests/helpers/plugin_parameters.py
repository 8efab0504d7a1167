"""What each parameter of each plugin does: the table that `test_reader_sweep` holds the reader to.

`PARAMETERS`: plugin -> (what it needs, parameter -> another value, which must show in the records).  `Silent`
values are accepted and change no expected image.  The files named here are written by the test.
"""

import numpy as np

from clvol.scene import rotate, translate
from clvol.scene.integrator import OTHERS, WRAPPERS
from clvol.scene.sensor import OTHER_SAMPLERS

RGB = {"type": "rgb", "value": [0.1, 0.2, 0.3]}
TEXELS = np.linspace(0, 1, 12, dtype=np.float32).reshape(2, 2, 3)
SKY = np.linspace(0, 1, 36, dtype=np.float32).reshape(3, 4, 3)
CORNERS = np.array([(0, 0, 0), (1, 0, 0), (0, 1, 0), (0, 0, 1)], float)
FACES = np.array([(0, 2, 1), (0, 1, 3), (0, 3, 2), (1, 2, 3)])
CELLS = np.linspace(0, 1, 8).reshape(2, 2, 2)
TEXTURE = {"type": "bitmap", "bitmap": TEXELS}
VOLUME = {"type": "gridvolume", "data": CELLS}
OTHER_TEXTURE = {"type": "bitmap", "bitmap": TEXELS[::-1]}
BENDS = {"flip_invalid_normals": False, "use_shadowing_function": False}
MOVED, TURNED = translate([1, 2, 3]), rotate([1, 2, 3], 40)


class Silent:
    """A value that is accepted and changes no expected image."""

    def __init__(self, value):
        self.value = value


# -- the table: plugin -> (what it needs, parameter -> another value) --------------------------------

CHOICES = {
    "technique": "delta",
    "transmittance": "ratio",
    "majorant": "grid",
    "lookup": "exact",
    "absorption": "weight",
    "gathering": "collision",
    "roulette": "depth",
    "background": "sampled",
    "probability": "max",
    "control": "min",
    "sampler": "sobol",
    "shadow_cache": "off",
    "light_choice": "power",
    "next_event": "plain",
    "lamp_edges": "sampled",
    "lanes": "8",
}
LIMITS = {
    "max_depth": 5,
    "rr_depth": 9,
    "hide_emitters": True,
    "samples_per_pass": Silent(4),
    "block_size": Silent(16),
    "timeout": Silent(9.0),
}
SHUTTER = {"shutter_open": Silent(-1.0), "shutter_close": Silent(2.0)}
CAMERA = {
    "to_world": MOVED,
    "fov": 30.0,
    "fov_axis": "y",
    "near_clip": 0.5,
    "far_clip": 50.0,
    "film": {"type": "hdrfilm", "width": 5},
    "sampler": {"type": "independent", "seed": 7},
    "medium": {"type": "homogeneous"},
    **SHUTTER,
}
PIXEL = {"type": "hdrfilm", "width": 1, "height": 1}
METER = {
    "film": PIXEL | {"pixel_format": "rgba"},
    "sampler": {"type": "independent", "seed": 7},
    "medium": {"type": "homogeneous"},
    **SHUTTER,
}
LIGHT = {"sampling_weight": Silent(2.0), "medium": Silent({"type": "homogeneous"})}
SHAPE = {
    "to_world": MOVED,
    "flip_normals": True,
    "bsdf": {"type": "null"},
    "emitter": {"type": "area"},
    "interior": {"type": "homogeneous"},
    "exterior": {"type": "homogeneous"},
    "silhouette_sampling_weight": Silent(2.0),
    "vertex_a": Silent(TEXTURE),  # for mesh_attribute textures
}
_NO_STRANDS = ("interior", "exterior", "flip_normals")
STRANDS = {name: value for name, value in SHAPE.items() if name not in _NO_STRANDS}
STRANDS["filename"] = "b.txt"
MESH = SHAPE | {"face_normals": True}
DIELECTRIC = {
    "int_ior": 1.7,
    "ext_ior": "water",
    "specular_reflectance": TEXTURE,
    "specular_transmittance": RGB,
}
ROUGH = {"distribution": "ggx", "alpha": 0.3, "sample_visible": Silent(False)}
PRINCIPLED = {
    "base_color": RGB,
    "roughness": TEXTURE,
    "diffuse_reflectance_sampling_rate": 0.5,
    **dict.fromkeys(("anisotropic", "spec_tint", "sheen", "sheen_tint", "flatness"), 0.3),
}
METAL = {"material": "Au", "specular_reflectance": TEXTURE}
COAT = {
    "diffuse_reflectance": TEXTURE,
    "int_ior": 1.7,
    "ext_ior": "water",
    "nonlinear": True,
    "specular_reflectance": RGB,
}
MEDIUM = {
    "sigma_t": RGB,
    "albedo": VOLUME,
    "scale": RGB,
    "phase": {"type": "hg"},
    "sample_emitters": False,
    "has_spectral_extinction": Silent(True),
    "emission": 2.0,
    "emission_scale": RGB,
    "temperature": VOLUME,
    "temperature_scale": 2.0,
    "temperature_offset": -1.0,
    "emission_density": VOLUME,
    "emission_density_scale": RGB,
}
SAMPLER = {"sample_count": 9, "seed": 9}
TECHNICAL = {name: LIMITS[name] for name in ("samples_per_pass", "block_size", "timeout")}
INNER = (
    {"inner": {"type": "path"}},
    {"inner": {"type": "volpath", "max_depth": 2}, "hide_emitters": Silent(True), **TECHNICAL},
)


def silent(types):
    """What is ignored, with a value of its type."""
    return {name: Silent({bool: True, int: 3, float: 0.5, str: "a"}[kind]) for name, kind in types.items()}


def limits(other):
    """What integrators have that ours serve."""
    fixed = ("max_depth", "rr_depth") if other.fixed else ()
    return {name: value for name, value in LIMITS.items() if name not in fixed} | silent(other.ignored)


UV = np.diag([2.0, 3.0, 1.0])

PARAMETERS = {
    "volpath": ({}, LIMITS | CHOICES),
    "volpathmis": ({}, LIMITS | CHOICES | {"use_spectral_mis": Silent(False)}),
    "path": ({}, LIMITS),
    "depth": ({}, {"hide_emitters": Silent(True), **TECHNICAL}),
    "moment": INNER,
    "aov": (INNER[0], INNER[1] | {"aovs": Silent("d:depth")}),
    **{name: (INNER[0], INNER[1] | silent(types)) for name, types in WRAPPERS.items()},
    **{name: ({}, limits(other)) for name, other in OTHERS.items()},
    "perspective": (
        {"fov": 40.0},
        CAMERA
        | {"principal_point_offset_x": 0.1, "principal_point_offset_y": 0.1, "focus_distance": Silent(2.0)},
    ),
    "thinlens": (
        {"fov": 40.0, "aperture_radius": 0.1},
        CAMERA | {"aperture_radius": 0.2, "focus_distance": 2.0},
    ),
    "orthographic": (
        {},
        {name: CAMERA[name] for name in ("near_clip", "far_clip", "film", "sampler", "medium")}
        | {"to_world": np.diag([2.0, 1.0, 1.0, 1.0]), "focus_distance": Silent(2.0), **SHUTTER},
    ),
    "radiancemeter": (
        {"film": PIXEL, "origin": [0, 0, 0], "direction": [0, 0, 1]},
        {"origin": [1, 2, 3], "direction": [1, 2, 3], **METER},
    ),
    "distant": (
        {"film": PIXEL, "direction": [0, 0, 1]},
        {name: METER[name] for name in ("film", "sampler", *SHUTTER)}
        | {"direction": [1, 2, 3], "target": [1, 2, 3]},
    ),
    "batch": (
        {"inner": {"type": "perspective", "fov": 40.0}},
        {
            "inner": {"type": "perspective", "fov": 50.0},
            "film": {"type": "hdrfilm", "width": 5},
            "sampler": {"type": "independent", "seed": 7},
            **SHUTTER,
        },
    ),
    "irradiancemeter": ({"film": PIXEL}, METER),
    "hdrfilm": (
        {"width": 8, "height": 9},
        {
            "width": 6,
            "height": 7,
            "crop_width": 4,
            "crop_height": 4,
            "sample_border": True,
            "rfilter": {"type": "box"},
            "pixel_format": "rgba",
            "backdrop": RGB,
            "component_format": Silent("float32"),
            "file_format": Silent("openexr"),
            "banner": Silent(False),
            "compensate": Silent(True),
        },
    ),
    "box": ({}, {}),
    "tent": ({}, {"radius": 2.0}),
    "gaussian": ({}, {"stddev": 0.7}),
    "mitchell": ({}, {"B": 0.2, "C": 0.2}),
    "catmullrom": ({}, {}),
    "lanczos": ({}, {"lobes": 2}),
    "independent": ({}, SAMPLER),
    **{name: ({}, SAMPLER | silent(types)) for name, types in OTHER_SAMPLERS.items()},
    "cube": ({}, SHAPE | {"face_normals": Silent(True)}),
    "sphere": ({}, SHAPE | {"center": [1, 2, 3], "radius": 2.0}),
    "rectangle": ({}, SHAPE | {"face_normals": Silent(True)}),
    "disk": ({}, SHAPE),
    "cylinder": ({}, SHAPE | {"p0": [1, 2, 3], "p1": [1, 2, 3], "radius": 2.0}),
    "shapegroup": (
        {"inner": {"type": "cube"}},
        {"inner": {"type": "sphere"}, "to_world": Silent(MOVED), "silhouette_sampling_weight": Silent(2.0)},
    ),
    "instance": (
        {"group": {"type": "shapegroup", "inner": {"type": "cube"}}},
        {
            "group": {"type": "shapegroup", "inner": {"type": "sphere"}},
            "to_world": MOVED,
            "silhouette_sampling_weight": Silent(2.0),
        },
    ),
    "merge": ({"inner": {"type": "cube"}}, {"inner": {"type": "sphere"}}),
    "obj": ({"filename": "a.obj"}, MESH | {"filename": "b.obj", "flip_tex_coords": False}),
    "ply": (
        {"filename": "a.ply"},
        MESH | {"filename": "b.ply", "flip_tex_coords": Silent(True)},
    ),  # without uvs
    "serialized": ({"filename": "a.serialized"}, MESH | {"filename": "b.serialized", "shape_index": 1}),
    "stl": ({"filename": "a.stl"}, MESH | {"filename": "b.stl", "face_normals": Silent(True)}),
    "glb": ({"filename": "a.glb"}, MESH | {"filename": "b.glb", "flip_tex_coords": Silent(False)}),
    "gltf": ({"filename": "a.gltf"}, MESH | {"filename": "b.gltf", "flip_tex_coords": Silent(False)}),
    "mesh": (
        {"vertex_positions": CORNERS, "faces": FACES},
        MESH
        | {"vertex_positions": 2 * CORNERS, "faces": FACES[:2]}
        | {"vertex_normals": CORNERS + 1, "vertex_texcoords": CORNERS[:, :2]},
    ),
    **{name: ({"filename": "a.txt"}, STRANDS) for name in ("bsplinecurve", "linearcurve")},
    "null": ({}, {}),
    "diffuse": ({}, {"reflectance": TEXTURE}),
    "dielectric": ({}, DIELECTRIC),
    "thindielectric": ({}, DIELECTRIC),
    "roughdielectric": ({}, DIELECTRIC | ROUGH),
    "conductor": ({}, METAL),
    "roughconductor": ({}, METAL | ROUGH),
    "plastic": ({}, COAT),
    "roughplastic": ({}, COAT | ROUGH),
    "principled": (
        {},
        PRINCIPLED
        | dict.fromkeys(("metallic", "spec_trans", "clearcoat", "clearcoat_gloss"), 0.3)
        | {"eta": 1.7, "specular": 0.3, "main_specular_sampling_rate": 0.5, "clearcoat_sampling_rate": 0.5},
    ),
    "principledthin": (
        {},
        PRINCIPLED
        | {"spec_trans": 0.3, "diff_trans": 1.5, "eta": 1.7}
        | dict.fromkeys(
            (
                "specular_reflectance_sampling_rate",
                "specular_transmittance_sampling_rate",
                "diffuse_transmittance_sampling_rate",
            ),
            0.5,
        ),
    ),
    "twosided": ({"inner": {"type": "diffuse"}}, {"inner": {"type": "plastic"}, "back": {"type": "plastic"}}),
    "mask": ({"inner": {"type": "diffuse"}}, {"inner": {"type": "plastic"}, "opacity": TEXTURE}),
    "blendbsdf": (
        {"weight": 0.5, "a": {"type": "diffuse"}, "b": {"type": "plastic"}},
        {"weight": TEXTURE, "a": {"type": "conductor"}, "b": {"type": "null"}},
    ),
    "normalmap": (
        {"normalmap": RGB, "inner": {"type": "diffuse"}},
        BENDS | {"normalmap": TEXTURE, "inner": {"type": "plastic"}},
    ),
    "bumpmap": (
        {"heights": TEXTURE, "inner": {"type": "diffuse"}},
        BENDS | {"heights": OTHER_TEXTURE, "inner": {"type": "plastic"}, "scale": 2.0},
    ),
    "homogeneous": ({"emission": 1.0, "temperature": 900.0, "emission_density": 1.0}, MEDIUM),
    "heterogeneous": (
        {"emission": 1.0, "temperature": 900.0, "emission_density": 1.0},
        MEDIUM | {"sigma_t": VOLUME},
    ),
    "classified": (
        {"values": VOLUME, "opacity": "0: 0, 1: 2", "emission": 1.0, "emission_density": 1.0},
        {
            "values": {"type": "gridvolume", "filename": "b.vol"},
            "opacity": "0: 0, 0.5: 3",
            "albedo": "0: 0.2, 1: 0.4",
            "scale": 2.0,
            "emission": "0: 0, 1: 3",
            "emission_scale": 2.0,
            "emission_density": VOLUME,
            "emission_density_scale": 2.0,
            "sample_emitters": False,
            "has_spectral_extinction": Silent(True),
            "phase": {"type": "rayleigh"},
        },
    ),
    "gridvolume": (
        {"filename": "a.vol"},
        {
            "filename": "b.vol",
            "to_world": MOVED,
            "use_grid_bbox": True,
            "filter_type": "nearest",
            "wrap_mode": "repeat",
            "accel": Silent(False),
            "raw": Silent(True),
            "max_value": Silent(9.0),
            "sanitize": Silent(True),
        },
    ),
    "constvolume": ({}, {"value": 0.5, "to_world": MOVED}),
    "vdbvolume": (
        {"filename": "fog.vdb"},
        {
            "filename": "other.vdb",
            "grid": "heat",
            "to_world": MOVED,
            "filter_type": "nearest",
            "level_set": "fog",
            "sanitize": Silent(True),
        },
    ),
    "isotropic": ({}, {}),
    "hg": ({}, {"g": 0.3}),
    "rayleigh": ({}, {}),
    "tabphase": ({"values": "1, 2, 3"}, {"values": "1, 2, 4", "angles": "0, 40, 180"}),
    "sggx": (
        {"S": "1, 2, 3, 0.1, 0.2, 0.3"},
        {"S": {"type": "gridvolume", "data": np.broadcast_to([1, 2, 4, 0.1, 0.2, 0.3], (1, 1, 1, 6))}},
    ),
    "blendphase": (
        {"weight": 0.5, "a": {"type": "isotropic"}, "b": {"type": "rayleigh"}},
        {"weight": VOLUME, "a": {"type": "hg"}, "b": {"type": "hg"}},
    ),
    "uniform": ({}, {"value": 0.5}),
    "rawconstant": ({}, {"value": 0.5}),
    "srgb": ({}, {"color": RGB}),
    "d65": ({}, {"color": RGB, "scale": 0.5}),
    "regular": ({"values": ".1, .2"}, {"values": ".1, .3", "wavelength_min": 500.0, "wavelength_max": 600.0}),
    "irregular": (
        {"values": ".1, .2", "wavelengths": "400, 700"},
        {"values": ".1, .3", "wavelengths": "500, 700"},
    ),
    "blackbody": (
        {"temperature": 900.0},
        {"temperature": 950.0, "wavelength_min": 500.0, "wavelength_max": 600.0},
    ),
    "constant": ({}, LIGHT | {"radiance": RGB, "to_world": Silent(TURNED)}),
    "envmap": (
        {"bitmap": SKY},
        LIGHT | {"bitmap": 2 * SKY, "scale": 2.0, "to_world": TURNED, "mis_compensation": Silent(True)},
    ),
    "directional": ({}, LIGHT | {"irradiance": RGB, "direction": [1, 2, 3], "to_world": TURNED}),
    "point": ({}, LIGHT | {"intensity": RGB, "position": [1, 2, 3], "to_world": MOVED}),
    "spot": (
        {},
        LIGHT
        | {"intensity": RGB, "cutoff_angle": 30.0, "beam_width": 5.0, "texture": TEXTURE, "to_world": TURNED},
    ),
    "projector": (
        {"fov": 40.0},
        LIGHT
        | {"irradiance": TEXTURE, "scale": 2.0, "fov": 50.0, "fov_axis": "diagonal", "to_world": TURNED},
    ),
    "sunsky": (
        {},
        LIGHT
        | {"turbidity": 4.0, "albedo": RGB, "sky_scale": 2.0, "sun_scale": 0.5, "sun_aperture": 3.0}
        | {"sun_direction": [1, 2, 3], "complex_sun": Silent(True), "to_world": TURNED}
        | {"latitude": 20.0, "longitude": 20.0, "timezone": 2.0, "year": 1999, "month": 3, "day": 3}
        | {"hour": 10.0, "minute": 20.0, "second": 300.0},
    ),
    "timed_sunsky": (
        {"start_month": 3, "start_day": 20},
        LIGHT
        | {"turbidity": 4.0, "albedo": RGB, "sky_scale": 2.0, "sun_scale": 0.5, "sun_aperture": 3.0}
        | {
            "complex_sun": Silent(True),
            "to_world": TURNED,
            "shutter_open": -1.0,
            "shutter_close": Silent(2.0),
        }
        | {"latitude": 20.0, "longitude": 20.0, "timezone": 8.0, "window_start_time": 10.0}
        | {"start_year": 2027, "start_month": 6, "start_day": 3, "window_end_time": Silent(20.0)}
        | {"end_year": Silent(2031), "end_month": Silent(5), "end_day": Silent(30)},
    ),
    "area": ({}, LIGHT | {"radiance": TEXTURE}),
    "directionalarea": ({}, LIGHT | {"radiance": Silent(RGB)}),
    "bitmap": (
        {"bitmap": TEXELS},
        {
            "bitmap": TEXELS / 2,
            "to_uv": UV,
            "filter_type": "nearest",
            "wrap_mode": "clamp",
            "raw": Silent(True),  # of an array of floats
            "accel": Silent(False),
            "format": Silent("fp16"),
        },
    ),
    "mesh_attribute": ({"name": "vertex_a"}, {"name": "face_a", "scale": 0.5}),
    "volume": ({"volume": VOLUME}, {"volume": VOLUME | {"data": CELLS / 2}}),
    "checkerboard": ({}, {"color0": RGB, "color1": RGB, "to_uv": UV}),
}
INSTEAD = {
    ("perspective", "focal_length"): ({}, "85mm"),
    ("projector", "focal_length"): ({}, "85mm"),
    ("thinlens", "focal_length"): ({"aperture_radius": 0.1}, "85mm"),
    ("radiancemeter", "to_world"): ({"film": PIXEL}, MOVED),
    ("distant", "to_world"): ({"film": PIXEL}, TURNED),
    ("distant", "target"): ({"film": PIXEL}, {"type": "rectangle"}),
    ("hdrfilm", "crop_offset_x"): ({"crop_width": 4}, 1),
    ("hdrfilm", "crop_offset_y"): ({"crop_height": 4}, 1),
    ("conductor", "eta"): ({}, TEXTURE),
    ("conductor", "k"): ({}, RGB),
    ("roughconductor", "eta"): ({}, RGB),
    ("roughconductor", "k"): ({}, TEXTURE),
    **{
        (bsdf, f"alpha_{axis}"): ({"alpha_u": 0.1, "alpha_v": 0.1}, 0.3)
        for bsdf in ("roughdielectric", "roughconductor")
        for axis in "uv"
    },
    ("gridvolume", "data"): ({}, CELLS),
    ("gridvolume", "level_set"): ({"filename": "fog.vdb"}, "fog"),
    ("gridvolume", "grid"): ({}, CELLS),
    ("envmap", "filename"): ({}, "sky.exr"),
    ("bitmap", "filename"): ({}, "sky.exr"),
}
"""(plugin, parameter) -> (what it goes with, its value), where it goes without what the plugin needs else."""
