"""The statements of a .pbrt file in their order, under the graphics state, as things for `translation`."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np

from clvol.errors import SceneError, shortened
from clvol.scene.lookup import find
from clvol.scene.pbrt.colours import SPACES
from clvol.scene.pbrt.options import take_option
from clvol.scene.pbrt.parameters import read_parameters
from clvol.scene.pbrt.statements import Read, State, Thing
from clvol.scene.pbrt.tokens import Token, Tokens
from clvol.scene.transforms import look_at, rotate, scale, translate
from clvol.scene.vocabulary import did_you_mean, join_hints, listed

if TYPE_CHECKING:
    from pathlib import Path

MAX_STACK = 10_000
MAX_SHAPES = 1_000_000
_WORLD, _BEGINS = "world", "WorldBegin"
_BLOCKS = ("AttributeBegin", "TransformBegin")
_TARGETS = ("shape", "light", "material", "medium", "texture")
_OPTIONS = ("Camera", "Film", "Sampler", "Integrator", "PixelFilter", "Accelerator")
_BEFORE_THE_WORLD = (*_OPTIONS, "TransformTimes", "WorldBegin")
_ANYWHERE = (
    *("LookAt", "Rotate", "Scale", "Translate", "Transform", "ConcatTransform", "Identity"),
    *("CoordinateSystem", "CoordSysTransform", "ActiveTransform", "ColorSpace", "Attribute"),
    *("MediumInterface", "MakeNamedMedium", "Option", "Include"),
)


class Directives:
    """Reads a file; the result is in `read`."""

    def __init__(self, path: Path) -> None:
        self.tokens = Tokens(path)
        self.folders = [path.parent.absolute()]  # names that are found are found again as they are
        self.read = Read()
        self.state = State()
        self._stack: list[tuple[str, State, str]] = []
        self._systems: dict[str, np.ndarray] = {}
        self._objects: dict[str, list[tuple[Thing, tuple[np.ndarray, ...]]]] = {}
        self._object: str | None = None
        self._imports: list[tuple[int, State]] = []

    def run(self) -> Read:
        """Read all statements.

        Raises
        ------
        SceneError
            A statement that is unknown, or stands where it cannot.
        """
        while (token := self.tokens.next()) is not None:
            while self._imports and self.tokens.depth <= self._imports[-1][0]:
                self.state = self._imports.pop()[1]
            if token.kind != "word":
                raise SceneError(f"expected a statement, got '{shortened(token.text, 60)}'", token.where)
            handler = _HANDLERS.get(token.text)
            if token.text == "WorldEnd":
                hint = "`pbrt --upgrade FILE` writes one of PBRT-v4"
                raise SceneError("WorldEnd is of scenes before PBRT-v4", token.where, hint)
            if handler is None:
                hint = join_hints(did_you_mean(token.text, _HANDLERS), f"supported: {listed(_HANDLERS)}")
                raise SceneError(f"unknown statement '{shortened(token.text, 60)}'", token.where, hint)
            self._check_place(token)
            handler(self, token)
        if self._stack:
            raise SceneError(f"{self._stack[-1][0]} without its end", self._stack[-1][2])
        if self._object is not None:
            raise SceneError(f"ObjectBegin '{shortened(self._object, 60)}' without its end", self.tokens.end)
        if _WORLD not in self._systems:
            raise SceneError(
                "a scene without WorldBegin", self.tokens.end, "the file is empty, or was cut short"
            )
        return self.read

    def _check_place(self, token: Token) -> None:
        """SceneError for what stands on the wrong side of WorldBegin: pbrt refuses it."""
        if token.text in _ANYWHERE:
            return
        begun = _WORLD in self._systems
        if begun and token.text in _BEFORE_THE_WORLD:
            what = "a second WorldBegin" if token.text == _BEGINS else f"{token.text} after {_BEGINS}"
            raise SceneError(what, token.where, f"it stands before {_BEGINS}, with the camera's transform")
        if not begun and token.text not in _BEFORE_THE_WORLD:
            raise SceneError(f"{token.text} before {_BEGINS}", token.where, "it is of the world")

    # -- pieces --------------------------------------------------------------------------------------

    def text(self, token: Token) -> str:
        """The quoted string that follows."""
        found = self.tokens.next()
        if found is not None and isinstance(found.values, list) and len(found.values) == 1:
            return found.values[0]
        if found is None or found.kind != "string":
            raise SceneError(f"{token.text} takes a quoted string", token.where)
        return found.text

    def numbers(self, token: Token, count: int) -> np.ndarray:
        """So many numbers that follow, in brackets or not."""
        found = np.empty(0)
        while len(found) < count:
            part = self.tokens.next()
            if part is None or not isinstance(part.values, np.ndarray) or not len(part.values):
                raise SceneError(f"{token.text} takes {count} numbers", token.where)
            found = np.concatenate([found, part.values])
        if len(found) > count:
            raise SceneError(f"{token.text} takes {count} numbers, got {len(found)}", token.where)
        return found

    def thing(self, token: Token, type: str) -> Thing:
        """What a statement makes, with the parameters that follow."""
        return Thing(token.text, type, read_parameters(self.tokens), token.where, self.state)

    def _push(self, token: Token) -> None:
        if len(self._stack) >= MAX_STACK:
            raise SceneError(f"more than {MAX_STACK} {token.text} in each other", token.where)
        self._stack.append((token.text, self.state, token.where))

    def _pop(self, token: Token) -> State:
        begins = ("ObjectBegin",) if token.text == "ObjectEnd" else _BLOCKS
        if not self._stack or self._stack[-1][0] not in begins:
            begin = token.text.replace("End", "Begin")
            raise SceneError(f"{token.text} without its {begin}", token.where)
        return self._stack.pop()[1]

    # -- transforms ----------------------------------------------------------------------------------

    def transform(self, token: Token) -> None:
        """LookAt, Rotate, Scale, …: multiplied to the current transform, or in its place."""
        try:
            with np.errstate(over="raise", invalid="raise"):
                matrix = self._matrix(token)
                replaces = token.text in ("Identity", "Transform", "CoordSysTransform")
                ctm = matrix if replaces else self.state.ctm @ matrix
        except (SceneError, np.linalg.LinAlgError, FloatingPointError) as error:
            if isinstance(error, SceneError) and error.where:
                raise
            what = error.what if isinstance(error, SceneError) else "a transform without an inverse"
            raise SceneError(what, token.where) from None
        if self.state.starting:
            self.state = replace(self.state, ctm=ctm)
        else:
            self.read.moving = self.read.moving or token.where

    def _matrix(self, token: Token) -> np.ndarray:
        if token.text == "Identity":
            return np.eye(4)
        if token.text == "CoordSysTransform":
            name = self.text(token)
            if name not in self._systems:
                hint = f"known: {listed(self._systems)}"
                raise SceneError(f"unknown coordinate system '{shortened(name, 60)}'", token.where, hint)
            return self._systems[name]
        counts = {
            "LookAt": 9,
            "Rotate": 4,
            "Scale": 3,
            "Translate": 3,
            "Transform": 16,
            "ConcatTransform": 16,
        }
        values = self.numbers(token, counts[token.text])
        if token.text == "LookAt":
            # the columns are pbrt's right, up and forward: by numbers those of Mitsuba's left, up, forward
            inverse: np.ndarray = np.linalg.inv(look_at(*values.reshape(3, 3)))
            return inverse
        if token.text == "Rotate":
            return rotate(values[1:], values[0])
        if token.text in ("Scale", "Translate"):
            return scale(values) if token.text == "Scale" else translate(values)
        return values.reshape(4, 4).T

    def coordinate_system(self, token: Token) -> None:
        """Give the current transform a name."""
        self._systems[self.text(token)] = self.state.ctm

    def active_transform(self, token: Token) -> None:
        """Which moments of the exposure transforms are for: the first is what is rendered."""
        which = self.tokens.next()
        if which is None or which.text not in ("StartTime", "EndTime", "All"):
            raise SceneError("ActiveTransform takes StartTime, EndTime or All", token.where)
        self.state = replace(self.state, starting=which.text != "EndTime")

    # -- blocks --------------------------------------------------------------------------------------

    def begin(self, token: Token) -> None:
        """AttributeBegin, TransformBegin."""
        self._push(token)

    def end(self, token: Token) -> None:
        """AttributeEnd, and TransformEnd, which PBRT-v4 takes for it: everything as it was."""
        self.state = self._pop(token)

    def world_begin(self, token: Token) -> None:
        """What follows is the scene, in world space."""
        self.state = replace(self.state, ctm=np.eye(4), starting=True)
        self._systems[_WORLD] = np.eye(4)

    def object_begin(self, token: Token) -> None:
        """What follows is a template that stands nowhere yet."""
        if self._object is not None:
            raise SceneError("ObjectBegin in an object", token.where)
        name = self.text(token)
        if name in self._objects:
            raise SceneError(f"the object '{shortened(name, 60)}' is given twice", token.where)
        self._push(token)
        self._object = name
        self._objects[name] = []

    def object_end(self, token: Token) -> None:
        """The end of a template."""
        self.state = self._pop(token)
        self._object = None

    def object_instance(self, token: Token) -> None:
        """A template's shapes, under the current transform."""
        name = self.text(token)
        if self._object is not None:
            raise SceneError("ObjectInstance in an object", token.where)
        if name not in self._objects:
            hint = join_hints(did_you_mean(name, self._objects), f"known: {listed(self._objects)}")
            raise SceneError(f"unknown object '{shortened(name, 60)}'", token.where, hint)
        self._add((thing, (self.state.ctm,)) for thing, _ in self._objects[name])

    def _add(self, shapes: Any) -> None:
        self.read.shapes.extend(shapes)
        if len(self.read.shapes) > MAX_SHAPES:
            raise SceneError(f"the scene has more than {MAX_SHAPES} shapes", self.tokens.end)

    # -- state ---------------------------------------------------------------------------------------

    def attribute(self, token: Token) -> None:
        """Parameters for all statements of a kind that follow."""
        target = self.text(token)
        if target not in _TARGETS:
            raise SceneError(f"Attribute is for {listed(_TARGETS)}", token.where)
        added = tuple((target, parameter) for parameter in reversed(read_parameters(self.tokens)))
        defaults = (*added, *self.state.defaults)
        if len(defaults) > MAX_STACK:
            raise SceneError("too many attributes", token.where)
        self.state = replace(self.state, defaults=defaults)

    def reverse(self, token: Token) -> None:
        """Normals to the other side."""
        self.state = replace(self.state, reverse=not self.state.reverse)

    def color_space(self, token: Token) -> None:
        """The space of the rgb values that follow."""
        name = self.text(token)
        if name not in SPACES:
            hint = f"supported: {listed(SPACES)}"
            raise SceneError(f"unknown colour space '{shortened(name, 60)}'", token.where, hint)
        self.state = replace(self.state, space=name)

    def medium_interface(self, token: Token) -> None:
        """The media behind and before the surfaces that follow; one name is for both sides."""
        inside = outside = self.text(token)
        following = self.tokens.next()
        if following is not None and following.kind == "string":
            outside = following.text
        elif following is not None:
            self.tokens.back(following)
        self.state = replace(self.state, inside=inside, outside=outside)

    # -- things --------------------------------------------------------------------------------------

    def option(self, token: Token) -> None:
        """Camera, Film and the others that a scene has once."""
        made = self.thing(token, self.text(token))
        if token.text == "Camera":
            try:
                self._systems["camera"] = np.linalg.inv(self.state.ctm)
            except np.linalg.LinAlgError:
                raise SceneError("the camera's transform has no inverse", token.where) from None
        self.read.options[token.text] = made

    def shape(self, token: Token) -> None:
        """A shape of the scene, or of the template that is open."""
        made = self.thing(token, self.text(token))
        if self._object is None:
            self._add([(made, ())])
        else:
            self._objects[self._object].append((made, ()))

    def light(self, token: Token) -> None:
        """A light that is no surface."""
        self.read.lights.append(self.thing(token, self.text(token)))

    def area_light(self, token: Token) -> None:
        """What the shapes that follow emit."""
        self.state = replace(self.state, area_light=self.thing(token, self.text(token)))

    def material(self, token: Token) -> None:
        """What the shapes that follow are made of."""
        self.state = replace(self.state, material=self.thing(token, self.text(token)))

    def named_material(self, token: Token) -> None:
        """The same, by name."""
        self.state = replace(self.state, material=self.text(token))

    def make_named(self, token: Token) -> None:
        """A material or a medium with a name; its type is a parameter."""
        name = self.text(token)
        table = self.read.materials if token.text == "MakeNamedMaterial" else self.read.media
        made = self.thing(token, name)
        if name in table:
            what = f"{token.text} '{shortened(name, 60)}' is given twice"
            raise SceneError(what, token.where, f"first at {table[name].where}")
        type = next((one.texts[0] for one in made.given if one.name == "type" and one.texts), "")
        table[name] = replace(made, type=type)

    def texture(self, token: Token) -> None:
        """A texture: its name, whether it is of floats or colours, and what it is."""
        name, kind, type = self.text(token), self.text(token), self.text(token)
        if kind not in ("float", "spectrum"):
            raise SceneError("a texture is of type float or spectrum", token.where)
        if (kind, name) in self.read.textures:
            raise SceneError(f"the texture '{shortened(name, 60)}' is given twice", token.where)
        self.read.textures[kind, name] = self.thing(token, type)

    # -- others --------------------------------------------------------------------------------------

    def include(self, token: Token) -> None:
        """Include goes on with a file; Import does, and then with the state as it was."""
        name = self.text(token)
        path = find(name, self.folders, token.where)
        if token.text == "Import":
            self._imports.append((self.tokens.depth, self.state))
        self.tokens.include(path, token.where)

    def set_option(self, token: Token) -> None:
        """Option: a name and a value."""
        name = self.text(token)
        take_option(self.read, name, self.tokens.next(), token.where)

    def skip_numbers(self, token: Token) -> None:
        """TransformTimes."""
        self.numbers(token, 2)


Handler = Callable[[Directives, Token], None]
_HANDLERS: dict[str, Handler] = {
    **dict.fromkeys(_OPTIONS, Directives.option),
    **dict.fromkeys(("LookAt", "Rotate", "Scale", "Translate", "Transform"), Directives.transform),
    **dict.fromkeys(("ConcatTransform", "Identity", "CoordSysTransform"), Directives.transform),
    **dict.fromkeys(_BLOCKS, Directives.begin),
    **dict.fromkeys(("Include", "Import"), Directives.include),
    **dict.fromkeys(("MakeNamedMaterial", "MakeNamedMedium"), Directives.make_named),
    "CoordinateSystem": Directives.coordinate_system,
    "ActiveTransform": Directives.active_transform,
    "TransformTimes": Directives.skip_numbers,
    **dict.fromkeys(("AttributeEnd", "TransformEnd"), Directives.end),
    "WorldBegin": Directives.world_begin,
    "ObjectBegin": Directives.object_begin,
    "ObjectEnd": Directives.object_end,
    "ObjectInstance": Directives.object_instance,
    "Attribute": Directives.attribute,
    "ReverseOrientation": Directives.reverse,
    "ColorSpace": Directives.color_space,
    "MediumInterface": Directives.medium_interface,
    "Shape": Directives.shape,
    "LightSource": Directives.light,
    "AreaLightSource": Directives.area_light,
    "Material": Directives.material,
    "NamedMaterial": Directives.named_material,
    "Texture": Directives.texture,
    "Option": Directives.set_option,
}
