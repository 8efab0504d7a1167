"""Text of scene files that all who write them share: attributes, and parameters that are one value."""

from __future__ import annotations

from numbers import Integral, Real
from typing import TYPE_CHECKING, Any
from xml.sax.saxutils import quoteattr

import numpy as np

if TYPE_CHECKING:
    from collections.abc import Callable


def quoted(text: str) -> str:
    """An attribute's value, whose dollar signs are no $names."""
    return quoteattr(text.replace("$", "\\$"))


def plain_parameter(name: str, value: Any, number: Callable[[Any], str]) -> str:
    """The element of a flag, a number or a text; "" for what is none of these.

    number : how numbers that are no integers are written.
    """
    label = f"name={quoted(name)}"
    if isinstance(value, bool | np.bool_):
        return f'<boolean {label} value="{str(bool(value)).lower()}"/>'
    if isinstance(value, Integral):
        return f'<integer {label} value="{int(value)}"/>'
    if isinstance(value, Real):
        return f'<float {label} value="{number(value)}"/>'
    if isinstance(value, str):
        return f"<string {label} value={quoted(value)}/>"
    return ""
