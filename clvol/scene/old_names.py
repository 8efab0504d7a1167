"""What scenes of Mitsuba before version 2 call otherwise than later ones: the data of `clvol.scene.upgrade`.

Mitsuba 3's own upgrader turns camelCase into snake_case, renames `diffuse_reflectance`, and makes
`to_uv` of `UV`. The rest is what scenes of that time need beside.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from collections.abc import Mapping

TAGS = {"lookAt": "lookat", "camera": "sensor", "luminaire": "emitter", "srgb": "rgb"}
"""Elements by their names then."""

NULL_IN_MEDIA = "null"
"""BSDF of a shape that has a medium and no BSDF: light passes.  From version 2 on such a shape is diffuse."""

ON_ALL: dict[str, tuple[str, ...]] = {
    "shape": ("collapse", "shape_triangles", "load_materials", "srgb"),
    "sensor": ("shutter_open", "shutter_close"),
    "film": (
        *("attach_log", "high_quality_edges", "file_format", "banner", "filename", "digits", "variable"),
        *("gamma", "exposure", "tonemap_method", "key", "burn"),
    ),
    "texture": ("max_anisotropy", "cache"),
    "integrator": ("strict_normals",),
    "emitter": ("sampling_weight",),
    "sampler": ("dimension",),
}
"""By kind of plugin: parameters that change no expected picture, or only how it is shown."""
ON_FILMS = ("metadata[", "label[")
"""How names of a film's parameters begin that are written into or on the picture."""


SKIES = ("sky", "sun", "sunsky")
"""Emitters that are a `sunsky` now."""

NOT_HEEDED: dict[tuple[str, str, str], str] = {
    ("shape", "", "max_smooth_angle"): "vertex normals are those of the file",
    ("rfilter", "box", "radius"): "the filter is a pixel wide",
    **dict.fromkeys(
        ((("emitter", name, parameter)) for name in SKIES for parameter in ("stretch", "extend")),
        "no light comes from below the horizon",
    ),
}
"""By kind, type ("": any) and parameter of plugins: in what the picture is another, which is said."""

NOT_HERE: dict[tuple[str, str], tuple[str, ...]] = {
    ("bsdf", "conductor"): ("ext_eta",),
    ("bsdf", "roughconductor"): ("ext_eta",),
    ("emitter", "envmap"): ("gamma",),
    ("medium", "homogeneous"): ("material",),
    ("shape", "obj"): ("flip_tex_coords", "shape_index"),
    ("texture", "bitmap"): ("channel", "wrap_mode_u", "wrap_mode_v"),
    ("volume", "gridvolume"): ("min", "max"),
}
"""By kind and type: parameters of Mitsuba 0.6 that change the picture and that clvol has not.

Other parameters that it does not know are none of Mitsuba 0.6's, and are not heeded either there.
"""


@dataclass(frozen=True)
class Rule:
    """What becomes of a plugin.

    to : its type.  renamed : its parameters' names.  dropped : parameters that change no expected picture.
    values : what a parameter's value is called now, in lower case.  added : (element, name, value) that say
        what was the default, where none of `unless` is given.  said : what it is taken as, where that is
        something else.
    """

    to: str = ""
    renamed: Mapping[str, str] = field(default_factory=dict)
    dropped: tuple[str, ...] = ()
    values: Mapping[str, Mapping[str, str]] = field(default_factory=dict)
    added: tuple[tuple[str, str, str], ...] = ()
    unless: tuple[str, ...] = ()
    said: str = ""


_FILM = Rule(
    values={
        "pixel_format": dict.fromkeys(("luminance", "spectrum", "xyz"), "rgb")
        | dict.fromkeys(("luminancealpha", "xyza", "spectrumalpha"), "rgba"),
        "component_format": {"uint32": "float32"},
    }
)
_BITMAP = Rule(values={"filter_type": {"ewa": "bilinear", "trilinear": "bilinear", "isotropic": "bilinear"}})
_COPPER = Rule(added=(("string", "material", "Cu"),), unless=("eta", "k"))


def _sky(scale: str = "", absent: str = "") -> Rule:
    """What becomes of a sky or a sun; `scale`: of the one that is there.  `absent`: of the other."""
    albedo = ("spectrum", "albedo", "0.2")
    return Rule(
        "sunsky",
        renamed={"scale": scale} if scale else {},
        dropped=("resolution",),
        added=(albedo, ("float", absent, "0")) if absent else (albedo,),
        said="" if absent == "sun_scale" else "sunsky, whose sun is Hosek and Wilkie's",
    )


_PIXELS = "hdrfilm: pictures are linear, and shown as the command line says"

RULES: dict[tuple[str, str], Rule] = {
    ("film", "hdrfilm"): _FILM,
    ("film", "exrfilm"): Rule("hdrfilm", values=_FILM.values),
    ("film", "tiledhdrfilm"): Rule("hdrfilm", values=_FILM.values),
    ("film", "ldrfilm"): Rule("hdrfilm", values=_FILM.values, said=_PIXELS),
    ("film", "pngfilm"): Rule("hdrfilm", values=_FILM.values, said=_PIXELS),
    ("film", "mfilm"): Rule(
        "hdrfilm",
        dropped=("file_format", "digits", "variable"),
        values=_FILM.values,
        added=(("integer", "width", "1"), ("integer", "height", "1")),
        said="hdrfilm, which writes no matrices",
    ),
    ("rfilter", "sinc"): Rule("lanczos"),
    ("sensor", "perspective"): Rule(dropped=("aperture_radius",)),
    ("bsdf", "diffuse"): Rule(renamed={"diffuse_reflectance": "reflectance"}),
    ("bsdf", "lambertian"): Rule("diffuse", renamed={"diffuse_reflectance": "reflectance"}),
    ("bsdf", "mirror"): Rule("conductor", added=(("string", "material", "none"),)),
    ("bsdf", "conductor"): _COPPER,
    ("bsdf", "roughconductor"): _COPPER,
    ("texture", "bitmap"): _BITMAP,
    ("texture", "ldrtexture"): Rule("bitmap", values=_BITMAP.values),
    ("texture", "exrtexture"): Rule("bitmap", values=_BITMAP.values),
    ("texture", "vertexcolors"): Rule("mesh_attribute", added=(("string", "name", "vertex_color"),)),
    ("texture", "checkerboard"): Rule(renamed={"bright_color": "color0", "dark_color": "color1"}),
    ("medium", "homogeneous"): Rule(dropped=("strategy", "sampling_weight", "medium_sampling_weight")),
    ("medium", "heterogeneous"): Rule(
        renamed={"density": "sigma_t", "density_multiplier": "scale"}, dropped=("method", "step_size")
    ),
    ("volume", "gridvolume"): Rule(dropped=("send_data",), added=(("boolean", "use_grid_bbox", "true"),)),
    ("volume", "constvolume"): Rule(renamed={"color": "value"}),
    ("emitter", "envmap"): Rule(renamed={"intensity_scale": "scale"}, dropped=("cache",)),
    ("emitter", "constant"): Rule(renamed={"intensity": "radiance"}),
    ("emitter", "area"): Rule(renamed={"intensity": "radiance"}),
    ("emitter", "directional"): Rule(renamed={"intensity": "irradiance"}),
    ("emitter", "sky"): _sky("sky_scale", "sun_scale"),
    ("emitter", "sun"): _sky("sun_scale", "sky_scale"),
    ("emitter", "sunsky"): _sky(),
    ("integrator", "vrl"): Rule(
        "volpath",
        dropped=(
            *("light_emissions", "use_light_cut", "short_vrls", "max_passes", "vrl_target_num"),
            *("max_particle_depth", "initial_specular_throughput", "samples_per_query"),
        ),
        said="volpath, which has the same expectation",
    ),
    ("integrator", "volpathsimple"): Rule("volpath_simple"),
    ("integrator", "ptracer"): Rule(dropped=("granularity", "brute_force")),
    ("integrator", "erpt"): Rule(dropped=("num_chains", "max_chains")),
}
"""By element and type of a plugin; those without a rule are as they were."""

UV = ("uoffset", "voffset", "uscale", "vscale")
"""Parameters of textures that are a `to_uv` now."""
