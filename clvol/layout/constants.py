"""Numbers that host and device have to agree on."""

from __future__ import annotations

COUNTER_STRIDE = 16
"""Queue counters of a group, padded to a cache line."""

BVH_WIDTH = 8
"""Children of a node of the surfaces' hierarchy."""
BVH_PACKET = 8
"""Primitives that a leaf holds at most, and that are tested together: the width of the device's vectors."""
BVH_MOST_DEPTH = 48
"""Splits on the way to a leaf, at most: nodes that could become deeper are halved by number."""
BVH_STACK = (BVH_WIDTH - 1) * BVH_MOST_DEPTH + 1
"""Nodes that a traversal may keep waiting: siblings on every level."""

RANDOMIZATIONS = 4
"""Independent randomisations that a pixel's low-discrepancy samples are dealt to in turn; a power of two."""

BLACKBODY_BINS = 1024
"""Entries of the table of blackbodies that is interpolated: within 1e-3 of the largest channel."""
BLACKBODY_MIDDLE_KELVIN = 3000.0
"""Temperature in the middle of that table, where colours change most."""
