"""Where NanoVDB's nodes have their fields, which follows from the type of their values as C++ lays them out.

Source: PNanoVDB.h, pnanovdb_grid_type_constants; NanoVDB.h, RootData, InternalData, LeafData, version 32.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

ALIGNMENT = 32
# Edge of a child in samples, and children per edge, of internal nodes.
UPPER, LOWER = (128, 32), (8, 16)
NODE_MASKS = 32  # where both kinds have their masks, after a box and flags
LEAF_MASK = 16
LEAF_FIELDS = 80


@dataclass(frozen=True)
class NanoType:
    """A type of values: NumPy's letter, values of a sample, letter of the mean, and whether it is quantised.

    bits : of a quantised value in a leaf: 4, 8, 16, or 0 where each leaf says so itself.
    """

    code: str
    channels: int = 1
    mean: str = "f"
    quantised: bool = False
    bits: int = 0

    @property
    def value(self) -> np.dtype:
        """Numbers of tiles and of the background, and of leaves that are not quantised."""
        return np.dtype("<" + self.code)


READABLE = {
    "Float": NanoType("f"),
    "Double": NanoType("d", mean="d"),
    "Int16": NanoType("i2"),
    "Int32": NanoType("i4"),
    "Int64": NanoType("i8", mean="d"),
    "UInt32": NanoType("u4"),
    "UInt8": NanoType("u1"),
    "Half": NanoType("e"),
    "Vec3f": NanoType("f", channels=3),
    "Vec3d": NanoType("d", channels=3, mean="d"),
    "Fp4": NanoType("f", quantised=True, bits=4),
    "Fp8": NanoType("f", quantised=True, bits=8),
    "Fp16": NanoType("f", quantised=True, bits=16),
    "FpN": NanoType("f", quantised=True),
}
"""What of nvdb_header.TYPES becomes float32."""


def up(offset: int, alignment: int) -> int:
    """The next multiple."""
    return -(-offset // alignment) * alignment


@dataclass(frozen=True)
class Layout:
    """Byte offsets in nodes, and the sizes of nodes.

    background, root : the root's background, and its size, after which its tiles come.
    tile_value, tile : the value in one of the root's tiles, and the tile's size.
    entry : size of an entry of an internal node's table.  upper_table, upper, lower_table, lower : where the
        tables of both kinds begin, and their nodes' sizes.
    leaf_values, leaf : where a leaf's values begin, and its size (0 where leaves differ).
    """

    background: int
    root: int
    tile_value: int
    tile: int
    entry: int
    upper_table: int
    upper: int
    lower_table: int
    lower: int
    leaf_values: int
    leaf: int

    @classmethod
    def of(cls, kind: NanoType) -> Layout:
        """The layout for values of a type."""
        number, mean = kind.value.itemsize, np.dtype(kind.mean).itemsize
        size = number * kind.channels

        def statistics_end(offset: int) -> int:
            """Where fields after a minimum, a maximum, a mean and a deviation may begin."""
            return up(up(offset, number) + 2 * size, mean) + 2 * mean

        background = up(28, number)
        root = up(statistics_end(background + size), ALIGNMENT)
        tile_value = up(20, number)
        # a table's entries hold a value or an offset of 64 bits
        entry = up(max(size, 8), 8)
        upper, lower = (
            up(statistics_end(NODE_MASKS + 2 * edge**3 // 8), ALIGNMENT) for _, edge in (UPPER, LOWER)
        )
        leaf_values = up(statistics_end(LEAF_FIELDS), ALIGNMENT)
        leaf = up(leaf_values + 512 * size, ALIGNMENT)
        if kind.quantised:
            leaf_values = LEAF_FIELDS + 16
            leaf = leaf_values + 64 * kind.bits if kind.bits else 0
        return cls(
            background=background,
            root=root,
            tile_value=tile_value,
            tile=up(tile_value + size, ALIGNMENT),
            entry=entry,
            upper_table=upper,
            upper=up(upper + entry * UPPER[1] ** 3, ALIGNMENT),
            lower_table=lower,
            lower=up(lower + entry * LOWER[1] ** 3, ALIGNMENT),
            leaf_values=leaf_values,
            leaf=leaf,
        )
