"""OpenCL text of the layout that goes by the scene: the path's state and the kernels' arguments."""

from __future__ import annotations

from typing import TYPE_CHECKING

from clvol.layout.arguments import ARGUMENTS, arguments
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


def layout_text(macros: Macros, stage: Stage | None = None) -> str:
    """OpenCL text of arguments, and of what a stage may do with paths (None: anything): cl/core/scene.h."""
    parts = [f"#define QUEUE_COUNT {len(QUEUES)}", f"#define QUEUE_LENGTHS_STRIDE {QUEUE_LENGTHS_STRIDE}u"]
    parts += _scene_text(macros)
    parts += [
        f"#define CLVOL_PATH_COUNTS {len(path_counts(macros))}u",
        f"#define CLVOL_RESULT_COUNTS {counts_per_path(macros)}u",
        f"#define CLVOL_PEAKS {1 + shows_weight(macros)}",
        f"#define CLVOL_FIRST_HIT_FIELDS {len(first_hit_fields(macros))}u",
        f"#define BLACKBODY_BINS {BLACKBODY_BINS}",
        f"#define BLACKBODY_MIDDLE {BLACKBODY_MIDDLE_KELVIN}f",
    ]
    parts += path_text(macros, stage)
    return "\n".join(parts) + "\n"


def _scene_text(macros: Macros) -> list[str]:
    """The kernels' arguments, and what a Scene is of them; what is no argument is null there."""
    args = arguments(macros)
    return [
        "#define CLVOL_ARGUMENTS " + ", ".join(f"{a.c_type} {a.name}_" for a in args),
        "#define CLVOL_SCENE {" + ", ".join(f"{a.name}_" if a in args else "0" for a in ARGUMENTS) + "}",
    ]
