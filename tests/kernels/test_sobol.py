"""Samplers sobol and joint: their sequences, their numbers on the device, their pictures against independent.

χ² tests have a false-alarm rate of 1e-4 each and use fixed seeds; what scrambling must keep is exact.
"""

from itertools import combinations, pairwise

import numpy as np
import pytest
from pictures import box, gridded, hg, picture, volume
from probe import Probe, medium_of, scene_of
from sampling import uniform_p_value
from scipy.stats import qmc
from stat_tests import FALSE_ALARM, assert_same_picture, image_mean, largest_z

import clvol
from clvol.scene.materials import Diffuse, Mask
from clvol.scene.records import ConstantEmitter, Shape
from clvol.tables import sobol

CAMERA, WALK, LIGHT, DIRECTION, SHADOW, SURFACE = range(6)
COLUMNS = {name: sobol.direction_numbers(name == "joint") for name in ("sobol", "joint")}


# -- the sequence ----------------------------------------------------------------------------------


def numbers(dimension, index, sampler="sobol"):
    """Numbers of the sequence in its natural order, uint32."""
    index = np.asarray(index, np.uint32)
    found = np.zeros(index.shape, np.uint32)
    for bit, column in enumerate(COLUMNS[sampler][dimension]):
        found ^= np.where(index >> np.uint32(bit) & 1, column, np.uint32(0)).astype(np.uint32)
    return found


def test_direction_numbers_are_those_of_scipy():
    """SciPy goes in Gray code's order: its number 2^k has the columns k and k - 1."""
    engine = qmc.Sobol(sobol.DIMENSIONS, scramble=False, bits=32)
    before = np.zeros(sobol.DIMENSIONS, np.uint32)
    for k in range(21):
        engine.fast_forward(2**k - engine.num_generated)
        (found,) = (engine.random(1) * 2**32).astype(np.uint32)
        assert (found == COLUMNS["sobol"][:, k] ^ before).all()
        before = COLUMNS["sobol"][:, k]


@pytest.fixture(scope="module")
def probe(device):
    return Probe(device, scene_of(medium_of(1.0, albedo=0.5)), sampler="sobol")


@pytest.fixture(scope="module")
def joint(device):
    return Probe(device, scene_of(medium_of(1.0, albedo=0.5)), sampler="joint")


@pytest.fixture(scope="module", params=["sobol", "joint"])
def either(request):
    return request.getfixturevalue({"sobol": "probe", "joint": "joint"}[request.param])


@pytest.mark.parametrize(("fixture", "sampler"), [("probe", "sobol"), ("joint", "joint")])
def test_the_device_has_the_same_sequence(request, fixture, sampler):
    probe = request.getfixturevalue(fixture)
    index = np.r_[0, 1, 2, 2**30, 2**32 - 1, np.random.default_rng(1).integers(0, 2**32, 999)]
    out = np.zeros((len(index), 4), np.uint32)
    probe.run([], "vstore4(sobol_point(scene, in0[i]), i, out0);", [out], [index.astype(np.uint32)])
    expected = [sobol.reverse_bits(numbers(d, index, sampler)) for d in range(4)]
    assert (out == np.stack(expected, axis=1)).all()


# -- numbers on the device ---------------------------------------------------------------------------


def blocks(probe, pixel=0, sample=0, bounce=0, block=CAMERA, segment=0):
    """decision_block of anything that broadcasts, as the device finds it: uint32 (…, 4)."""
    keys = np.broadcast_arrays(pixel, sample, bounce, block, segment)
    flat = np.stack([k.ravel() for k in keys], axis=1).astype(np.uint32)
    out = np.zeros((len(flat), 4), np.uint32)
    body = """
        __global uint *g = in0 + 5 * i;
        SampleKey key;
        key.pixel = g[0], key.sample = g[1], key.bounce = g[2];
        vstore4(decision_block(scene, key, g[3], g[4]), i, out0);"""
    probe.run([], body, [out], [flat])
    return out.reshape(*keys[0].shape, 4)


def of_one(part, count, first=0):
    """The samples of one part, from number `first` of its own on."""
    return part + sobol.RANDOMIZATIONS * (first + np.arange(count, dtype=np.int64))


PLACES = [
    {"block": CAMERA},
    {"block": WALK},
    {"block": SURFACE},
    {"block": LIGHT, "bounce": 1},
    {"block": SHADOW, "bounce": 1},
    {"block": DIRECTION, "bounce": 1},
    {"block": WALK, "bounce": 1, "segment": 3},
    {"block": SURFACE, "bounce": 1, "segment": 2},
    {"block": DIRECTION, "bounce": 70},
]
"""Blocks of one path."""
PIXELS = np.arange(2**16)


def p_values(one, other, bins=16):
    """Of every number of `one` being uniform, and independent of every number of `other`; (n, 4) uint32."""
    shift = np.uint32(32 - int(np.log2(bins)))
    a, b = (one >> shift).astype(int), (other >> shift).astype(int)
    same = one is other
    pairs = combinations(range(4), 2) if same else np.ndindex(4, 4)
    found = (
        [uniform_p_value((one[:, n] >> np.uint32(22)).astype(int), 1024) for n in range(4)] if same else []
    )
    return found + [uniform_p_value(bins * a[:, m] + b[:, n], bins * bins) for m, n in pairs]


def test_a_sample_is_uniform_over_pixels_and_its_blocks_are_independent(either):
    found = []
    for sample in (0, 7, 4 * 1023 + 2, 2**32 - 1):
        drawn = [blocks(either, PIXELS, sample, **place) for place in PLACES]
        found += [p for d in drawn for p in p_values(d, d)]
        found += [p for one, other in pairwise(drawn) for p in p_values(one, other)]
    assert min(found) * len(found) > FALSE_ALARM


def test_seeds_pixels_and_randomisations_are_independent_but_samples_of_one_are_not(probe):
    def drawn(pixel, sample, seed=1):
        probe.upload(seed)
        return np.concatenate([blocks(probe, PIXELS * 2 + pixel, sample, **place) for place in PLACES[2:4]])

    base = drawn(0, 0)
    others = [drawn(1, 0), drawn(0, 1), drawn(0, 3), drawn(0, 0, seed=2), drawn(0, 0, seed=1 + 2**32)]
    found = [p for other in others for p in p_values(base, other)]
    assert min(found) * len(found) > FALSE_ALARM
    assert min(p_values(base, drawn(0, sobol.RANDOMIZATIONS))) < 1e-100


def test_randomisations_are_scrambled_apart_and_not_only_in_another_order(probe):
    probe.upload()
    drawn = [blocks(probe, pixel, of_one(r, 1024)).ravel() for pixel in (0, 1) for r in (0, 1, 3)]
    for one, other in combinations(drawn, 2):
        assert len(np.intersect1d(one, other)) < 20  # by chance 4096²/2^32


def test_blocks_never_share_their_numbers(either):
    """Pixel, sample, bounce, block, segment and seed all tell them apart."""
    grid = np.meshgrid([0, 1, 2], [0, 1, 4], [1, 2, 3, 9], range(6), [0, 1, 2**16])
    found = []
    for seed in (3, 3 + 2**32, 9):
        either.upload(seed)
        found.append(blocks(either, *grid).reshape(-1, 4))
    assert len(np.unique(np.concatenate(found), axis=0)) == sum(map(len, found))


def cells(drawn, bits):
    """Number of the stratum of each point (n, dimensions) among 2^bits[d] along each dimension."""
    index = np.zeros(len(drawn), np.int64)
    for d, b in enumerate(bits):
        index = index << b | drawn[:, d].astype(np.int64) >> 32 - b
    return index


def best(place):
    """Which two numbers of a block: a light's point, a direction, a place in the pixel."""
    return [1, 2] if place["block"] in (LIGHT, SURFACE) else [0, 1]


def assert_a_stratum_each(drawn, place, least=0, but=()):
    """2^k of them in every dimension, and in all elementary intervals of the two that matter most.

    `but`: dimensions that need not.
    """
    for k in range(least, 10):
        for run in drawn.reshape(-1, 2**k, 4)[:2]:
            for d in set(range(4)) - set(but):
                assert len(np.unique(cells(run[:, [d]], [k]))) == 2**k, (place, k, d)
            for a in range(k + 1):
                assert len(np.unique(cells(run[:, best(place)], [a, k - a]))) == 2**k, (place, k, a)


@pytest.mark.parametrize("first", [0, 512 * 77, 2**30 - 2**20])
def test_samples_of_a_part_take_a_stratum_each(either, first):
    either.upload()
    for place in PLACES:
        assert_a_stratum_each(blocks(either, 5, of_one(2, 512, first), **place), place)


@pytest.mark.parametrize("first", [0, 4 * 128 * 77, 2**32 - 2**20])
def test_all_parts_of_a_joint_sequence_together_take_a_stratum_each(joint, first):
    joint.upload()
    for place in PLACES:
        drawn = blocks(joint, 5, first + np.arange(512, dtype=np.int64), **place)
        own = [0] if place["block"] == LIGHT else []  # which light: each part's own
        assert_a_stratum_each(drawn, place, least=2, but=own)  # as many as there are parts


def imbalance(one, other):
    """Variance, over pixels, of the share of samples in which two numbers lie in the same half.

    Over that of independent samples; uint32 (pixels, samples) each.
    """
    same = (one ^ other) >> np.uint32(31) == 0
    return 4 * same.shape[1] * same.mean(axis=1).var()


@pytest.mark.parametrize("count", [8, 16, 64])
def test_decisions_of_different_blocks_meet_at_random(probe, count):
    """Samples 2n and 2n + 1 differ in their first digits everywhere.

    So a pair of numbers is drawn half as often as there are samples, at worst.  In one order for all blocks
    it would be drawn once.
    """
    probe.upload()
    pixels = np.arange(1500)[:, None]
    drawn = [blocks(probe, pixels, of_one(1, count), **place) for place in PLACES]
    error = np.sqrt(2 / pixels.size)
    for one, other in combinations(drawn, 2):
        for m, n in np.ndindex(4, 4):
            assert imbalance(one[..., m], other[..., n]) < 2 * (1 + 6 * error)
    in_order = numbers(0, np.arange(count)) ^ np.uint32(2**31) * (pixels % 2).astype(np.uint32)
    assert imbalance(in_order, np.broadcast_to(numbers(0, np.arange(count)), in_order.shape)) > count / 2


@pytest.mark.parametrize("count", [4, 16, 64])
def test_decisions_of_different_blocks_meet_at_random_in_all_parts_together(joint, count):
    """The halves of two numbers are paired alike for eight samples at most."""
    joint.upload()
    pixels = np.arange(1500)[:, None]
    drawn = [blocks(joint, pixels, np.arange(count), **place) for place in PLACES]
    error = np.sqrt(2 / pixels.size)
    for one, other in combinations(drawn, 2):
        for m, n in np.ndindex(4, 4):
            assert imbalance(one[..., m], other[..., n]) < 8 * (1 + 6 * error)


@pytest.mark.parametrize("bounce", [0, 1, 2, 3, 70])
@pytest.mark.parametrize("count", [4, 16, 64])
def test_what_meets_around_a_scattering_is_paired_evenly(joint, bounce, count):
    """In the four points of a turn, no two of these numbers have their halves alike."""
    joint.upload()
    pixels = np.arange(200)[:, None]

    def drawn(block, number, later=1):
        place = {"block": block, "bounce": bounce + later}
        return blocks(joint, pixels, np.arange(count), **place)[..., number]

    flight, next_flight = drawn(WALK, 0, later=0), drawn(WALK, 0)
    light, shadow, direction = drawn(LIGHT, 1), drawn(SHADOW, 0), drawn(DIRECTION, 0)
    for one, other in [
        (flight, light),
        (flight, shadow),
        (light, shadow),
        (flight, direction),
        (flight, next_flight),
        (direction, next_flight),
    ]:
        assert imbalance(one, other) == 0


# -- pictures ----------------------------------------------------------------------------------------

UP, DOWN = (clvol.rotate((1, 0, 0), angle) for angle in (-90, 90))
FLOOR = Shape("rectangle", clvol.translate((0, -1, 0)) @ UP @ clvol.scale(3), bsdf=Diffuse((0.6,)))
LAMP = Shape("rectangle", clvol.translate((0.3, 1.5, 0.2)) @ DOWN @ clvol.scale(0.8), emission=(1.5,))
LACE = Shape(
    "rectangle", clvol.translate((0, 0.9, 0)) @ UP @ clvol.scale(3), bsdf=Mask(Diffuse((0.5,)), (0.4,))
)
"""Lets paths through by chance, so that a first surface decides and what is behind it decides again."""


def smoke(albedo, scale):
    values = np.random.default_rng(5).random((6, 6, 6)) ** 2
    lower, upper = (-1, -1, -1), (1, 0.6, 1)
    return box(lower, upper, gridded(volume(values, lower, upper), albedo, hg(0.4), scale))


def seen(shapes, sky):
    emitters = [ConstantEmitter(sky)]
    return picture(shapes, emitters, (0.1, 1.4, -4.0), (0, -0.3, 0), 32.0, (16, 16), max_depth=6, rr_depth=1)


SCENES = {
    "lace": (seen([FLOOR, LAMP, LACE, smoke(0.8, 3.0)], (1.0,)), "delta", (3000, 2400)),
    "chromatic": (seen([smoke((0.9, 0.7, 0.5), 5.0)], (1.0, 0.8, 0.6)), "spectral", (1700, 1300)),
}


@pytest.mark.contract
@pytest.mark.parametrize(("name", "sampler"), [("lace", "sobol"), ("lace", "joint"), ("chromatic", "joint")])
def test_pictures_have_the_mean_of_independent_samples(name, sampler):
    """Image mean and tiles; a difference of 0.5 % of the mean would be seen."""
    scene, technique, spp = SCENES[name]
    pair = [
        clvol.render(scene, spp=n, seed=seed, sampler=used, technique=technique, transmittance="ratio")
        for n, seed, used in zip(spp, (1, 2), ("independent", sampler), strict=True)
    ]
    assert_same_picture(*pair)
    (mean, variance), (_, other) = (image_mean(r) for r in pair)
    assert (largest_z(mean.size) * np.sqrt(variance + other) < 0.005 * mean).all()
