"""A scene description, the dict that `load_dict` takes, as Mitsuba 3 XML that reads well."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any
from xml.sax.saxutils import quoteattr

import numpy as np

from clvol.scene.loader import PLUGINS
from clvol.scene.sensor import is_rigid
from clvol.scene.xml_text import plain_parameter

Attach = Callable[[str, np.ndarray], str]
"""Puts an array where a scene can name it, by the parameter that has it; the file's name."""
FILE_OF = {"bitmap": "filename", "data": "filename", "grid": "filename"}
"""Parameters that are arrays in dicts, and those that name a file of the same in XML."""
_NAMED = ("volume", "texture")
"""Kinds of plugins that are found by their parameter's name."""


def scene_xml(description: Mapping[str, Any], attach: Attach, comment: str = "") -> str:
    """The scene as the text of an XML file, which begins with a comment.

    Parameters
    ----------
    description : plugins, colours, numbers, strings, 4x4 arrays as transforms, three numbers as vectors.
    attach : what writes the arrays that XML cannot hold.
    """
    lines = [f"<!-- {comment.replace('--', '- -')} -->"] if comment else []
    lines.append('<scene version="3.0.0">')
    for name, value in description.items():
        if name != "type":
            lines += ["", *("    " + line for line in _plugin(name, value, attach, top=True))]
    return "\n".join([*lines, "</scene>", ""])


def _kind(plugin: Mapping[str, Any]) -> str:
    return next(kind for kind, types in PLUGINS.items() if plugin["type"] in types)


def _plugin(name: str, plugin: Mapping[str, Any], attach: Attach, top: bool = False) -> list[str]:
    """An element and what is inside it; a name only where it means something."""
    kind = _kind(plugin)
    named = kind in _NAMED or name in ("interior", "exterior")
    attributes = f" name={quoteattr(name)}" if named and not top else ""
    opening = f"<{kind}{attributes} type={quoteattr(plugin['type'])}"
    parameters = [(key, value) for key, value in plugin.items() if key != "type"]
    inside = ["    " + line for key, value in parameters for line in _value(key, value, plugin, attach)]
    return [f"{opening}>", *inside, f"</{kind}>"] if inside else [f"{opening}/>"]


def _value(name: str, value: Any, owner: Mapping[str, Any], attach: Attach) -> list[str]:
    """The lines of one parameter."""
    label = f"name={quoteattr(name)}"
    if isinstance(value, Mapping):
        if value["type"] != "rgb":
            return _plugin(name, value, attach)
        return [f'<rgb {label} value="{_numbers(value["value"])}"/>']
    if plain := plain_parameter(name, value, _numbers):
        return [plain]
    if name in FILE_OF:
        file = attach(name, np.asarray(value))
        return [f'<string name="{FILE_OF[name]}" value={quoteattr(file)}/>']
    array = np.asarray(value, np.float64)
    if array.shape == (4, 4):
        steps = _look_at(array) if _kind(owner) == "sensor" and is_rigid(array) else _steps(array)
        return [f"<transform {label}>", *("    " + step for step in steps), "</transform>"]
    x, y, z = (_numbers(one) for one in array)
    return [f'<vector {label} x="{x}" y="{y}" z="{z}"/>']


def _look_at(matrix: np.ndarray) -> list[str]:
    """A camera's place, what it looks at, and its up."""
    eye, up, ahead = matrix[:3, 3], matrix[:3, 1], matrix[:3, 2]
    target = eye + ahead * max(float(np.linalg.norm(eye)), 1.0)
    return [f'<lookat origin="{_numbers(eye)}" target="{_numbers(target)}" up="{_numbers(up)}"/>']


def _steps(matrix: np.ndarray) -> list[str]:
    """A scale and a translation where that is all, else the matrix."""
    factors, offset = np.diag(matrix)[:3], matrix[:3, 3]
    if np.any(matrix[:3, :3] != np.diag(factors)):
        return [f'<matrix value="{_numbers(matrix)}"/>']
    steps = [] if (factors == 1).all() else [_step("scale", factors)]
    return steps + ([_step("translate", offset)] if offset.any() else [])


def _step(name: str, values: np.ndarray) -> str:
    x, y, z = (_numbers(one) for one in values)
    return f'<{name} x="{x}" y="{y}" z="{z}"/>'


def _numbers(values: Any) -> str:
    """Numbers with as many digits as they need; those that are next to nothing beside the others as 0."""
    flat = np.atleast_1d(np.asarray(values, np.float64)).reshape(-1)
    small = 1e-15 * np.abs(flat).max()
    return ", ".join("0" if abs(one) <= small else f"{one:.12g}" for one in flat.tolist())
