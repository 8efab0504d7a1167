"""Majorants of heterogeneous media: cells with a bound of the density, and controls where they are needed."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from clvol.accel import controls, costs
from clvol.accel.bounds import Bounds, with_slack
from clvol.accel.cells import Cells
from clvol.accel.kdtree import KdTree, pack_maximum, unpack_maximum
from clvol.accel.sparse_bounds import SparseBounds, from_dense, sparse_bounds
from clvol.accel.sparse_grid import tree_grid
from clvol.accel.sparse_kdtree import build_tree, finest_lattice
from clvol.accel.steps import MANY_STEPS, Worst, worst_cell
from clvol.errors import SceneError, option
from clvol.scene.medium_facts import is_homogeneous
from clvol.volumes.bricks import BOUND_CELLS, BrickTree

if TYPE_CHECKING:
    from collections.abc import Sequence

    from clvol.planning.needs import MajorantNeeds
    from clvol.scene import records
    from clvol.scene.medium_facts import Matter
    from clvol.tables.volumes import PreparedVolume
    from clvol.volumes.transfer import Transfer

KINDS = ("global", "grid", "kdtree")


@dataclass(frozen=True, eq=False)
class PreparedMajorant:
    """The cells of one medium's majorant, in the units of its sigma_t volume.

    A row is the whole medium for `global`, a cell in C order [z, y, x] for `grid` (in the order of
    clvol.accel.sparse_grid where a volume of the scene is large and mostly empty), and a leaf for `kdtree`.

    cells, cell_size : the lattice it is walked on, x y z, and a cell's edge in index units.
    nodes : uint32 (m, 2), the kd-tree, its bounds as in `majorant`; else None.
    links, levels : int32 (m, 512) and its levels, the tree that a sparse grid's cells are found through.
    majorant : float32 (n,), bound of all channels, times `the plan's scale of bounds`.
    control : float32 (n, channels), what decomposition subtracts; None where nothing is.
    residual : float32 (n, channels + 1), control and majorant of residual ratio tracking; None where unused.
    """

    cells: tuple[int, int, int]
    cell_size: float
    nodes: np.ndarray | None
    majorant: np.ndarray
    control: np.ndarray | None
    residual: np.ndarray | None
    links: np.ndarray | None = None
    levels: int = 0


AnyBounds = Bounds | SparseBounds


class _Candidate(NamedTuple):
    """One medium's majorant of one kind: the lattice it is walked on, its tree, its expected cost."""

    bounds: AnyBounds
    tree: KdTree | None
    cost: float


@dataclass(frozen=True, eq=False)
class Majorants:
    """The majorants of a scene's media, all of one kind.

    Parameters
    ----------
    kind : "none" where no medium needs one.
    costs : expected cost per ray of each kind that was weighed for "auto".
    tables : for each medium, by number; None of homogeneous ones.
    worst : of media in which walks by tentative collisions may take many steps.
    """

    kind: str
    costs: tuple[tuple[str, float], ...]
    tables: tuple[PreparedMajorant | None, ...]
    worst: tuple[Worst, ...] = ()


class _Walked(NamedTuple):
    """A heterogeneous medium: its number, its density, and in how many places it is."""

    number: int
    medium: records.Medium
    volume: PreparedVolume
    places: int


def choose_majorants(matter: Matter, volumes: Sequence[PreparedVolume], needs: MajorantNeeds) -> Majorants:
    """Majorants per medium of one kind, the cheapest on the whole for `auto`.

    Raises
    ------
    SceneError
        A coefficient is too large for a float.
    """
    walked = [
        _Walked(n, medium, volumes[roles["sigma_t"]], matter.of_entry.count(n))
        for n, (medium, roles) in enumerate(zip(matter.media, matter.roles, strict=True))
        if not is_homogeneous(medium)
    ]
    tables: list[PreparedMajorant | None] = [None] * len(matter.media)
    if not walked:
        return Majorants("none", (), tuple(tables))
    for one in walked:
        _check_range(one, needs)
    bounds: dict[tuple[int, Transfer | None], AnyBounds] = {}
    for one in walked:
        key = _density(matter, one)
        if key not in bounds:
            bounds[key] = _bounds(one.volume, needs, key[1])
    found = {
        kind: [_candidate(one, bounds[_density(matter, one)], kind, needs) for one in walked]
        for kind in (KINDS if needs.majorant == "auto" else (needs.majorant,))
    }
    costs = {
        kind: sum(one.places * c.cost for one, c in zip(walked, candidates, strict=True))
        for kind, candidates in found.items()
    }
    chosen = min(costs, key=lambda kind: costs[kind])
    best = found[chosen]
    if chosen == "grid" and any(isinstance(c.bounds, SparseBounds) for c in best):
        # all media are walked by the same code
        best = [c._replace(bounds=_as_sparse(c.bounds)) for c in best]
    for one, candidate in zip(walked, best, strict=True):
        tables[one.number] = _tables(candidate, chosen, needs, _longest(one))
    weighed = tuple(costs.items()) if needs.majorant == "auto" else ()
    dense = (_worst(one, bounds[_density(matter, one)], needs.scale) for one in walked)
    return Majorants(chosen, weighed, tuple(tables), tuple(filter(None, dense)))


def _density(matter: Matter, one: _Walked) -> tuple[int, Transfer | None]:
    """Number of the volume that is a medium's sigma_t, and what is made of its values."""
    return matter.roles[one.number]["sigma_t"], one.medium.transfer("sigma_t")


def _longest(one: _Walked) -> np.ndarray:
    """Optical depth of the longest way through the volume's box at density 1, float64 (channels,)."""
    bricks = one.volume.bricks
    edges = one.volume.edges * bricks.size
    scale = np.array(one.medium.scale, np.float64)
    own = scale if bricks.channels == len(scale) else scale.max()
    return np.broadcast_to(np.linalg.norm(edges) * own, bricks.channels)


def _check_range(one: _Walked, needs: MajorantNeeds) -> None:
    scale = float(np.max(one.medium.scale))
    largest = float(one.volume.peak(one.medium.transfer("sigma_t")).max())
    if largest * max(scale, 1.0) * max(needs.scale, 1.0) > float(np.finfo(np.float32).max):
        factor = "" if needs.scale == 1 else f" and {option('majorant_scale', needs.scale)}"
        raise SceneError(
            f"sigma_t times scale {scale:g}{factor} is too large for a float",
            one.volume.volume.source or one.medium.name,
        )


def _worst(one: _Walked, bounds: AnyBounds, scale: float) -> Worst | None:
    """Where a medium's walks have the most steps; None of one that is not that thick, whatever its cells."""
    transfer = one.medium.transfer("sigma_t")
    peak = one.volume.peak(transfer)
    if scale * float(np.max(_longest(one) * peak)) < MANY_STEPS:
        return None
    rate = float(np.max(one.medium.scale))
    steps = worst_cell(bounds, one.volume.voxel * bounds.cell_size, rate, scale)
    where = one.volume.volume.source or one.medium.name
    return Worst(where, rate * float(np.max(peak)), steps, transfer is not None, scale)


def _bounds(volume: PreparedVolume, needs: MajorantNeeds, transfer: Transfer | None) -> AnyBounds:
    """Bounds over the finest cells there are, with means where they are wanted."""
    bricks = volume.bricks
    if isinstance(bricks, BrickTree):
        return sparse_bounds(bricks, needs.means, transfer)
    means = bricks.means(transfer) if needs.means else None
    return with_slack(bricks.minimum, bricks.maximum, BOUND_CELLS, means, transfer)


def _as_sparse(bounds: AnyBounds) -> SparseBounds:
    return bounds if isinstance(bounds, SparseBounds) else from_dense(bounds)


def _candidate(one: _Walked, bounds: AnyBounds, kind: str, needs: MajorantNeeds) -> _Candidate:
    extent = one.volume.voxel
    rate, technique = float(np.max(one.medium.scale)), (needs.control, needs.scale)
    if kind == "kdtree":
        bounds = finest_lattice(bounds)
        visits = costs.LEAF_COST, costs.STEP_COST
        tree = build_tree(bounds, extent * bounds.cell_size, rate, *visits, *technique)
        return _Candidate(bounds, tree, tree.cost)
    if kind == "grid":
        bounds, cost = costs.best_grid(bounds, extent * bounds.cell_size, rate, *technique, needs.in_lanes)
        return _Candidate(bounds, None, cost)
    return _Candidate(bounds, None, costs.global_cost(bounds, extent * bounds.cell_size, rate, *technique))


def _tables(candidate: _Candidate, kind: str, needs: MajorantNeeds, longest: np.ndarray) -> PreparedMajorant:
    """What the device reads of a majorant's cells, row by row; `longest` limits controls."""
    bounds, tree, _ = candidate
    chosen = tree or (bounds.whole() if kind == "global" else bounds)
    links, levels = None, 0
    if isinstance(chosen, SparseBounds):
        links, levels, cells = tree_grid(chosen)
    else:
        cells = Cells(chosen.minimum, chosen.maximum, chosen.mean)
    channels = cells.maximum.shape[-1]
    cells = cells.each(lambda values: values.reshape(-1, channels))
    majorant = controls.scaled_majorant(cells.maximum, needs.scale)
    if tree:
        majorant = unpack_maximum(pack_maximum(majorant))
    control = residual = None
    if needs.control != "none":
        control = controls.control(*cells, needs.control, needs.scale, longest)
    if needs.residual != "none":
        parts = controls.residual(*cells, needs.residual, needs.scale, longest)
        residual = np.column_stack(parts)
    nodes = tree.nodes if tree else None
    lattice = bounds.cells, bounds.cell_size
    return PreparedMajorant(*lattice, nodes, majorant, control, residual, links, levels)
