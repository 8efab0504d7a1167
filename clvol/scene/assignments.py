"""Parameters of a scene as text, NAME=VALUE: how the command line sets what `clvol.traverse` names."""

from __future__ import annotations

import re
from typing import TYPE_CHECKING, Any

import numpy as np

from clvol.errors import Error, OptionError, shown
from clvol.scene.parameters import SceneParameters
from clvol.scene.transforms import look_at

if TYPE_CHECKING:
    from collections.abc import Iterable

    from clvol.scene.records import Scene

Assignment = tuple[str, str]
"""A parameter's name and its value's text."""
_TRANSFORM, _VIEW = 16, 9
"""Numbers of a matrix, row by row; of a point, what it looks at, and what is up."""


def assign(scene: Scene, assignments: Iterable[Assignment]) -> None:
    """Set parameters of a scene, all of them or none.

    Values are numbers with commas between them: one, a colour's or a direction's three, the two of a size.
    Transforms have 16, or the 9 of `look_at`: origin, target, up.  Transfer functions have points, as
    ``-500: 0, 300: 0.5``.

    Raises
    ------
    OptionError
        A name that no parameter has, or text that is no numbers.
    SceneError, VolumeError
        A value that the parameter cannot have.
    """
    parameters = SceneParameters(scene)
    for name, text in assignments:
        parameters[name] = value_of(name, text)
    parameters.update()


def value_of(name: str, text: str) -> Any:
    """What the text of a value stands for, as `SceneParameters` takes it."""
    if ":" in text:
        return text
    try:
        found = [_number(word) for word in re.split(r"\s*,\s*", text.strip())]
    except ValueError:
        hint = "as 0.5 or 1,0.9,0.8; transforms take origin,target,up of three numbers each, or all 16"
        raise OptionError(
            f"{name} takes numbers with commas between them, not {shown(text)}", hint=hint
        ) from None
    if name.endswith("to_world") and len(found) == _VIEW:
        try:
            return look_at(*np.reshape(np.array(found, float), (3, 3)))
        except Error as error:
            raise OptionError(error.what, name, error.hint) from None
    if len(found) == _TRANSFORM:
        return np.reshape(np.array(found, float), (4, 4))
    return found[0] if len(found) == 1 else tuple(found)


def _number(word: str) -> float | int:
    """Whole numbers stay so: a size takes no others."""
    return int(word) if re.fullmatch(r"[+-]?[0-9]{1,18}", word) else float(word)
