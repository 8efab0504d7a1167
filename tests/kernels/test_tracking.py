"""The contract, on the device functions.

Every technique's collisions follow the exact distribution, every transmittance estimate has the exact mean,
whatever the majorant and the look-up (METHODS §1).
"""

import itertools
from dataclasses import replace

import numpy as np
import pytest
from fields import CHROMATIC, FIELDS, RAYS, exit_distance
from probe import Probe, medium_of, scene_of
from stat_tests import FALSE_ALARM, largest_z, require_precision, sidak, z_score
from tiers import quick_first, quick_where
from walks import (
    BINS,
    assert_weighted_collisions,
    collision_p_value,
    exact_depth,
    probes_of,
    sample_walks,
    scene_with,
    transmittance_walks,
    unbiased,
)

from clvol.planning import registry

WALKS = 1 << 16
TECHNIQUES, TRANSMITTANCES = unbiased("technique"), unbiased("transmittance")
GREY_CASES = len(FIELDS) * len(RAYS)
STOCHASTIC = "delta", "weighted-decomposition", "ratio", "residual-ratio"
CHROMATIC_RAYS = ("oblique", "on a cell's face")


def combinations(family):
    """(name, majorant, look-up) of everything that is not refused."""
    table = registry.FAMILIES[family]
    return [
        (name, majorant, lookup)
        for name, majorant, lookup in itertools.product(
            unbiased(family), registry.MAJORANTS, registry.LOOKUPS
        )
        if lookup == "exact" or table[name].linear
    ]


def is_quick(combination):
    """All with a grid; those of `STOCHASTIC` with stochastic look-ups over a tree, too."""
    name, majorant, lookup = combination
    if lookup == "exact":
        return majorant == "grid"
    return majorant == "kdtree" and name in STOCHASTIC


def chromatic_combinations(family):
    """The same, stochastic look-ups over grids only."""
    return [c for c in combinations(family) if c[2] == "exact" or c[1] == "grid"]


@pytest.fixture(scope="module")
def probes(device):
    return probes_of(device)


def choices_of(family, name, majorant, lookup):
    """Choices that compile this one, the other family at what goes with every look-up."""
    other = {"technique": "delta", "transmittance": "ratio"} | {family: name}
    return other | {"majorant": majorant, "lookup": lookup}


@quick_where(("technique", "majorant", "lookup"), combinations("technique"), is_quick)
def test_collisions_follow_the_exact_distribution(probes, technique, majorant, lookup):
    weighted = registry.TECHNIQUES[technique].weighted
    level, bound = sidak(FALSE_ALARM, GREY_CASES), largest_z(GREY_CASES * (BINS + 1))
    for field, (name, ray) in itertools.product(FIELDS, RAYS.items()):
        probe = probes(field, **choices_of("technique", technique, majorant, lookup))
        length = exit_distance(*ray)
        t, weights, _, flaws, _ = sample_walks(probe, ray, length, WALKS)
        tau = exact_depth(field, name)[0]
        where = f"{field}, ray {name}"
        assert flaws.sum() == 0, where
        if weighted and tau[-1] > 0:
            assert_weighted_collisions(t, weights[:, 0], tau, length, bound, where)
        else:
            assert (weights == 1).all(), where
            assert collision_p_value(t, tau, length) > level, where


@pytest.mark.contract
@pytest.mark.parametrize(("technique", "majorant", "lookup"), chromatic_combinations("technique"))
def test_collisions_of_each_channel_follow_its_distribution(probes, technique, majorant, lookup):
    bound = largest_z(len(CHROMATIC) * len(CHROMATIC_RAYS) * 3 * (BINS + 1))
    for field, name in itertools.product(CHROMATIC, CHROMATIC_RAYS):
        probe = probes(field, **choices_of("technique", technique, majorant, lookup))
        ray, length = RAYS[name], exit_distance(*RAYS[name])
        tau = exact_depth(field, name)
        together = probe.plan.spectrum == 3
        assert together == registry.TECHNIQUES[technique].all_channels
        walks = None
        for channel in range(3):
            if walks is None or not together:
                walks = sample_walks(probe, ray, length, WALKS, channel=channel)
            t, weights, _, flaws, _ = walks
            assert flaws.sum() == 0
            own = weights[:, channel if together else 0]
            where = f"{field}, ray {name}, channel {channel}"
            assert_weighted_collisions(t, own, tau[channel], length, bound, where)


@quick_first("family", ["technique", "transmittance"])
@quick_first("majorant", registry.MAJORANTS)
def test_minus_nothing_in_a_direction_is_nothing(probes, family, majorant):
    """A direction along an axis has zeros of both signs; -1/0 must not be where a plane is crossed."""
    walks = {"technique": sample_walks, "transmittance": transmittance_walks}[family]
    for name in unbiased(family):
        probe = probes("sparse", **choices_of(family, name, majorant, "exact"))
        plus, minus = (
            walks(probe, (np.array([0.997, 0.52, 0.48]), np.array([-1.0, zero, zero])), 0.99, 64)
            for zero in (0.0, -0.0)
        )
        assert all(np.array_equal(a, b) for a, b in zip(plus, minus, strict=True)), name


def assert_mean(values, exact, comparisons, where):
    values = values.astype(float)
    rounding = (1e-6 * exact) ** 2
    z = abs(z_score(values.mean(), values.var() / len(values) + rounding, exact))
    assert z < largest_z(comparisons), f"{where}: {values.mean():.7f}, exact {exact:.7f}, {z:.1f} sigma"


def assert_transmittance(transmittance, values, exact, comparisons, where):
    if exact == 1.0:
        assert (values == 1.0).all(), f"{where}: vacuum transmits everything, with no variance"
    elif transmittance == "regular":
        assert np.ptp(values) == 0, f"{where}: regular transmittance has no variance"
        assert abs(values[0] - exact) < 1e-5 * exact, where
    else:
        assert_mean(values, exact, comparisons, where)


@quick_where(("transmittance", "majorant", "lookup"), combinations("transmittance"), is_quick)
def test_transmittance_is_unbiased(probes, transmittance, majorant, lookup):
    for field, (name, ray) in itertools.product(FIELDS, RAYS.items()):
        probe = probes(field, **choices_of("transmittance", transmittance, majorant, lookup))
        length = exit_distance(*ray)
        values, flaws, _ = transmittance_walks(probe, ray, length, WALKS)
        assert flaws.sum() == 0
        exact = np.exp(-exact_depth(field, name)[0, -1])
        assert_transmittance(transmittance, values[:, 0], exact, GREY_CASES, f"{field}, ray {name}")


@pytest.mark.contract
@pytest.mark.parametrize(("transmittance", "majorant", "lookup"), chromatic_combinations("transmittance"))
def test_transmittance_of_each_channel_is_unbiased(probes, transmittance, majorant, lookup):
    """As a path that follows all channels needs it, and (with exact look-ups) one that follows one."""
    for technique in ("spectral", "delta") if lookup == "exact" else ("spectral",):
        check_channels(probes, transmittance, majorant, lookup, technique)


def check_channels(probes, transmittance, majorant, lookup, technique):
    cases = len(CHROMATIC) * len(CHROMATIC_RAYS) * 3
    for field, name in itertools.product(CHROMATIC, CHROMATIC_RAYS):
        choices = choices_of("transmittance", transmittance, majorant, lookup) | {"technique": technique}
        probe = probes(field, **choices)
        ray, length = RAYS[name], exit_distance(*RAYS[name])
        exact = np.exp(-exact_depth(field, name)[:, -1])
        walks = None
        for channel in range(3):
            if walks is None or technique == "delta":
                walks = transmittance_walks(probe, ray, length, WALKS // 2, channel=channel)
            values, flaws, _ = walks
            assert flaws.sum() == 0
            own = values[:, channel if technique == "spectral" else 0]
            assert_transmittance(transmittance, own, exact[channel], cases, f"{field}, {name}, {channel}")


def half_percent_cases(family):
    """One majorant and look-up for each name, by turns."""
    turns = itertools.cycle(itertools.product(registry.LOOKUPS, registry.MAJORANTS))
    table = registry.FAMILIES[family]
    return [
        (name, majorant, lookup if table[name].linear else "exact")
        for name, (lookup, majorant) in zip(unbiased(family), turns, strict=False)
    ]


@pytest.mark.contract
@pytest.mark.parametrize(("technique", "majorant", "lookup"), half_percent_cases("technique"))
def test_density_is_right_to_half_a_percent(probes, technique, majorant, lookup):
    """The weight of the walks that collide pins the density: 0.5 % more or less of it is rejected."""
    ray, walks = RAYS["oblique"], 1 << 22
    length = exit_distance(*ray)
    probe = probes("ramp", **choices_of("technique", technique, majorant, lookup))
    t, weights, *_ = sample_walks(probe, ray, length, walks, seed=2)
    share = np.where(t >= 0, weights[:, 0], 0.0).astype(float)
    tau = exact_depth("ramp", "oblique")[0, -1]
    bound = largest_z(1)
    deviations = [
        z_score(share.mean(), share.var() / walks, -np.expm1(-factor * tau)) for factor in (0.995, 1.0, 1.005)
    ]
    assert abs(deviations[1]) < bound
    require_precision(share.std() / walks**0.5, 0.005 * share.mean() / bound, "half a percent")
    assert deviations[0] > bound and deviations[2] < -bound


@pytest.mark.contract
@pytest.mark.parametrize(("transmittance", "majorant", "lookup"), half_percent_cases("transmittance"))
def test_transmittance_is_right_to_half_a_percent(probes, transmittance, majorant, lookup):
    ray, walks = RAYS["oblique"], 1 << 22
    length = exit_distance(*ray)
    probe = probes("ramp", **choices_of("transmittance", transmittance, majorant, lookup))
    values, _, _ = transmittance_walks(probe, ray, length, walks, seed=2)
    exact = np.exp(-exact_depth("ramp", "oblique")[0, -1])
    values = values.astype(float)
    variance = max(values.var() / walks, (1e-6 * exact) ** 2)  # rounding, where there is no variance
    z = [z_score(values.mean(), variance, f * exact) for f in (0.995, 1, 1.005)]
    bound = largest_z(1)
    assert abs(z[1]) < bound
    require_precision(variance**0.5, 0.005 * exact / bound, "half a percent")
    assert z[0] > bound and z[2] < -bound


@pytest.mark.parametrize("technique", TECHNIQUES)
def test_empty_space_costs_no_lookup(probes, technique):
    for majorant in registry.MAJORANTS:
        probe = probes("vacuum", **choices_of("technique", technique, majorant, "exact"))
        length = exit_distance(*RAYS["oblique"])
        *_, lookups = sample_walks(probe, RAYS["oblique"], length, 1 << 12)
        assert lookups.sum() == 0


def test_local_majorants_need_fewer_lookups(device):
    values = np.zeros((40, 40, 40), np.float32)
    values[:, :, 30:] = 1.0
    ray, cost = RAYS["oblique"], {}
    for majorant in registry.MAJORANTS:
        probe = Probe(device, scene_of(medium_of(values, 8.0, 0.5)), majorant=majorant, transmittance="ratio")
        *_, lookups = transmittance_walks(probe, ray, exit_distance(*ray), 1 << 14)
        cost[majorant] = lookups.mean()
    assert max(cost["grid"], cost["kdtree"]) < 0.6 * cost["global"]


@pytest.mark.contract
@pytest.mark.parametrize("transmittance", TRANSMITTANCES)
def test_small_transmittances_survive_roulette(device, transmittance):
    """Where most walks come below the roulette's threshold: an error of 1 % in a survivor's weight shows."""
    scene = scene_of(medium_of(FIELDS["ramp"](), 6.0, 0.5))
    probe = Probe(device, scene, majorant="global", transmittance=transmittance)
    ray, walks = RAYS["oblique"], 1 << (25 if transmittance == "delta" else 22)
    length = exit_distance(*ray)
    values, _, _ = transmittance_walks(probe, ray, length, walks)
    exact = np.exp(-3.0 * exact_depth("ramp", "oblique")[0, -1])
    error = max(values.var(dtype=float) / walks, (1e-5 * exact) ** 2)
    assert exact < 0.1
    assert abs(z_score(values.mean(dtype=float), error, exact)) < largest_z(1)
    assert z_score(values.mean(dtype=float), error, 0.99 * exact) > largest_z(1)


@pytest.mark.parametrize("rule", registry.PROBABILITIES)
@quick_first("technique", ["spectral-decomposition", "spectral"])
def test_every_rule_serves_a_constant_medium_of_three_colours(device, technique, rule):
    """Where the control is the whole majorant of the densest channel, the others still need null events."""
    values = np.full((9, 8, 10), 0.7, np.float32)
    scene = scene_of(replace(medium_of(values, 1.0, 0.5), scale=(1.0, 0.5, 0.1)))
    probe = Probe(device, scene, technique=technique, probability=rule)
    length = exit_distance(*RAYS["oblique"])
    t, weights, *_ = sample_walks(probe, RAYS["oblique"], length, 1 << 18)
    escaped = np.where((t < 0)[:, None], weights, 0.0).astype(float)
    exact = np.exp(-0.7 * length * np.array([1.0, 0.5, 0.1]))
    z = z_score(escaped.mean(axis=0), escaped.var(axis=0) / len(escaped), exact)
    assert np.abs(z).max() < largest_z(3), f"{escaped.mean(axis=0)}, not {exact}"
    assert np.abs(weights).max() < 1000


@pytest.mark.parametrize("scale", [1e-25, 1e25])
@pytest.mark.parametrize("technique", TECHNIQUES)
def test_coefficients_of_any_size_leave_the_weights_alone(device, technique, scale):
    """Products of two coefficients would run over a float, or under it."""
    values = 0.2 + np.random.default_rng(2).random((9, 8, 10), np.float32)
    scene = scene_of(replace(medium_of(values, 1.0, 0.5), scale=(scale, 0.5 * scale, 0.1 * scale)))
    probe = Probe(device, scene, technique=technique, majorant="grid")
    t, weights, *_ = sample_walks(probe, RAYS["oblique"], 0.5, 1 << 12)
    assert np.isfinite(weights).all()
    assert (t >= 0).all() if scale > 1 else (t < 0).all()
    assert weights.mean() == pytest.approx(1.0, rel=0.2)


@pytest.mark.parametrize("depth", [30.0, 3e5])
def test_a_power_series_survives_thick_media(device, depth):
    """Estimates neither run over nor grow biased where the majorant's optical depth is large."""
    values = np.full((16, 16, 16), 0.7 * 0.3 / depth, np.float32)
    values[0, 0, 0] = 1.0  # one dense voxel, off the ray, makes the bound loose
    probe = Probe(
        device, scene_of(medium_of(values, depth, 0.5)), transmittance="power-series", majorant="global"
    )
    ray = RAYS["along an axis"]
    estimates, flaws, _ = transmittance_walks(probe, ray, 0.9, 1 << 8)
    assert flaws.sum() == 0
    assert estimates.mean(dtype=float) == pytest.approx(np.exp(-0.7 * 0.3 * 0.9), rel=1e-4)
    noise = (np.random.default_rng(3).random((16, 16, 16)) < 0.5).astype(np.float32)
    probe = Probe(
        device, scene_of(medium_of(noise, depth, 0.5)), transmittance="power-series", lookup="stochastic"
    )
    estimates, *_ = transmittance_walks(probe, RAYS["oblique"], 1.0, 1 << 10)
    assert np.isfinite(estimates).all()


@pytest.mark.contract
def test_marching_is_biased_until_its_steps_are_fine(device):
    """The exp of a noisy sum is too large on the mean: the baseline shows it."""
    ray, length = RAYS["oblique"], exit_distance(*RAYS["oblique"])
    exact = np.exp(-exact_depth("sparse", "oblique")[0, -1])
    for step, is_biased in ((0.5, True), (1e-3, False)):
        probe = Probe(device, scene_with("sparse"), technique="marching", transmittance="marching", step=step)
        estimates = transmittance_walks(probe, ray, length, 1 << 14)[0].astype(float)
        assert (abs(estimates.mean() / exact - 1) > 0.02) == is_biased
        t, *_ = sample_walks(probe, ray, length, 1 << 18)
        assert (collision_p_value(t, exact_depth("sparse", "oblique")[0], length) < FALSE_ALARM) == is_biased
