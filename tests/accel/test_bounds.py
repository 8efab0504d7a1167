"""Majorants and minorants bound every value a look-up can return, and brick maps return the field."""

import numpy as np
import pytest
from fields import sparse, trilinear
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp
from probe import Probe, grid_volume, medium_of, scene_of
from trees import leaves_of

from clvol.accel.bounds import with_slack
from clvol.accel.kdtree import build_kdtree, pack_maximum
from clvol.layout import BRICK_CELLS
from clvol.volumes.bricks import BOUND_CELLS, build_bricks
from clvol.volumes.grid import DenseGrid, SparseGrid

UNIT_BOX = np.array([[0.0, 0, 0], [1, 1, 1]])
VOLUMES = hnp.arrays(
    np.float32,
    hnp.array_shapes(min_dims=3, max_dims=3, min_side=1, max_side=21),
    elements=st.floats(0, 1000, width=32),
    fill=st.sampled_from([0.0, 0.0, 1.0]).map(np.float32),
)


def bounds_of(values):
    bricks = build_bricks(DenseGrid(values[..., None], UNIT_BOX))
    return with_slack(bricks.minimum, bricks.maximum, BOUND_CELLS)


def random_points(values, count=4000):
    """Index positions inside the lattice and half a voxel beyond, many of them on cell faces."""
    rng = np.random.default_rng(values.size)
    size = np.array(values.shape[::-1])
    points = rng.random((count, 3)) * size - 0.5
    faces = np.round(points / BOUND_CELLS) * BOUND_CELLS
    return np.where(rng.random(points.shape) < 0.2, faces, points)


def cells_of(points, bounds):
    x, y, z = np.clip((points // bounds.cell_size).astype(int), 0, np.array(bounds.cells) - 1).T
    return z, y, x


def look_up(values, points):
    size = np.array(values.shape[::-1])
    return trilinear(values, (points + 0.5) / size)


@settings(max_examples=60, deadline=None, derandomize=True)
@given(VOLUMES)
def test_every_trilinear_value_lies_within_the_bounds_of_its_cell(values):
    points = random_points(values)
    found = look_up(values, points)
    bounds = bounds_of(values)
    while True:
        cells = cells_of(points, bounds)
        assert (found <= bounds.majorant[cells]).all()
        assert (found <= bounds.maximum[cells][:, 0]).all()
        assert (found >= bounds.minimum[cells][:, 0]).all()
        if max(bounds.cells) == 1:
            return
        bounds = bounds.coarser()


@settings(max_examples=60, deadline=None, derandomize=True)
@given(VOLUMES, st.floats(0.01, 100), st.floats(0.0, 5.0))
def test_every_trilinear_value_lies_within_the_bounds_of_its_leaf(values, rate, visit_cost):
    points = random_points(values, 500)
    found = look_up(values, points)
    bounds = bounds_of(values)
    tree = build_kdtree(bounds, np.array([1.0, 0.7, 1.3]), rate, visit_cost, 0.2 * visit_cost)
    for point, value in zip(points, found, strict=True):
        leaf, high = leaf_of(tree.nodes, point, bounds)
        assert value <= high
        assert tree.minimum[leaf, 0] <= value <= tree.maximum[leaf, 0]


def leaf_of(nodes, point, bounds):
    """Number and packed maximum of the leaf that holds an index position, found as the device finds it."""
    cell = np.clip((point // bounds.cell_size).astype(int), 0, np.array(bounds.cells) - 1)
    node = nodes[0]
    while node[0] & 3 != 3:
        right = cell[node[0] & 3] >= node[0] >> 2
        node = nodes[int(node[1]) + int(right)]
    high = 0.0 if node[0] == 3 else node[:1].view(np.float32)[0]
    return int(node[1]), high


def test_without_the_halo_the_bounds_fail():
    """The property test can fail: extrema of a cell's own 4³ samples miss what it interpolates towards."""
    values = sparse((16, 16, 16))
    points = random_points(values)
    blocks = values.reshape(4, 4, 4, 4, 4, 4).max(axis=(1, 3, 5))
    z, y, x = np.clip((points // 4).astype(int), 0, 3).T
    assert (look_up(values, points) > blocks[z, y, x]).any()


@given(st.floats(0, np.float32(3.0e38).item(), width=32))
def test_a_packed_maximum_is_never_lower(value):
    word = pack_maximum(np.array([value], np.float32))
    assert word[0] & 3 == 3
    unpacked = 0.0 if word[0] == 3 else word.view(np.float32)[0]
    assert unpacked >= value
    assert unpacked <= np.float32(value) * (1 + 1e-6) + 1e-44


@pytest.mark.parametrize("bad", [np.inf, np.nan, -1.0])
def test_a_majorant_that_is_no_bound_is_refused(bad):
    with pytest.raises(ValueError, match="must be finite and not negative"):
        pack_maximum(np.array([bad], np.float32))


def test_constant_volumes_get_one_leaf_and_lumpy_ones_more():
    uniform = build_kdtree(bounds_of(np.ones((32, 32, 32), np.float32)), np.ones(3), 1.0, 0.4, 0.1)
    assert uniform.leaves == 1
    lumpy = build_kdtree(bounds_of(sparse((32, 32, 64))), np.ones(3), 100.0, 0.1, 0.02)
    assert lumpy.leaves > 8


def expected_cost(nodes, bounds, rate, leaf_cost, step_cost):
    """Cost of a tree by walking it: what its builder minimised."""
    total = 0.0
    for index, lower, upper, depth in leaves_of(nodes, bounds):
        w, h, d = (upper - lower).astype(float)
        high = 0.0 if nodes[index, 0] == 3 else nodes[index, :1].view(np.float32)[0]
        visits = 0.5 * (w * h + h * d + d * w) * (w * h * d > 0)
        total += w * h * d * rate * high + (leaf_cost + depth * step_cost) * visits
    return total


@pytest.mark.parametrize("leaf_cost", [0.0, 0.3, 3.0, 1e9])
def test_the_tree_costs_what_its_builder_says_and_never_more_than_one_leaf(leaf_cost):
    bounds = bounds_of(sparse())
    tree = build_kdtree(bounds, np.ones(3), 5.0, leaf_cost, 0.1 * leaf_cost)
    cost = expected_cost(tree.nodes, bounds, 5.0, leaf_cost, 0.1 * leaf_cost)
    assert tree.cost == pytest.approx(cost, rel=1e-5)
    nx, ny, nz = bounds.cells
    whole = 5.0 * nx * ny * nz * float(bounds.majorant.max()) + leaf_cost * 0.5 * (
        nx * ny + ny * nz + nz * nx
    )
    assert tree.cost <= whole * (1 + 1e-9)
    if leaf_cost == 1e9:
        assert tree.leaves == 1, "where visits cost everything, nothing is split"


def device_values(device, volume, points):
    """volume_value at index positions (n, 3)."""
    medium = medium_of(np.ones((2, 2, 2)))
    object.__setattr__(medium, "sigma_t", volume)
    probe = Probe(device, scene_of(medium))
    out = np.empty(len(points), np.float32)
    body = "out0[i] = volume_value(scene, scene->volumes, vload3(i, in0), 0);"
    origin = np.array(probe.prepared.volumes[0].bricks.origin)
    probe.run(["density/volume.h"], body, [out], [(points - origin).astype(np.float32)])
    return out


@pytest.mark.parametrize("shape", [(1, 1, 1), (2, 3, 1), (8, 8, 8), (9, 9, 9), (17, 30, 41)])
def test_the_device_reads_what_the_array_holds(device, shape):
    values = np.random.default_rng(3).random(shape).astype(np.float32)
    points = random_points(values, 20_000)
    found = device_values(device, grid_volume(values), points)
    assert np.abs(found - look_up(values, points)).max() < 2e-6 * max(shape)


def test_the_device_reads_the_nearest_sample(device):
    values = np.random.default_rng(4).random((9, 10, 21)).astype(np.float32)
    points = random_points(values, 20_000)
    points = points[(np.abs(points - np.floor(points) - 0.5) > 1e-3).all(axis=1)]
    found = device_values(device, grid_volume(values, "nearest"), points)
    x, y, z = np.clip(np.round(points).astype(int), 0, np.array(values.shape[::-1]) - 1).T
    assert (found == values[z, y, x]).all()


def sparse_grid():
    """Two leaves, one active tile beside them, and a background that is not 0."""
    rng = np.random.default_rng(5)
    return SparseGrid(
        leaf_origins=np.array([[-8, 0, 0], [8, 8, 0]], np.int32),
        leaf_values=rng.random((2, 8, 8, 8, 1)).astype(np.float32),
        leaf_active=np.full((2, 64), 255, np.uint8),
        tile_origins=np.array([[16, 0, 0]], np.int32),
        tile_sizes=np.array([8], np.int32),
        tile_values=np.array([[0.4]], np.float32),
        tile_active=np.array([True]),
        background=np.array([0.25], np.float32),
        index_to_world=np.diag([0.05, 0.05, 0.05, 1.0]),
        active_box=np.array([[-8, 0, 0], [23, 15, 7]], np.int32),
    )


def dense_of(grid, lower, upper):
    """Every sample of a sparse grid between two inclusive indices, [z, y, x]."""
    values = np.full(tuple(int(n) for n in (upper - lower + 1)[::-1]), grid.background[0], np.float32)
    blocks = [(o, 8, v) for o, v in zip(grid.leaf_origins, grid.leaf_values[..., 0], strict=True)]
    blocks += [
        (o, s, v) for o, s, (v,) in zip(grid.tile_origins, grid.tile_sizes, grid.tile_values, strict=True)
    ]
    for origin, edge, value in blocks:
        x, y, z = origin - lower
        values[z : z + edge, y : y + edge, x : x + edge] = value
    return values


def test_a_sparse_grid_reads_like_the_dense_one_it_stands_for(device):
    grid = sparse_grid()
    lower, upper = grid.active_box[0] - 1, grid.active_box[1] + 1
    values = dense_of(grid, lower, upper)
    points = np.random.default_rng(6).random((20_000, 3)) * (upper - lower) + lower
    volume = grid_volume(np.ones((2, 2, 2)))
    object.__setattr__(volume, "grid", grid)
    found = device_values(device, volume, points)
    assert np.abs(found - look_up(values, points - lower)).max() < 1e-5


def test_constant_bricks_are_stored_once():
    values = np.zeros((65, 65, 65), np.float32)
    values[:8, :8, :8] = 1.0
    bricks = build_bricks(DenseGrid(values[..., None], UNIT_BOX))
    assert bricks.top.shape == (8, 8, 8) and bricks.brick_count <= 9
    stored = {number: samples for number, samples in bricks.stored()}
    assert (stored[bricks.top[7, 7, 7]] == 0).all()
    assert BRICK_CELLS == 8


def quadrature_means(values, cells):
    """Means over cubes of 4³ cells, (nz, ny, nx): Gauss–Legendre, two points per cell and axis."""
    offsets = np.array([0.5 - 0.5 / np.sqrt(3), 0.5 + 0.5 / np.sqrt(3)])
    along = (np.arange(BOUND_CELLS)[:, None] + offsets).reshape(-1)
    inner = np.stack(np.meshgrid(along, along, along, indexing="ij"), -1).reshape(-1, 3)
    means = np.empty(cells)
    for z, y, x in np.ndindex(cells):
        means[z, y, x] = look_up(values, inner + BOUND_CELLS * np.array([x, y, z])).mean()
    return means


@pytest.mark.parametrize("shape", [(1, 1, 1), (2, 3, 1), (9, 9, 9), (8, 13, 10), (17, 5, 30)])
@pytest.mark.parametrize("channels", [1, 3])
def test_means_of_cells_are_those_of_the_interpolant(shape, channels):
    values = np.random.default_rng(8).random((*shape, channels)).astype(np.float32)
    bricks = build_bricks(DenseGrid(values, UNIT_BOX))
    means = bricks.means()
    assert means.dtype == np.float32 and means.shape == bricks.minimum.shape == bricks.maximum.shape
    assert means.shape == (*(2 * n for n in bricks.top.shape), channels)
    for channel in range(channels):
        exact = quadrature_means(values[..., channel], means.shape[:3])
        assert np.abs(means[..., channel] - exact).max() < 1e-6


def test_the_mean_of_a_cells_samples_is_not_that_of_the_interpolant():
    """The test above can fail: samples on the border of a cell count half, or less, in its mean."""
    values = np.zeros((9, 9, 9), np.float32)
    values[0] = 1.0
    assert build_bricks(DenseGrid(values[..., None], UNIT_BOX)).means()[0, 0, 0, 0] == 0.125
    assert values[:5, :5, :5].mean() == np.float32(0.2)


def test_means_of_a_sparse_grid_are_those_of_the_dense_one_it_stands_for():
    grid = sparse_grid()
    bricks = build_bricks(grid)
    upper = np.array(bricks.origin) + bricks.top.shape[::-1] * np.array(BRICK_CELLS)
    values = dense_of(grid, np.array(bricks.origin), np.maximum(upper, grid.active_box[1] + 1))
    means = bricks.means()
    assert means.shape == bricks.minimum.shape
    assert np.abs(means[..., 0] - quadrature_means(values, means.shape[:3])).max() < 1e-6


@pytest.mark.parametrize("value", [0.0, 0.1, 3.0e38, 1e-44])
def test_constant_cells_have_their_value_as_mean(value):
    values = np.full((20, 9, 9, 2), value, np.float32)
    values[-1, -1, -1] = 1.0
    means = build_bricks(DenseGrid(values, UNIT_BOX)).means()
    assert (means[:4] == np.float32(value)).all()


def test_extrema_and_means_of_coloured_volumes_are_those_of_each_channel():
    values = np.random.default_rng(9).random((9, 12, 17, 3)).astype(np.float32)
    coloured = build_bricks(DenseGrid(values, UNIT_BOX))
    for channel in range(3):
        grey = build_bricks(DenseGrid(values[..., channel : channel + 1], UNIT_BOX))
        for name in ("minimum", "maximum"):
            assert (getattr(coloured, name)[..., channel] == getattr(grey, name)[..., 0]).all()
        assert (coloured.means()[..., channel] == grey.means()[..., 0]).all()
