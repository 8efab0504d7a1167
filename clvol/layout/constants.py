"""Numbers that host and device have to agree on."""

from __future__ import annotations

QUEUE_LENGTHS_STRIDE = 16
"""Queue counters of a group, padded to a cache line."""

NO_JOB = 0xFFFFFFFF
"""Job of a slot that holds no path."""
NO_SLOT = 0xFFFFFFFF
"""Slot of a lane that walks for none."""
NO_PRIMITIVE = 0xFFFFFFFF
"""Primitive of a hit where nothing is hit."""

BRICK_CELLS = 8
"""Interpolation cells of a volume's brick along an axis: a power of two."""
BRICK_EDGE = BRICK_CELLS + 1
"""Samples of a brick along an axis, so that all corners of its cells are its own."""
BRICK_SAMPLES = BRICK_EDGE**3

BVH_WIDTH = 8
"""Children of a node of the surfaces' hierarchy."""
BVH_PACKET = 8
"""Primitives that a leaf holds at most, and that are tested together: the width of the device's vectors."""
BVH_MOST_DEPTH = 48
"""Splits on the way to a leaf, at most: nodes that could become deeper are halved by number."""
BVH_NODE_ROWS, BVH_PACKET_ROWS = 8, 10
"""Rows of `BVH_WIDTH` and `BVH_PACKET` floats that a node and a leaf are made of (clvol.accel.bvh)."""
BVH_LEAF, BVH_HAS_QUADRICS = 1 << 31, 1 << 30
"""Marks in a child's reference; what remains is the number of the node, or of the leaf's packet."""
BVH_STACK = (BVH_WIDTH - 1) * BVH_MOST_DEPTH + 1
"""Nodes that a traversal may keep waiting: siblings on every level."""

RANDOMIZATIONS = 4
"""Independent randomisations that a pixel's low-discrepancy samples are dealt to in turn; a power of two."""

MOST_WEIGHED_LIGHTS = 16
"""Lights, the strongest, that the choice among lights tells apart by what they bring to a point."""

LAMP_GRID = 2
"""Points per pixel, along an axis, at which lamps are looked for that the camera sees."""
LAMP_NONE, LAMP_UNSURE = 0, 255
"""What may be there instead of the number of a lamp (cl/kernels/lamp_edges.cl)."""

FLIGHT_STRATA = 8
"""Points of an exact flight at which emission is gathered, if at several; a power of two."""

COAT_ENTRIES = 64
"""Entries of the table of what a rough plastic's coat lets through, over the cosine of incidence."""

BLACKBODY_BINS = 1024
"""Entries of the table of blackbodies that is interpolated: within 1e-3 of the largest channel."""
BLACKBODY_MIDDLE_KELVIN = 3000.0
"""Temperature in the middle of that table, where colours change most."""
