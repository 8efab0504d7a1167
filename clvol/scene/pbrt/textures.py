"""Textures: constants, pictures, checkerboards; and products and mixtures where these are such again."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from clvol.scene.image import read_image
from clvol.scene.lookup import find
from clvol.scene.nodes import MAX_DEPTH, Node
from clvol.scene.pbrt.colours import colour

if TYPE_CHECKING:
    from clvol.scene.pbrt.context import Context
    from clvol.scene.pbrt.parameters import Parameters
    from clvol.scene.pbrt.statements import Thing

FLIPPED = np.array([[1.0, 0, 0], [0, -1, 1], [0, 0, 1]])
"""From pbrt's (u, v) to a bitmap's: its first row is at v = 1."""
SURFACES = {
    "": np.eye(3),
    "sphere": np.array([[1.0, 0, 0], [0, -1, 1], [0, 0, 1]]),
    "disk": np.array([[0.0, 1, 0], [-1, 0, 1], [0, 0, 1]]),
}
"""From Mitsuba's (u, v) of a shape to pbrt's, where a sphere's v begins at its other pole, and a disk has the
angle as its u and 1 - r as its v."""
_WRAPS = {"repeat": "repeat", "clamp": "clamp", "black": "clamp", "octahedralsphere": "repeat"}


@dataclass(frozen=True, eq=False)
class Picture:
    """A picture over (u, v): `factor` times texels, where these are `scale` times its own, or 1 less that."""

    path: str
    to_uv: np.ndarray
    filter_type: str
    wrap_mode: str
    raw: bool
    where: str
    inverted: bool = False
    scale: float = 1.0
    factor: tuple[float, ...] = (1.0, 1.0, 1.0)


@dataclass(frozen=True, eq=False)
class Board:
    """A checkerboard of two colours."""

    colors: tuple[np.ndarray, np.ndarray]
    to_uv: np.ndarray
    where: str


Texture = np.ndarray | Picture | Board


class Textures:
    """The textures of a scene, each made once."""

    def __init__(self, context: Context) -> None:
        self.context = context
        self._made: dict[tuple[str, str], Texture] = {}
        self._nodes: dict[tuple[int, str], Node] = {}
        self.surface = ""  # of `SURFACES`: what textures are for
        self.varied = 0  # how many have been asked for
        self._depth = 0

    def of(
        self, parameters: Parameters, name: str, default: float, space: str, kind: str = "spectrum"
    ) -> Texture:
        """A parameter that may be a texture; constants as float64 (3,), in [0, 1]."""
        found = parameters.get(name)
        if found is None or found.type != "texture":
            if found is not None and kind == "float":
                return np.full(3, parameters.number(name, default))
            return self.context.colour(parameters, name, default, space, bounded=True)
        if len(found.texts) != 1:
            parameters.fail(f"'{name}' takes the name of one texture", found.where)
        key = kind, found.texts[0]
        if key not in self.context.read.textures:
            parameters.fail(f"there is no {kind} texture '{key[1][:60]}'", found.where)
        return self._texture(key)

    def constant(self, parameters: Parameters, name: str, default: float) -> float:
        """A number that may be a constant texture; another one's mean is said to stand for it."""
        found = parameters.get(name)
        if found is None or found.type != "texture":
            return parameters.number(name, default, 0.0)
        texture = self.of(parameters, name, default, "srgb", "float")
        if isinstance(texture, np.ndarray):
            return float(texture[0])
        self.context.say(f"'{name}' of {parameters.what} is taken as its texture's mean", found.where)
        if isinstance(texture, Board):
            return float(np.mean(texture.colors))
        return float(self._pixels(texture).mean())

    def normals(self, parameters: Parameters, name: str) -> Node:
        """The picture of normals in a file, as it is stored."""
        path = find(parameters.string(name, ""), self.context.folders, parameters.place(name))
        where = parameters.place(name)
        if self.surface == "disk":
            parameters.refuse("a normalmap on a disk", where)
        self.varied += 1
        to_uv = FLIPPED @ SURFACES[self.surface]
        return self.context.node("texture", "bitmap", where, filename=str(path), raw=True, to_uv=to_uv)

    def value(self, texture: Texture, where: str) -> Node:
        """A texture as the value of a node's parameter."""
        if isinstance(texture, np.ndarray):
            return self.context.rgb(texture, where)
        self.varied += 1
        key = id(texture), self.surface
        if key not in self._nodes:
            self._nodes[key] = self._node(texture, SURFACES[self.surface])
        return self._nodes[key]

    def _node(self, texture: Picture | Board, places: np.ndarray) -> Node:
        make = self.context.node
        if isinstance(texture, Board):
            first, second = (self.context.rgb(one, texture.where) for one in texture.colors)
            to_uv = np.diag([0.5, 0.5, 1]) @ texture.to_uv @ places
            return make("texture", "checkerboard", texture.where, color0=first, color1=second, to_uv=to_uv)
        to_uv = texture.to_uv @ places
        common = {"to_uv": to_uv, "filter_type": texture.filter_type, "wrap_mode": texture.wrap_mode}
        if (texture.scale, *texture.factor) == (1.0, 1.0, 1.0, 1.0) and not texture.inverted:
            return make("texture", "bitmap", texture.where, filename=texture.path, raw=texture.raw, **common)
        pixels = self._pixels(texture)
        return make("texture", "bitmap", texture.where, bitmap=pixels, raw=True, **common)

    def _pixels(self, picture: Picture) -> np.ndarray:
        pixels = picture.scale * read_image(picture.path, picture.where, picture.raw)
        pixels = np.maximum(1 - pixels, 0) if picture.inverted else pixels
        clipped: np.ndarray = np.clip(pixels * np.asarray(picture.factor, np.float32), 0, 1)
        return clipped

    def _texture(self, key: tuple[str, str]) -> Texture:
        if key not in self._made:
            thing = self.context.read.textures[key]
            parameters = thing.parameters()
            if self._depth >= MAX_DEPTH:
                parameters.fail("it is made of itself")
            self._depth += 1
            made = self._build(thing, parameters, key[0])
            self._depth -= 1
            parameters.finish()
            self._made[key] = made
        return self._made[key]

    def _build(self, thing: Thing, parameters: Parameters, kind: str) -> Texture:
        space = thing.state.space
        if thing.type == "constant":
            found = parameters.get("value")
            if found is None:
                return np.ones(3)
            return colour(found, space, self.context.folders, bounded=kind == "spectrum")
        if thing.type == "imagemap":
            return self._picture(thing, parameters)
        if thing.type == "checkerboard":
            if parameters.integer("dimension", 2) != 2:
                parameters.refuse("a checkerboard in space", parameters.place("dimension"))
            tiles = [
                self.of(parameters, name, default, space, kind)
                for name, default in (("tex1", 1), ("tex2", 0))
            ]
            if not all(isinstance(tile, np.ndarray) for tile in tiles):
                parameters.refuse("a checkerboard of textures")
            return Board((tiles[0], tiles[1]), _to_uv(parameters), thing.where)  # type: ignore[arg-type]
        if thing.type == "scale":
            texture = self.of(parameters, "tex", 1.0, space, kind)
            given = parameters.get("scale")
            by = self.of(
                parameters, "scale", 1.0, space, "float" if given and given.type == "float" else kind
            )
            return self._product(texture, by, parameters)
        if thing.type == "mix":
            first, second = (
                self.of(parameters, "tex1", 0, space, kind),
                self.of(parameters, "tex2", 1, space, kind),
            )
            amount = self.constant(parameters, "amount", 0.5)
            if isinstance(first, np.ndarray) and isinstance(second, np.ndarray):
                mixed: np.ndarray = (1 - amount) * first + amount * second
                return mixed
            if amount in (0, 1):
                return second if amount else first
        parameters.refuse(
            f"such a {thing.type} texture",
            hint="supported: constant, imagemap, checkerboard, scale, mix of constants",
        )

    def _product(self, texture: Texture, by: Texture, parameters: Parameters) -> Texture:
        if isinstance(texture, np.ndarray) and not isinstance(by, np.ndarray):
            texture, by = by, texture
        if not isinstance(by, np.ndarray):
            parameters.refuse("a product of two textures that vary")
        if isinstance(texture, np.ndarray):
            return texture * by
        if isinstance(texture, Board):
            return replace(texture, colors=(texture.colors[0] * by, texture.colors[1] * by))
        return replace(texture, factor=tuple((np.array(texture.factor) * by).tolist()))

    def _picture(self, thing: Thing, parameters: Parameters) -> Picture:
        path = find(parameters.string("filename", ""), self.context.folders, parameters.place("filename"))
        encoding = parameters.string("encoding", "sRGB" if path.suffix.lower() != ".exr" else "linear")
        if encoding not in ("sRGB", "linear"):
            what = f"pictures of the encoding '{encoding[:40]}' are taken as sRGB"
            self.context.say(what, parameters.place("encoding"))
        smooth = parameters.string("filter", "bilinear", ("bilinear", "point", "trilinear", "ewa", "EWA"))
        parameters.ignore("maxanisotropy")
        wrap = parameters.string("wrap", "repeat", tuple(_WRAPS))
        if wrap == "black":
            self.context.say("pictures with black round them are taken as clamped", parameters.place("wrap"))
        return Picture(
            str(path),
            FLIPPED @ _to_uv(parameters),
            "nearest" if smooth == "point" else "bilinear",
            _WRAPS[wrap],
            encoding == "linear",
            thing.where,
            parameters.boolean("invert", False),
            parameters.number("scale", 1.0, 0.0),
        )


def _to_uv(parameters: Parameters) -> np.ndarray:
    """The mapping of (u, v), 3x3."""
    parameters.string("mapping", "uv", ("uv",))
    scales = parameters.number("uscale", 1.0), parameters.number("vscale", 1.0)
    offsets = parameters.number("udelta", 0.0), parameters.number("vdelta", 0.0)
    return np.array([[scales[0], 0, offsets[0]], [0, scales[1], offsets[1]], [0, 0, 1]])
