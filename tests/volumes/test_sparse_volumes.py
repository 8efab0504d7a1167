"""Large volumes that are mostly empty.

The tree of bricks and the majorants over it say what dense arrays say, and take memory and time for what is
in them, not for their box.
"""

import tracemalloc
from dataclasses import replace

import numpy as np
import pytest
from fields import exit_distance, optical_depth
from probe import Probe, scene_of
from sparse_grids import dense_of, grid_of, lumps, medium_of_grid, volume_of
from stat_tests import FALSE_ALARM, largest_z, sidak, z_score
from tiers import quick_first, quick_where
from trees import leaves_of
from walks import BINS, collision_p_value, sample_walks, transmittance_walks, unbiased, weighted_z

import clvol
from clvol.accel import costs
from clvol.accel.bounds import with_slack
from clvol.accel.sparse_bounds import from_dense, sparse_bounds
from clvol.accel.sparse_grid import tree_grid
from clvol.accel.sparse_kdtree import build_tree, finest_lattice
from clvol.planning import registry
from clvol.planning.choices import Choices
from clvol.planning.plan import Plan
from clvol.scene.records import Medium
from clvol.tables.prepare import prepare
from clvol.volumes.brick_tree import MOST_EXTENT, BrickTree, is_scattered
from clvol.volumes.bricks import BOUND_CELLS, BrickMap, build_bricks
from clvol.volumes.transfer import transfer_of_points
from clvol.volumes.tree import build_tiers, device_nodes, keys, rows_of


def colours():
    """Lumps and a tile of three channels that differ, one of them 0 here and there."""
    one = lumps(6, tiles=[((48, 0, 0), 8, 0.5)])
    ramp = np.array([1.0, 0.5, 0.25], np.float32)
    values = one.leaf_values * ramp
    values[2::4, ..., 1] = 0
    return replace(
        one, leaf_values=values, tile_values=one.tile_values * ramp, background=one.background * ramp
    )


GRIDS = {
    "one leaf": lumps(2, places=3, leaves=1),
    "lumps": lumps(3),
    "over a background": lumps(4, background=0.25),
    "tiles": lumps(
        5, places=24, tiles=[((128, 0, 0), 128, 0.4), ((-8, 16, 8), 8, 0.3), ((0, 128, 0), 128, 0.0)]
    ),
    "colours": colours(),
    "all alike": grid_of([[0, 0, 0], [64, 8, 0]], np.full((2, 8, 8, 8), 0.5), 0.5),
}


def force_trees(monkeypatch):
    """Every sparse grid's top grid is a tree, built without arrays over its box, however small."""
    monkeypatch.setattr("clvol.volumes.bricks.is_scattered", lambda shape, places: True)
    monkeypatch.setattr("clvol.volumes.sparse_places.TABLE_PLACES", 0)


@pytest.fixture
def trees(monkeypatch):
    force_trees(monkeypatch)


def both(grid, monkeypatch):
    """The same grid under a dense top grid and under a tree."""
    dense = build_bricks(grid)
    with monkeypatch.context() as forced:
        force_trees(forced)
        tree = build_bricks(grid)
    assert isinstance(dense, BrickMap) and isinstance(tree, BrickTree)
    return dense, tree


def found_in(nodes, levels, places):
    """Values of a tree at places z y x, found as the device finds them."""
    values, done = np.zeros(len(places), np.int64), np.zeros(len(places), bool)
    for shift in range(3 * (levels - 1), -1, -3):
        z, y, x = (places >> shift & 7).T
        below = nodes[np.where(done, 0, -values), z << 6 | y << 3 | x]
        values = np.where(done, values, below)
        done |= values >= 0
    return values


@pytest.mark.parametrize("levels", [1, 2, 4])
def test_a_tree_finds_what_was_put_into_it_and_its_constant_elsewhere(levels):
    rng = np.random.default_rng(levels)
    places = np.unique(rng.integers(0, 8**levels, (50, 3)), axis=0)

    def values(number, tier):
        return (
            np.where(tier.below >= 0, 1000 + tier.below, 7) if number == 0 else np.full(tier.below.shape, 7)
        )

    nodes = device_nodes(build_tiers(places, levels), values)
    asked = np.concatenate([places, rng.integers(0, 8**levels, (500, 3))])
    row = rows_of(keys(places), keys(asked))
    assert (found_in(nodes, levels, asked) == np.where(row >= 0, 1000 + row, 7)).all()


@pytest.mark.parametrize("name", GRIDS)
def test_tree_and_array_lead_to_the_same_bricks(monkeypatch, name):
    dense, tree = both(GRIDS[name], monkeypatch)
    places = np.argwhere(np.ones(dense.shape, bool))
    stored = [
        np.concatenate([samples for _, samples in sorted(b.stored(), key=lambda part: part[0])])
        for b in (dense, tree)
    ]
    numbers = found_in(tree.top, tree.levels, places)
    assert (stored[0][dense.top.reshape(-1)] == stored[1][numbers]).all()
    assert (tree.size, tree.origin) == (dense.size, dense.origin)
    assert (tree.peak == dense.peak).all()


def spread(bounds):
    """Bounds of a sparse lattice as arrays over all its cells."""
    arrays = [np.full((*bounds.shape, bounds.inside.maximum.shape[-1]), np.nan, np.float32) for _ in range(3)]
    for tier in bounds.tiers:
        for node, *entry in np.argwhere(tier.leaf()):
            start = (8 * tier.tier.nodes[node] + entry) * tier.edge
            for array, cells in zip(arrays, tier.cells, strict=True):
                array[tuple(slice(k, k + tier.edge) for k in start)] = cells[(node, *entry)]
    return arrays


BOUNDED = [*((name, None) for name in GRIDS), ("lumps", [(0, 0.25), (0.3, 0), (0.5, 4), (0.7, 0)])]


@quick_where(("name", "points"), BOUNDED, lambda case: case[1] or case[0] in ("tiles", "colours"))
def test_bounds_without_arrays_over_the_box_are_those_with_them(monkeypatch, name, points):
    dense, tree = both(GRIDS[name], monkeypatch)
    transfer = points and transfer_of_points(points)
    exact = with_slack(dense.minimum, dense.maximum, BOUND_CELLS, dense.means(transfer), transfer)
    bounds = sparse_bounds(tree, True, transfer)
    for _ in range(10):
        assert (bounds.cells, bounds.cell_size) == (exact.cells, exact.cell_size)
        low, high, mean = spread(bounds)
        assert (low == exact.minimum).all() and (high == exact.maximum).all()
        assert np.abs(mean - exact.mean).max() < 1e-6
        whole, own = exact.whole(), bounds.whole()
        assert (own.minimum == whole.minimum).all() and (own.maximum == whole.maximum).all()
        assert own.mean == pytest.approx(whole.mean, rel=1e-5)
        grid = tree_grid(bounds)
        places = np.argwhere(np.ones(bounds.shape, bool))
        rows = found_in(grid.links, grid.levels, places)
        assert (grid.cells.maximum[rows] == exact.maximum[tuple(places.T)]).all()
        exact, bounds = exact.coarser(), bounds.coarser()
    assert (spread(from_dense(exact))[1] == exact.maximum).all()


@pytest.mark.parametrize("name", GRIDS)
@pytest.mark.parametrize("control", ["none", "fitted"])
def test_a_kdtree_without_arrays_bounds_all_cells_and_costs_what_it_says(monkeypatch, name, control):
    dense, tree = both(GRIDS[name], monkeypatch)
    exact = with_slack(dense.minimum, dense.maximum, BOUND_CELLS, dense.means())
    bounds = finest_lattice(sparse_bounds(tree, True))
    priced = 2.0, costs.LEAF_COST, costs.STEP_COST
    built = build_tree(bounds, np.array([1.0, 0.7, 1.3]), *priced, control)
    total = 0.0
    for index, lower, upper, depth in leaves_of(built.nodes, exact):
        x, y, z = (slice(a, b) for a, b in zip(lower, upper, strict=True))
        row = int(built.nodes[index, 1])
        inside = exact.maximum[z, y, x]
        if inside.size:
            assert (inside <= built.maximum[row]).all() and (
                exact.minimum[z, y, x] >= built.minimum[row]
            ).all()
            mean = exact.mean[z, y, x].mean(axis=(0, 1, 2), dtype=float)
            assert built.mean[row] == pytest.approx(mean, rel=1e-4, abs=1e-9)
        high = 0.0 if built.nodes[index, 0] == 3 else built.nodes[index, :1].view(np.float32)[0]
        w, h, d = (upper - lower) * np.array([1.0, 0.7, 1.3])
        total += 2.0 * w * h * d * high + (priced[1] + depth * priced[2]) * 0.5 * (
            w * h + h * d + d * w
        ) * bool(inside.size)
    if control == "none":
        assert built.cost == pytest.approx(total, rel=1e-5)


LOOK_UPS = """
    Stream stream = stream_begin(i, 7u);
    const float3 p = vload3(i, in0);
    out0[i] = volume_value(scene, scene->volumes, p, 0);
    out1[i] = volume_value(scene, scene->volumes + 1, p, 0);
    out2[i] = density(scene, scene->volumes, p, 0, &stream);
"""


def test_look_ups_through_a_tree_have_the_same_bits(device, monkeypatch):
    grid = lumps(4, background=0.25, tiles=[((0, 128, 0), 128, 0.4)])
    medium = replace(medium_of_grid(grid), albedo=volume_of(lumps(4, places=20), "nearest"))
    rng = np.random.default_rng(1)
    points = rng.random((30_000, 3)) * 300 - 20
    points[:10_000] = np.resize(grid.leaf_origins + 8, (10_000, 3)) + 10 * rng.random((10_000, 3))
    points = points.astype(np.float32)
    found = []
    for forced in (False, True):
        if forced:
            force_trees(monkeypatch)
        probe = Probe(device, scene_of(medium), lookup="stochastic", majorant="global")
        assert probe.plan.settled.top_trees == forced
        out = [np.empty(len(points), np.float32) for _ in range(3)]
        found.append(probe.run(["density/stochastic.h"], LOOK_UPS, out, [points]))
    for without, through in zip(*found, strict=True):
        assert (without == through).all() and len(np.unique(without)) > 100


@pytest.mark.contract
def test_a_picture_through_trees_has_the_same_bits(monkeypatch):
    """Every kind of volume, boxes that differ, colours, and a field that reaches beyond its box."""
    medium = Medium(
        volume_of(lumps(4, background=0.05), clipped=False),
        volume_of(lumps(9, places=30, background=0.5)),
        (8.0, 4.0, 2.0),
        homogeneous=False,
        emission=volume_of(lumps(10, places=5)),
        temperature=volume_of(lumps(11, background=0.3)),
        temperature_scale=4000.0,
        emission_scale=0.1,
    )
    pictures = []
    for forced in (False, True):
        if forced:
            force_trees(monkeypatch)
        result = clvol.render(
            scene_of(medium), spp=4, seed=3, majorant="global", transmittance="ratio", lanes="off"
        )
        pictures.append(result.image)
    assert (pictures[0] == pictures[1]).all() and pictures[0].std() > 0.01


RAYS = {
    "oblique": (
        np.array([0.02, 0.11, 0.07]),
        np.array([1.0, 0.71, 0.53]) / np.linalg.norm([1.0, 0.71, 0.53]),
    ),
    "along an axis": (np.array([0.99, 0.51, 0.48]), np.array([-1.0, 0.0, 0.0])),
}
WALKED = lumps(6, leaves=1200, background=0.02)
WALKS = 1 << 14


@pytest.fixture(scope="module")
def depths():
    values = dense_of(WALKED)
    return {
        name: optical_depth(values, *ray, exit_distance(*ray), 12.0, 100_000) for name, ray in RAYS.items()
    }


def majorants_of(names):
    return [(name, "grid") for name in names] + [(names[0], "kdtree")]


@quick_first(("technique", "majorant"), majorants_of(unbiased("technique")), count=2)
def test_collisions_through_trees_follow_the_exact_distribution(device, trees, depths, technique, majorant):
    probe = Probe(device, scene_of(medium_of_grid(WALKED, (12.0,))), technique=technique, majorant=majorant)
    assert probe.plan.has_tree_grid == (majorant == "grid")
    for name, ray in RAYS.items():
        length, tau = exit_distance(*ray), depths[name]
        t, weights, _, flaws, _ = sample_walks(probe, ray, length, WALKS)
        assert flaws.sum() == 0
        if registry.TECHNIQUES[technique].weighted:
            assert weighted_z(t, weights[:, 0], tau, length).max() < largest_z(2 * (BINS + 1)), name
        else:
            assert collision_p_value(t, tau, length) > sidak(FALSE_ALARM, 2), name


@quick_first(("transmittance", "majorant"), majorants_of(unbiased("transmittance")), count=2)
def test_transmittance_through_trees_has_the_exact_mean(device, trees, depths, transmittance, majorant):
    medium = medium_of_grid(WALKED, (12.0,))
    probe = Probe(device, scene_of(medium), transmittance=transmittance, majorant=majorant)
    for name, ray in RAYS.items():
        values, flaws, _ = transmittance_walks(probe, ray, exit_distance(*ray), WALKS)
        assert flaws.sum() == 0
        exact, variance = np.exp(-depths[name][-1]), values.astype(float).var() / WALKS
        if variance == 0:
            assert values.mean(dtype=float) == pytest.approx(exact, rel=1e-4), name
        else:
            assert abs(z_score(values.mean(dtype=float), variance, exact)) < largest_z(2), name


def planned(scene, **choices):
    return prepare(scene, Plan.of(scene, Choices(**choices)))


def test_trees_and_arrays_are_walked_in_one_scene():
    """Where one medium is large and mostly empty, a compact one is walked by the same code."""
    scene = scene_of(medium_of_grid(lumps(6, places=6), (6.0,)))
    beside = replace(scene.shapes[0], interior=medium_of_grid(far_pair(4088), (6.0,)))
    prepared = planned(replace(scene, shapes=(*scene.shapes, beside)), majorant="grid")
    assert all(found.links is not None and found.levels >= 1 for found in prepared.majorants)


def far_pair(apart):
    return grid_of([[0, 0, 0], [apart] * 3], np.ones((2, 8, 8, 8)))


def trail(count, step):
    """Leaves one after the other along a diagonal, `step` voxels apart."""
    return grid_of(step * np.repeat(np.arange(count)[:, None], 3, axis=1), np.ones((count, 8, 8, 8)))


FAR = {"pair": far_pair(4088), "trail": trail(100, 1000), "farthest": far_pair(MOST_EXTENT - 24)}


@quick_where("name", FAR, "trail".__ne__)
def test_memory_follows_what_a_volume_holds_and_not_its_box(name):
    """What is built for the device and on the way, in bytes: 8 bricks, some blocks and nodes a leaf."""
    grid = FAR[name]
    leaves = len(grid.leaf_origins)
    scene = scene_of(medium_of_grid(grid, (4000.0,)))
    tracemalloc.start()
    prepared = planned(
        scene, technique="weighted-decomposition", transmittance="residual-ratio", control="mean"
    )
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    ((volume,), (majorant,)) = prepared.volumes, prepared.majorants
    bricks = volume.bricks
    assert bricks.brick_count <= 8 * leaves + 1
    assert bricks.top.nbytes <= 2048 * (1 + 8 * leaves * bricks.levels)
    tables = [majorant.nodes, majorant.links, majorant.majorant, majorant.control, majorant.residual]
    assert sum(t.nbytes for t in tables if t is not None) < 200_000 * leaves
    assert peak < (8 << 20) + 500_000 * leaves
    assert prepared.plan.chosen["majorant"] != "global"


@pytest.mark.parametrize("majorant", ["grid", "kdtree"])
def test_far_leaves_attenuate_and_the_space_between_them_is_crossed_in_few_steps(device, majorant):
    apart = 4088
    grid = far_pair(apart)
    size = float(apart + 10)
    scene = scene_of(medium_of_grid(grid, (0.1 * size,)))
    probe = Probe(device, scene, transmittance="regular", majorant=majorant)
    ray = np.full(3, 0.2 / size), np.full(3, 3**-0.5)
    length = exit_distance(*ray)
    values, flaws, lookups = transmittance_walks(probe, ray, length, 1)
    # along the diagonal the field is the cube of a trapezoid: 1 over 7 voxels, and the ends' 1/4 each
    exact = np.exp(-0.1 * 2 * (7 + 2 / 4) * 3**0.5)
    assert flaws.sum() == 0 and values[0, 0] == pytest.approx(exact, rel=1e-3)
    assert lookups[0] < 2000, "of the 24,000 that all planes on the way would take"


def test_a_box_that_floats_cannot_place_is_refused():
    with pytest.raises(clvol.VolumeError, match=f"more than the limit of {MOST_EXTENT}"):
        build_bricks(far_pair(MOST_EXTENT))


def test_more_bricks_than_the_limit_are_refused_before_they_are_bounded(monkeypatch):
    monkeypatch.setattr("clvol.volumes.sparse_places.MOST_PLACES", 1000)
    build_bricks(trail(100, 1000))
    with pytest.raises(clvol.VolumeError, match="more than 1000 bricks"):
        build_bricks(trail(126, 1000))


def test_compact_and_filled_grids_keep_their_arrays():
    assert not is_scattered((48, 48, 48), 1), "small"
    assert not is_scattered((128, 128, 128), 128**3 // 16), "filled"
    assert is_scattered((128, 128, 128), 128**3 // 16 - 1)
