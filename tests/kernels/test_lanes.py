"""Walks in lanes: the contract on the device functions, the same bits at every width, random numbers."""

import itertools

import numpy as np
import pytest
from fields import FIELDS, RAYS, exit_distance
from lane_walks import lane_walks
from probe import Probe, medium_of, scene_of
from scipy import stats
from stat_tests import FALSE_ALARM, largest_z, require_precision, sidak, z_score
from tiers import quick_first, quick_where
from walks import collision_p_value, exact_depth, probes_of, scene_with

from clvol.accel import costs
from clvol.accel.skipping import marked_empty
from clvol.planning import registry
from clvol.rendering import upload

WALKS = 1 << 16
CASES = len(FIELDS) * len(RAYS)
WIDTHS = (1, 4, 8, 16)
WALKED = [
    *itertools.product(
        [name for name, choice in registry.MAJORANTS.items() if choice.in_lanes], registry.LOOKUPS
    )
]
TRANSMITTANCES = [name for name, choice in registry.TRANSMITTANCES.items() if choice.in_lanes]


@pytest.fixture(scope="module")
def probes(device):
    return probes_of(device, lanes="8")


@quick_first(("majorant", "lookup"), WALKED)
def test_collisions_in_lanes_follow_the_exact_distribution(probes, majorant, lookup):
    level = sidak(FALSE_ALARM, CASES)
    for field, (name, ray) in itertools.product(FIELDS, RAYS.items()):
        probe, length = probes(field, majorant=majorant, lookup=lookup), exit_distance(*ray)
        (t, _, flaws, *_), _ = transposed(lane_walks(probe, "technique", ray, length, WALKS))
        assert flaws.sum() == 0
        assert collision_p_value(t, exact_depth(field, name)[0], length) > level, f"{field}, ray {name}"


@quick_first("transmittance", TRANSMITTANCES)
@quick_first(("majorant", "lookup"), WALKED)
def test_transmittance_in_lanes_is_unbiased(probes, transmittance, majorant, lookup):
    for field, (name, ray) in itertools.product(FIELDS, RAYS.items()):
        probe = probes(field, majorant=majorant, lookup=lookup, transmittance=transmittance)
        length, exact = exit_distance(*ray), np.exp(-exact_depth(field, name)[0, -1])
        (_, values, flaws, *_), _ = transposed(lane_walks(probe, "transmittance", ray, length, WALKS))
        assert flaws.sum() == 0
        values = values.astype(float)
        error = np.sqrt(values.var() / WALKS + (1e-6 * exact) ** 2)
        assert abs(z_score(values.mean(), error**2, exact)) < largest_z(CASES), f"{field}, ray {name}"
        assert field != "vacuum" or (values == 1.0).all()


@pytest.mark.contract
def test_half_a_percent_shows_in_lanes(device):
    """A scale that is off by as much, and the bound with it: the tests above would fail."""
    values, ray = FIELDS["ramp"](), RAYS["oblique"]
    probe = Probe(device, scene_of(medium_of(values, 2.0 * 1.005)), lanes="8", transmittance="ratio")
    length, exact = exit_distance(*ray), np.exp(-exact_depth("ramp", "oblique")[0, -1])
    (_, values, *_), _ = transposed(lane_walks(probe, "transmittance", ray, length, 3 << 20))
    error = values.astype(float).std() / np.sqrt(len(values))
    require_precision(error, 0.005 * exact / 6, "transmittance")
    assert abs(values.mean(dtype=float) - exact) > largest_z(CASES) * error / 2


@pytest.mark.parametrize("channel", range(3))
def test_each_channel_of_a_coloured_volume_has_its_own_density(probes, channel):
    ray = RAYS["oblique"]
    probe, length = probes("coloured", majorant="grid"), exit_distance(*ray)
    found, _ = transposed(lane_walks(probe, "technique", ray, length, WALKS, channel=channel))
    tau = exact_depth("coloured", "oblique")[channel]
    assert collision_p_value(found[0], tau, length) > sidak(FALSE_ALARM, 3)


def transposed(found):
    outcomes, steps = found
    return outcomes.T, steps


# -- widths, cells, steps ----------------------------------------------------------------------------------


@quick_first(
    ("family", "lookup"), [("technique", "exact"), ("technique", "stochastic"), ("transmittance", "exact")]
)
def test_walks_have_the_same_bits_at_every_width(probes, family, lookup):
    choices = {"majorant": "grid", "lookup": lookup, "transmittance": "ratio"}
    probe, ray = probes("sparse", **choices), RAYS["backwards"]
    length = exit_distance(*ray)
    found = [lane_walks(probe, family, ray, length, 5000, lanes) for lanes in WIDTHS]
    for outcomes, steps in found:
        assert outcomes.tobytes() == found[0][0].tobytes()
        t, estimate, _, lookups, cells, _ = outcomes.T
        left = (t < 0).sum() if family == "technique" else (estimate > 0).sum()
        assert steps[:, 1].sum() == lookups.sum() + cells.sum() + left
        assert (steps[:, 0] >= steps[:, 1]).all()
    busy = [steps[:, 1].sum() / steps[:, 0].sum() for _, steps in found]
    assert busy[0] == 1.0 and min(busy) > 0.3


def test_empty_blocks_are_marked_with_their_edge():
    bounds = np.zeros((9, 8, 17), np.float32)
    bounds[0, 0, 0] = bounds[8, 7, 16] = 2.0
    marked = marked_empty(bounds)
    assert (marked[bounds > 0] == 2.0).all() and marked.min() == -8
    for z, y, x in np.ndindex(*bounds.shape):
        edge = int(-marked[z, y, x]) if marked[z, y, x] < 0 else 1
        block = tuple(slice(i // edge * edge, i // edge * edge + edge) for i in (z, y, x))
        assert bounds[z, y, x] > 0 or not bounds[block].any()
        wider = tuple(slice(i // (2 * edge) * 2 * edge, (i // (2 * edge) + 1) * 2 * edge) for i in (z, y, x))
        assert edge == 8 or bounds[z, y, x] > 0 or bounds[wider].any()


def test_crossing_empty_blocks_in_one_step_touches_no_collision(device, monkeypatch):
    values = np.zeros((40, 41, 66), np.float32)
    values[30:36, 4:9, 50:60] = values[5:8, 20:30, 2:12] = 1.0
    towards = np.random.default_rng(4).uniform([0.7, 0.0, 0.7], [0.95, 0.3, 0.95], (40, 3))
    found = []
    for marks in (marked_empty, lambda bounds: bounds):
        monkeypatch.setattr(upload, "marked_empty", marks)
        probe = Probe(device, scene_of(medium_of(values, 30.0)), lanes="16")
        rays = [(START, (end - START) / np.linalg.norm(end - START)) for end in towards]
        found.append(np.concatenate([lane_walks(probe, "technique", ray, 1.5, 500)[0] for ray in rays]))
    marked, plain = found
    assert marked[:, 4].sum() < 0.6 * plain[:, 4].sum()
    assert (marked[:, 0] > 0).any() and (marked[:, [0, 2, 3]] == plain[:, [0, 2, 3]]).all()


START = np.array([0.1, 0.65, 0.02])


def test_rays_along_planes_and_corners_of_cells_get_on(device, monkeypatch):
    """A cell walk that finds its cell from a position could stand still where a ray grazes a plane."""
    monkeypatch.setattr(costs, "LANE_CELL_COST", 0.0)
    values = np.random.default_rng(5).uniform(0, 1e-3, (64, 64, 64)).astype(np.float32)
    probe = Probe(device, scene_of(medium_of(values)), lanes="8")
    cells = probe.prepared.majorants[0].cells
    assert cells == (16, 16, 16)
    for slope, start in itertools.product((0.0, 1e-12, 1e-7, 1e-4, 1.0), (0.5, 0.5 + 1 / 128, 8.5 / 64)):
        for sign in (1.0, -1.0):
            direction = np.array([sign, slope, -slope]) / np.sqrt(1 + 2 * slope**2)
            ray = np.array([0.5 - 0.499999 * sign, start, start]), direction
            found = lane_walks(probe, "technique", ray, exit_distance(*ray), 256)[0]
            crossed = found[:, 4].max()
            assert found[:, 2].sum() == 0 and 2 <= crossed <= sum(cells), (slope, start, sign)


# -- random numbers ----------------------------------------------------------------------------------------

DRAWS = """
    LaneStream stream = {(Bits)(in0[2 * i]), (Bits)(in0[2 * i + 1])};
    for (uint n = 0; n < %du; ++n) {
        const BitsPair k = lane_pair(&stream, (Int)(-1));
        out0[2 * (i * %du + n)] = k.x;
        out0[2 * (i * %du + n) + 1] = k.y;
    }
"""
STREAMS, NUMBERS = 1 << 12, 64


def draws(device, seeds):
    """The first pairs of streams of these seeds: uint32 (streams, NUMBERS, 2)."""
    probe, out = Probe(device, scene_with("constant")), np.empty((len(seeds), NUMBERS, 2), np.uint32)
    body, macros = DRAWS % (NUMBERS, NUMBERS, NUMBERS), {"CLVOL_LANES": 1}
    probe.run(["core/lane_random.h"], body, [out], [seeds.astype(np.uint32)], macros=macros)
    return out


NEIGHBOURS = {
    "low words that follow each other": lambda n: (n, np.zeros_like(n)),
    "high words that follow each other": lambda n: (np.zeros_like(n), n),
    "seeds of one bit": lambda n: (1 << (n % 32), 1 << (n // 32 % 32)),
    "a counter's steps apart": lambda n: (n * 0x9E3779B9, n),
}


@pytest.mark.parametrize("how", NEIGHBOURS)
def test_streams_are_uniform_and_independent_of_their_neighbours(device, how):
    seeds = np.stack(NEIGHBOURS[how](np.arange(STREAMS, dtype=np.uint64)), axis=1) & 0xFFFFFFFF
    seeds = np.unique(seeds, axis=0)
    found = draws(device, seeds)
    level = sidak(FALSE_ALARM, len(NEIGHBOURS) * 12)
    for word in range(2):
        numbers = found[..., word]
        for shift in (24, 16, 0):  # the highest byte, the next, the lowest
            counts = np.bincount((numbers >> shift & 255).ravel(), minlength=256)
            assert stats.chisquare(counts).pvalue > level, (word, shift)
    top = (found >> 28).astype(int)  # 16 x 16 classes of two numbers
    pairs = {
        "of a pair": (top[..., 0], top[..., 1]),
        "one after the other": (top[:, :-1, 1], top[:, 1:, 0]),
        "of neighbours": (top[:-1, :, 0], top[1:, :, 0]),
        "of neighbours' second": (top[:-1, :, 1], top[1:, :, 1]),
        "the same, every other": (top[:-1, :, 0], top[1:, :, 1]),
        "a step apart": (top[:-1, 1:, 0], top[1:, :-1, 0]),
    }
    for name, (a, b) in pairs.items():
        counts = np.bincount((16 * a + b).ravel(), minlength=256)
        assert stats.chisquare(counts).pvalue > level, name


def test_streams_of_two_seeds_share_no_run_of_numbers(device):
    """Counters that meet give the same numbers only under the same key."""
    n = np.arange(STREAMS, dtype=np.uint64)
    found = draws(device, np.stack([n % 64 * 0x9E3779B9 & 0xFFFFFFFF, n // 64], axis=1))
    pairs = found.reshape(-1, 2).astype(np.uint64)
    distinct = len(np.unique(pairs[:, 0] << np.uint64(32) | pairs[:, 1]))
    assert distinct == 64 * (64 + NUMBERS - 1)  # of each key, as many as its counters pass


@pytest.mark.parametrize("sampler", registry.SAMPLERS)
@quick_where("lanes", WIDTHS, (8).__eq__)
def test_lanes_decide_by_the_numbers_that_paths_alone_decide_by(device, sampler, lanes):
    keys = np.random.default_rng(8).integers(0, 1 << 13, (64, 4), dtype=np.uint32)
    alone, together = (np.empty((64, 4), np.uint32) for _ in range(2))
    probe = Probe(device, scene_with("constant"), sampler=sampler)
    one = """
    const SampleKey key = {in0[4 * i], in0[4 * i + 1], in0[4 * i + 2]};
    const uint4 k = decision_block(scene, key, i % 6u, in0[4 * i + 3]);
    out0[4 * i] = k.x, out0[4 * i + 1] = k.y, out0[4 * i + 2] = k.z, out0[4 * i + 3] = k.w;
    """
    probe.run([], one, [alone], [keys])
    many = """
    if (i % CLVOL_LANES != 0)
        return;
    const Bits none = (Bits)(0u);
    LaneKeys keys = {none, none, none};
    Bits segment = none, block = none;
    for (uint n = 0; n < CLVOL_LANES; ++n) {
        __global const uint *key = in0 + 4 * (i + n);
        ((uint *)&keys.pixel)[n] = key[0], ((uint *)&keys.sample)[n] = key[1];
        ((uint *)&keys.bounce)[n] = key[2], ((uint *)&segment)[n] = key[3];
        ((uint *)&block)[n] = (i + n) % 6u; /* every BLOCK_* */
    }
    const BitsBlock k = lane_decisions(scene, &keys, block, segment);
    for (uint n = 0; n < CLVOL_LANES; ++n) {
        __global uint *out = out0 + 4 * (i + n);
        out[0] = ((const uint *)&k.x)[n], out[1] = ((const uint *)&k.y)[n];
        out[2] = ((const uint *)&k.z)[n], out[3] = ((const uint *)&k.w)[n];
    }
    """
    probe.run([], many, [together], [keys], macros={"CLVOL_LANES": lanes})
    assert len(np.unique(alone)) > 250 and (alone == together).all()
