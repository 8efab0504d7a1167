"""Tiny scenes of what scenes/ have not, for tools/oclgrind.py: for each part of cl/ one compiles it."""

from __future__ import annotations

import sys
import tempfile
from pathlib import Path
from typing import Any

import numpy as np
from folders import ROOT

import clvol

sys.path.insert(0, str(ROOT / "tests" / "helpers"))

from vdb_writer import GridSpec, write_vdb

SMALL = {"type": "hdrfilm", "width": 4, "height": 4, "rfilter": {"type": "box"}}
RANDOM = np.random.default_rng(1)
PICTURE, CELLS = RANDOM.random((4, 6, 3)).astype(np.float32), RANDOM.random((5, 4, 3)).astype(np.float32)
COLOURS = RANDOM.random((5, 4, 3, 3)).astype(np.float32)
TEXTURE = {"type": "bitmap", "bitmap": PICTURE}


def lights_and_masks() -> clvol.Scene:
    """Pictures as textures and environment, a lens, masks, spots, mixed phases."""
    smoke = {
        "type": "heterogeneous",
        "sigma_t": {"type": "gridvolume", "grid": CELLS, "to_world": clvol.translate((-0.5, 0, -0.5))},
        "albedo": 0.8,
        "scale": 6.0,
        "phase": {
            "type": "blendphase",
            "weight": 0.3,
            "a": {"type": "rayleigh"},
            "b": {"type": "hg", "g": 0.5},
        },
    }
    return clvol.load_dict(
        {
            "type": "scene",
            "integrator": {"type": "volpath", "max_depth": 12},
            "sensor": {
                "type": "thinlens",
                "fov": 45.0,
                "aperture_radius": 0.02,
                "focus_distance": 2.0,
                "to_world": clvol.look_at((0.3, 1.0, -2.0), (0, 0.4, 0), (0, 1, 0)),
                "film": {"type": "hdrfilm", "width": 4, "height": 4, "rfilter": {"type": "mitchell"}},
            },
            "sky": {"type": "envmap", "bitmap": PICTURE},
            "spot": {
                "type": "spot",
                "to_world": clvol.look_at((1, 2, 0), (0, 0, 0), (0, 0, 1)),
                "texture": {"type": "checkerboard"},
            },
            "slide": {
                "type": "projector",
                "fov": 40.0,
                "to_world": clvol.look_at((-1, 2, 0), (0, 0, 0), (0, 0, 1)),
                "irradiance": TEXTURE,
            },
            "point": {"type": "point", "position": (0.0, 1.5, -1.0)},
            "lamp": {
                "type": "sphere",
                "center": (-0.9, 1.0, 0.0),
                "radius": 0.1,
                "light": {"type": "area", "radiance": 3.0},
            },
            "panel": {
                "type": "rectangle",
                "to_world": clvol.translate((0, 0.5, 1.2))
                @ clvol.rotate((0, 1, 0), 180.0)
                @ clvol.scale(0.5),
                "light": {"type": "area", "radiance": TEXTURE},
            },
            "floor": {
                "type": "rectangle",
                "to_world": clvol.rotate((1, 0, 0), -90.0) @ clvol.scale(2.0),
                "bsdf": {"type": "twosided", "nested": {"type": "diffuse", "reflectance": TEXTURE}},
            },
            "veil": {
                "type": "rectangle",
                "to_world": clvol.translate((0, 0.5, -0.8)) @ clvol.scale(0.5),
                "bsdf": {"type": "mask", "opacity": TEXTURE, "nested": {"type": "roughplastic"}},
            },
            "pearl": {
                "type": "sphere",
                "center": (0.7, 0.3, 0.2),
                "radius": 0.3,
                "bsdf": {"type": "dielectric"},
                "interior": {"type": "homogeneous", "sigma_t": 2.0, "albedo": 0.5},
            },
            "smoke": {
                "type": "cube",
                "to_world": clvol.translate((0, 0.5, 0)) @ clvol.scale(0.5),
                "bsdf": {"type": "null"},
                "interior": smoke,
            },
        }
    )


def field(values: np.ndarray) -> dict[str, Any]:
    """A volume in the box from -0.5 to 0.5."""
    return {"type": "gridvolume", "grid": values, "to_world": clvol.translate((-0.5, -0.5, -0.5))}


def pinhole(at: tuple[float, float, float] = (0, 0, -3), **film: Any) -> dict[str, Any]:
    """A camera that looks at the origin."""
    to_world = clvol.look_at(at, (0, 0, 0), (0, 1, 0))
    return {"type": "perspective", "fov": 40.0, "to_world": to_world, "film": SMALL | film}


def box(medium: dict[str, Any], **more: Any) -> dict[str, Any]:
    """A medium in that box."""
    half = clvol.scale(0.5)
    return {"type": "cube", "to_world": half, "bsdf": {"type": "null"}, "interior": medium} | more


DIFFUSE = {"type": "diffuse", "reflectance": TEXTURE}
MATERIALS = [
    {"type": "conductor", "eta": TEXTURE, "k": 2.0},
    {"type": "thindielectric"},
    {"type": "principled", "base_color": TEXTURE, "roughness": 0.4, "clearcoat": 0.5, "metallic": 0.3},
    {"type": "principled", "base_color": 0.5, "roughness": 0.3, "spec_trans": 0.8, "eta": 1.4},
    {"type": "principledthin", "roughness": 0.4, "spec_trans": 0.5, "diff_trans": 0.6},
    {"type": "twosided", "nested": {"type": "roughconductor", "alpha": TEXTURE}},
    {"type": "roughdielectric", "alpha": 0.3},
    {"type": "blendbsdf", "weight": 0.4, "a": DIFFUSE, "b": {"type": "roughplastic"}},
]
BENDS = [
    {"type": "bumpmap", "heights": TEXTURE, "nested": DIFFUSE},
    {"type": "normalmap", "normalmap": TEXTURE, "nested": {"type": "roughplastic"}},
    {"type": "diffuse", "reflectance": {"type": "volume", "volume": {"type": "gridvolume", "grid": COLOURS}}},
]


def balls(bsdfs: list[dict[str, Any]], integrator: str = "path") -> clvol.Scene:
    """A wall of balls, one of each BSDF."""
    made = {
        f"ball{n}": {
            "type": "sphere",
            "center": (0.55 * (n % 4) - 0.825, 0.6 * (n // 4) - 0.3, 0.0),
            "radius": 0.33,
            "bsdf": bsdf,
        }
        for n, bsdf in enumerate(bsdfs)
    }
    limits = {"type": integrator} | ({"max_depth": 6} if integrator == "path" else {})
    sky = {"type": "envmap", "bitmap": PICTURE}
    described = {"type": "scene", "integrator": limits, "sensor": pinhole(), "sky": sky}
    return clvol.load_dict(described | made)


def colours() -> clvol.Scene:
    """A camera inside a medium of coloured volumes, of a tabulated phase function, which glows."""
    table = {"type": "tabphase", "values": "0.2, 0.5, 1, 3"}
    fog = {
        "type": "heterogeneous",
        "sigma_t": field(COLOURS),
        "albedo": field(COLOURS),
        "emission_density": field(COLOURS),
        "scale": 4.0,
        "phase": {"type": "blendphase", "weight": field(CELLS), "a": table, "b": {"type": "hg", "g": 0.3}},
    }
    sensor = pinhole((0.1, 0.2, -0.3)) | {"medium": {"type": "ref", "id": "fog"}}
    described = {"type": "scene", "sensor": sensor, "fog": fog | {"id": "fog"}, "sky": {"type": "constant"}}
    return clvol.load_dict(described | {"box": box({"type": "ref", "id": "fog"})})


def flames() -> clvol.Scene:
    """Emission of two media that overlap, one of them classified, seen in parallel under a sun."""
    fire = {"type": "heterogeneous", "sigma_t": field(CELLS), "emission": field(CELLS), "scale": 3.0}
    values = {"type": "classified", "values": field(CELLS), "opacity": "0: 0, 1: 4", "albedo": 0.7}
    to_world = clvol.look_at((0, 0, -3), (0, 0, 0), (0, 1, 0)) @ clvol.scale((0.6, 0.6, 1.0))
    sensor = {"type": "orthographic", "to_world": to_world}
    return clvol.load_dict(
        {
            "type": "scene",
            "integrator": {"type": "volpath", "max_depth": 3},
            "sensor": sensor | {"film": SMALL | {"width": 2, "height": 2, "pixel_format": "rgba"}},
            "sky": {"type": "sunsky", "sun_direction": (0.3, -0.5, 0.8)},
            "fire": box(fire),
            "values": box(values, to_world=clvol.translate((0.2, 0.1, 0)) @ clvol.scale(0.5)),
        }
    )


def one_medium(**more: Any) -> clvol.Scene:
    """One heterogeneous medium under a uniform sky, with more of the film or of the medium."""
    fog = {"type": "heterogeneous", "sigma_t": field(CELLS), "albedo": 0.8, "scale": 6.0}
    fog |= {name: value for name, value in more.items() if name == "emission"}
    film = {name: value for name, value in more.items() if name != "emission"}
    return clvol.load_dict(
        {"type": "scene", "sensor": pinhole(**film), "sky": {"type": "constant"}, "fog": box(fog)}
    )


def sunlit() -> clvol.Scene:
    """One heterogeneous medium under a sun and a sky."""
    fog = {"type": "heterogeneous", "sigma_t": field(CELLS), "albedo": field(CELLS), "scale": 6.0}
    sun, sky = {"type": "directional", "direction": (0.2, -1.0, 0.5)}, {"type": "envmap", "bitmap": PICTURE}
    described = {"type": "scene", "integrator": {"type": "volpath", "max_depth": 4}, "sensor": pinhole()}
    return clvol.load_dict(described | {"sun": sun, "sky": sky, "fog": box(fog)})


def flakes() -> clvol.Scene:
    """Fog of microflakes under a sun."""
    phase = {"type": "sggx", "S": "0.5, 0.9, 0.1, 0.1, 0, 0"}
    fog = {"type": "heterogeneous", "sigma_t": field(CELLS), "albedo": 0.8, "scale": 6.0, "phase": phase}
    sun = {"type": "directional", "direction": (0.2, -1.0, 0.5)}
    return clvol.load_dict({"type": "scene", "sensor": pinhole(), "sun": sun, "fog": box(fog)})


def woven() -> clvol.Scene:
    """Fog of microflakes that differ from place to place, and more of them in a mixture."""
    matrices = np.ones((1, 2, 2, 1)) * np.array((0.5, 0.9, 0.2, 0.1, 0.0, 0.1))
    matrices[0, 1] *= 0.5
    phase = {"type": "sggx", "S": {"type": "gridvolume", "data": matrices}}
    fog = {"type": "heterogeneous", "sigma_t": field(CELLS), "albedo": 0.8, "scale": 6.0, "phase": phase}
    mixture = {"type": "blendphase", "weight": 0.4, "a": phase, "b": {"type": "hg"}}
    ball = {"type": "homogeneous", "albedo": 0.8, "phase": mixture}
    shape = {"type": "sphere", "radius": 0.5, "bsdf": {"type": "null"}, "interior": ball}
    sun = {"type": "directional", "direction": (0.2, -1.0, 0.5)}
    return clvol.load_dict({"type": "scene", "sensor": pinhole(), "sun": sun, "fog": box(fog), "ball": shape})


def within() -> clvol.Scene:
    """A camera in a ball of glass that is filled with fog."""
    fog = {"type": "homogeneous", "sigma_t": 0.5, "albedo": 0.8}
    ball = {"type": "sphere", "radius": 5.0, "bsdf": {"type": "dielectric"}, "interior": fog}
    integrator = {"type": "volpath", "max_depth": 8}
    described = {"type": "scene", "integrator": integrator, "sensor": pinhole(), "sky": {"type": "constant"}}
    return clvol.load_dict(described | {"ball": ball})


def plate() -> clvol.Scene:
    """The irradiance of a box in fog."""
    fog = {"type": "homogeneous", "sigma_t": 0.5, "albedo": 0.8}
    meter = {"type": "irradiancemeter", "film": {"type": "hdrfilm", "width": 2, "height": 2}}
    integrator = {"type": "volpath", "max_depth": 3}
    described = {"type": "scene", "integrator": integrator, "sky": {"type": "constant"}, "fog": box(fog)}
    return clvol.load_dict(
        described | {"plate": {"type": "cube", "to_world": clvol.scale(0.2), "meter": meter}}
    )


def target() -> clvol.Scene:
    """A ball in fog, seen all over from afar."""
    ball = {"type": "sphere", "radius": 0.2}
    pixel = {"type": "hdrfilm", "width": 1, "height": 1}
    sensor = {"type": "distant", "direction": (0.2, 0.1, 1.0), "target": ball, "film": pixel}
    fog = {"type": "homogeneous", "sigma_t": 0.5, "albedo": 0.8}
    integrator = {"type": "volpath", "max_depth": 3}
    described = {"type": "scene", "integrator": integrator, "sensor": sensor, "sky": {"type": "constant"}}
    return clvol.load_dict(described | {"fog": box(fog), "ball": ball})


def far_apart() -> clvol.Scene:
    """A sparse grid of which two distant corners hold something."""
    leaf = np.full((8, 8, 8), 0.2), np.ones((8, 8, 8), bool)
    with tempfile.NamedTemporaryFile(suffix=".vdb") as file:
        write_vdb(Path(file.name), [GridSpec(leaves={(0, 0, 0): leaf, (600, 600, 600): leaf})])
        grid = clvol.load_volume(file.name)
    fog = {"type": "heterogeneous", "sigma_t": {"type": "gridvolume", "grid": grid}, "albedo": 0.8}
    cube = {"type": "cube", "to_world": clvol.translate((304, 304, 304)) @ clvol.scale(304.0)}
    camera = {"to_world": clvol.look_at((-20, -20, -20), (4, 4, 4), (0, 1, 0))}
    described = {"type": "scene", "sensor": pinhole() | camera, "sky": {"type": "constant"}}
    return clvol.load_dict(described | {"cube": cube | {"bsdf": {"type": "null"}, "interior": fog}})


MADE = {
    "lights and masks": lights_and_masks,
    "materials": lambda: balls(MATERIALS),
    "bends": lambda: balls(BENDS),
    "depths": lambda: balls(BENDS, "depth"),
    "colours": colours,
    "flames": flames,
    "sunlit": sunlit,
    "flakes": flakes,
    "woven": woven,
    "within": within,
    "a meter": plate,
    "a target": target,
    "far apart": far_apart,
    "a backdrop": lambda: one_medium(backdrop=0.3),
    "transparent": lambda: one_medium(pixel_format="rgba"),
    "an emitting medium": lambda: one_medium(emission=2.0),
}
"""Scenes by name."""
