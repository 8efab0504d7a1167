"""Numbers that callers of the Python functions give, checked alike everywhere."""

from __future__ import annotations

import math
import operator
from numbers import Real
from typing import Any, cast

import numpy as np

from clvol.errors import OptionError, shown

MOST_SEED = 2**64 - 1


def positive(name: str, value: object, unit: str = "") -> float:
    """`value` if it is a finite number above 0; OptionError otherwise.

    `name` is what stands before the value, as in "step=" or "time limit ".
    """
    number = cast("float", value)  # or another real number, as NumPy's are
    try:
        fits = isinstance(value, Real) and not isinstance(value, bool) and 0 < float(number) < math.inf
    except OverflowError:
        fits = False
    if not fits:
        raise OptionError(f"{name}{shown(value)} is not a positive number{unit}")
    return number


def index(value: Any) -> int:
    """`value` as an int, if it is an integer of any kind; TypeError otherwise, and for True and False."""
    if isinstance(value, bool):
        raise TypeError
    return operator.index(value)


def whole(name: str, value: Any) -> int:
    """`value` if it is an integer of any kind; OptionError otherwise."""
    try:
        return index(value)
    except TypeError:
        raise OptionError(f"{name}={shown(value)} is not a whole number") from None


def flag(name: str, value: Any) -> bool:
    """`value` if it is true or false; OptionError otherwise."""
    if not isinstance(value, bool | np.bool_):
        raise OptionError(f"{name}={shown(value)} is neither True nor False")
    return bool(value)


def listed(value: Any) -> list[Any] | None:
    """The items of anything that can be gone through, a string as one; None for what cannot."""
    try:
        return [value] if isinstance(value, str) else list(value)
    except TypeError:
        return None


def check_seed(seed: Any) -> int:
    """`seed` if it is a 64-bit number; OptionError otherwise."""
    try:
        number = index(seed)
    except TypeError:
        number = -1
    if not 0 <= number <= MOST_SEED:
        raise OptionError(
            f"seed {shown(seed)} is not a 64-bit number",
            hint="choose a whole number from 0 to 2**64 - 1",
        )
    return number
