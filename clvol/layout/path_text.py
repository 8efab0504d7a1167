"""OpenCL text of a path's state: `path_beta(scene, slot)` reads a value of a slot, `set_path_beta` writes it.

A unit has the functions that its stage's contract names.  They are there whether the scene needs the value
or not: where it does not, they read a constant and write nothing.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

from clvol.layout.path_state import (
    ALPHA,
    FIRST_HIT,
    PATH_STATE,
    Declared,
    path_counts,
    path_fields,
    shows_weight,
)
from clvol.layout.shared_text import C_TYPES

if TYPE_CHECKING:
    from collections.abc import Mapping

    from clvol.layout.path_state import Macros
    from clvol.layout.stages import Stage

SLOT = "const Scene *scene, uint slot"


@dataclass(frozen=True)
class Value:
    """A value of a slot.

    Parameters
    ----------
    declared : what it is.
    rows : the fields of a slot that hold its parts; none where the scene does not need it.
    """

    declared: Declared
    rows: tuple[int, ...]

    @property
    def c_type(self) -> str:
        """Its OpenCL type."""
        if self.declared.times:
            return {"CLVOL_SPECTRUM": "Spectrum", "CLVOL_BOUNDARY_WORDS": "Inside"}[self.declared.times]
        return "float3" if len(self.declared.parts) == 3 else C_TYPES[self.declared.kind]

    def reader(self) -> str:
        """The function that reads it."""
        return f"INLINE {self.c_type} path_{self.declared.name}({SLOT}) {{ {self._load()} }}"

    def writer(self) -> str:
        """The function that writes it."""
        store = self.store("value")
        return f"INLINE void set_path_{self.declared.name}({SLOT}, {self.c_type} value) {{ {store} }}"

    def store(self, value: str) -> str:
        """Statements that write `value`."""
        parts = [value] if len(self.rows) == 1 else [f"{value}.{axis}" for axis in "xyz"]
        if self.c_type == "Inside":
            parts = [f"{value}.word[{n}]" for n in range(len(self.rows))]
        bits = "as_uint({})" if self.declared.kind == "f" else "(uint)({})"
        pairs = zip(self.rows, parts, strict=False)
        return " ".join(f"{_place(row)} = {bits.format(part)};" for row, part in pairs)

    def _load(self) -> str:
        bits = {"f": "as_float({})", "i": "(int){}", "u": "{}"}[self.declared.kind]
        parts = [bits.format(_place(row)) for row in self.rows]
        if self.c_type == "Inside":
            words = " ".join(f"inside.word[{n}] = {part};" for n, part in enumerate(parts))
            return f"Inside inside = {{{{0}}}}; {words} return inside;"
        if not parts:
            return f"return {self.declared.absent};"
        return f"return {parts[0]};" if len(parts) == 1 else f"return ({self.c_type})({', '.join(parts)});"


def _place(row: int) -> str:
    return f"scene->state[{row}u * scene->slot_stride + slot]"


def path_values(macros: Macros) -> dict[str, Value]:
    """Every value that a slot may hold, by name."""
    rows = {field.name: row for row, field in enumerate(path_fields(macros))}
    return {
        declared.name: Value(declared, tuple(rows[field.name] for field in declared.fields(macros)))
        for declared in PATH_STATE
    }


def state_traffic(macros: Macros, stage: Stage) -> int:
    """Bytes of a path's state that a stage reads and writes at most: each value of its contract once."""
    values = path_values(macros)
    named = [*stage.reads, *stage.writes, *stage.sets]
    return 4 * sum(len(values[name].rows) for name in named)


def path_text(macros: Macros, stage: Stage | None) -> list[str]:
    """The functions of the values that a stage's contract names; of all values where there is no stage."""
    parts = [f"typedef struct {{ uint word[{max(macros['CLVOL_BOUNDARY_WORDS'], 1)}]; }} Inside;"]
    values = path_values(macros)
    for name, value in values.items():
        reads = stage is None or name in stage.reads
        writes = stage is None or name in stage.writes
        lines = [f"/* {value.declared.meaning} */"]
        lines += [value.reader()] if reads else []
        lines += [value.writer()] if writes else []
        parts += ["\n".join(lines)] if reads or writes else []
    if stage is None or "job" in stage.writes:  # paths begin and end there
        parts += [*_counts_text(macros), _first_hit_text(values)]
    return parts


def _counts_text(macros: Macros) -> list[str]:
    """How a path's counts are begun and written; its largest weight, if it is kept, comes last."""
    counts, weight = path_counts(macros), shows_weight(macros)
    reset = [f"set_path_{name}(scene, slot, 0);" for name in counts]
    write = [f"counts[{n}] = path_{name}(scene, slot);" for n, name in enumerate(counts)]
    if weight:
        reset.append("set_path_largest_weight(scene, slot, 1.0f);")
        write.append(f"counts[{len(counts)}] = as_uint(path_largest_weight(scene, slot));")
    if write:
        write.insert(0, f"__global uint *counts = scene->result_counts + place * {len(write)}u;")
    return [
        f"INLINE void reset_counts({SLOT}) {{ {' '.join(reset)} }}",
        f"INLINE void write_counts({SLOT}, size_t place) {{ {' '.join(write)} }}",
    ]


def _first_hit_text(values: Mapping[str, Value]) -> str:
    """How what a path first met is written."""
    write, n = [], 0
    for name in (*FIRST_HIT, "met", ALPHA):
        if values[name].c_type == "float3" and values[name].rows:
            write.append(f"vstore3(path_{name}(scene, slot), 0, firsts + {n});")
        elif values[name].rows:
            write.append(f"firsts[{n}] = path_{name}(scene, slot);")
        n += len(values[name].rows)
    if write:
        write.insert(0, f"__global float *firsts = scene->result_firsts + place * {n}u;")
    return f"INLINE void write_first_hit({SLOT}, size_t place) {{ {' '.join(write)} }}"
