"""The six scenes of the benchmark, as Mitsuba 3 scene files that clvol and Mitsuba both read.

They span what participating media ask of a renderer: an open cloud, a dense one in the sun, colours that are
attenuated differently, a closed room, a large grid that is nearly empty, and emission.
"""

from __future__ import annotations

import dataclasses
import json
from dataclasses import dataclass
from typing import TYPE_CHECKING
from xml.etree import ElementTree as Xml

import numpy as np

from benchmarks.volumes import volume
from clvol.volumes import write_vol

if TYPE_CHECKING:
    from pathlib import Path

Triple = tuple[float, float, float]
WHITE: Triple = (1.0, 1.0, 1.0)
BLACK: Triple = (0.0, 0.0, 0.0)
UNIT = np.array([[0.0, 0.0, 0.0], [1.0, 1.0, 1.0]])
"""The cube that the medium is in."""
NO_ROULETTE = 100_000


@dataclass(frozen=True)
class Sun:
    """A light at infinity: the direction it travels in, and its irradiance on a plane across that."""

    direction: Triple = (0.5, -0.7, 0.5)
    irradiance: Triple = (3.0, 3.0, 3.0)


@dataclass(frozen=True)
class Quad:
    """A diffuse parallelogram from `corner` along u and v, facing u × v; a lamp where it has a radiance."""

    corner: Triple
    u: Triple
    v: Triple
    reflectance: Triple = BLACK
    radiance: Triple | None = None

    def to_world(self) -> np.ndarray:
        """What makes it of the square from -1 to 1; float64 (4, 4)."""
        corner, u, v = map(np.array, (self.corner, self.u, self.v))
        normal = np.cross(u, v)
        matrix = np.eye(4)
        matrix[:3] = np.stack([u / 2, v / 2, normal / np.linalg.norm(normal), corner + (u + v) / 2], axis=1)
        return matrix


@dataclass(frozen=True)
class Emission:
    """What the medium emits: a volume of radiance, times a colour."""

    volume: str
    radiance: Triple


@dataclass(frozen=True)
class BenchScene:
    """One medium in the unit cube, and the light round it.

    Parameters
    ----------
    letter, about : what the tables call it, and what it is for.
    volume, size : density, and voxels along an axis.
    sigma_t, albedo, g : extinction where the density is 1; Henyey-Greenstein's g.
    sky, sun, quads, emission : the light; radiance of the sky.
    scatterings : that a path may have.
    roulette : scattering after which roulette may start.
    eye : of a camera of 40 degrees that looks at the cube's middle.
    """

    letter: str
    about: str
    volume: str
    sigma_t: Triple
    albedo: Triple
    size: int = 128
    g: float = 0.0
    sky: Triple | None = None
    sun: Sun | None = None
    quads: tuple[Quad, ...] = ()
    emission: Emission | None = None
    scatterings: int = 64
    roulette: int = NO_ROULETTE
    eye: Triple = (0.5, 0.5, -1.2)

    @property
    def grey(self) -> bool:
        """Whether all channels are attenuated alike."""
        return len(set(self.sigma_t)) == len(set(self.albedo)) == 1


_WALL, _RED, _GREEN = (0.725, 0.71, 0.68), (0.63, 0.065, 0.05), (0.14, 0.45, 0.091)
_ROOM = (
    Quad((-0.5, -0.5, -0.5), (0, 0, 2), (2, 0, 0), _WALL),
    Quad((-0.5, 1.5, -0.5), (2, 0, 0), (0, 0, 2), _WALL),
    Quad((-0.5, -0.5, 1.5), (0, 2, 0), (2, 0, 0), _WALL),
    Quad((1.5, -0.5, -0.5), (0, 0, 2), (0, 2, 0), _RED),
    Quad((-0.5, -0.5, -0.5), (0, 2, 0), (0, 0, 2), _GREEN),
    Quad((0.2, 1.499, 0.2), (0.6, 0, 0), (0, 0, 0.6), radiance=(12.0, 12.0, 12.0)),
)


def _alike(value: float) -> Triple:
    return value, value, value


SCENES = {
    "cloud": BenchScene("A", "a cloud under a white sky", "cloud", _alike(50), _alike(0.9), sky=WHITE),
    "cloud_dense": BenchScene(
        "B",
        "a dense bright cloud in the sun",
        "cloud",
        _alike(200),
        _alike(0.999),
        g=0.8,
        sun=Sun(),
        scatterings=512,
        roulette=100,
    ),
    "chroma": BenchScene(
        "C", "a cloud attenuated as 6 : 3 : 1", "cloud", (60, 30, 10), (0.95, 0.9, 0.8), sky=WHITE
    ),
    "box_smoke": BenchScene(
        "D",
        "smoke in a room with a lamp",
        "cloud",
        _alike(40),
        _alike(0.8),
        g=0.3,
        quads=_ROOM,
        eye=(0.5, 0.5, -3.2),
    ),
    "thin_sparse": BenchScene(
        "E",
        "a large grid, 5 % filled, with spikes",
        "thin",
        _alike(400),
        _alike(0.95),
        size=256,
        sky=_alike(0.2),
        sun=Sun(),
    ),
    "emissive": BenchScene(
        "F",
        "a flame in dark smoke",
        "flame",
        _alike(20),
        _alike(0.3),
        emission=Emission("glow", (4.0, 1.8, 0.5)),
    ),
}


def write_scene(scene: BenchScene, folder: Path, size: int | None = None) -> Path:
    """The scene as scene.xml in a folder, with its volumes beside it; its film's edge is $res.

    scene.json beside it describes the same to programs that do not read Mitsuba's scenes.

    size : voxels along an axis, where it is not the scene's own.
    """
    size = size or scene.size
    density = volume(scene.volume, size)
    strongest = max(scene.sigma_t)
    if len(set(scene.sigma_t)) > 1:
        density = density[..., None] * np.divide(scene.sigma_t, strongest).astype(np.float32)
    write_vol(folder / "density.vol", density, UNIT)
    if scene.emission:
        colour = np.asarray(scene.emission.radiance, np.float32)
        glow = volume(scene.emission.volume, size)
        write_vol(folder / "emission.vol", glow[..., None] * colour, UNIT)
    described = dataclasses.asdict(scene)
    (folder / "scene.json").write_text(json.dumps(described, indent=1), encoding="utf-8")
    path = folder / "scene.xml"
    root = _root(scene)
    _add_lights(root, scene)
    _add_medium(root, scene, strongest)
    Xml.indent(root)
    Xml.ElementTree(root).write(path)
    return path


def _root(scene: BenchScene) -> Xml.Element:
    """The integrator and the camera."""
    root = Xml.Element("scene", version="3.0.0")
    Xml.SubElement(root, "default", name="res", value="128")
    integrator = Xml.SubElement(root, "integrator", type="volpath")
    Xml.SubElement(integrator, "integer", name="max_depth", value=str(scene.scatterings + 1))
    Xml.SubElement(integrator, "integer", name="rr_depth", value=str(scene.roulette))
    sensor = Xml.SubElement(root, "sensor", type="perspective")
    Xml.SubElement(sensor, "float", name="fov", value="40")
    place = Xml.SubElement(sensor, "transform", name="to_world")
    Xml.SubElement(place, "lookat", origin=_joined(scene.eye), target="0.5, 0.5, 0.5", up="0, 1, 0")
    film = Xml.SubElement(sensor, "film", type="hdrfilm")
    for edge in ("width", "height"):
        Xml.SubElement(film, "integer", name=edge, value="$res")
    Xml.SubElement(film, "rfilter", type="box")
    return root


def _add_lights(root: Xml.Element, scene: BenchScene) -> None:
    """Sky, sun, and whatever surfaces there are."""
    if scene.sky:
        sky = Xml.SubElement(root, "emitter", type="constant")
        Xml.SubElement(sky, "rgb", name="radiance", value=_joined(scene.sky))
    if scene.sun:
        sun = Xml.SubElement(root, "emitter", type="directional")
        x, y, z = map(str, scene.sun.direction)
        Xml.SubElement(sun, "vector", name="direction", x=x, y=y, z=z)
        Xml.SubElement(sun, "rgb", name="irradiance", value=_joined(scene.sun.irradiance))
    for quad in scene.quads:
        shape = Xml.SubElement(root, "shape", type="rectangle")
        place = Xml.SubElement(shape, "transform", name="to_world")
        Xml.SubElement(place, "matrix", value=" ".join(map(repr, quad.to_world().ravel().tolist())))
        bsdf = Xml.SubElement(shape, "bsdf", type="diffuse")
        Xml.SubElement(bsdf, "rgb", name="reflectance", value=_joined(quad.reflectance))
        if quad.radiance:
            lamp = Xml.SubElement(shape, "emitter", type="area")
            Xml.SubElement(lamp, "rgb", name="radiance", value=_joined(quad.radiance))


def _add_medium(root: Xml.Element, scene: BenchScene, scale: float) -> None:
    """The cube that holds it."""
    cube = Xml.SubElement(root, "shape", type="cube")
    place = Xml.SubElement(cube, "transform", name="to_world")
    Xml.SubElement(place, "translate", x="1", y="1", z="1")
    Xml.SubElement(place, "scale", value="0.5")
    Xml.SubElement(cube, "bsdf", type="null")
    medium = Xml.SubElement(cube, "medium", name="interior", type="heterogeneous")
    for name, file in (("sigma_t", "density.vol"), ("emission", "emission.vol")):
        if name == "sigma_t" or scene.emission:
            grid = Xml.SubElement(medium, "volume", name=name, type="gridvolume")
            Xml.SubElement(grid, "string", name="filename", value=file)
            Xml.SubElement(grid, "boolean", name="raw", value="true")
    Xml.SubElement(medium, "float", name="scale", value=str(scale))
    if len(set(scene.albedo)) == 1:
        Xml.SubElement(medium, "float", name="albedo", value=str(scene.albedo[0]))
    else:
        Xml.SubElement(medium, "rgb", name="albedo", value=_joined(scene.albedo))
    phase = Xml.SubElement(medium, "phase", type="hg" if scene.g else "isotropic")
    if scene.g:
        Xml.SubElement(phase, "float", name="g", value=str(scene.g))
    if scene.grey:
        Xml.SubElement(medium, "boolean", name="has_spectral_extinction", value="false")


def _joined(values: Triple) -> str:
    return ", ".join(map(str, values))
