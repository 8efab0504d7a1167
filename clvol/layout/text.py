"""OpenCL text of the layout that goes by the scene: the path's state and the kernels' arguments."""

from __future__ import annotations

from clvol.layout.arguments import ARGUMENTS, arguments
from clvol.layout.constants import BLACKBODY_BINS, BLACKBODY_MIDDLE_KELVIN, COUNTER_STRIDE
from clvol.layout.path_state import (
    Macros,
    counts_per_path,
    first_hit_fields,
    path_counts,
    path_fields,
    shows_weight,
)
from clvol.layout.records import ENUMS
from clvol.layout.shared_text import C_TYPES


def layout_text(macros: Macros) -> str:
    """OpenCL text of every path-state accessor and the stage argument list: cl/core/scene.h."""
    parts = [f"#define QUEUE_COUNT {len(ENUMS['QUEUE'])}", f"#define COUNTER_STRIDE {COUNTER_STRIDE}u"]
    parts += _scene_text(macros)
    for index, field in enumerate(path_fields(macros)):
        at = f"scene->state[{index}u * scene->slot_stride + slot]"
        get, put = (f"as_float({at})", "as_uint(value)") if field.kind == "f" else (at, "(uint)(value)")
        if field.kind == "i":
            get = f"(int){at}"
        c_type = C_TYPES[field.kind]
        slot = "const Scene *scene, uint slot"
        parts += [
            f"/* {field.meaning} */",
            f"INLINE {c_type} path_{field.name}({slot}) {{ return {get}; }}",
            f"INLINE void set_path_{field.name}({slot}, {c_type} value) {{ {at} = {put}; }}",
        ]
    parts += _counts_text(macros)
    parts += _inside_text(macros) + _first_hit_text(macros)
    return "\n".join(parts) + "\n"


def _scene_text(macros: Macros) -> list[str]:
    """The kernels' arguments, and the Scene that holds them; what is no argument is null there."""
    args = arguments(macros)
    members = "\n".join(f"    {a.c_type} {a.name};" for a in ARGUMENTS)
    return [
        f"typedef struct {{\n{members}\n}} Scene;",
        "#define CLVOL_ARGUMENTS " + ", ".join(f"{a.c_type} {a.name}_" for a in args),
        "#define CLVOL_SCENE {" + ", ".join(f"{a.name}_" if a in args else "0" for a in ARGUMENTS) + "}",
    ]


def _first_hit_text(macros: Macros) -> list[str]:
    """How what a path first meets is begun, recorded and written."""
    fields = first_hit_fields(macros)
    values = {"depth_0": "depth", "met": "met"} | {
        f"{name}_{c}": f"{name}.{axis}"
        for name in ("normal", "albedo", "position")
        for c, axis in enumerate("xyz")
    }
    reset = " ".join(f"set_path_{name}(scene, slot, 0.0f);" for name in fields)
    record = " ".join(f"set_path_{name}(scene, slot, {values[name]});" for name in fields)
    write = " ".join(
        f"scene->result_firsts[place * {len(fields)}u + {n}u] = path_{name}(scene, slot);"
        for n, name in enumerate(fields)
    )
    slot, place = "const Scene *scene, uint slot", "size_t place"
    values = "float depth, float3 normal, float3 albedo, float3 position, float met"
    return [
        f"#define CLVOL_FIRST_HIT_FIELDS {len(fields)}u",
        f"INLINE void reset_first_hit({slot}) {{ {reset} }}",
        f"INLINE void record_first_hit({slot}, {values}) {{ {record} }}",
        f"INLINE void write_first_hit({slot}, {place}) {{ {write} }}",
    ]


def _inside_text(macros: Macros) -> list[str]:
    """How a path's bits of boundaries, and its shadow ray's, are read and written as an Inside."""
    words, slot = macros["CLVOL_BOUNDARY_WORDS"], "const Scene *scene, uint slot"
    prefixes = ("inside", "shadow_inside") if macros["CLVOL_NEE"] else ("inside",)
    parts = [f"typedef struct {{ uint word[{max(words, 1)}]; }} Inside;"]
    for prefix in prefixes:
        read = " ".join(f"inside.word[{w}] = path_{prefix}_{w}(scene, slot);" for w in range(words))
        write = " ".join(f"set_path_{prefix}_{w}(scene, slot, inside.word[{w}]);" for w in range(words))
        parts += [
            f"INLINE Inside get_{prefix}({slot}) {{ Inside inside; {read} return inside; }}",
            f"INLINE void set_{prefix}({slot}, Inside inside) {{ {write} }}",
        ]
    return parts


def _counts_text(macros: Macros) -> list[str]:
    """How a path's counts are begun and written; its largest weight, if it is kept, comes last."""
    counts, weight = path_counts(macros), shows_weight(macros)
    reset = [f"set_path_{name}(scene, slot, 0);" for name in counts]
    write = [
        f"scene->result_counts[place * CLVOL_RESULT_COUNTS + {n}u] = path_{name}(scene, slot);"
        for n, name in enumerate(counts)
    ]
    if weight:
        reset.append("set_path_largest_weight(scene, slot, 1.0f);")
        write.append(
            f"scene->result_counts[place * CLVOL_RESULT_COUNTS + {len(counts)}u]"
            " = as_uint(path_largest_weight(scene, slot));"
        )
    return [
        f"#define CLVOL_PATH_COUNTS {len(counts)}u",
        f"#define CLVOL_RESULT_COUNTS {counts_per_path(macros)}u",
        f"#define CLVOL_PEAKS {1 + weight}",
        f"#define BLACKBODY_BINS {BLACKBODY_BINS}",
        f"#define BLACKBODY_MIDDLE {BLACKBODY_MIDDLE_KELVIN}f",
        "INLINE void reset_counts(const Scene *scene, uint slot) { " + " ".join(reset) + " }",
        "INLINE void write_counts(const Scene *scene, uint slot, size_t place) { " + " ".join(write) + " }",
    ]
