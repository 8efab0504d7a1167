"""Controls keep what makes decomposition and residual tracking unbiased and bounded.

Kd-trees carry and weigh them by leaf.
"""

import numpy as np
import pytest
from fields import trilinear
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp
from trees import leaves_of

from clvol.accel import costs
from clvol.accel.bounds import Bounds, with_slack
from clvol.accel.controls import WEIGHT_GROWTH, control, looseness, residual, scaled_majorant
from clvol.accel.kdtree import build_kdtree, pack_maximum, unpack_maximum
from clvol.volumes.bricks import BOUND_CELLS, build_bricks
from clvol.volumes.grid import DenseGrid

SCALES = st.sampled_from([0.1, 0.5, 0.9, 1.0, 1.1, 3.0])
KINDS = ["none", "min", "fitted"]
VALUES = hnp.arrays(
    np.float32,
    st.tuples(st.integers(1, 6), st.just(4), st.sampled_from([1, 3])),
    elements=st.one_of(st.just(0.0), st.floats(2.0**-13, 1000, width=32)),
    fill=st.just(np.float32(0.5)),
)
"""Samples of some cells, (cells, samples, channels)."""


def cells_of(values):
    """Extrema, with slack, and means of each cell's samples, (cells, channels); no cell has neighbours."""
    low, high = (f(axis=1)[:, None, None] for f in (values.min, values.max))
    mean = values.mean(axis=1, dtype=float).astype(np.float32)[:, None, None]
    bounds = [with_slack(a[None], b[None], 4, c[None]) for a, b, c in zip(low, high, mean, strict=True)]
    return tuple(
        np.concatenate([getattr(b, n)[0, 0] for b in bounds]) for n in ("minimum", "maximum", "mean")
    )


def is_constant(low, high):
    return (high - low <= 2.0**-18 * low).all(axis=-1)


@settings(deadline=None, derandomize=True)
@given(VALUES, st.sampled_from(KINDS), SCALES)
def test_controls_lie_between_nothing_and_the_majorant(values, kind, scale):
    cells = cells_of(values)
    subtracted = control(*cells, kind, scale)
    assert subtracted.dtype == np.float32 and subtracted.shape == cells[0].shape
    assert (subtracted >= 0).all()
    assert (subtracted <= scaled_majorant(cells[1], scale)[:, None]).all()


@settings(deadline=None, derandomize=True)
@given(VALUES, SCALES)
def test_a_scaled_majorant_is_never_lower_than_the_exact_product(values, scale):
    maximum = cells_of(values)[1]
    found = scaled_majorant(maximum, scale)
    assert found.dtype == np.float32
    exact = maximum.max(axis=-1).astype(float) * scale
    assert (found >= exact).all() and (found <= exact * (1 + 2.0**-22)).all()
    packed = unpack_maximum(pack_maximum(found))
    assert (packed >= found).all() and (packed <= found * (1 + 2.0**-21)).all()


@settings(deadline=None, derandomize=True)
@given(VALUES, SCALES)
def test_the_weight_of_a_look_up_is_bounded_with_a_fitted_control(values, scale):
    """(|sigma_r| + |sigma_n|) / (sigma_maj - c), METHODS §3, at every value that a cell can hold."""
    low, high, mean = cells_of(values)
    majorant = scaled_majorant(high, scale).astype(float)[:, None]
    c = control(low, high, mean, "fitted", scale).astype(float)
    varies = ~is_constant(low, high) | (scale < 1)
    assert ((majorant - c) >= 0.0999 * majorant)[varies].all(), "residual events keep a probability"
    for sigma in (low, mean, high, c):
        excess = np.maximum(sigma - majorant, 0)
        weight = (np.abs(sigma - c) + np.abs(majorant - sigma)) / np.maximum(majorant - c, 1e-30)
        assert (weight <= 3.001 + 21 * excess / np.maximum(majorant, 1e-30))[varies].all()


def test_without_a_share_for_the_residual_the_weight_is_not_bounded():
    """The test above can fail: the mean itself, where one sample of a hundred is thin, weighs 99."""
    low, high, mean = (np.array([[v]], np.float32) for v in (0.0, 1.0, 0.99))
    assert np.abs(0 - mean) / (high - mean) > 98
    assert control(low, high, mean, "fitted")[0, 0] <= 0.5


@settings(deadline=None, derandomize=True)
@given(VALUES)
def test_a_fitted_control_seldom_exceeds_the_density(values):
    """The mean of (c - sigma)⁺, on which the weights' growth hangs, is a small share of the mean density."""
    low, high, mean = cells_of(values)
    c = control(low, high, mean, "fitted").astype(float)
    varies = ~is_constant(low, high)
    excess = np.maximum(c[None] - values.transpose(1, 0, 2), 0).mean(axis=0)
    assert (excess <= (WEIGHT_GROWTH * mean + 1e-6 * high))[varies].all()
    share = 0.9 * high.max(axis=-1, keepdims=True)
    assert (c >= np.minimum(low, share) * (1 - 1e-6)).all(), "and is no worse than the minimum"


@pytest.mark.parametrize("value", [(0.7,), (0.7, 0.2, 0.0), (1e-30,), (3e37,)])
def test_a_constant_cell_needs_next_to_no_look_up(value):
    values = np.broadcast_to(np.float32(value), (1, 4, len(value)))
    low, high, mean = cells_of(values)
    assert (control(low, high, mean, "fitted") == values[:, 0]).all()
    if len(value) == 1:
        assert looseness(Bounds(low, high, 4, mean), "fitted") < 2.0**-18 * high[0, 0]
    assert (control(low, high, mean, "fitted", 0.8) < 0.73 * high.max()).all(), "the bound no longer bounds"


def test_the_gap_of_a_constant_cell_covers_the_roundings_of_a_look_up():
    value = np.float32(np.random.default_rng(1).uniform(0.1, 100, (1000, 1)))
    low, high, mean = cells_of(np.repeat(value[:, None], 4, axis=1))
    gap = scaled_majorant(high) - control(low, high, mean, "fitted")[:, 0]
    assert (gap >= 4 * np.spacing(value[:, 0])).all()


@settings(deadline=None, derandomize=True)
@given(VALUES, st.sampled_from(["mean", "min", "max"]), SCALES)
def test_a_residual_majorant_bounds_what_the_control_leaves(values, kind, scale):
    low, high, mean = cells_of(values)
    subtracted, majorant = residual(low, high, mean, kind, scale)
    assert (subtracted == {"mean": mean, "min": low, "max": high}[kind]).all()
    assert majorant.dtype == np.float32 and majorant.shape == low.shape[:-1]
    c = subtracted.astype(float)
    spread = max(np.abs(v - c).max() for v in (low, high, values.transpose(1, 0, 2)))
    assert majorant.max() >= scale * spread * (1 - 1e-9)
    for sigma in (low, high, *values.transpose(1, 0, 2)):
        assert (majorant >= scale * np.abs(sigma - c).max(axis=-1)).all()
    tight = np.maximum(np.abs(high - c), np.abs(low - c)).max(axis=-1)
    assert (majorant <= scale * np.maximum(tight, 2.0**-20 * high.max(axis=-1)) * (1 + 2.0**-22)).all()
    assert ((majorant == 0) == (high.max(axis=-1) == 0)).all(), "0 only in empty space"


@pytest.mark.parametrize("kind", ["mean", "min", "max"])
def test_extrema_without_slack_still_leave_a_residual_majorant(kind):
    one = np.ones((1, 1), np.float32)
    assert residual(one, one, one, kind)[1] > 0


@pytest.mark.parametrize("function", [control, residual])
def test_kinds_of_controls_that_there_are_not_are_refused(function):
    one = np.ones((1, 1), np.float32)
    with pytest.raises(ValueError, match="median"):
        function(one, one, one, "median")


@settings(deadline=None, derandomize=True)
@given(VALUES, st.sampled_from(KINDS), SCALES)
def test_looseness_is_the_majorant_less_the_mean_control(values, kind, scale):
    cells = cells_of(values)
    loose = looseness(Bounds(*cells[:2], 4, cells[2]), kind, scale)
    majorant = scaled_majorant(cells[1], scale).astype(float)
    assert (loose >= 0).all() and (loose <= majorant).all()
    expected = majorant - control(*cells, kind, scale).mean(axis=-1, dtype=float)
    assert np.allclose(loose, expected, rtol=1e-6, atol=1e-7 * majorant.max())


# -- fields ------------------------------------------------------------------------------------------


def lumps(channels=1, shape=(21, 37, 50), base=True):
    """Lumps over a base that varies from place to place, as a dense field [z, y, x, channel]."""
    rng = np.random.default_rng(11)
    coarse = rng.random((3, 4, 5, channels)) * 3
    points = np.stack(np.meshgrid(*(np.arange(n) for n in shape[::-1]), indexing="ij"), -1)
    points = points.transpose(2, 1, 0, 3).reshape(-1, 3)
    places = (points + 0.5) / np.array(shape[::-1])
    smooth = np.stack([trilinear(coarse[..., c], places) for c in range(channels)], -1)
    values = smooth.reshape(*shape, channels) * base + 0.1 * rng.random((*shape, channels))
    return values.astype(np.float32)


def bounds_of(values):
    bricks = build_bricks(DenseGrid(values, np.zeros((2, 3))))
    return with_slack(bricks.minimum, bricks.maximum, BOUND_CELLS, bricks.means())


def recounted(bounds, lower, upper):
    """Extrema and mean of the cells of a box, x y z."""
    box = tuple(slice(a, b) for a, b in zip(lower[::-1], upper[::-1], strict=True))
    low, high = bounds.minimum[box].min(axis=(0, 1, 2)), bounds.maximum[box].max(axis=(0, 1, 2))
    return low, high, bounds.mean[box].mean(axis=(0, 1, 2), dtype=float)


def reference_looseness(low, high, mean, kind, scale):
    """The rule in plain float64."""
    majorant = scale * float(high.max())
    c = {"none": 0 * low, "min": np.minimum(low, majorant)}.get(kind)
    if c is None:
        with np.errstate(divide="ignore", invalid="ignore"):
            most = low + WEIGHT_GROWTH * mean * (high - low) / (
                high - mean
            )  # NaN and inf where nothing limits
        c = np.fmin(np.minimum(mean, np.minimum((low + majorant) / 2, 0.9 * majorant)), most)
        if scale >= 1 and is_constant(low, high):
            c = np.minimum(mean, majorant)
    return majorant - float(np.mean(c, dtype=float))


def recounted_cost(tree, bounds, extent, rate, visits, kind, scale):
    """Cost of a tree, in the looseness of any kind, by walking its nodes."""
    total = 0.0
    for _, lower, upper, depth in leaves_of(tree.nodes, bounds):
        if (upper > lower).all():
            w, h, d = (upper - lower) * extent
            loose = reference_looseness(*recounted(bounds, lower, upper), kind, scale)
            total += w * h * d * rate * loose
            total += (visits[0] + depth * visits[1]) * 0.5 * (w * h + h * d + d * w)
    return total


EXTENT = np.array([1.0, 0.7, 1.3])


@pytest.mark.parametrize("channels", [1, 3])
def test_the_minimum_as_control_lies_below_every_value(channels):
    """Of cells at every coarseness, of leaves and of the whole, up to the slack beyond the cell."""
    values = lumps(channels)
    bounds = bounds_of(values)
    rng = np.random.default_rng(2)
    size = np.array(values.shape[2::-1])
    points = rng.random((5000, 3)) * (size - 1)
    found = np.stack([trilinear(values[..., c], (points + 0.5) / size) for c in range(channels)], -1)
    tree = build_kdtree(bounds, EXTENT, 1.0, 0.3, 0.1, "min")
    rows = control(tree.minimum, tree.maximum, None, "min")
    for index, lower, upper, _ in leaves_of(tree.nodes, bounds):
        within = ((points >= lower * BOUND_CELLS) & (points <= upper * BOUND_CELLS)).all(axis=1)
        assert (found[within] >= rows[tree.nodes[index, 1]]).all()
    whole = bounds.whole()
    assert (found >= control(whole.minimum, whole.maximum, None, "min")[0, 0, 0]).all()
    while True:
        nearby = points + rng.choice([-1, 0, 1], points.shape) * 2.0**-11
        x, y, z = np.clip(nearby // bounds.cell_size, 0, np.array(bounds.cells) - 1).astype(int).T
        assert (found >= control(bounds.minimum, bounds.maximum, None, "min")[z, y, x] - 1e-6).all()
        if max(bounds.cells) == 1:
            return
        bounds = bounds.coarser()


@pytest.mark.parametrize("scale", [1.0, 0.8, 1.5])
@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("channels", [1, 3])
def test_the_rows_of_leaves_are_those_of_their_boxes(channels, kind, scale):
    bounds = bounds_of(lumps(channels))
    tree = build_kdtree(bounds, EXTENT, 2.0, 0.3, 0.05, kind, scale)
    leaves = list(leaves_of(tree.nodes, bounds))
    assert sorted(tree.nodes[index, 1] for index, *_ in leaves) == list(range(tree.leaves))
    assert tree.leaves > 8 and tree.minimum.shape == (tree.leaves, channels)
    for index, lower, upper, _ in leaves:
        word, row = tree.nodes[index]
        if (upper == lower).any():  # beyond the lattice
            assert not (tree.minimum[row].any() or tree.maximum[row].any() or tree.mean[row].any())
            continue
        low, high, mean = recounted(bounds, lower, upper)
        assert (tree.minimum[row] == low).all() and (tree.maximum[row] == high).all()
        assert tree.mean[row] == pytest.approx(mean, rel=1e-5)
        assert unpack_maximum(word[None])[0] >= scale * float(high.max())
        assert unpack_maximum(word[None])[0] <= scale * float(high.max()) * (1 + 1e-6)


@pytest.mark.parametrize("scale", [1.0, 0.8, 1.5])
@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("channels", [1, 3])
def test_a_tree_costs_what_a_recount_of_its_looseness_says(channels, kind, scale):
    bounds = bounds_of(lumps(channels))
    tree = build_kdtree(bounds, EXTENT, 2.0, 0.3, 0.05, kind, scale)
    cost = recounted_cost(tree, bounds, EXTENT, 2.0, (0.3, 0.05), kind, scale)
    assert tree.cost == pytest.approx(cost, rel=1e-5)


@pytest.mark.parametrize("kind", ["min", "fitted"])
def test_a_tree_for_decomposition_costs_it_less_than_one_for_delta_tracking(kind):
    """Over a varying base the split that lowers the bound is not the one that lifts the control."""
    bounds = bounds_of(lumps())
    visits = costs.LEAF_COST, costs.STEP_COST
    delta = build_kdtree(bounds, EXTENT, 2.0, *visits)
    own = build_kdtree(bounds, EXTENT, 2.0, *visits, kind)
    assert own.cost < 0.99 * recounted_cost(delta, bounds, EXTENT, 2.0, visits, kind, 1.0)
    assert own.cost < delta.cost


def test_trees_without_means_carry_none():
    bounds = bounds_of(lumps())
    tree = build_kdtree(Bounds(bounds.minimum, bounds.maximum, 4), EXTENT, 2.0, 0.3, 0.05, "min")
    assert tree.mean is None


@pytest.mark.parametrize("kind", KINDS)
def test_grids_and_global_bounds_cost_their_looseness(kind):
    bounds, scale = bounds_of(lumps(3)), 1.2
    nx, ny, nz = bounds.cells
    volume = np.prod(EXTENT)
    sides = EXTENT[0] * EXTENT[1] + EXTENT[1] * EXTENT[2] + EXTENT[2] * EXTENT[0]
    whole = reference_looseness(*recounted(bounds, (0, 0, 0), bounds.cells), kind, scale)
    cost = costs.global_cost(bounds, EXTENT, 2.0, kind, scale)
    assert cost == pytest.approx(nx * ny * nz * volume * 2.0 * whole, rel=1e-5)
    each = [
        reference_looseness(*(a[k] for a in (bounds.minimum, bounds.maximum, bounds.mean)), kind, scale)
        for k in np.ndindex(nz, ny, nx)
    ]
    cost = costs.grid_cost(bounds, EXTENT, 2.0, kind, scale)
    assert cost == pytest.approx(
        volume * 2.0 * sum(each) + costs.CELL_COST * 0.5 * sides * nx * ny * nz, rel=1e-5
    )


def test_grids_for_walks_in_lanes_have_the_cells_that_cost_these_least():
    """And are told at the cost of walks one by one, which that of a kd-tree is."""
    bounds = bounds_of(lumps(1))
    rates = np.geomspace(1e-3, 1e3, 61)
    alone = [costs.best_grid(bounds, EXTENT, rate) for rate in rates]
    lanes = [costs.best_grid(bounds, EXTENT, rate, in_lanes=True) for rate in rates]
    sizes = np.array(
        [(one.cell_size, other.cell_size) for (one, _), (other, _) in zip(alone, lanes, strict=True)]
    )
    assert (sizes[:, 1] >= sizes[:, 0]).all() and (sizes[:, 1] > sizes[:, 0]).any()
    for rate, (_, least), (other, told) in zip(rates, alone, lanes, strict=True):
        edge = EXTENT * other.cell_size / bounds.cell_size
        assert told == pytest.approx(costs.grid_cost(other, edge, rate)) and told >= least * (1 - 1e-9)


def test_in_a_mean_every_merged_cell_counts_the_same():
    mean = np.random.default_rng(3).random((3, 4, 5, 2)).astype(np.float32)
    bounds = Bounds(mean, mean, 4, mean)
    merged = bounds.coarser().mean
    assert merged.shape == (2, 2, 3, 2)
    for z, y, x in np.ndindex(2, 2, 3):
        members = mean[2 * z : 2 * z + 2, 2 * y : 2 * y + 2, 2 * x : 2 * x + 2]
        assert merged[z, y, x] == pytest.approx(members.mean(axis=(0, 1, 2)), rel=1e-6)
    assert bounds.whole().mean[0, 0, 0] == pytest.approx(mean.mean(axis=(0, 1, 2)), rel=1e-6)


def test_a_channel_that_is_0_in_a_cell_has_slack_where_another_is_not():
    """The bound of all channels must hold beside a cell where the empty channel is the densest."""
    low = np.zeros((1, 1, 2, 2), np.float32)
    high = np.float32([[[[0.0, 1e-6], [1000.0, 0.0]]]])
    bounds = with_slack(low, high, 4)
    assert bounds.majorant[0, 0, 0] >= 1000 * 2.0**-10
    assert with_slack(low, high * np.float32([1, 0]), 4).majorant[0, 0, 0] == 0
