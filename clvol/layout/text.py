"""OpenCL text of the layout that goes by the scene: the path's state and the kernels' arguments."""

from __future__ import annotations

import re
from typing import TYPE_CHECKING

from clvol.layout.arguments import ALWAYS, ARGUMENTS, Argument, arguments
from clvol.layout.constants import BLACKBODY_BINS, BLACKBODY_MIDDLE_KELVIN, QUEUE_LENGTHS_STRIDE
from clvol.layout.path_state import (
    Macros,
    counts_per_path,
    first_hit_fields,
    path_counts,
    shows_weight,
)
from clvol.layout.path_text import path_text
from clvol.layout.stages import QUEUES

if TYPE_CHECKING:
    from clvol.layout.stages import Stage


_DEFINED = re.compile(r"^(?:#define|INLINE \w+|typedef .*\}) (?:set_)?(\w+)", re.MULTILINE)
_VALUE = re.compile(r"path_\w+")
_MEMBERS = re.compile(r"->(\w+)"), re.compile(r"\.(\w+)")
"""Each begins with letters that Python finds fast: every unit of every plan is searched."""


def layout_text(macros: Macros, stage: Stage | None = None, unit: str | None = None) -> str:
    """OpenCL text of arguments, and of what a stage may do with paths (None: anything): cl/core/scene.h.

    `unit` is the rest of a unit, which gets what it uses; None: everything.  What a unit does not use is no
    argument of its kernels either: units are then the same for more scenes and choices, and built once.
    """
    parts = [f"#define QUEUE_COUNT {len(QUEUES)}", f"#define QUEUE_LENGTHS_STRIDE {QUEUE_LENGTHS_STRIDE}u"]
    parts += [
        f"#define CLVOL_PATH_COUNTS {len(path_counts(macros))}u",
        f"#define CLVOL_RESULT_COUNTS {counts_per_path(macros)}u",
        f"#define CLVOL_PEAKS {1 + shows_weight(macros)}",
        f"#define CLVOL_FIRST_HIT_FIELDS {len(first_hit_fields(macros))}u",
        f"#define BLACKBODY_BINS {BLACKBODY_BINS}",
        f"#define BLACKBODY_MIDDLE {BLACKBODY_MIDDLE_KELVIN}f",
    ]
    parts += path_text(macros, stage)
    args = arguments(macros)
    if unit is not None:
        parts = _used(parts, unit)
        text = "\n".join([unit, *parts])
        members = {ALWAYS}.union(*(member.findall(text) for member in _MEMBERS))
        args = [argument for argument in args if argument.name in members]
    return "\n".join([*_scene_text(args, macros), *parts]) + "\n"


def _used(parts: list[str], unit: str) -> list[str]:
    """Those of the definitions whose names occur in a unit, or in others that it uses."""
    left, kept, text = {part: set(_DEFINED.findall(part)) for part in parts}, set[str](), unit
    while left and text:
        values = set(_VALUE.findall(text))
        new = [
            part
            for part, names in left.items()
            if not names.isdisjoint(values)
            or any(name in text for name in names if not name.startswith("path_"))
        ]
        for part in new:
            del left[part]
        kept.update(new)
        text = "\n".join(new)
    return [part for part in parts if part in kept]


def _scene_text(args: list[Argument], macros: Macros) -> list[str]:
    """The kernels' arguments, and what a Scene is of them; what is no argument is null there."""
    members = [a for a in ARGUMENTS if not a.rare or macros[a.needs]]
    return [
        "#define CLVOL_ARGUMENTS " + ", ".join(f"{a.c_type} {a.name}_" for a in args),
        "#define CLVOL_SCENE {" + ", ".join(f"{a.name}_" if a in args else "0" for a in members) + "}",
    ]
