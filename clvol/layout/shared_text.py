"""OpenCL text of what host and device share whatever the scene: records, numbered kinds, the Scene."""

from __future__ import annotations

from functools import cache
from typing import TYPE_CHECKING, Any

from clvol.layout import constants
from clvol.layout.arguments import ARGUMENTS
from clvol.layout.bsdfs import BSDF_FACTS
from clvol.layout.records import ENUMS, RARE_KINDS, RARE_RECORDS, RECORDS

if TYPE_CHECKING:
    from collections.abc import Iterable

    import numpy as np

C_TYPES = {"f": "float", "i": "int", "u": "uint"}

_NUMBERS = (
    "NO_JOB",
    "NO_SLOT",
    "NO_PRIMITIVE",
    "BRICK_CELLS",
    "BRICK_EDGE",
    "BRICK_SAMPLES",
    "BVH_NODE_ROWS",
    "BVH_PACKET_ROWS",
    "BVH_PACKET",
    "BVH_LEAF",
    "BVH_HAS_QUADRICS",
    "COAT_ENTRIES",
    "MOST_WEIGHED_LIGHTS",
)
"""Names in `clvol.layout.constants`, which kernels know by the same."""


RARE = (
    "TABPHASE",
    "SGGX",
    "MIXED_SGGX",
    "PRINCIPLED",
    "PRINCIPLED_GLASS",
    "PRINCIPLED_THIN",
    "BLEND",
    "BENT",
)
"""Kinds of material and phase function that few scenes have: what others compile does not name them."""


def record_text(name: str, dtype: np.dtype[Any]) -> str:
    """C struct of a record dtype."""
    lines = []
    for field in dtype.names or ():
        base, shape = dtype[field].base, dtype[field].shape
        suffix = f"[{shape[0]}]" if shape else ""
        lines.append(f"    {C_TYPES[base.kind]} {field}{suffix};")
    return "typedef struct {\n" + "\n".join(lines) + f"\n}} {name};"


@cache
def shared_text() -> str:
    """Every record, enum and number, and the Scene, which has room for all buffers: cl/core/shared.h.

    What is rare is there only where a scene has it.
    """
    parts = [_where(RARE_RECORDS.get(name), record_text(name, dtype)) for name, dtype in RECORDS.items()]
    for family, names in ENUMS.items():
        for value, name in enumerate(names):
            kind = f"{family}_{name.upper()}"
            parts.append(_where(RARE_KINDS.get(kind), f"#define {kind} {value}"))
    for name in _NUMBERS:
        value = getattr(constants, name)
        parts.append(f"#define {name} {value}" if value < 1 << 16 else f"#define {name} 0x{value:08X}u")
    members = "\n".join(
        _where(argument.needs if argument.rare else None, f"    {argument.c_type} {argument.name};")
        for argument in ARGUMENTS
    )
    members += "\n" + _where(
        "CLVOL_HAS_VOLUME_TEXTURES", "    float3 texture_point; /* see texture/volume.h */"
    )
    parts.append(f"typedef struct {{\n{members}\n}} Scene;")
    return "\n".join(parts) + "\n"


def _where(macro: str | None, text: str) -> str:
    return text if macro is None else f"#if {macro}\n{text}\n#endif"


@cache
def kinds_text(family: str) -> str:
    """How many of "BSDF" or "PHASE" a scene has, and facts of a material: cl/bsdf/kinds.h, cl/phase/kinds.h.

    In units of these only: macros that occur in a unit decide what is built again.
    """
    names = tuple(BSDF_FACTS) if family == "BSDF" else ENUMS[family]
    rare = [f"CLVOL_{family}_{name}" for name in names if name in RARE]
    if not rare:
        return _facts_text(family, names)
    usual = _facts_text(family, [name for name in names if name not in RARE])
    return f"#if {' || '.join(rare)}\n{_facts_text(family, names)}#else\n{usual}#endif\n"


def _facts_text(family: str, names: Iterable[str]) -> str:
    names = tuple(names)
    parts = [f"#define {family}_KINDS ({' + '.join(f'CLVOL_{family}_{name}' for name in names)})"]
    if family == "BSDF":
        smooth = (name for name in names if BSDF_FACTS[name].smooth)
        transmits = (name for name in names if BSDF_FACTS[name].transmits)
        parts += [f"#define IS_SMOOTH(material) {_any_of(smooth)}"]
        parts += [f"#define IS_TRANSMISSIVE(material) {_any_of(transmits)}"]
    return "\n".join(parts) + "\n"


def _any_of(names: Iterable[str]) -> str:
    return "(" + " || ".join(f"IS_BSDF(material, {name})" for name in names) + ")"
