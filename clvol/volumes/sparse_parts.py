"""Leaves and tiles of a tree, OpenVDB's or NanoVDB's, put together within limits: a SparseGrid."""

from __future__ import annotations

from typing import TYPE_CHECKING, NoReturn

import numpy as np

from clvol.volumes.brick_tree import MOST_EXTENT, PRUNE
from clvol.volumes.files import allocate
from clvol.volumes.grid import SparseGrid
from clvol.volumes.narrowing import Narrowing

if TYPE_CHECKING:
    from collections.abc import Sequence

    from clvol.volumes.vdb_stream import VdbStream

LEAF_EDGE, LEAF_VOXELS, LEAF_MASK_BYTES = 8, 512, 64
ROOT_CHILD_EDGE = 4096
# Children per edge of an internal node, by the edge of a child in samples.
INTERNAL_NODES = {128: 32, LEAF_EDGE: 16}
# Beyond 2²⁴ index positions are no longer exact in float32, the device's precision.
LARGEST_INDEX = 1 << 24
# Bricks on a side of a root tile, or just beyond it, and what finding and bounding one takes.
TILE_SIDE_BRICKS = 6 * (ROOT_CHILD_EDGE // LEAF_EDGE + 1) ** 2
BRICK_BYTES = 128


def child_coordinates(edge: int) -> np.ndarray:
    """x, y, z of a node's children in the tree's order (x slowest), int32 (edge³, 3)."""
    axes = np.meshgrid(*[np.arange(edge, dtype=np.int32)] * 3, indexing="ij")
    return np.stack(axes, axis=-1).reshape(-1, 3)


def mask_bits(masks: bytes | np.ndarray) -> np.ndarray:
    """Bits of a mask as bool, lowest bit of the first byte first; of each row for a 2-D array."""
    rows = np.frombuffer(masks, np.uint8) if isinstance(masks, bytes) else masks
    return np.unpackbits(rows, axis=-1, bitorder="little").view(bool)


class SparseParts:
    """The arrays of a SparseGrid while its file is read; a reader derives from it.

    Parameters
    ----------
    stream : the file, in whose name errors are raised.
    channels : values of a sample.
    max_bytes : a VolumeError is raised before the arrays would take more.
    """

    leaf_values: np.ndarray
    leaf_active: np.ndarray
    background: np.ndarray

    def __init__(self, stream: VdbStream, channels: int, max_bytes: int) -> None:
        self.stream, self.channels, self.max_bytes = stream, channels, max_bytes
        self.narrowed = Narrowing(stream.where)
        self.leaf_count = self.tile_count = 0
        self._leaf_origins: list[np.ndarray] = []
        self._tiles: list[tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]] = []
        self._roots: set[tuple[int, ...]] = set()

    def fail(self, what: str, hint: str = "") -> NoReturn:
        """Raise a VolumeError for this file; without a hint it is taken to be damaged."""
        if hint:
            self.stream.fail(what, hint)
        self.stream.fail(what)

    def claim(self, leaves: int, tiles: int) -> None:
        """Fail if so many leaves and tiles (held twice while they are joined) exceed the limit."""
        leaf_bytes = 4 * LEAF_VOXELS * self.channels + LEAF_MASK_BYTES + 12
        tile_bytes = 12 + 4 + 4 * self.channels + 1
        if leaves * leaf_bytes + 2 * tiles * tile_bytes > self.max_bytes:
            self.fail(
                f"{leaves} leaves and {tiles} tiles need more than the limit of {self.max_bytes} bytes",
                "use a smaller grid",
            )

    def set_background(self, stored: float | Sequence[float] | np.ndarray) -> None:
        """Keep the value outside of leaves and tiles, which must be finite, as float32."""
        self.background = self.narrowed(np.array(stored, np.float64).reshape(self.channels))
        if not np.isfinite(self.background).all():
            self.fail(f"the background is {', '.join(map(str, np.ravel(stored)))}")

    def differs(self, values: np.ndarray) -> np.ndarray:
        """Whether values, float32 (n, channels), are not the background's: bool (n,)."""
        different: np.ndarray = (values != self.background).any(axis=-1)
        return different

    def add_root_tiles(self, origins: np.ndarray, values: np.ndarray, active: np.ndarray) -> None:
        """Keep tiles of 4096³ samples, those of inactive background aside."""
        kept = np.flatnonzero(active | self.differs(values))
        if kept.size * TILE_SIDE_BRICKS * BRICK_BYTES > self.max_bytes:
            self.fail(
                f"{kept.size} root tiles of {ROOT_CHILD_EDGE}³ samples have {kept.size * TILE_SIDE_BRICKS}"
                f" bricks at their sides: more than the limit of {self.max_bytes} bytes can hold",
                PRUNE,
            )
        for origin in origins[kept].tolist():
            self.add_root_origin(tuple(origin))
        if kept.size:
            self.add_tiles(origins[kept], ROOT_CHILD_EDGE, values[kept], active[kept])

    def add_root_origin(self, origin: tuple[int, ...]) -> None:
        """Fail if `origin` is off the root's lattice, absurdly far out or taken already."""
        if any(c % ROOT_CHILD_EDGE or not -LARGEST_INDEX <= c < LARGEST_INDEX for c in origin):
            self.fail(f"a node lies at {origin}: not a multiple of {ROOT_CHILD_EDGE} within ±2^24")
        if origin in self._roots:
            self.fail(f"two nodes lie at {origin}")
        self._roots.add(origin)

    def add_tiles(self, origins: np.ndarray, size: int, values: np.ndarray, active: np.ndarray) -> None:
        """Keep constant cells of one size."""
        self.tile_count += len(values)
        self.claim(self.leaf_count, self.tile_count)
        self._tiles.append((origins, np.full(len(values), size, np.int32), values, active))

    def add_leaves(self, origins: np.ndarray) -> None:
        """Keep where leaves are, int32 (n, 3)."""
        self.leaf_count += len(origins)
        self._leaf_origins.append(origins)

    def join(self) -> None:
        """Make arrays of all leaves and tiles, once they are known: those of the leaves' values are empty."""
        self.claim(self.leaf_count, self.tile_count)
        self.leaf_origins = np.concatenate([np.empty((0, 3), np.int32), *self._leaf_origins])
        none = (
            np.empty((0, 3), np.int32),
            np.empty(0, np.int32),
            np.empty((0, self.channels), np.float32),
            np.empty(0, bool),
        )
        columns = [np.concatenate(column) for column in zip(none, *self._tiles, strict=True)]
        self.tile_origins, self.tile_sizes, self.tile_values, self.tile_active = columns
        self._check_extent()
        shape = (self.leaf_count, LEAF_EDGE, LEAF_EDGE, LEAF_EDGE, self.channels)
        self.leaf_values = allocate(shape, np.float32, self.stream.where)
        self.leaf_active = allocate((self.leaf_count, LEAF_MASK_BYTES), np.uint8, self.stream.where)

    def _check_extent(self) -> None:
        """Fail if leaves and tiles lie too far apart for the brick map to place them."""
        corners = np.concatenate([self.leaf_origins, self.tile_origins])
        if not len(corners):
            return
        ends = np.concatenate([self.leaf_origins + LEAF_EDGE, self.tile_origins + self.tile_sizes[:, None]])
        extent = [int(size) for size in ends.max(axis=0) - corners.min(axis=0)]
        if max(extent) > MOST_EXTENT:
            self.fail(
                f"leaves and tiles span {' x '.join(map(str, extent))} samples: more than the limit of"
                f" {MOST_EXTENT} along an axis",
                PRUNE,
            )

    def put_leaves(self, first: int, values: np.ndarray, active: np.ndarray) -> None:
        """Values, float32 (n, 512, channels) in the tree's order, and masks of the leaves from `first` on."""
        rows = slice(first, first + len(values))
        self.leaf_active[rows] = active
        # The trees store x slowest, SparseGrid z slowest.
        self.leaf_values[rows] = values.reshape(-1, 8, 8, 8, self.channels).transpose(0, 3, 2, 1, 4)

    def grid(self, index_to_world: np.ndarray, kind: str, name: str, source: str) -> SparseGrid:
        """What was read."""
        self.narrowed.check()
        return SparseGrid(
            leaf_origins=self.leaf_origins,
            leaf_values=self.leaf_values,
            leaf_active=self.leaf_active,
            tile_origins=self.tile_origins,
            tile_sizes=self.tile_sizes,
            tile_values=self.tile_values,
            tile_active=self.tile_active,
            background=self.background,
            index_to_world=index_to_world,
            active_box=self._active_box(),
            kind=kind,
            name=name,
            source=source,
        )

    def _active_box(self) -> np.ndarray:
        """Inclusive box of the active samples, int32 (2, 3); upper below lower where there are none."""
        return active_box(
            self.leaf_origins,
            self.leaf_active,
            self.tile_origins[self.tile_active],
            self.tile_sizes[self.tile_active],
        )


def active_box(
    leaf_origins: np.ndarray, leaf_active: np.ndarray, tile_origins: np.ndarray, tile_sizes: np.ndarray
) -> np.ndarray:
    """Inclusive box of the samples that masks of leaves say are active, and of active tiles, int32 (2, 3)."""
    # A mask is 8 x 8 bytes, [x, y], with z in the bits of each byte.
    masks = leaf_active.reshape(-1, 8, 8)
    along_x, along_y = (masks != 0).any(axis=2), (masks != 0).any(axis=1)
    along_z = np.unpackbits(np.bitwise_or.reduce(masks, axis=(1, 2))[:, None], axis=1, bitorder="little")
    used = np.stack([along_x, along_y, along_z.view(bool)], axis=1)
    filled = along_x.any(axis=1)
    first = leaf_origins + used.argmax(axis=2)
    last = leaf_origins + 7 - used[:, :, ::-1].argmax(axis=2)
    lower = np.concatenate([first[filled], tile_origins])
    upper = np.concatenate([last[filled], tile_origins + tile_sizes[:, None] - 1])
    if not len(lower):
        return np.array([[0, 0, 0], [-1, -1, -1]], np.int32)
    return np.stack([lower.min(axis=0), upper.max(axis=0)]).astype(np.int32)


CHILD_COORDINATES = {edge: child_coordinates(edge) for edge in INTERNAL_NODES.values()}
