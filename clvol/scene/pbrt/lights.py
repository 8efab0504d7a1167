"""Lights: what pbrt's give as scale, power, illuminance and spectrum, as Mitsuba's emitters."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from clvol.base.rows import bands
from clvol.scene.image import read_image
from clvol.scene.lookup import find
from clvol.scene.pbrt.colours import light_colour, white
from clvol.scene.vocabulary import did_you_mean, join_hints, listed

if TYPE_CHECKING:
    from collections.abc import Callable

    from clvol.scene.nodes import Node
    from clvol.scene.pbrt.context import Context
    from clvol.scene.pbrt.parameters import Parameters
    from clvol.scene.pbrt.statements import Thing


class Lights:
    """The lights of a scene."""

    def __init__(self, context: Context) -> None:
        self.context = context

    def node(self, thing: Thing) -> Node:
        """A light that is no surface."""
        parameters = thing.parameters()
        builder = _BUILDERS.get(thing.type)
        if builder is None:
            hint = join_hints(did_you_mean(thing.type, _BUILDERS), f"supported: {listed(_BUILDERS)}")
            parameters.refuse(f"the light '{thing.type[:60]}'", hint=hint)
        made = builder(self, thing, parameters)
        parameters.finish()
        return made

    def area(self, thing: Thing) -> Node:
        """What a shape emits."""
        parameters = thing.parameters()
        if thing.type != "diffuse":
            parameters.refuse(f"the area light '{thing.type[:60]}'", hint="supported: diffuse")
        for name in ("filename", "power"):
            if parameters.get(name) is not None:
                parameters.refuse(f"'{name}' of an area light", parameters.place(name), "give L")
        if parameters.boolean("twosided", False):
            parameters.fail("an area light cannot emit on both sides", parameters.place("twosided"))
        radiance = self._colour(thing, parameters, "L")
        parameters.finish()
        return self.context.node(
            "emitter", "area", thing.where, radiance=self.context.rgb(radiance, thing.where)
        )

    # -- the lights ----------------------------------------------------------------------------------

    def distant(self, thing: Thing, parameters: Parameters) -> Node:
        """Parallel light from `from` to `to`."""
        direction = self._direction(thing, parameters)
        illuminance = parameters.number("illuminance", -1.0)
        irradiance = self._colour(thing, parameters, "L") * (illuminance if illuminance > 0 else 1)
        value = self.context.rgb(irradiance, thing.where)
        return self.context.node("emitter", "directional", thing.where, irradiance=value, direction=direction)

    def point(self, thing: Thing, parameters: Parameters) -> Node:
        """A point light; `power` is that of its luminance in all directions together."""
        power = parameters.number("power", -1.0)
        intensity = self._colour(thing, parameters, "I") * (power / (4 * np.pi) if power > 0 else 1)
        place = _moved(thing, parameters.point("from", (0, 0, 0)))
        value = self.context.rgb(intensity, thing.where)
        return self.context.node("emitter", "point", thing.where, intensity=value, position=place.tolist())

    def spot(self, thing: Thing, parameters: Parameters) -> Node:
        """A spot, whose edge Mitsuba lets fall in a straight line with the angle."""
        cone = parameters.number("coneangle", 30.0, 0.0, 180.0)
        beam = max(cone - parameters.number("conedeltaangle", 5.0, 0.0), 0.0)
        inner, outer = np.cos(np.deg2rad([beam, cone]))
        power = parameters.number("power", -1.0)
        solid = 2 * np.pi * ((1 - inner) + (inner - outer) / 2)
        intensity = self._colour(thing, parameters, "I") * (power / solid if power > 0 and solid > 0 else 1)
        matrix = np.eye(4)
        matrix[:3, :3] = _frame(self._direction(thing, parameters))
        matrix[:3, 3] = _moved(thing, parameters.point("from", (0, 0, 0)))
        if beam < cone:
            self.context.say("a spot's edge is taken as Mitsuba's, linear in the angle", thing.where)
        return self.context.node(
            "emitter",
            "spot",
            thing.where,
            intensity=self.context.rgb(intensity, thing.where),
            cutoff_angle=cone,
            beam_width=beam,
            to_world=matrix,
        )

    def infinite(self, thing: Thing, parameters: Parameters) -> Node:
        """An environment of one colour, or a picture of the sphere of equal area (Clarberg 2008)."""
        if parameters.get("portal") is not None:
            parameters.refuse("a portal", parameters.place("portal"), "leave it out")
        illuminance = parameters.number("illuminance", -1.0)
        if parameters.get("filename") is None:
            radiance = self._colour(thing, parameters, "L") * (illuminance / np.pi if illuminance > 0 else 1)
            value = self.context.rgb(radiance, thing.where)
            return self.context.node("emitter", "constant", thing.where, radiance=value)
        if parameters.get("L") is not None:
            parameters.fail("give either L or a filename", parameters.place("L"))
        where = parameters.place("filename")
        path = find(parameters.string("filename", ""), self.context.folders, where)
        image = read_image(str(path), where)
        if image.shape[0] != image.shape[1]:
            what = f"'{path}' is {image.shape[1]} x {image.shape[0]}, and an environment is a square"
            parameters.fail(what, where, "pbrt's imgtool makes one of a picture of latitudes and longitudes")
        factor = parameters.number("scale", 1.0, 0.0) * self.context.exposure
        if illuminance > 0:
            lit = _illuminance(image)
            if lit <= 0:
                parameters.fail(
                    "a picture without light above has no illuminance", parameters.place("illuminance")
                )
            factor *= illuminance / lit
        matrix = np.eye(4)
        matrix[:3, :3] = thing.state.ctm[:3, :3]
        bitmap = latitudes_and_longitudes(image)
        return self.context.node("emitter", "envmap", where, bitmap=bitmap, scale=factor, to_world=matrix)

    # -- pieces --------------------------------------------------------------------------------------

    def _colour(self, thing: Thing, parameters: Parameters, name: str) -> np.ndarray:
        """A light's colour times its scale and the film's exposure, float64 (3,)."""
        found = parameters.get(name, "rgb", "spectrum", "blackbody")
        space = thing.state.space
        shown = white(space) if found is None else light_colour(found, space, self.context.folders)
        return shown * parameters.number("scale", 1.0, 0.0) * self.context.exposure

    def _direction(self, thing: Thing, parameters: Parameters) -> np.ndarray:
        """Unit vector from `from` to `to` in the world."""
        way = parameters.point("to", (0, 0, 1)) - parameters.point("from", (0, 0, 0))
        moved = thing.state.ctm[:3, :3] @ way
        length = np.linalg.norm(moved)
        if not 0 < length < np.inf:
            parameters.fail("from and to are the same point")
        unit: np.ndarray = moved / length
        return unit


_BUILDERS: dict[str, Callable[[Lights, Thing, Parameters], Node]] = {
    "distant": Lights.distant,
    "point": Lights.point,
    "spot": Lights.spot,
    "infinite": Lights.infinite,
}


def _moved(thing: Thing, point: np.ndarray) -> np.ndarray:
    moved: np.ndarray = thing.state.ctm[:3, :3] @ point + thing.state.ctm[:3, 3]
    return moved


def _frame(z: np.ndarray) -> np.ndarray:
    """A rotation of +z onto the unit vector `z`."""
    x = np.cross([0.0, 1, 0] if abs(z[1]) < 0.9 else [1.0, 0, 0], z)
    x /= np.linalg.norm(x)
    return np.stack([x, np.cross(z, x), z], axis=1)


def latitudes_and_longitudes(square: np.ndarray) -> np.ndarray:
    """Mitsuba's picture, float32 (n, 2n, 3), of an environment on a square, (n, n, 3), its z axis as it is.

    Each texel is the mean of four places in it.
    """
    n = len(square)
    height, width = max(n, 3), max(2 * n, 4)
    made = np.empty((height, width, 3), np.float32)
    for rows in bands(height, width):
        row = np.arange(height)[rows]
        total = np.zeros((len(row), width, 3), np.float64)
        for down, right in ((-0.25, 0.25), (-0.25, 0.75), (0.25, 0.25), (0.25, 0.75)):
            theta = np.pi * np.clip(row + down, 0, height - 1)[:, None] / (height - 1)
            phi = 2 * np.pi * (np.arange(width) + right)[None] / width
            x, z = np.sin(theta) * np.sin(phi), -np.sin(theta) * np.cos(phi)
            at = square_place(x, np.broadcast_to(np.cos(theta), x.shape), z)
            u, v = (np.minimum((one * n).astype(int), n - 1) for one in at)
            total += square[v, u]
        made[rows] = total / 4
    return made


def square_place(x: np.ndarray, y: np.ndarray, z: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Where a direction is in the square (u, v): rings of equal area about z, the lower half folded out."""
    radius = np.sqrt(np.maximum(1 - np.abs(z), 0))
    phi = np.arctan2(np.abs(y), np.abs(x)) * (2 / np.pi)
    v = phi * radius
    u = radius - v
    below = z < 0
    u, v = np.where(below, 1 - v, u), np.where(below, 1 - u, v)
    return (np.copysign(u, x) + 1) / 2, (np.copysign(v, y) + 1) / 2


def _illuminance(square: np.ndarray) -> float:
    """What the upper half of an environment sheds on the ground; as in pbrt, a texel counts half its size."""
    n = len(square)
    side = 2 * (np.arange(n) + 0.5) / n - 1
    distance = 1 - np.abs(side)[None] - np.abs(side)[:, None]
    height = np.where(distance > 0, 1 - (1 - distance) ** 2, 0.0)
    return float((square @ [0.2126, 0.7152, 0.0722] * height).sum() * 2 * np.pi / n**2)
