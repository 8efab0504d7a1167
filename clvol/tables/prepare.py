"""What can be worked out about a scene without a device: brick maps, majorants, its bounding sphere."""

from __future__ import annotations

import logging
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from clvol.accel import choice, controls
from clvol.accel.bounds import Bounds, with_slack
from clvol.accel.kdtree import KdTree, pack_maximum, unpack_maximum
from clvol.accel.sparse_bounds import SparseBounds, from_dense, sparse_bounds
from clvol.accel.sparse_grid import tree_grid
from clvol.accel.sparse_kdtree import build_tree, finest_lattice
from clvol.errors import SceneError
from clvol.planning.features import Features, is_homogeneous, medium_volumes
from clvol.scene import records
from clvol.scene.boundaries import Boundaries, find_boundaries, is_clipped, scene_sphere
from clvol.scene.thinness import check_thinness
from clvol.tables.camera_medium import check_camera_medium
from clvol.tables.surfaces import Surfaces, prepare_surfaces
from clvol.volumes.bricks import BOUND_CELLS, BrickMap, BrickTree, build_bricks
from clvol.volumes.grid import DenseGrid

log = logging.getLogger("clvol")

COVERED = ("albedo", "emission", "temperature")
"""Volumes of a medium that are looked up wherever sigma_t is."""


@dataclass(frozen=True, eq=False)
class PreparedVolume:
    """A grid volume as bricks, with the map from the scene's centred world to brick index space."""

    volume: records.GridVolume
    bricks: BrickMap | BrickTree
    world_to_index: np.ndarray


@dataclass(frozen=True)
class MajorantNeeds:
    """What tracking needs to know of each majorant cell.

    majorant : "global", "grid", "kdtree", or "auto" for the one of least expected cost.
    control : "none", "min" or "fitted", what the technique's decomposition subtracts.
    residual : "none", "mean", "min" or "max", the control of residual ratio tracking.
    scale : multiplies every bound, for experiments.
    """

    majorant: str = "auto"
    control: str = "none"
    residual: str = "none"
    scale: float = 1.0

    @property
    def means(self) -> bool:
        """Whether the means of cells are wanted, which takes another pass over the volume."""
        return self.control == "fitted" or self.residual == "mean"


@dataclass(frozen=True, eq=False)
class PreparedMajorant:
    """The cells of one medium's majorant, in the units of its sigma_t volume.

    A row is the whole medium for `global`, a cell in C order [z, y, x] for `grid` (in the order of
    clvol.accel.sparse_grid where a volume of the scene is large and mostly empty), and a leaf for `kdtree`.

    cells, cell_size : the lattice it is walked on, x y z, and a cell's edge in index units.
    nodes : uint32 (m, 2), the kd-tree, its bounds as in `majorant`; else None.
    links, levels : int32 (m, 512) and its levels, the tree that a sparse grid's cells are found through.
    majorant : float32 (n,), bound of all channels, times `MajorantNeeds.scale`.
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


@dataclass(frozen=True, eq=False)
class PreparedScene:
    """Everything about a scene that can be worked out without a device.

    boundaries : which shapes are surfaces, and what bounds media.  surfaces : None where there are none.
    majorant : the chosen kind, "none" where no medium is heterogeneous.
    volumes, majorants : by id() of the GridVolume and of the Medium, which the scene keeps alive.
    """

    scene: records.Scene
    features: Features
    boundaries: Boundaries
    centre: np.ndarray
    radius: float
    surfaces: Surfaces | None
    volumes: dict[int, PreparedVolume]
    needs: MajorantNeeds
    majorant: str
    majorants: dict[int, PreparedMajorant]


def prepare(scene: records.Scene, needs: MajorantNeeds | None = None) -> PreparedScene:
    """Build brick maps, majorants and what `needs` asks of them.

    Raises SceneError where a coefficient is too large for a float, a volume is wrapped as none can be, a
    medium is too thin for places in it, or the camera is not in the medium that it is said to be in.
    """
    needs = needs or MajorantNeeds()
    features = Features.from_scene(scene)
    found = find_boundaries(scene)
    check_camera_medium(scene, found)
    check_thinness(scene, found)
    centre, radius = scene_sphere(scene, found)
    volumes = {}
    for medium in (entry.medium for entry in found.entries):
        for volume in medium_volumes(medium):
            if id(volume) not in volumes:
                volumes[id(volume)] = _prepare_volume(volume, centre)
        _check_cover(medium)
    media = [e.medium for e in found.entries if not is_homogeneous(e.medium)]
    majorant, majorants = _choose_majorants(media, volumes, needs)
    surfaces = prepare_surfaces(scene, found, centre)
    return PreparedScene(
        scene, features, found, centre, radius, surfaces, volumes, needs, majorant, majorants
    )


def _prepare_volume(volume: records.GridVolume, centre: np.ndarray) -> PreparedVolume:
    grid, shift = volume.grid, np.zeros(3)
    if volume.wrap_mode == "repeat" and isinstance(grid, DenseGrid):
        wrapped = np.pad(grid.values, [(1, 1), (1, 1), (1, 1), (0, 0)], mode="wrap")
        grid, shift = replace(grid, values=wrapped), np.full(3, -1.0)
    bricks = build_bricks(grid)
    to_world = volume.index_to_world.copy()
    to_world[:3, 3] -= centre
    to_brick = np.eye(4)
    to_brick[:3, 3] = -(np.array(bricks.origin) + shift)
    return PreparedVolume(volume, bricks, to_brick @ np.linalg.inv(to_world))


def _check_cover(medium: records.Medium) -> None:
    """Beyond its box a repeated or mirrored volume would need its wrap mode on the device."""
    sigma_t = medium.sigma_t
    for volume in medium_volumes(medium):
        if volume is sigma_t or volume.wrap_mode == "clamp":
            continue
        same = isinstance(sigma_t, records.GridVolume) and is_clipped(medium)
        same = same and np.allclose(
            sigma_t.index_to_world @ _box(sigma_t), volume.index_to_world @ _box(volume)
        )
        if not same:
            name = next(name for name in COVERED if getattr(medium, name) is volume)
            raise SceneError(
                f"wrap_mode {volume.wrap_mode!r} of the {name} volume, whose box is not that of sigma_t",
                volume.source or medium.name,
                "give both volumes the same to_world, or use wrap_mode clamp",
            )


def _box(volume: records.GridVolume) -> np.ndarray:
    return np.array([[*volume.lower, 1.0], [*volume.upper, 1.0]]).T


AnyBounds = Bounds | SparseBounds


class _Candidate(NamedTuple):
    """One medium's majorant of one kind: the lattice it is walked on, its tree, its expected cost."""

    bounds: AnyBounds
    tree: KdTree | None
    cost: float


def _choose_majorants(
    media: list[records.Medium], volumes: dict[int, PreparedVolume], needs: MajorantNeeds
) -> tuple[str, dict[int, PreparedMajorant]]:
    """Majorants per medium of one kind, the cheapest on the whole for `auto`, and the kind's name."""
    if not media:
        return "none", {}
    for medium in media:
        _check_range(medium, volumes[id(medium.sigma_t)], needs)
    names = ("global", "grid", "kdtree") if needs.majorant == "auto" else (needs.majorant,)
    bounds = {key: _bounds(volumes[key], needs) for key in {id(m.sigma_t) for m in media}}
    found = {
        name: [_candidate(m, volumes[id(m.sigma_t)], bounds[id(m.sigma_t)], name, needs) for m in media]
        for name in names
    }
    costs = {name: sum(candidate.cost for candidate in found[name]) for name in names}
    chosen = min(costs, key=costs.get)
    if needs.majorant == "auto":
        least = costs[chosen] or 1.0
        relative = ", ".join(f"{name} {cost / least:.2f}" for name, cost in costs.items())
        log.info("majorant %s: expected cost per ray relative to it: %s", chosen, relative)
    if chosen == "grid" and any(isinstance(c.bounds, SparseBounds) for c in found[chosen]):
        # all media are walked by the same code
        found[chosen] = [c._replace(bounds=_as_sparse(c.bounds)) for c in found[chosen]]
    return chosen, {
        id(m): _tables(c, chosen, needs, _longest(m, volumes[id(m.sigma_t)]))
        for m, c in zip(media, found[chosen], strict=True)
    }


def _longest(medium: records.Medium, volume: PreparedVolume) -> np.ndarray:
    """Optical depth of the longest way through the volume's box at density 1, float64 (channels,)."""
    edges = np.linalg.inv(volume.world_to_index)[:3, :3] * volume.bricks.size
    scale = np.array(medium.scale, np.float64)
    own = scale if volume.bricks.channels == len(scale) else scale.max()
    return np.broadcast_to(np.linalg.norm(edges) * own, volume.bricks.channels)


def _check_range(medium: records.Medium, volume: PreparedVolume, needs: MajorantNeeds) -> None:
    scale = float(np.max(medium.scale))
    largest = float(volume.bricks.peak.max())
    if largest * max(scale, 1.0) * max(needs.scale, 1.0) > float(np.finfo(np.float32).max):
        factor = "" if needs.scale == 1 else f" and majorant_scale {needs.scale:g}"
        raise SceneError(
            f"sigma_t times scale {scale:g}{factor} is too large for a float",
            volume.volume.source or medium.name,
        )


def _bounds(volume: PreparedVolume, needs: MajorantNeeds) -> AnyBounds:
    """Bounds over the finest cells there are, with means where they are wanted."""
    bricks = volume.bricks
    if isinstance(bricks, BrickTree):
        return sparse_bounds(bricks, needs.means)
    return with_slack(bricks.minimum, bricks.maximum, BOUND_CELLS, bricks.means() if needs.means else None)


def _as_sparse(bounds: AnyBounds) -> SparseBounds:
    return bounds if isinstance(bounds, SparseBounds) else from_dense(bounds)


def _candidate(
    medium: records.Medium, volume: PreparedVolume, bounds: AnyBounds, kind: str, needs: MajorantNeeds
) -> _Candidate:
    extent = np.linalg.norm(np.linalg.inv(volume.world_to_index)[:3, :3], axis=0)
    rate, technique = float(np.max(medium.scale)), (needs.control, needs.scale)
    if kind == "kdtree":
        bounds = finest_lattice(bounds)
        visits = choice.LEAF_COST, choice.STEP_COST
        tree = build_tree(bounds, extent * bounds.cell_size, rate, *visits, *technique)
        return _Candidate(bounds, tree, tree.cost)
    if kind == "grid":
        bounds, cost = choice.best_grid(bounds, extent * bounds.cell_size, rate, *technique)
        return _Candidate(bounds, None, cost)
    return _Candidate(bounds, None, choice.global_cost(bounds, extent * bounds.cell_size, rate, *technique))


def _tables(candidate: _Candidate, kind: str, needs: MajorantNeeds, longest: np.ndarray) -> PreparedMajorant:
    """What the device reads of a majorant's cells, row by row; `longest` limits controls."""
    bounds, tree, _ = candidate
    found = tree or (bounds.whole() if kind == "global" else bounds)
    links, levels = None, 0
    if isinstance(found, SparseBounds):
        links, levels, found = tree_grid(found)
    channels = found.maximum.shape[-1]
    extrema = [
        None if values is None else values.reshape(-1, channels)
        for values in (found.minimum, found.maximum, found.mean)
    ]
    majorant = controls.scaled_majorant(extrema[1], needs.scale)
    if tree:
        majorant = unpack_maximum(pack_maximum(majorant))
    control = residual = None
    if needs.control != "none":
        control = controls.control(*extrema, needs.control, needs.scale, longest)
    if needs.residual != "none":
        chosen, residual_majorant = controls.residual(*extrema, needs.residual, needs.scale, longest)
        residual = np.column_stack([chosen, residual_majorant])
    nodes = tree.nodes if tree else None
    lattice = bounds.cells, bounds.cell_size
    return PreparedMajorant(*lattice, nodes, majorant, control, residual, links, levels)
