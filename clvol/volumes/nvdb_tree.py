"""The tree of a NanoVDB grid to flat arrays.

Nodes point at their children by offsets, and lie level by level: root, nodes of 32³ children of 128³ samples,
nodes of 16³ leaves, leaves.  Where a node is in the world follows from who points at it, as in look-ups.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from clvol.volumes.nvdb_layout import LEAF_FIELDS, LEAF_MASK, LOWER, NODE_MASKS, UPPER, Layout, NanoType
from clvol.volumes.sparse_parts import CHILD_COORDINATES, LEAF_MASK_BYTES, SparseParts, mask_bits

if TYPE_CHECKING:
    from clvol.volumes.nvdb_bytes import GridBytes

# Bytes of nodes decoded at once: large enough for NumPy, small enough to stay in the cache.
BATCH_BYTES = 1 << 20
# An entry of a 64-bit key of the root: 21 bits for each of x, y, z, in 4096 samples.
KEY_BITS, ROOT_SHIFT = 21, 12


class NanoTree(SparseParts):
    """Leaves and tiles of one tree as arrays, in the form SparseGrid documents.

    Reading fails with a VolumeError before its arrays would take more than `max_bytes`.
    """

    def __init__(self, grid: GridBytes, kind: NanoType, max_bytes: int) -> None:
        super().__init__(grid.stream, kind.channels, max_bytes)
        self.bytes, self.kind, self.layout = grid, kind, Layout.of(kind)

    def read(self, root: int) -> None:
        """Read the tree below the root node at this offset."""
        origins, offsets = self.read_root(root)
        origins, offsets = self.read_internal(origins, offsets, *UPPER)
        origins, offsets = self.read_internal(origins, offsets, *LOWER)
        self.add_leaves(origins)
        smallest = self.layout.leaf or self.layout.leaf_values
        if self.leaf_count * smallest > self.bytes.size:
            self.fail(f"{self.leaf_count} leaves do not fit into its {self.bytes.size} bytes")
        self.join()
        self.read_leaves(offsets)

    def read_root(self, at: int) -> tuple[np.ndarray, np.ndarray]:
        """Background and tiles of the root; origins, int32 (n, 3), and offsets of the nodes below it."""
        layout = self.layout
        head = self.bytes.take(at, layout.root)
        self.set_background(self._values(np.frombuffer(head, np.uint8)[None, layout.background :])[0])
        count = int(np.frombuffer(head, "<u4", 1, 24)[0])
        if count * layout.tile > self.bytes.size:
            self.fail(f"its root has {count} tiles, in {self.bytes.size} bytes")
        tiles = np.frombuffer(self.bytes.take(at + layout.root, count * layout.tile), np.uint8)
        tiles = tiles.reshape(-1, layout.tile)
        key = tiles[:, :8].copy().view("<u8")[:, 0]
        shifts = np.array([2 * KEY_BITS, KEY_BITS, 0], np.uint64)
        fields = (key[:, None] >> shifts & np.uint64((1 << KEY_BITS) - 1)).astype(np.uint32)
        origins = (fields << np.uint32(ROOT_SHIFT)).view(np.int32)
        child = tiles[:, 8:16].copy().view("<i8")[:, 0]
        active = tiles[:, 16:20].copy().view("<u4")[:, 0] > 0
        constant = child == 0
        values = self._values(tiles[constant, layout.tile_value :])
        self.add_root_tiles(origins[constant], values, active[constant])
        for origin in origins[~constant].tolist():
            self.add_root_origin(tuple(origin))
        below, parents = child[~constant], np.full(np.count_nonzero(~constant), at, np.int64)
        sizes = layout.root + count * layout.tile, layout.upper
        return self._next_level(origins[~constant], parents, below, sizes)

    def read_internal(
        self, origins: np.ndarray, offsets: np.ndarray, child_edge: int, edge: int
    ) -> tuple[np.ndarray, np.ndarray]:
        """Tiles of internal nodes at these places; origins and offsets of the nodes below them."""
        layout = self.layout
        table, size, child_size = (
            (layout.upper_table, layout.upper, layout.lower)
            if (child_edge, edge) == UPPER
            else (layout.lower_table, layout.lower, layout.leaf or layout.leaf_values)
        )
        below: list[tuple[np.ndarray, np.ndarray, np.ndarray]] = []
        count = max(1, BATCH_BYTES // size)
        for first in range(0, len(offsets), count):
            at = offsets[first : first + count]
            nodes = self.bytes.records(at, size)
            places = origins[first : first + count, None] + child_edge * CHILD_COORDINATES[edge]
            below.append(self._read_nodes(nodes, at, places, table, child_edge))
            self.claim(sum(len(part) for part, _, _ in below), self.tile_count)
        nowhere = (np.empty((0, 3), np.int32), np.empty(0, np.int64), np.empty(0, np.int64))
        found, parents, child = (np.concatenate(column) for column in zip(nowhere, *below, strict=True))
        return self._next_level(found, parents, child, (size, child_size))

    def _read_nodes(
        self, nodes: np.ndarray, at: np.ndarray, places: np.ndarray, table: int, child_edge: int
    ) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Keep the tiles of some nodes; `places` are the origins of their entries, int32 (n, entries, 3).

        Of their children: origins, the offsets of the nodes that point at them, and what these say.
        """
        mask_bytes = places.shape[1] // 8
        masks = nodes[:, NODE_MASKS : NODE_MASKS + 2 * mask_bytes]
        active, is_child = mask_bits(masks[:, :mask_bytes]), mask_bits(masks[:, mask_bytes:])
        entries = nodes[:, table : table + places.shape[1] * self.layout.entry]
        entries = entries.reshape(*places.shape[:2], self.layout.entry)
        tiles = ~is_child
        values = self._values(entries[tiles])
        kept = active[tiles] | self.differs(values)
        if kept.any():
            self.add_tiles(places[tiles][kept], child_edge, values[kept], active[tiles][kept])
        child = entries[is_child][:, :8].copy().view("<i8")[:, 0]
        return places[is_child], np.repeat(at, is_child.sum(axis=1)), child

    def _values(self, raw: np.ndarray) -> np.ndarray:
        """What bytes, uint8 (n, at least a value's), begin with: float32 (n, channels)."""
        stored = np.ascontiguousarray(raw[:, : self.kind.value.itemsize * self.channels])
        return self.narrowed(stored.view(self.kind.value))

    def _next_level(
        self, origins: np.ndarray, parents: np.ndarray, child: np.ndarray, sizes: tuple[int, int]
    ) -> tuple[np.ndarray, np.ndarray]:
        """Nodes in the order of their offsets, `parents` + `child`; fail where nodes overlap.

        sizes : of the nodes that point at them, and their own.
        """
        offsets, (parent, own) = parents + child, sizes
        within = np.flatnonzero((child > -own) & (child < parent))
        if len(within):
            self.fail(f"the node at byte {offsets[within[0]]} lies within the one that points at it")
        order = np.argsort(offsets, kind="stable")
        offsets = offsets[order]
        overlaps = np.flatnonzero(np.diff(offsets) < own)
        if len(overlaps):
            self.fail(f"nodes overlap at byte {offsets[overlaps[0] + 1]}")
        return origins[order], offsets

    def read_leaves(self, offsets: np.ndarray) -> None:
        """Values and masks of all leaves, which are in the order of their offsets."""
        count = max(1, BATCH_BYTES // (self.layout.leaf or 2048))
        for first in range(0, len(offsets), count):
            at = offsets[first : first + count]
            if self.layout.leaf:
                leaves = self.bytes.records(at, self.layout.leaf)
                values = self._leaf_values(leaves)
            else:
                leaves, values = self._adaptive_leaves(at)
            mask = leaves[:, LEAF_MASK : LEAF_MASK + LEAF_MASK_BYTES]
            self.put_leaves(first, values.reshape(len(at), 512, self.channels), mask)

    def _leaf_values(self, leaves: np.ndarray) -> np.ndarray:
        """Of leaves of one size, uint8 (n, size): float32 (n, 512 · channels)."""
        stored = np.ascontiguousarray(leaves[:, self.layout.leaf_values :])
        if self.kind.quantised:
            return _dequantised(leaves, stored, self.kind.bits)
        numbers = stored[:, : 512 * self.channels * self.kind.value.itemsize].view(self.kind.value)
        return self.narrowed(numbers)

    def _adaptive_leaves(self, offsets: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Of leaves that say how many bits their values have: their heads, and values float32 (n, 512)."""
        heads, codes = [], []
        for at in offsets.tolist():
            head = self.bytes.take(at, self.layout.leaf_values)
            bits = 1 << (head[15] >> 5)
            if bits > 16:
                self.fail(f"the leaf at byte {at} has values of {bits} bits, 1 to 16 are possible")
            heads.append(head)
            codes.append(self.bytes.take(at + len(head), 64 * bits))
        leaves = np.frombuffer(b"".join(heads), np.uint8).reshape(len(heads), -1)
        widths = 1 << (leaves[:, 15] >> 5)
        values = np.empty((len(heads), 512), np.float32)
        for bits in np.unique(widths):
            own = np.flatnonzero(widths == bits)
            stored = np.frombuffer(b"".join(codes[row] for row in own), np.uint8).reshape(len(own), -1)
            values[own] = _dequantised(leaves[own], stored, int(bits))
        return leaves, values


def _dequantised(leaves: np.ndarray, stored: np.ndarray, bits: int) -> np.ndarray:
    """Values of quantised leaves, float32 (n, 512): code · quantum + minimum, the lowest bits first."""
    minimum, quantum = leaves[:, LEAF_FIELDS : LEAF_FIELDS + 8].copy().view("<f4").T[..., None]
    if bits == 16:
        codes = stored.view("<u2")
    else:
        shifts = np.arange(0, 8, bits, dtype=np.uint8)
        codes = (stored[..., None] >> shifts & np.uint8((1 << bits) - 1)).reshape(len(stored), 512)
    with np.errstate(over="ignore", invalid="ignore"):
        values: np.ndarray = codes.astype(np.float32) * quantum + minimum
    return values
