"""The parameters of one pbrt statement, each with its type: asking for one is what declares it as known."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, NoReturn

import numpy as np

from clvol.errors import SceneError, shortened
from clvol.scene.faults import UnsupportedError
from clvol.scene.vocabulary import did_you_mean, join_hints, listed

if TYPE_CHECKING:
    from clvol.scene.pbrt.tokens import Token, Tokens, Values

_SAME = {"point": "point3", "vector": "vector3", "normal": "normal3", "color": "rgb", "xyz": "rgb"}
_WIDTHS = {"point2": 2, "vector2": 2, "point3": 3, "vector3": 3, "normal3": 3, "rgb": 3}
TYPES = (*("integer", "float", "bool", "string", "texture"), *_WIDTHS, "spectrum", "blackbody")
"""Types that parameters have; "point", "vector" and "normal" are those in space."""


@dataclass(frozen=True)
class Parameter:
    """One parameter: its type and values, and where it stands."""

    type: str
    name: str
    values: Values
    where: str

    @property
    def numbers(self) -> np.ndarray:
        """The values, which must be numbers."""
        if not isinstance(self.values, np.ndarray):
            raise SceneError(f"'{self.name}' takes numbers", self.where)
        return self.values

    @property
    def texts(self) -> list[str]:
        """The values, which must be words or strings."""
        if isinstance(self.values, np.ndarray) and len(self.values):
            raise SceneError(f"'{self.name}' takes no numbers", self.where)
        return list(self.values)


def read_parameters(tokens: Tokens) -> list[Parameter]:
    """The parameters that follow, up to the next directive."""
    found: list[Parameter] = []
    while (token := tokens.next()) is not None:
        if token.kind != "string":
            tokens.back(token)
            break
        words = token.text.split()
        if len(words) != 2 or _SAME.get(words[0], words[0]) not in TYPES:
            raise SceneError(
                f'"{shortened(token.text, 60)}" is no parameter\'s type and name',
                token.where,
                join_hints(did_you_mean(words[0], TYPES) if words else "", f"types: {listed(TYPES)}"),
            )
        kind = _SAME.get(words[0], words[0])
        found.append(Parameter(kind, words[1], _value(tokens, words[1], token), token.where))
    return found


def _value(tokens: Tokens, name: str, declared: Token) -> Values:
    token = tokens.next()
    if token is None or (token.kind == "word" and token.text not in ("true", "false")):
        raise SceneError(f"'{shortened(name, 60)}' has no value", declared.where)
    return [token.text] if token.values is None else token.values


class Parameters:
    """Typed access to the parameters of a statement `what`, as "Shape 'sphere'".

    defaults : parameters that `Attribute` gave to all statements of its kind.
    """

    def __init__(
        self, given: list[Parameter], what: str, where: str, defaults: tuple[Parameter, ...] = ()
    ) -> None:
        self.what, self.where = what, where
        self._given: dict[str, Parameter] = {}
        for parameter in given:
            if parameter.name in self._given and self._given[parameter.name].type == parameter.type:
                self.fail(f"'{parameter.name}' is given twice", parameter.where)
            self._given[parameter.name] = parameter
        self._own = set(self._given)
        for parameter in defaults:
            self._given.setdefault(parameter.name, parameter)
        self._asked: list[str] = []

    @property
    def asked(self) -> tuple[str, ...]:
        """The names of the parameters that somebody asked for."""
        return tuple(dict.fromkeys(self._asked))

    def fail(self, what: str, where: str = "", hint: str = "") -> NoReturn:
        """Raise a SceneError about this statement."""
        raise SceneError(f"{self.what}: {what}", where or self.where, hint)

    def refuse(self, what: str, where: str = "", hint: str = "") -> NoReturn:
        """Raise an UnsupportedError: that it cannot be rendered."""
        raise UnsupportedError(f"{self.what}: {what} cannot be rendered", where or self.where, hint)

    def get(self, name: str, *types: str) -> Parameter | None:
        """The parameter of that name, which must be of one of these types; None without."""
        self._asked.append(name)
        found = self._given.get(name)
        if found is not None and types and found.type not in types:
            self.fail(f"'{name}' is a {found.type}, not a {' or '.join(types)}", found.where)
        return found

    def place(self, name: str) -> str:
        """Where a parameter stands, or the statement."""
        return self._given[name].where if name in self._given else self.where

    def number(self, name: str, default: float, minimum: float = -np.inf, maximum: float = np.inf) -> float:
        """A float from `minimum` to `maximum`."""
        found = self.get(name, "float", "integer")
        if found is None:
            return default
        value = float(self._one(found))
        if not minimum <= value <= maximum:
            self.fail(f"'{name}' is {value:g}, beyond {minimum:g} to {maximum:g}", found.where)
        return value

    def integer(self, name: str, default: int, minimum: int = -(2**31), maximum: int = 2**31 - 1) -> int:
        """An integer."""
        found = self.get(name, "integer")
        if found is None:
            return default
        value = float(self._one(found))
        if value != int(value) or not minimum <= value <= maximum:
            self.fail(f"'{name}' must be an integer from {minimum} to {maximum}", found.where)
        return int(value)

    def boolean(self, name: str, default: bool) -> bool:
        """True or false."""
        found = self.get(name, "bool")
        if found is None:
            return default
        words = found.texts
        if len(words) != 1 or words[0] not in ("true", "false"):
            self.fail(f"'{name}' must be true or false", found.where)
        return words[0] == "true"

    def string(self, name: str, default: str, choices: tuple[str, ...] = ()) -> str:
        """A string, perhaps one of some."""
        found = self.get(name, "string")
        if found is None:
            return default
        words = found.texts
        if len(words) != 1:
            self.fail(f"'{name}' takes one string", found.where)
        if choices and words[0] not in choices:
            hint = join_hints(did_you_mean(words[0], choices), f"supported: {listed(choices)}")
            self.fail(f"'{name}' cannot be '{shortened(words[0], 60)}'", found.where, hint)
        return words[0]

    def point(self, name: str, default: tuple[float, float, float]) -> np.ndarray:
        """A point in space."""
        rows = self.rows(name, "point3")
        if rows is None:
            return np.array(default)
        if len(rows) != 1:
            self.fail(f"'{name}' takes one point", self.place(name))
        point: np.ndarray = rows[0]
        return point

    def rows(self, name: str, *types: str) -> np.ndarray | None:
        """Points, vectors or colours, float64 (n, 2 or 3); None without."""
        found = self.get(name, *types)
        if found is None:
            return None
        width = _WIDTHS[found.type]
        if not len(found.numbers) or len(found.numbers) % width:
            self.fail(f"'{name}' takes {width} numbers each, got {len(found.numbers)}", found.where)
        return found.numbers.reshape(-1, width)

    def floats(self, name: str) -> np.ndarray | None:
        """Any number of floats; None without."""
        found = self.get(name, "float")
        return None if found is None else found.numbers

    def integers(self, name: str) -> np.ndarray | None:
        """Any number of integers, int64; None without."""
        found = self.get(name, "integer")
        if found is None:
            return None
        if (found.numbers != np.floor(found.numbers)).any() or (np.abs(found.numbers) > 2**53).any():
            self.fail(f"'{name}' takes integers", found.where)
        return found.numbers.astype(np.int64)

    def ignore(self, *names: str) -> None:
        """Know parameters that do not change the picture."""
        for name in names:
            self.get(name)

    def finish(self) -> None:
        """Raise for the first parameter that nobody asked for."""
        for name, parameter in self._given.items():
            if name in self._own and name not in self._asked:
                hint = join_hints(did_you_mean(name, self._asked), f"supported: {listed(self.asked)}")
                self.fail(f"unknown parameter '{shortened(name, 60)}'", parameter.where, hint)

    def _one(self, found: Parameter) -> float:
        if len(found.numbers) != 1:
            self.fail(f"'{found.name}' takes one number, got {len(found.numbers)}", found.where)
        value: float = found.numbers[0]
        return value
