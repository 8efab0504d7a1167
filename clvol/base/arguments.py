"""Numbers that callers of the Python functions give, checked alike everywhere."""

from __future__ import annotations

import math
import operator
from numbers import Real
from typing import Any, cast

from clvol.errors import OptionError, shown

MOST_SEED = 2**64 - 1


def positive(name: str, value: object, unit: str = "") -> float:
    """`value` if it is a finite number above 0; OptionError otherwise.

    `name` is what stands before the value, as in "step=" or "time limit ".
    """
    number = cast("float", value)  # or another real number, as NumPy's are
    if isinstance(value, bool) or not isinstance(value, Real) or not 0 < number < math.inf:
        raise OptionError(f"{name}{shown(value)} is not a positive number{unit}")
    return number


def whole(name: str, value: Any) -> int:
    """`value` if it is an integer of any kind; OptionError otherwise."""
    try:
        return operator.index(value)
    except TypeError:
        raise OptionError(f"{name}={shown(value)} is not a whole number") from None


def check_seed(seed: Any) -> int:
    """`seed` if it is a 64-bit number; OptionError otherwise."""
    try:
        number = operator.index(seed)
    except TypeError:
        number = -1
    if not 0 <= number <= MOST_SEED:
        raise OptionError(
            f"seed {shown(seed)} is not a 64-bit number",
            hint="choose a whole number from 0 to 2**64 - 1",
        )
    return number
