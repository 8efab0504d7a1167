"""A scene with its knobs: which of its parameters somebody may turn by hand, and how they stood at first."""

from __future__ import annotations

import shlex
from dataclasses import dataclass, field
from itertools import chain
from typing import TYPE_CHECKING, Any

import numpy as np

from clvol.errors import OptionError
from clvol.scene.assignments import value_of
from clvol.scene.extents import shape_bounds
from clvol.scene.parameters import traverse
from clvol.scene.records import Perspective
from clvol.scene.transforms import rotate
from clvol.scene.views import viewed
from clvol.staging.framing import Axes
from clvol.volumes.transfer import transfer_of_points

if TYPE_CHECKING:
    from collections.abc import Iterable, Sequence

    from clvol.scene.assignments import Assignment
    from clvol.scene.records import Scene
    from clvol.viewer.wish import Wish

_ENDINGS = {
    "density": "_medium.scale",
    "glow": ".emission_scale",
    "anisotropy": ".phase_function.g",
    "opacity": "_medium.opacity",
}
"""How the names of knobs' parameters end."""
_COLOURS = 33
"""Of a transfer function, that a page is told."""


@dataclass(eq=False)
class Subject:
    """A scene, changed by wishes.

    Parameters
    ----------
    words : the command line that renders it as it is, without the output.
    sensor, size : which sensor sees it, and in how many pixels; (0, 0): those of its film.
    """

    scene: Scene
    words: Sequence[str] = ("clvol", "render", "SCENE.xml")
    sensor: int = 0
    size: tuple[int, int] = (0, 0)
    _first: dict[str, Any] = field(default_factory=dict, init=False)

    def __post_init__(self) -> None:
        seen = viewed(self.scene, self.sensor)
        if self.sensor >= len(self.scene.sensors):
            what = f"the viewer moves sensors of the scene, and sensor {self.sensor} is inside of a batch"
            raise OptionError(what, self.scene.source, "render it, or add a perspective sensor")
        if not isinstance(seen.sensor, Perspective):
            what = f"the viewer moves perspective cameras, and sensor {self.sensor} is another"
            raise OptionError(what, self.scene.source, "render it, or add a perspective sensor")
        if not any(self.size):
            self.size = seen.film.window[2:]
        seen = viewed(self.scene, self.sensor, self.size)
        self.parameters = traverse(self.scene)
        cameras = [name for name in self.parameters if name.endswith(".film.size")]
        self._camera = cameras[self.sensor].removesuffix("film.size") + "to_world"
        self._knobs = {
            knob: [name for name in self.parameters if name.endswith(ending)]
            for knob, ending in _ENDINGS.items()
        }
        self._sun = next((name for name in self.parameters if name.endswith(".direction")), None)
        self._turned = [name.removesuffix("data") + "to_world" for name in self._environments()]
        names = [self._camera, *chain(*self._knobs.values()), *self._turned, *filter(None, [self._sun])]
        self._first = {name: self.parameters[name] for name in names}
        self.axes = _axes(seen.camera.to_world)

    def _environments(self) -> Iterable[str]:
        """Pictures of light from infinity: they can be turned."""
        shapes = {name.removesuffix(".data") for name in self.parameters if name.count(".") == 1}
        return [f"{one}.data" for one in shapes if f"{one}.data" in self.parameters]

    def described(self) -> dict[str, Any]:
        """What a page must know of it at first."""
        eye, target, up = self._view()
        first = self._first
        found: dict[str, Any] = {
            "size": self.size,
            "camera": [*eye, *target, *up],
            "x_fov": self.parameters[self._camera.removesuffix("to_world") + "x_fov"],
            "axes": {name: getattr(self.axes, name).tolist() for name in ("up", "front", "right")},
            "knobs": [knob for knob, names in self._knobs.items() if names],
            "environment": bool(self._turned),
        }
        if names := self._knobs["anisotropy"]:
            found["anisotropy"] = first[names[0]]
        if names := self._knobs["opacity"]:
            found["opacity"] = first[names[0]]
            found["colours"] = self._colours(names[0])
        if self._sun:
            found["sun"] = _angles(self.axes, -np.array(first[self._sun]))
        return found

    def _colours(self, opacity: str) -> list[list[float]]:
        """Linear colours of values, evenly over those of the transfer function."""
        name = opacity.removesuffix("opacity") + "albedo"
        values = [value for value, _ in self._first[opacity]]
        if name not in self.parameters:
            return []
        albedo = transfer_of_points(self.parameters[name])
        colours: list[list[float]] = albedo(np.linspace(values[0], values[-1], _COLOURS)).tolist()
        return colours

    def _view(self) -> tuple[list[float], ...]:
        """Origin, target and up of the camera as it stood: it turns about the middle of the media."""
        matrix = np.asarray(self._first[self._camera])
        eye, forward, up = matrix[:3, 3], matrix[:3, 2], matrix[:3, 1]
        centre, radius = _middle(self.scene)
        ahead = float((centre - eye) @ forward)
        target = eye + forward * (ahead if ahead > 1e-3 * radius else radius)
        return eye.tolist(), target.tolist(), up.tolist()

    def assignments(self, wish: Wish) -> list[Assignment]:
        """The parameters that the wish changes, as --set takes them."""
        found: list[Assignment] = []
        if wish.camera is not None:
            found.append((self._camera, _text(wish.camera)))
        for knob in ("density", "glow"):
            if (factor := getattr(wish, knob)) != 1:
                found += [(name, _text(np.ravel(self._first[name]) * factor)) for name in self._knobs[knob]]
        if wish.anisotropy is not None:
            found += [(name, _text([wish.anisotropy])) for name in self._knobs["anisotropy"]]
        if wish.opacity is not None:
            points = ", ".join(f"{_plain(value)}: {_plain(number)}" for value, number in wish.opacity)
            found += [(name, points) for name in self._knobs["opacity"]]
        if self._sun and (wish.azimuth is not None or wish.elevation is not None):
            azimuth, elevation = _angles(self.axes, -np.array(self._first[self._sun]))
            azimuth = azimuth if wish.azimuth is None else wish.azimuth
            elevation = elevation if wish.elevation is None else wish.elevation
            found.append((self._sun, _text(-self.axes.towards(azimuth, elevation))))
        if wish.turn:
            about = rotate(self.axes.up, wish.turn)
            found += [(name, _text(np.ravel(about @ self._first[name]))) for name in self._turned]
        return found

    def turn(self, wish: Wish) -> None:
        """Change the scene; OptionError or SceneError, and the scene as it was, where that cannot be."""
        values = {name: value_of(name, text) for name, text in self.assignments(wish)}
        self.parameters.update(self._first | values)

    def command(self, wish: Wish, spp: int) -> str:
        """The command that renders the same picture."""
        words = [*self.words, "-o", "view.png", "--size", "x".join(map(str, self.size)), "--spp", str(spp)]
        words += [] if wish.exposure == 0 else ["--exposure", _plain(wish.exposure)]
        words += ["--denoise"] if wish.denoise else []
        for family in ("technique", "transmittance"):
            name = getattr(wish, family)
            words += [] if name == "auto" else [f"--{family}", name]
        for name, text in self.assignments(wish):
            words += ["--set", f"{name}={text}"]
        return shlex.join(words)


def _plain(number: float | str) -> str:
    return number if isinstance(number, str) else f"{number:.8g}"


def _text(numbers: Iterable[float]) -> str:
    return ",".join(f"{float(one):.8g}" for one in np.asarray(numbers, float) + 0.0)


def _axes(to_world: np.ndarray) -> Axes:
    """Directions of the world as a camera sees it: what of its axes is nearest to the camera's up is up."""
    above = to_world[:3, 1]
    axis = int(np.argmax(np.abs(above)))
    up = np.zeros(3)
    up[axis] = 1.0 if above[axis] > 0 else -1.0
    front = np.array([(0.0, 1.0, 0.0), (0.0, 0.0, 1.0), (0.0, -1.0, 0.0)][axis])
    return Axes(up, front, np.cross(up, front))


def _angles(axes: Axes, direction: np.ndarray) -> tuple[float, float]:
    """Azimuth and elevation of a direction, in degrees."""
    x, y, z = (float(direction @ axis) for axis in (axes.front, axes.right, axes.up))
    return float(np.degrees(np.arctan2(y, x))), float(np.degrees(np.arctan2(z, np.hypot(x, y))))


def _middle(scene: Scene) -> tuple[np.ndarray, float]:
    """Centre (3,) and radius of the media, or of everything where there are none; of the origin at worst."""
    shapes = [shape for shape in scene.shapes if shape.interior is not None] or list(scene.shapes)
    if not shapes:
        return np.zeros(3), 1.0
    boxes = [shape_bounds(shape) for shape in shapes]
    lower, upper = (np.array(corners) for corners in zip(*boxes, strict=True))
    low, high = lower.min(axis=0), upper.max(axis=0)
    return (low + high) / 2, max(float(np.linalg.norm(high - low)) / 2, 1e-9)
