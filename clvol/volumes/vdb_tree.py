"""The tree of an OpenVDB grid: root, internal nodes 32³ and 16³, leaves 8³, to flat arrays."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from clvol.volumes.brick_tree import MOST_EXTENT, PRUNE
from clvol.volumes.files import allocate
from clvol.volumes.vdb_stream import ACTIVE_MASK, VdbStream

LEAF_EDGE, LEAF_VOXELS, LEAF_MASK_BYTES = 8, 512, 64
ROOT_CHILD_EDGE = 4096
# Children per edge of an internal node, by the edge of a child in samples.
INTERNAL_NODES = {128: 32, LEAF_EDGE: 16}
# Beyond 2²⁴ index positions are no longer exact in float32, the device's precision.
LARGEST_INDEX = 1 << 24
LEAF_BYTES = 4 * LEAF_VOXELS + LEAF_MASK_BYTES + 12
TILE_BYTES = 12 + 4 + 4 + 1
# Bricks on a side of a root tile, or just beyond it, and what finding and bounding one takes.
TILE_SIDE_BRICKS = 6 * (ROOT_CHILD_EDGE // LEAF_EDGE + 1) ** 2
BRICK_BYTES = 128
# Leaves decoded at once: large enough for NumPy, small enough to stay in the cache.
BATCH = 512

# How a node's inactive values are stored ("metadata" byte of io/Compression.h).
BACKGROUND, MINUS_BACKGROUND, ONE_VALUE, MASK_BACKGROUNDS, MASK_ONE_VALUE, MASK_TWO_VALUES, ALL_VALUES = (
    range(7)
)


def child_coordinates(edge: int) -> np.ndarray:
    """x, y, z of a node's children in the tree's order (x slowest), int32 (edge³, 3)."""
    axes = np.meshgrid(*[np.arange(edge, dtype=np.int32)] * 3, indexing="ij")
    return np.stack(axes, axis=-1).reshape(-1, 3)


def mask_bits(masks: bytes | np.ndarray) -> np.ndarray:
    """Bits of a mask as bool, lowest bit of the first byte first; of each row for a 2-D array."""
    rows = np.frombuffer(masks, np.uint8) if isinstance(masks, bytes) else masks
    return np.unpackbits(rows, axis=-1, bitorder="little").view(bool)


@dataclass(frozen=True)
class StoredNode:
    """Values of one node as stored: `payload` holds the active ones (`packed`) or all of them."""

    packed: bool
    inactive: tuple[float, float]
    selection: bytes
    payload: bytes


class NodeValues:
    """Reads the values of nodes, internal ones and leaves alike, and expands them to float32.

    Parameters
    ----------
    code : the tree's type as a `struct` and NumPy letter, one of "fdiq".
    half : the blocks hold 16-bit floats.  compression : flags of the grid.
    background : the tree's, in its own type.
    """

    def __init__(self, stream: VdbStream, code: str, half: bool, compression: int, background: float) -> None:
        self.stream, self.half, self.compression = stream, half, compression
        self.value_layout = "<" + code
        self.stored_type = np.dtype("<e" if half else "<" + code)
        self.background = background

    def read(self, mask: bytes) -> StoredNode:
        """The node's values at the cursor; `mask` holds its active bits."""
        stream = self.stream
        code = stream.take(1)[0]
        inactive = (-self.background, self.background)
        selection = bytes(len(mask))
        if code in (BACKGROUND, ALL_VALUES):
            inactive = (self.background, self.background)
        elif code in (ONE_VALUE, MASK_ONE_VALUE):
            inactive = (*stream.unpack(self.value_layout), self.background)
        elif code == MASK_TWO_VALUES:
            inactive = stream.unpack(self.value_layout) + stream.unpack(self.value_layout)
        elif code not in (MINUS_BACKGROUND, MASK_BACKGROUNDS):
            stream.fail(f"a node at byte {stream.pos - 1} has code {code}, 0 to 6 are known")
        if code in (MASK_BACKGROUNDS, MASK_ONE_VALUE, MASK_TWO_VALUES):
            selection = stream.take(len(mask))
        packed = bool(self.compression & ACTIVE_MASK) and code != ALL_VALUES
        count = int.from_bytes(mask, "little").bit_count() if packed else 8 * len(mask)
        # OpenVDB skips an empty block of halves whole, but writes the size of any other.
        payload = b""
        if count or not self.half:
            payload = stream.block(count * self.stored_type.itemsize, self.compression)
        return StoredNode(packed, inactive, selection, payload)

    def expand(self, nodes: list[StoredNode], masks: np.ndarray) -> np.ndarray:
        """All values in tree order, float32 (nodes, values); `masks` are active bits, (nodes, bytes)."""
        selection = mask_bits(
            np.frombuffer(b"".join(n.selection for n in nodes), np.uint8).reshape(masks.shape)
        )
        packed = np.array([n.packed for n in nodes])
        payload = np.frombuffer(b"".join(n.payload for n in nodes), self.stored_type)
        # A double beyond float32 becomes infinite, and is reported as such when the values are checked.
        with np.errstate(over="ignore", invalid="ignore"):
            inactive = np.array([n.inactive for n in nodes], np.float64).astype(np.float32)
            values = np.where(selection, inactive[:, 1:], inactive[:, :1])
            values[mask_bits(masks) | ~packed[:, None]] = payload.astype(np.float32)
        return values


class VdbTree:
    """Leaves and tiles of one tree as arrays, in the form SparseGrid documents.

    Reading fails with a VolumeError before its arrays would take more than `max_bytes`.
    """

    def __init__(self, stream: VdbStream, code: str, half: bool, compression: int, max_bytes: int) -> None:
        self.stream, self.code, self.half = stream, code, half
        self.compression, self.max_bytes = compression, max_bytes
        self.tile_count = 0
        self._leaf_origins: list[np.ndarray] = [np.empty((0, 3), np.int32)]
        self._tiles: list[tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]] = []

    def read(self) -> None:
        """Read topology, then the leaves' values."""
        self.read_topology()
        self.leaf_origins = np.concatenate(self._leaf_origins)
        self.tile_origins, self.tile_sizes, self.tile_values, self.tile_active = self._join_tiles()
        self.check_extent()
        self.read_leaves()

    def claim(self, leaves: int, tiles: int) -> None:
        """Fail if so many leaves and tiles (held twice while they are joined) exceed the limit."""
        if leaves * LEAF_BYTES + 2 * tiles * TILE_BYTES > self.max_bytes:
            self.stream.fail(
                f"{leaves} leaves and {tiles} tiles need more than the limit of {self.max_bytes} bytes",
                "use a smaller grid, or raise max_bytes",
            )

    def read_topology(self) -> None:
        """Root tiles, then every internal node: tiles of their own and the origins of their leaves."""
        stream = self.stream
        (buffers,) = stream.unpack("<i")
        if buffers != 1:
            stream.fail(f"the tree has {buffers} buffers, 1 is expected")
        (background,) = stream.unpack("<" + self.code)
        with np.errstate(over="ignore"):
            self.background = np.float32(background)
        if not np.isfinite(self.background):
            stream.fail(f"the background is {background}")
        self.nodes = NodeValues(stream, self.code, self.half, self.compression, background)
        tiles, children = stream.unpack("<II")
        seen = self.read_root_tiles(tiles)
        stream.require(children * 12)
        for _ in range(children):
            origin = stream.unpack("<3i")
            self.check_root_origin(origin, seen)
            self.read_internal(np.array(origin, np.int32), 128)

    def read_root_tiles(self, count: int) -> set[tuple[int, ...]]:
        """Keep the root's tiles, those of inactive background aside; their origins."""
        record = np.dtype([("origin", "<i4", 3), ("value", "<" + self.code), ("active", "?")])
        self.stream.require(count * record.itemsize)
        self.claim(0, count)
        table = np.frombuffer(self.stream.take(count * record.itemsize), record)
        with np.errstate(over="ignore"):
            values = table["value"].astype(np.float32)
        kept = np.flatnonzero(table["active"] | (values != self.background))
        bricks = kept.size * TILE_SIDE_BRICKS
        if bricks * BRICK_BYTES > self.max_bytes:
            self.stream.fail(
                f"{kept.size} root tiles of {ROOT_CHILD_EDGE}³ samples have {bricks} bricks at their sides:"
                f" more than the limit of {self.max_bytes} bytes can hold",
                PRUNE,
            )
        origins = table["origin"][kept]
        seen: set[tuple[int, ...]] = set()
        for origin in origins.tolist():
            self.check_root_origin(tuple(origin), seen)
        if kept.size:
            self.add_tiles(origins, ROOT_CHILD_EDGE, values[kept], table["active"][kept])
        return seen

    def check_root_origin(self, origin: tuple[int, ...], seen: set[tuple[int, ...]]) -> None:
        """Fail if `origin` is off the root's lattice, absurdly far out or taken already."""
        if any(c % ROOT_CHILD_EDGE or not -LARGEST_INDEX <= c < LARGEST_INDEX for c in origin):
            self.stream.fail(f"a node lies at {origin}: not a multiple of {ROOT_CHILD_EDGE} within ±2^24")
        if origin in seen:
            self.stream.fail(f"two nodes lie at {origin}")
        seen.add(origin)

    def read_internal(self, origin: np.ndarray, child_edge: int) -> None:
        """An internal node: its tiles and its children; the leaves' masks come again with their values."""
        stream = self.stream
        edge = INTERNAL_NODES[child_edge]
        child_mask, value_mask = stream.take(edge**3 // 8), stream.take(edge**3 // 8)
        node = self.nodes.read(value_mask)
        values = self.nodes.expand([node], np.frombuffer(value_mask, np.uint8)[None])[0]
        is_child, active = mask_bits(child_mask), mask_bits(value_mask)
        cells = np.flatnonzero(~is_child & (active | (values != self.background)))
        coordinates = CHILD_COORDINATES[edge]
        if cells.size:
            self.add_tiles(origin + child_edge * coordinates[cells], child_edge, values[cells], active[cells])
        child_origins = origin + child_edge * coordinates[is_child]
        if child_edge == LEAF_EDGE:
            stream.skip(LEAF_MASK_BYTES * len(child_origins))
            self._leaf_origins.append(child_origins)
        else:
            for child_origin in child_origins:
                self.read_internal(child_origin, LEAF_EDGE)

    def add_tiles(self, origins: np.ndarray, size: int, values: np.ndarray, active: np.ndarray) -> None:
        """Keep constant cells of one size."""
        self.tile_count += len(values)
        self.claim(0, self.tile_count)
        self._tiles.append((origins, np.full(len(values), size, np.int32), values, active))

    def _join_tiles(self) -> tuple[np.ndarray, ...]:
        none = (np.empty((0, 3), np.int32), np.empty(0, np.int32), np.empty(0, np.float32), np.empty(0, bool))
        return tuple(np.concatenate(column) for column in zip(none, *self._tiles, strict=True))

    def check_extent(self) -> None:
        """Fail if leaves and tiles lie too far apart for the brick map to place them."""
        corners = np.concatenate([self.leaf_origins, self.tile_origins])
        if not len(corners):
            return
        ends = np.concatenate([self.leaf_origins + LEAF_EDGE, self.tile_origins + self.tile_sizes[:, None]])
        extent = [int(size) for size in ends.max(axis=0) - corners.min(axis=0)]
        if max(extent) > MOST_EXTENT:
            self.stream.fail(
                f"leaves and tiles span {' x '.join(map(str, extent))} samples: more than the limit of"
                f" {MOST_EXTENT} along an axis",
                PRUNE,
            )

    def read_leaves(self) -> None:
        """Values and masks of all leaves, in the order of their origins."""
        count = len(self.leaf_origins)
        self.claim(count, self.tile_count)
        self.stream.require(count * LEAF_MASK_BYTES)
        where = self.stream.where
        self.leaf_values = allocate((count, LEAF_EDGE, LEAF_EDGE, LEAF_EDGE), np.float32, where)
        self.leaf_active = allocate((count, LEAF_MASK_BYTES), np.uint8, where)
        for first in range(0, count, BATCH):
            masks, nodes = [], []
            for _ in range(min(BATCH, count - first)):
                mask = self.stream.take(LEAF_MASK_BYTES)
                masks.append(mask)
                nodes.append(self.nodes.read(mask))
            batch = slice(first, first + len(nodes))
            self.leaf_active[batch] = np.frombuffer(b"".join(masks), np.uint8).reshape(-1, LEAF_MASK_BYTES)
            values = self.nodes.expand(nodes, self.leaf_active[batch])
            # OpenVDB stores x slowest, SparseGrid z slowest.
            self.leaf_values[batch] = values.reshape(-1, 8, 8, 8).transpose(0, 3, 2, 1)


CHILD_COORDINATES = {edge: child_coordinates(edge) for edge in INTERNAL_NODES.values()}
