"""One picture, whatever the combination.

A set covers every pair of technique, transmittance, majorant, look-up and absorption; each picture is
compared with all the others.

Tiles are compared by Welch's test with Holm's correction, image means against the mean of all other pictures;
the false-alarm rate of each test is 1e-4, at fixed seeds, and a bias of 0.5 % of any one picture is seen.
"""

import functools
import itertools

import numpy as np
import pytest
from pictures import box, gridded, hg, picture, volume
from scipy import stats
from stat_tests import FALSE_ALARM, image_mean, largest_z, tile_means
from walks import unbiased

from clvol import render
from clvol.planning import registry
from clvol.scene.records import ConstantEmitter, DirectionalEmitter

FAMILIES = ("technique", "transmittance", "majorant", "lookup", "absorption")
TECHNIQUES, TRANSMITTANCES = unbiased("technique"), unbiased("transmittance")
MAJORANTS, ABSORPTIONS = list(registry.MAJORANTS), list(registry.ABSORPTIONS)
CUBE = (-1.0, -1.0, -1.0), (1.0, 1.0, 1.0)


def linear(technique, transmittance):
    return registry.TECHNIQUES[technique].linear and registry.TRANSMITTANCES[transmittance].linear


def covering_set():
    """Every technique with every transmittance; the rest by residues, so that few kernels are built.

    Three or four of each technique, three or four of each transmittance.
    """
    chosen = []
    for (i, technique), (j, transmittance) in itertools.product(
        enumerate(TECHNIQUES), enumerate(TRANSMITTANCES)
    ):
        k = (i + j) % 3
        stochastic = k == 2 * i % 3 and linear(technique, transmittance)
        chosen.append(
            (
                technique,
                transmittance,
                MAJORANTS[k],
                "stochastic" if stochastic else "exact",
                ABSORPTIONS[(k + i // 3) % 3],
            )
        )
    return chosen


COMBINATIONS = covering_set()
CHROMATIC = [
    next(
        c for c in COMBINATIONS[i * len(TRANSMITTANCES) :] if c[1] == TRANSMITTANCES[i % len(TRANSMITTANCES)]
    )
    for i in range(len(TECHNIQUES))
]


def test_the_set_covers_every_pair_that_is_not_refused():
    tables = [TECHNIQUES, TRANSMITTANCES, MAJORANTS, list(registry.LOOKUPS), ABSORPTIONS]
    for a, b in itertools.combinations(range(len(FAMILIES)), 2):
        for x, y in itertools.product(tables[a], tables[b]):
            entries = [registry.FAMILIES[FAMILIES[k]][name] for k, name in ((a, x), (b, y))]
            refused = "stochastic" in (x, y) and not all(e.linear for e in entries)
            assert refused or any((c[a], c[b]) == (x, y) for c in COMBINATIONS), f"{x} with {y}"


@functools.cache
def scene(channels):
    """Lumps over a base, thin enough for little noise, in sun and sky."""
    rng = np.random.default_rng(4)
    shape = (9, 10, 11, channels) if channels > 1 else (9, 10, 11)
    values = 0.1 + rng.uniform(0.0, 1.0, shape) ** 3
    if channels > 1:
        values = values * [1.0, 0.5, 0.2]
    medium = gridded(volume(values, *CUBE), 0.8, hg(0.3), scale=1.2 if channels == 1 else 2.0)
    lights = (ConstantEmitter((0.5,)), DirectionalEmitter((1.0,), (0.6, -0.8, 0.0)))
    return picture([box(*CUBE, medium)], lights, (0.6, 0.5, -3.6), (0, 0, 0), 30.0, (16, 16))


@functools.cache
def pictures(channels):
    """Every combination's picture, each of a seed of its own."""
    combinations, spp = (COMBINATIONS, 1 << 11) if channels == 1 else (CHROMATIC, 1 << 12)
    results = {}
    for seed, combination in enumerate(combinations):
        choices = dict(zip(FAMILIES, combination, strict=True))
        result = render(scene(channels), spp=spp, seed=100 + seed, **choices)
        assert all(result.metadata[family] == name for family, name in choices.items())
        results[combination] = result
    return results


def holm_rejects(p_values, alpha=FALSE_ALARM):
    """Whether Holm's procedure rejects any of the hypotheses: the smallest p against alpha / n."""
    return np.min(p_values) < alpha / np.size(p_values)


def tile_p_values(results):
    """Of every pair of pictures, tile by tile."""
    tiles = [tile_means(r.image, r.variance, 4) for r in results]
    p = []
    for (a, va), (b, vb) in itertools.combinations(tiles, 2):
        error = np.sqrt(va + vb)
        z = np.divide(a - b, error, out=np.zeros_like(a), where=error > 0)
        p.append(2 * stats.norm.sf(np.abs(z)))
    return np.array(p)


def mean_deviations(results):
    """The z of each picture's mean against the weighted mean of all others, and the relative errors."""
    means, variances = (np.array(x) for x in zip(*(image_mean(r) for r in results), strict=True))
    z, error = np.empty_like(means), np.empty_like(means)
    for k in range(len(means)):
        weights = np.delete(1 / variances, k, axis=0)
        others = (np.delete(means, k, axis=0) * weights).sum(axis=0) / weights.sum(axis=0)
        error[k] = np.sqrt(variances[k] + 1 / weights.sum(axis=0))
        z[k] = (means[k] - others) / error[k]
    return z, error / means


@pytest.mark.contract
@pytest.mark.parametrize("channels", [1, 3], ids=["grey", "chromatic"])
def test_tiles_of_all_combinations_agree(channels):
    results = pictures(channels)
    for name in ("majorant_violations", "walks_exhausted", "non_finite"):
        assert sum(r.stats[name] for r in results.values()) == 0
    assert not holm_rejects(tile_p_values(results.values()))


@pytest.mark.contract
@pytest.mark.parametrize("channels", [1, 3], ids=["grey", "chromatic"])
def test_image_means_of_all_combinations_agree_and_half_a_percent_would_show(channels):
    results = pictures(channels)
    z, error = mean_deviations(results.values())
    z, error = z[:, :channels], error[:, :channels]
    bound = largest_z(z.size)
    for combination, deviation in zip(results, z, strict=True):
        assert np.abs(deviation).max() < bound, f"{combination}: {deviation}"
    for bias in (-0.005, 0.005):
        seen = np.abs(z + bias / error).max(axis=1) > bound
        assert seen.all(), [c for c, ok in zip(results, seen, strict=True) if not ok]


@pytest.mark.contract
def test_a_tile_off_by_a_few_percent_is_rejected():
    results = list(pictures(1).values())
    p = tile_p_values(results)
    tile = np.s_[4:8, 4:8]
    original = results[3].image[tile].copy()
    try:
        results[3].image[tile] *= 1.06
        assert holm_rejects(tile_p_values(results)) and not holm_rejects(p)
    finally:
        results[3].image[tile] = original
