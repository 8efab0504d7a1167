"""What stands at the brick places of a sparse grid, found by sorted keys: no array over a large box."""

from __future__ import annotations

from itertools import chain
from typing import TYPE_CHECKING

import numpy as np

from clvol.errors import VolumeError
from clvol.layout import BRICK_CELLS
from clvol.volumes.files import place
from clvol.volumes.tree import keys, rows_of, unique_places

if TYPE_CHECKING:
    from collections.abc import Iterator

    from clvol.volumes.grid import SparseGrid

MOST_PLACES = 1 << 24
"""Bricks that a sparse grid may need: they would take 49 GB."""
TABLE_PLACES = 1 << 18
"""Where a box has no more places than this, a table of all of them is faster than sorted keys."""
_CHUNK_PLACES = 1 << 18
_CORNERS = np.array(list(np.ndindex(2, 2, 2)))


class SparsePlaces:
    """Leaves and constants at brick places z, y, x, counted from `origin`, an index position (x, y, z).

    shape : bricks per axis, z y x; one place more per axis can be asked for.
    """

    def __init__(self, grid: SparseGrid, origin: tuple[int, int, int], shape: tuple[int, int, int]) -> None:
        self.background, self.shape = grid.background, shape
        self._where = place(grid.source, grid.name)
        self._origin = np.array(origin, np.int64)[::-1]
        at = (grid.leaf_origins[:, ::-1] - self._origin) // BRICK_CELLS
        inside = np.flatnonzero(self._holds(at))
        order = np.argsort(keys(at[inside]), kind="stable")
        self.leaf_places, self._leaf_rows = at[inside[order]], inside[order]
        self._leaf_keys = keys(self.leaf_places)
        self._table = self._leaf_table() if np.prod(np.array(shape) + 1) <= TABLE_PLACES else None
        self._tiles = [self._tiles_of(grid, int(edge)) for edge in np.unique(grid.tile_sizes)]

    def _holds(self, places: np.ndarray) -> np.ndarray:
        inside: np.ndarray = np.all((places >= 0) & (places <= np.array(self.shape)), axis=1)
        return inside

    def _tiles_of(self, grid: SparseGrid, edge: int) -> tuple[int, np.ndarray, np.ndarray, np.ndarray]:
        """Edge, first brick places, keys and values of tiles of one size, those far outside left out."""
        own = np.flatnonzero(grid.tile_sizes == edge)
        start = (grid.tile_origins[own, ::-1] - self._origin) // BRICK_CELLS
        at = grid.tile_origins[own, ::-1] // edge - self._origin // edge
        inside = ((at >= 0) & (start <= np.array(self.shape))).all(axis=1)
        key = keys(at[inside])
        order = np.argsort(key)
        return edge, start[inside][order], key[order], grid.tile_values[own][inside][order]

    def _leaf_table(self) -> np.ndarray:
        """Number of the leaf, or -1, at all places of a small box."""
        table = np.full(np.array(self.shape) + 1, -1, np.int32)
        table[tuple(self.leaf_places.T)] = self._leaf_rows
        return table

    def leaf(self, places: np.ndarray) -> np.ndarray:
        """Number of the leaf at each place, int (...), or -1."""
        if self._table is not None:
            numbers: np.ndarray = self._table[tuple(np.moveaxis(places, -1, 0))]
            return numbers
        if not len(self._leaf_rows):
            return np.full(places.shape[:-1], -1, np.intp)
        row = rows_of(self._leaf_keys, keys(places))
        return np.where(row >= 0, self._leaf_rows[row], -1)

    def constant(self, places: np.ndarray) -> np.ndarray:
        """Values of the tile at each place, or of the background, float32 (..., channels); leaves aside."""
        values = np.empty((*places.shape[:-1], len(self.background)), np.float32)
        values[...] = self.background
        if not self._tiles:
            return values
        for edge, _, tile_keys, tile_values in self._tiles:
            # a place and its tile have the same cell of the lattice of that edge
            cell = (places * BRICK_CELLS + self._origin) // edge - self._origin // edge
            row = rows_of(tile_keys, keys(cell))
            values[row >= 0] = tile_values[row[row >= 0]]
        return values

    def changing(self) -> np.ndarray:
        """Places of bricks whose samples, far faces included, meet a leaf or two constants: int (n, 3).

        Raises VolumeError where they are more than MOST_PLACES.
        """
        if self._table is not None:
            return np.argwhere(self._changing_in_box(self._table))
        found, pending = np.empty((0, 3), np.int64), []
        for part in self._candidates():
            pending.append(part[self._meets(part)])
            if sum(map(len, pending)) > max(len(found), _CHUNK_PLACES):
                found, pending = self._joined([found, *pending]), []
        return self._joined([found, *pending])

    def _changing_in_box(self, table: np.ndarray) -> np.ndarray:
        """The same as a bool for every place of a small box."""
        constant = np.empty((*table.shape, len(self.background)), np.float32)
        constant[...] = self.background
        if self._tiles:
            constant = self.constant(np.stack(list(np.indices(table.shape)), axis=-1))
        nz, ny, nx = self.shape
        changes, own = np.zeros(self.shape, bool), constant[:-1, :-1, :-1]
        for z, y, x in _CORNERS:
            cut = np.s_[z : z + nz, y : y + ny, x : x + nx]
            changes |= (table[cut] >= 0) | (constant[cut] != own).any(axis=-1)
        return changes

    def _joined(self, parts: list[np.ndarray]) -> np.ndarray:
        places, _ = unique_places(np.concatenate(parts))
        if len(places) > MOST_PLACES:
            raise VolumeError(
                f"more than {MOST_PLACES} bricks of 8³ voxels hold something",
                self._where,
                "use a smaller grid",
            )
        return places

    def _candidates(self) -> Iterator[np.ndarray]:
        """Places at leaves and at borders of tiles, as far as they lie inside, a bounded chunk at a time."""
        limit = np.array(self.shape)
        for part in chain(self._at_leaves(), self._tile_borders()):
            yield part[((part >= 0) & (part < limit)).all(axis=1)]

    def _meets(self, places: np.ndarray) -> np.ndarray:
        around = places[:, None] + _CORNERS
        constant = self.constant(around)
        differs = (constant != constant[:, :1]).any(axis=2)
        met: np.ndarray = np.any((self.leaf(around) >= 0) | differs, axis=1)
        return met

    def _at_leaves(self) -> Iterator[np.ndarray]:
        """Places of bricks that reach into a leaf."""
        step = _CHUNK_PLACES // len(_CORNERS)
        for first in range(0, len(self.leaf_places), step):
            yield (self.leaf_places[first : first + step, None] - _CORNERS).reshape(-1, 3)

    def _tile_borders(self) -> Iterator[np.ndarray]:
        """Brick places at the six sides of every tile, one layer within and one without."""
        for edge, starts, _, _ in self._tiles:
            n = edge // BRICK_CELLS
            plane = np.stack(np.meshgrid(*[np.arange(-1, n)] * 2, indexing="ij"), axis=-1).reshape(-1, 2)
            sides = [np.insert(plane, axis, layer, axis=1) for axis in range(3) for layer in (-1, n - 1)]
            shell, _ = unique_places(np.concatenate(sides) + 1)
            step = max(1, _CHUNK_PLACES // len(shell))
            for first in range(0, len(starts), step):
                yield (starts[first : first + step, None] + shell - 1).reshape(-1, 3)
