"""The tree of an OpenVDB grid: root, internal nodes 32³ and 16³, leaves 8³, to flat arrays."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from clvol.volumes.sparse_parts import (
    CHILD_COORDINATES,
    INTERNAL_NODES,
    LEAF_EDGE,
    LEAF_MASK_BYTES,
    SparseParts,
    mask_bits,
)
from clvol.volumes.vdb_stream import ACTIVE_MASK

if TYPE_CHECKING:
    from clvol.volumes.narrowing import Narrowing
    from clvol.volumes.vdb_stream import VdbStream

# Leaves decoded at once: large enough for NumPy, small enough to stay in the cache.
BATCH = 512

# How a node's inactive values are stored ("metadata" byte of io/Compression.h).
BACKGROUND, MINUS_BACKGROUND, ONE_VALUE, MASK_BACKGROUNDS, MASK_ONE_VALUE, MASK_TWO_VALUES, ALL_VALUES = (
    range(7)
)


@dataclass(frozen=True)
class StoredNode:
    """Values of one node as stored: `payload` holds the active ones (`packed`) or all of them."""

    packed: bool
    inactive: tuple[tuple[float, ...], tuple[float, ...]]
    selection: bytes
    payload: bytes


@dataclass(frozen=True)
class ValueType:
    """How a tree stores a value: the letter of `struct` and NumPy, one of "efdiq", and how many of them."""

    code: str
    channels: int = 1

    @property
    def layout(self) -> str:
        """Of one value, for `struct`."""
        return f"<{self.channels}{self.code}"

    @property
    def element(self) -> np.dtype:
        """One value as float32, as an element of an array: masks then choose whole values."""
        return np.dtype(np.float32) if self.channels == 1 else np.dtype((np.void, 4 * self.channels))


class NodeValues:
    """Reads the values of nodes, internal ones and leaves alike, and expands them to float32.

    Parameters
    ----------
    value : the tree's type.  half : the blocks hold 16-bit floats.  compression : flags of the grid.
    background : the tree's, in its own type.  narrowed : makes float32 of all values of the tree.
    """

    def __init__(
        self,
        stream: VdbStream,
        value: ValueType,
        half: bool,
        compression: int,
        background: tuple[float, ...],
        narrowed: Narrowing,
    ) -> None:
        self.narrowed = narrowed
        self.stream, self.value, self.half, self.compression = stream, value, half, compression
        self.stored_type = np.dtype("<e" if half else "<" + value.code)
        self.background = background
        self.minus_background = tuple(-number for number in background)

    def read(self, mask: bytes) -> StoredNode:
        """The node's values at the cursor; `mask` holds its active bits."""
        stream, layout = self.stream, self.value.layout
        code = stream.take(1)[0]
        inactive = (self.minus_background, self.background)
        selection = bytes(len(mask))
        if code in (BACKGROUND, ALL_VALUES):
            inactive = (self.background, self.background)
        elif code in (ONE_VALUE, MASK_ONE_VALUE):
            inactive = (stream.unpack(layout), self.background)
        elif code == MASK_TWO_VALUES:
            inactive = (stream.unpack(layout), stream.unpack(layout))
        elif code not in (MINUS_BACKGROUND, MASK_BACKGROUNDS):
            stream.fail(f"a node at byte {stream.pos - 1} has code {code}, 0 to 6 are known")
        if code in (MASK_BACKGROUNDS, MASK_ONE_VALUE, MASK_TWO_VALUES):
            selection = stream.take(len(mask))
        packed = bool(self.compression & ACTIVE_MASK) and code != ALL_VALUES
        count = int.from_bytes(mask, "little").bit_count() if packed else 8 * len(mask)
        # OpenVDB skips an empty block of halves whole, but writes the size of any other.
        payload = b""
        if count or not self.half:
            nbytes = count * self.value.channels * self.stored_type.itemsize
            payload = stream.block(nbytes, self.compression)
        return StoredNode(packed, inactive, selection, payload)

    def expand(self, nodes: list[StoredNode], masks: np.ndarray) -> np.ndarray:
        """Values in tree order, float32 (nodes, values, channels).  masks : active bits, (nodes, bytes)."""
        element, channels = self.value.element, self.value.channels
        selection = mask_bits(
            np.frombuffer(b"".join(n.selection for n in nodes), np.uint8).reshape(masks.shape)
        )
        packed = np.array([n.packed for n in nodes])
        payload = np.frombuffer(b"".join(n.payload for n in nodes), self.stored_type)
        inactive = self.narrowed(np.array([n.inactive for n in nodes], np.float64))
        first, second = np.moveaxis(inactive.view(element)[..., 0], 1, 0)[..., None]
        values = np.where(selection, second, first)
        values[mask_bits(masks) | ~packed[:, None]] = self.narrowed(payload).view(element)
        expanded: np.ndarray = values.view(np.float32).reshape(*values.shape, channels)
        return expanded


class VdbTree(SparseParts):
    """Leaves and tiles of one tree as arrays, in the form SparseGrid documents.

    Reading fails with a VolumeError before its arrays would take more than `max_bytes`.
    """

    def __init__(
        self, stream: VdbStream, value: ValueType, half: bool, compression: int, max_bytes: int
    ) -> None:
        super().__init__(stream, value.channels, max_bytes)
        self.value, self.half, self.compression = value, half, compression

    def read(self) -> None:
        """Read topology, then the leaves' values."""
        self.read_topology()
        self.claim(self.leaf_count, self.tile_count)
        self.stream.require(self.leaf_count * LEAF_MASK_BYTES)
        self.join()
        self.read_leaves()

    def read_topology(self) -> None:
        """Root tiles, then every internal node: tiles of their own and the origins of their leaves."""
        stream = self.stream
        (buffers,) = stream.unpack("<i")
        if buffers != 1:
            stream.fail(f"the tree has {buffers} buffers, 1 is expected")
        background = stream.unpack(self.value.layout)
        self.set_background(background)
        storage = self.value, self.half, self.compression
        self.nodes = NodeValues(stream, *storage, background, self.narrowed)
        tiles, children = stream.unpack("<II")
        self.read_root_tiles(tiles)
        stream.require(children * 12)
        for _ in range(children):
            origin = stream.unpack("<3i")
            self.add_root_origin(origin)
            self.read_internal(np.array(origin, np.int32), 128)

    def read_root_tiles(self, count: int) -> None:
        """The root's own tiles."""
        value = ("value", "<" + self.value.code, (self.channels,))
        record = np.dtype([("origin", "<i4", 3), value, ("active", "?")])
        self.stream.require(count * record.itemsize)
        self.claim(0, count)
        table = np.frombuffer(self.stream.take(count * record.itemsize), record)
        self.add_root_tiles(table["origin"], self.narrowed(table["value"]), table["active"])

    def read_internal(self, origin: np.ndarray, child_edge: int) -> None:
        """An internal node: its tiles and its children; the leaves' masks come again with their values."""
        stream = self.stream
        edge = INTERNAL_NODES[child_edge]
        child_mask, value_mask = stream.take(edge**3 // 8), stream.take(edge**3 // 8)
        node = self.nodes.read(value_mask)
        values = self.nodes.expand([node], np.frombuffer(value_mask, np.uint8)[None])[0]
        is_child, active = mask_bits(child_mask), mask_bits(value_mask)
        cells = np.flatnonzero(~is_child & (active | self.differs(values)))
        coordinates = CHILD_COORDINATES[edge]
        if cells.size:
            self.add_tiles(origin + child_edge * coordinates[cells], child_edge, values[cells], active[cells])
        child_origins = origin + child_edge * coordinates[is_child]
        if child_edge == LEAF_EDGE:
            stream.skip(LEAF_MASK_BYTES * len(child_origins))
            self.add_leaves(child_origins)
        else:
            for child_origin in child_origins:
                self.read_internal(child_origin, LEAF_EDGE)

    def read_leaves(self) -> None:
        """Values and masks of all leaves, in the order of their origins."""
        for first in range(0, self.leaf_count, BATCH):
            masks, nodes = [], []
            for _ in range(min(BATCH, self.leaf_count - first)):
                mask = self.stream.take(LEAF_MASK_BYTES)
                masks.append(mask)
                nodes.append(self.nodes.read(mask))
            active = np.frombuffer(b"".join(masks), np.uint8).reshape(-1, LEAF_MASK_BYTES)
            self.put_leaves(first, self.nodes.expand(nodes, active), active)
