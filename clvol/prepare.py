"""What can be worked out about a scene without a device: brick maps, majorants, its bounding sphere."""

from __future__ import annotations

import logging
from dataclasses import dataclass, replace

import numpy as np

from clvol.accel import choice
from clvol.accel.bounds import Bounds, with_slack
from clvol.accel.kdtree import KdTree, build_kdtree, tree_lattice
from clvol.errors import SceneError
from clvol.features import Features, is_clipped, is_homogeneous, scene_media, shape_bounds
from clvol.scene import records
from clvol.volumes.bricks import BOUND_CELLS, BrickMap, build_bricks
from clvol.volumes.grid import DenseGrid

log = logging.getLogger("clvol")


@dataclass(frozen=True, eq=False)
class PreparedVolume:
    """A grid volume as bricks, with the map from the scene's centred world to brick index space."""

    volume: records.GridVolume
    bricks: BrickMap
    world_to_index: np.ndarray


@dataclass(frozen=True, eq=False)
class PreparedScene:
    """Everything about a scene that can be worked out without a device."""

    scene: records.Scene
    features: Features
    centre: np.ndarray
    radius: float
    volumes: dict[int, PreparedVolume]  # by id() of the GridVolume, which the scene keeps alive
    majorant: str
    bounds: dict[int, Bounds]  # by id() of the Medium
    trees: dict[int, KdTree]


def prepare(scene: records.Scene, majorant: str = "auto") -> PreparedScene:
    """Build brick maps and majorants; `auto` takes the majorant of least expected cost."""
    features = Features.from_scene(scene)
    centre, radius = _scene_sphere(scene)
    volumes = {}
    for medium in scene_media(scene):
        for volume in (medium.sigma_t, medium.albedo):
            if isinstance(volume, records.GridVolume) and id(volume) not in volumes:
                volumes[id(volume)] = _prepare_volume(volume, centre)
        _check_albedo_cover(medium)
    media = [m for m in scene_media(scene) if not is_homogeneous(m)]
    majorant, bounds, trees = _choose_majorants(media, volumes, majorant)
    return PreparedScene(scene, features, centre, radius, volumes, majorant, bounds, trees)


def _scene_sphere(scene: records.Scene) -> tuple[np.ndarray, float]:
    """Centre and radius of a sphere round every medium: what rays can meet (else the camera's place)."""
    corners = [corner for s in scene.shapes if s.interior is not None for corner in shape_bounds(s)]
    if not corners:
        return scene.sensor.to_world[:3, 3].copy(), 1.0
    lower, upper = np.min(corners, axis=0), np.max(corners, axis=0)
    return (lower + upper) / 2, float(np.linalg.norm(upper - lower)) / 2


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


def _check_albedo_cover(medium: records.Medium) -> None:
    """Beyond its box a repeated or mirrored albedo would need its wrap mode on the device."""
    albedo = medium.albedo
    if not isinstance(albedo, records.GridVolume) or albedo.wrap_mode == "clamp":
        return
    sigma_t = medium.sigma_t
    same = isinstance(sigma_t, records.GridVolume) and is_clipped(medium)
    same = same and np.allclose(sigma_t.index_to_world @ _box(sigma_t), albedo.index_to_world @ _box(albedo))
    if not same:
        raise SceneError(
            f"wrap_mode {albedo.wrap_mode!r} of an albedo volume that does not share the box of sigma_t",
            albedo.source or medium.name,
            "give both volumes the same to_world, or use wrap_mode clamp",
        )


def _box(volume: records.GridVolume) -> np.ndarray:
    return np.array([[*volume.lower, 1.0], [*volume.upper, 1.0]]).T


def _choose_majorants(
    media: list[records.Medium], volumes: dict[int, PreparedVolume], majorant: str
) -> tuple[str, dict[int, Bounds], dict[int, KdTree]]:
    """Bounds and trees per medium for one kind of majorant, the cheapest on the whole for `auto`."""
    if not media:
        return "none", {}, {}
    names = ("global", "grid", "kdtree") if majorant == "auto" else (majorant,)
    found = {name: [_majorant(m, volumes[id(m.sigma_t)], name) for m in media] for name in names}
    costs = {name: sum(cost for _, _, cost in found[name]) for name in names}
    chosen = min(costs, key=costs.get)
    if majorant == "auto":
        least = costs[chosen] or 1.0
        relative = ", ".join(f"{name} {cost / least:.2f}" for name, cost in costs.items())
        log.info("majorant %s: expected cost per ray relative to it: %s", chosen, relative)
    bounds = {id(m): b for m, (b, _, _) in zip(media, found[chosen], strict=True)}
    trees = {id(m): tree for m, (_, tree, _) in zip(media, found[chosen], strict=True) if tree}
    return chosen, bounds, trees


def _majorant(
    medium: records.Medium, volume: PreparedVolume, kind: str
) -> tuple[Bounds, KdTree | None, float]:
    """One medium's majorant of one kind: the lattice it is walked on, its tree, its expected cost."""
    if float(volume.bricks.maximum.max()) * medium.scale > float(np.finfo(np.float32).max):
        raise SceneError(
            f"sigma_t times scale {medium.scale:g} is too large for a float",
            volume.volume.source or medium.name,
        )
    bounds = with_slack(volume.bricks.minimum, volume.bricks.maximum, BOUND_CELLS)
    extent = np.linalg.norm(np.linalg.inv(volume.world_to_index)[:3, :3], axis=0)
    if kind == "kdtree":
        bounds = tree_lattice(bounds)
        cell = extent * bounds.cell_size
        tree = build_kdtree(bounds, cell, medium.scale, choice.LEAF_COST, choice.STEP_COST)
        return bounds, tree, tree.cost
    if kind == "grid":
        bounds, cost = choice.best_grid(bounds, extent * bounds.cell_size, medium.scale)
        return bounds, None, cost
    return bounds, None, choice.global_cost(bounds, extent * bounds.cell_size, medium.scale)
