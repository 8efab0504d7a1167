"""Typed access to one node's parameters: reading a parameter is what declares it as supported.

A plugin's function asks for every parameter it knows; then `clvol.scene.building` notes what is left over.
"""

from __future__ import annotations

import logging
from numbers import Integral, Real
from typing import TYPE_CHECKING, Any, NoReturn

import numpy as np

from clvol.base.masks import as_array, masked_count
from clvol.errors import SceneError, shown
from clvol.scene import spectra
from clvol.scene.faults import UnsupportedError
from clvol.scene.lookup import find
from clvol.scene.nodes import NAMELESS, Node
from clvol.scene.old_names import NOT_HERE
from clvol.scene.records import SpectrumColor
from clvol.scene.spectrum_files import read_spectrum
from clvol.scene.transforms import as_matrix
from clvol.scene.vocabulary import did_you_mean, join_hints, listed

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import ArrayLike

    from clvol.scene.library import Library
    from clvol.scene.records import Spectrum

log = logging.getLogger("clvol")

ROUNDING = 1e-6
"""Share by which colours and volumes may exceed their maximum: rounding of what wrote them, which is cut."""


BRIGHTEST = 1e15
"""Largest radiance: the variance of a picture has its square, times weights, and must be a float."""

BY_NAME = ("volume", "texture")
"""Kinds of plugin that stand for the value of a parameter, and are found by its name."""

_PLAIN: dict[type, Any] = {bool: (bool, np.bool_), int: Integral, float: Real, str: str}
_PLAIN_NAMES = {bool: "true or false", int: "an integer", float: "a number", str: "a string"}


class Reader:
    """The parameters of `node`, converted and checked as its plugin asks for them.

    All methods raise `SceneError` with the parameter's place when its value does not fit.
    """

    def __init__(self, node: Node, library: Library) -> None:
        self.node, self.library = node, library
        self.type = node.type
        self.kind = library.kind_of(node)
        self.failed_at = ""  # the parameter whose value the last error is about, whatever the others are
        self._asked: list[str] = []
        self._used: set[str] = set()

    # -- asking ------------------------------------------------------------------------------------

    def has(self, name: str) -> bool:
        """Whether the scene gives `name`, which is thereby known."""
        if name not in self._asked:
            self._asked.append(name)
        return name in self.node

    def fail(self, what: str, name: str = "", hint: str = "") -> NoReturn:
        """Raise a `SceneError` at parameter `name`, or at the plugin itself: a mistake."""
        raise SceneError(what, self.place(name), hint)

    def unsupported(self, what: str, name: str = "", hint: str = "") -> NoReturn:
        """As `fail`, where it is no mistake, and the parameter or plugin can be left out."""
        self.failed_at = name
        raise UnsupportedError(what, self.place(name), hint)

    def place(self, name: str) -> str:
        """Where parameter `name` was written, or without one the plugin."""
        return self.node.place(name) if name else self.node.where

    def raw(self, name: str) -> Any:
        """The value of `name` as it is given, or None."""
        return self._take(name) if self.has(name) else None

    def _take(self, name: str) -> Any:
        self._used.add(name)
        return self.node[name]

    def _wrong(self, name: str, expected: str, value: object) -> NoReturn:
        self.failed_at = name
        given = f"a '{value.type}'" if isinstance(value, Node) else shown(value)
        self.fail(f"'{name}' of {self.kind} '{self.type}' must be {expected}, got {given}", name)

    # -- plain values ------------------------------------------------------------------------------

    def number(
        self,
        name: str,
        default: float,
        minimum: float = -np.inf,
        maximum: float = np.inf,
        open_interval: bool = False,
    ) -> float:
        """A finite number in [minimum, maximum], or between them exclusively."""
        if not self.has(name):
            return default
        value = self._take(name)
        if isinstance(value, bool | np.bool_) or not isinstance(value, Real):
            self._wrong(name, "a number", value)
        number = _float(value)
        inside = minimum < number < maximum if open_interval else minimum <= number <= maximum
        if not np.isfinite(number) or not inside:
            self._wrong(name, range_in_words(minimum, maximum, open_interval), number)
        return number

    def integer(self, name: str, default: int, minimum: int, maximum: int = 2**31 - 1) -> int:
        """An integer in [minimum, maximum]."""
        if not self.has(name):
            return default
        value = self._take(name)
        if isinstance(value, bool | np.bool_) or not isinstance(value, Integral):
            self._wrong(name, "an integer", value)
        if not minimum <= int(value) <= maximum:
            self._wrong(name, f"an integer from {minimum} to {maximum}", int(value))
        return int(value)

    def boolean(self, name: str, default: bool) -> bool:
        """True or false."""
        if not self.has(name):
            return default
        value = self._take(name)
        if not isinstance(value, bool | np.bool_):
            self._wrong(name, "true or false", value)
        return bool(value)

    def string(self, name: str, default: str, choices: Sequence[str] = ()) -> str:
        """A string; one of `choices` where there are any."""
        if not self.has(name):
            return default
        value = self._take(name)
        if not isinstance(value, str):
            self._wrong(name, "a string", value)
        if choices and value not in choices:
            hint = join_hints(did_you_mean(value, choices), f"supported: {listed(choices)}")
            self.failed_at = name
            self.fail(f"'{name}' of {self.kind} '{self.type}' cannot be '{value}'", name, hint)
        return value

    def vector(self, name: str, default: ArrayLike) -> np.ndarray:
        """Three finite numbers, float64 (3,)."""
        if not self.has(name):
            return np.array(default, dtype=np.float64)
        value = self._take(name)
        try:
            vector = np.asarray(value)
            numbers = vector.dtype.kind in "iuf" and not masked_count(value)
            vector = vector.astype(np.float64) if numbers else np.empty(0)
        except (TypeError, ValueError, OverflowError):
            vector = np.empty(0)
        if vector.shape != (3,) or not np.isfinite(vector).all():
            self._wrong(name, "three finite numbers", value)
        return vector

    def transform(self, name: str = "to_world") -> np.ndarray:
        """An invertible 4x4 float64 matrix; the identity when not given."""
        if not self.has(name):
            return np.eye(4)
        try:
            return as_matrix(self._take(name))
        except SceneError as error:
            raise SceneError(
                f"'{name}' of {self.kind} '{self.type}': {error.what}", self.node.place(name), error.hint
            ) from None

    def array(self, name: str) -> np.ndarray:
        """A numeric NumPy array, or what turns into one, with its masks; `name` must be given."""
        value = self._take(name)
        try:
            array = as_array(value)
        except (TypeError, ValueError, OverflowError):
            array = np.empty(0, dtype=object)
        if array.dtype.kind not in "buif":
            self._wrong(name, "an array of numbers", value)
        return array

    # -- colours -----------------------------------------------------------------------------------

    def is_value(self, name: str) -> bool:
        """Whether `name` holds a number or a colour rather than a plugin."""
        value = self.node.get(name)
        return not isinstance(value, Node) or value.is_value or self._is_spectrum(value)

    def _is_spectrum(self, node: Node) -> bool:
        """Whether it is a spectrum that is a plugin of its own, which stands for a colour."""
        made = self.library.built.get(id(self.library.resolve(node)))
        return isinstance(made, SpectrumColor)

    def color(self, name: str, default: float, light: bool = False, maximum: float = np.inf) -> Spectrum:
        """A number, rgb or spectrum with components in [0, maximum]: one number if grey, else three.

        `light`: spectra are seen under equal energy and not under D65.
        """
        if not self.has(name):
            return (float(default),)
        value = self._take(name)
        if not isinstance(value, Node):
            if isinstance(value, bool | np.bool_) or not isinstance(value, Real):
                self._wrong(name, "a number, an rgb or a spectrum", value)
            rgb = np.array([_float(value)])
        elif value.type == "rgb":
            rgb = self._rgb(name, value)
        elif value.type == "spectrum":
            rgb = self._spectrum(name, value, light, maximum)
        elif self._is_spectrum(value):
            target = self.library.resolve(value)
            self.library.taken.add(id(target))
            made = self.build(target)
            rgb = made.light if light else np.minimum(made.surface, maximum)
        else:
            self._wrong(name, "a number, an rgb or a spectrum", value)
        if not np.isfinite(rgb).all() or (rgb < 0).any() or (rgb > maximum * (1 + ROUNDING)).any():
            self._wrong(name, range_in_words(0, maximum, False), rgb.tolist())
        if (rgb > maximum).any():
            log.warning("%s: %.9g is taken as %g", self.node.place(name), rgb.max(), maximum)
        components = tuple(np.minimum(rgb, maximum).tolist())
        return components[:1] if len(set(components)) == 1 else components

    def _colour_value(self, name: str, node: Node) -> Any:
        extra = [key for key, _ in node.parameters() if key != "value"]
        if extra or "value" not in node:
            self.fail(
                f"'{node.type}' '{name}' " + (f"has an unknown '{extra[0]}'" if extra else "has no 'value'"),
                name,
            )
        return node["value"]

    def _from_file(self, name: str, node: Node) -> Any:
        """The pairs in the file that a spectrum names."""
        if others := [key for key, _ in node.parameters() if key != "filename"]:
            self.fail(f"a spectrum takes either a filename or a {others[0]}", name)
        file, where = node["filename"], self.place(name)
        if not isinstance(file, str):
            self._wrong(name, "the name of a file", file)
        return read_spectrum(find(file, node.folders, where), where)

    def _rgb(self, name: str, node: Node) -> np.ndarray:
        value = self._colour_value(name, node)
        try:
            rgb = np.ma.filled(as_array(value).astype(np.float64), np.nan).reshape(-1)
        except (TypeError, ValueError, OverflowError):
            rgb = np.empty(0)
        if rgb.size not in (1, 3):
            self._wrong(name, "one or three numbers", value)
        return rgb

    def _spectrum(self, name: str, node: Node, light: bool, maximum: float) -> np.ndarray:
        value = self._from_file(name, node) if "filename" in node else self._colour_value(name, node)
        if isinstance(value, Real) and not isinstance(value, bool):
            return spectra.constant_to_rgb(_float(value)) if light else np.array([_float(value)])
        try:
            pairs = np.ma.filled(as_array(value).astype(np.float64), np.nan)
        except (TypeError, ValueError, OverflowError):
            pairs = np.empty(0)
        if pairs.ndim != 2 or pairs.shape[1:] != (2,) or len(pairs) < 2:
            self._wrong(name, "a number, or at least two wavelength:value pairs", value)
        if not np.isfinite(pairs).all() or (np.diff(pairs[:, 0]) <= 0).any() or (pairs[:, 1] < 0).any():
            self._wrong(name, "pairs of increasing wavelengths (nm) and values >= 0", value)
        # Out of the gamut of what can be, Mitsuba cuts; a spectrum in [0, 1] may well be.
        rgb = spectra.sampled_to_rgb(pairs[:, 0], pairs[:, 1], light)
        return rgb if light else np.minimum(rgb, maximum)

    # -- plugins inside ----------------------------------------------------------------------------

    def children(self, kind: str, name: str = "") -> list[tuple[str, Node]]:
        """All (name, node) of plugins of one kind inside this one, references resolved.

        With `name`, only the one of that name.
        """
        found = []
        for key, value in self.node.parameters():
            if isinstance(value, Node) and not value.is_value and name in ("", key):
                target = self.library.resolve(value)
                if self.library.kind_of(target) == kind:
                    self._used.add(key)
                    self.library.taken.add(id(target))
                    found.append((key, target))
        return found

    def only_child(self, kind: str) -> Node | None:
        """The one plugin of this kind inside, or None."""
        found = self.children(kind)
        if len(found) > 1:
            self.fail(f"{self.kind} '{self.type}' takes one {kind}, got {len(found)}", found[1][0])
        return found[0][1] if found else None

    def build(self, node: Node) -> Any:
        """The record of a plugin inside, which has been built before this one."""
        return self.library.built[id(node)]

    # -- the rest ----------------------------------------------------------------------------------

    def approximated(self, as_what: str, name: str = "") -> None:
        """Say that this plugin, or its parameter `name`, is taken as something else.

        Once for all alike in the log, with the first one's place, and in the metadata of pictures.
        """
        taken = f"'{name}' of {self.kind} '{self.type}'" if name else f"{self.kind} '{self.type}'"
        self.library.faults.approximate(f"{taken} is taken as {as_what}", self.place(name))

    def ignore(self, **names: type) -> None:
        """Accept parameters of these types (bool, int, float, str): they do not change the expected image."""
        for name, kind in names.items():
            if self.has(name):
                value = self._take(name)
                if not isinstance(value, _PLAIN[kind]) or (kind is not bool and isinstance(value, bool)):
                    self._wrong(name, _PLAIN_NAMES[kind], value)

    def refuse(self, name: str, hint: str = "") -> None:
        """Raise if the scene gives `name`, a known parameter that is not supported yet."""
        if name in self.node:
            what = f"'{name}' of {self.kind} '{self.type}' is not supported in this version"
            self.unsupported(what, name, hint)

    def refuse_plugin(self, name: str, expected: str = "") -> NoReturn:
        """Raise for the plugin in parameter `name`, or for the value there: not supported here."""
        value = self.node[name]
        if not isinstance(value, Node) or value.is_value:
            self._wrong(name, expected or "left out", value)
        inner = self.library.resolve(value)
        takes = f"takes no {self.library.kind_of(inner)} ('{inner.type}')"
        what = f"{self.kind} '{self.type}' {takes}"
        if expected:
            what = f"'{name}' of {self.kind} '{self.type}' must be {expected}, got a '{inner.type}'"
        self.unsupported(what, name)

    def finish(self) -> None:
        """Note each parameter or inner plugin that nobody asked for among the faults."""
        for name in [key for key, _ in self.node.parameters() if key not in self._used]:
            if not self._not_heeded(name):
                self.library.faults.note(self._left_over(name))

    def _not_heeded(self, name: str) -> bool:
        """Whether an old scene gives a parameter that Mitsuba 0.6 did not have, and no misspelt one.

        Mitsuba 0.6 warns of such "unqueried attributes" and goes on; files for its offspring have them.
        """
        value, plugin = self.node[name], (self.kind, self.type)
        is_plugin = isinstance(value, Node) and not value.is_value
        if not self.node.old or is_plugin or name in self._asked or name in NOT_HERE.get(plugin, ()):
            return False
        if did_you_mean(name, self._asked):
            return False
        what = f"'{name}' of {self.kind} '{self.type}' is not heeded: Mitsuba 0.6 has no such parameter"
        self.library.faults.approximate(what, self.place(name))
        self.node.unheeded.add(name)
        return True

    def _left_over(self, name: str) -> SceneError:
        value, where = self.node[name], self.place(name)
        if name in self._asked:
            return SceneError(
                f"'{name}' of {self.kind} '{self.type}' has no effect here", where, "leave it out"
            )
        if isinstance(value, Node) and not value.is_value:
            inner = self.library.resolve(value)
            kind = self.library.kind_of(inner)
            if kind not in BY_NAME or name.startswith(NAMELESS):
                what = f"{self.kind} '{self.type}' takes no {kind} ('{inner.type}')"
                return UnsupportedError(what, where)
        hint = join_hints(did_you_mean(name, self._asked), f"supported: {listed(self._asked)}")
        return UnsupportedError(f"unknown parameter '{name}' of {self.kind} '{self.type}'", where, hint)


def _float(value: Real) -> float:
    """`value` in double precision; infinite when it is beyond that."""
    try:
        return float(value)
    except OverflowError:
        return np.inf


def range_in_words(minimum: float, maximum: float, open_interval: bool) -> str:
    """An interval as messages name it, as "in [0, 1]"."""
    if np.isinf(minimum) and np.isinf(maximum):
        return "finite"
    if np.isinf(maximum):
        return f"finite and {'>' if open_interval else '>='} {minimum:g}"
    return f"in {'(' if open_interval else '['}{minimum:g}, {maximum:g}{')' if open_interval else ']'}"
