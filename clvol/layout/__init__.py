"""What the device sees: every record, path-state field, queue and kernel argument, described once.

Python's dtypes and OpenCL's text are both made from the tables here; a test compares sizes and offsets on the
device.  What a scene has of them follows from the macros of its plan (`clvol.planning`).  No value of a scene
belongs here, only its shape, and nothing of clvol but its errors is imported.
"""

from clvol.layout.arguments import ARGUMENTS, Argument, arguments
from clvol.layout.constants import (
    BLACKBODY_BINS,
    BLACKBODY_MIDDLE_KELVIN,
    BVH_MOST_DEPTH,
    BVH_PACKET,
    BVH_STACK,
    BVH_WIDTH,
    COUNTER_STRIDE,
    RANDOMIZATIONS,
)
from clvol.layout.path_state import (
    COUNTS,
    FIRST_HIT,
    PATH_STATE,
    SLOT_STATISTICS,
    Macros,
    PathField,
    counts_per_path,
    first_hit_fields,
    path_counts,
    path_fields,
    shows_weight,
    slot_fields,
)
from clvol.layout.records import (
    BSDFS,
    EMITTER,
    ENUMS,
    ENVMAP,
    MATERIAL,
    MEDIUM,
    PHASE,
    QUADRIC,
    RECORDS,
    RENDER,
    SHAPE,
    TEXTURE,
    VOLUME,
    enum,
)
from clvol.layout.text import layout_text, record_text

__all__ = [
    "ARGUMENTS",
    "BLACKBODY_BINS",
    "BLACKBODY_MIDDLE_KELVIN",
    "BSDFS",
    "BVH_MOST_DEPTH",
    "BVH_PACKET",
    "BVH_STACK",
    "BVH_WIDTH",
    "COUNTER_STRIDE",
    "COUNTS",
    "EMITTER",
    "ENUMS",
    "ENVMAP",
    "FIRST_HIT",
    "MATERIAL",
    "MEDIUM",
    "PATH_STATE",
    "PHASE",
    "QUADRIC",
    "RANDOMIZATIONS",
    "RECORDS",
    "RENDER",
    "SHAPE",
    "SLOT_STATISTICS",
    "TEXTURE",
    "VOLUME",
    "Argument",
    "Macros",
    "PathField",
    "arguments",
    "counts_per_path",
    "enum",
    "first_hit_fields",
    "layout_text",
    "path_counts",
    "path_fields",
    "record_text",
    "shows_weight",
    "slot_fields",
]
