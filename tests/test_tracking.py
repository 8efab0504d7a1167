"""Every tracker against the exact free-flight distribution and transmittance, on the device functions."""

import numpy as np
import pytest
from fields import FIELDS, RAYS, exit_distance, optical_depth
from probe import Probe, medium_of, scene_of
from stat_tests import FALSE_ALARM, chi2_p_value, largest_z, sidak, z_score

from clvol import registry
from clvol.upload import upload_scene

SCALES = {"constant": 1.5, "ramp": 2.0, "sparse": 25.0, "vacuum": 1.0}
WALKS = 1 << 19
BINS = 40
TRACKED = [name for name in registry.TECHNIQUES]
ESTIMATED = [name for name, choice in registry.TRANSMITTANCES.items() if choice.header]
CASES = len(FIELDS) * len(RAYS)

RAY_BODY = """
    const SampleKey key = {i, 0, 0};
    const uint4 k = decision_block((uint2)(%d, 77), key, BLOCK_WALK, 0);
    Stream stream = stream_begin(k.z, k.w);
    Tally tally = {0, 0, 0};
    __global const Medium *medium = scene->media;
    Ray ray;
    ray.o = (float3)(in0[0], in0[1], in0[2]);
    ray.d = (float3)(in0[3], in0[4], in0[5]);
    const Ray index_ray = transform_ray(scene->volumes[medium->sigma_t_volume].world_to_index, ray);
"""
COLLISION_BODY = (
    RAY_BODY
    + """
    Collision collision;
    collision.channel = 0;
    out0[i] = sample_collision(scene, medium, index_ray, in0[6], k.x, &stream, &tally, &collision)
        ? collision.t : -1.0f;
    out1[i] = tally.violations + tally.exhausted;
    out2[i] = tally.lookups;
"""
)
TRANSMITTANCE_BODY = (
    RAY_BODY
    + """
    out0[i] = estimate_transmittance(scene, medium, index_ray, in0[6], 0, k.x, &stream, &tally);
    out1[i] = tally.violations + tally.exhausted;
    out2[i] = tally.lookups;
"""
)


@pytest.fixture(scope="module")
def probes(device):
    """Probes by (field, majorant), made when first asked for."""
    made = {}

    def get(field, majorant):
        if (field, majorant) not in made:
            made[field, majorant] = Probe(
                device, scene_of(medium_of(FIELDS[field](), SCALES[field])), majorant=majorant
            )
        return made[field, majorant]

    return get


def walk(probe, headers, body, ray, length, seed=1, walks=WALKS):
    """Many walks along one ray of the unit cube: values, look-ups per walk; no bound may be violated."""
    origin, direction = ray
    centred = origin - probe.prepared.centre
    record = np.array([*centred, *direction, length], np.float32)
    out = tuple(np.empty(walks, t) for t in (np.float32, np.uint32, np.uint32))
    values, flaws, lookups = probe.run(headers, body % seed, out, [record])
    assert flaws.sum() == 0
    return values, lookups.mean()


def headers_of(majorant, tracker):
    return ["density/volume.h", registry.MAJORANTS[majorant].header, tracker]


def collision_p_value(distances, tau, length):
    """χ² of sampled distances (−1: none) in bins of equal probability, and the escapes."""
    escape = np.exp(-tau[-1])
    if tau[-1] == 0:
        return 1.0 if (distances < 0).all() else 0.0
    t = np.linspace(0, length, len(tau))
    cdf = -np.expm1(-tau)
    edges = np.interp(np.linspace(0, cdf[-1], BINS + 1)[1:-1], cdf, t)
    hit = distances[distances >= 0]
    counts = np.bincount(np.searchsorted(edges, hit), minlength=BINS)
    expected = np.diff(np.concatenate([[0], np.interp(edges, t, cdf), [cdf[-1]]]))
    return chi2_p_value([*counts, len(distances) - len(hit)], len(distances) * np.append(expected, escape))


@pytest.mark.parametrize("majorant", registry.MAJORANTS)
@pytest.mark.parametrize("field", FIELDS)
@pytest.mark.parametrize("technique", TRACKED)
def test_free_flights_follow_the_exact_distribution(probes, technique, field, majorant):
    headers = headers_of(majorant, registry.TECHNIQUES[technique].header)
    level = sidak(FALSE_ALARM, CASES * len(registry.MAJORANTS))
    for name, ray in RAYS.items():
        length = exit_distance(*ray)
        distances, _ = walk(probes(field, majorant), headers, COLLISION_BODY, ray, length)
        tau = optical_depth(FIELDS[field](), *ray, length, SCALES[field])
        assert collision_p_value(distances, tau, length) > level, f"ray {name}"


@pytest.mark.parametrize("majorant", registry.MAJORANTS)
@pytest.mark.parametrize("field", FIELDS)
@pytest.mark.parametrize("transmittance", ESTIMATED)
def test_transmittance_is_unbiased(probes, transmittance, field, majorant):
    headers = headers_of(majorant, registry.TRANSMITTANCES[transmittance].header)
    bound = largest_z(CASES * len(registry.MAJORANTS))
    for name, ray in RAYS.items():
        length = exit_distance(*ray)
        values, _ = walk(probes(field, majorant), headers, TRANSMITTANCE_BODY, ray, length)
        exact = np.exp(-optical_depth(FIELDS[field](), *ray, length, SCALES[field])[-1])
        if exact == 1.0:
            assert (values == 1.0).all(), "vacuum transmits everything, with no variance"
            continue
        z = z_score(values.mean(dtype=float), values.var(dtype=float) / WALKS, exact)
        assert abs(z) < bound, f"ray {name}: {values.mean():.6f}, exact {exact:.6f}, {z:.1f} sigma"


@pytest.mark.parametrize("majorant", registry.MAJORANTS)
@pytest.mark.parametrize("technique", TRACKED)
def test_density_is_right_to_half_a_percent(probes, technique, majorant):
    """The share of walks that collide pins the density: 0.5 % more or less of it is rejected."""
    ray, walks = RAYS["oblique"], 1 << 22
    length = exit_distance(*ray)
    headers = headers_of(majorant, registry.TECHNIQUES[technique].header)
    distances, _ = walk(probes("ramp", majorant), headers, COLLISION_BODY, ray, length, walks=walks)
    share = (distances >= 0).mean()
    tau = optical_depth(FIELDS["ramp"](), *ray, length, SCALES["ramp"])[-1]
    bound = largest_z(len(registry.MAJORANTS))
    deviations = [
        z_score(share, share * (1 - share) / walks, -np.expm1(-factor * tau))
        for factor in (0.995, 1.0, 1.005)
    ]
    assert abs(deviations[1]) < bound
    assert deviations[0] > bound and deviations[2] < -bound


@pytest.mark.parametrize("majorant", registry.MAJORANTS)
@pytest.mark.parametrize("transmittance", ESTIMATED)
def test_transmittance_is_right_to_half_a_percent(probes, transmittance, majorant):
    ray, walks = RAYS["oblique"], 1 << 22
    length = exit_distance(*ray)
    headers = headers_of(majorant, registry.TRANSMITTANCES[transmittance].header)
    values, _ = walk(probes("ramp", majorant), headers, TRANSMITTANCE_BODY, ray, length, walks=walks)
    exact = np.exp(-optical_depth(FIELDS["ramp"](), *ray, length, SCALES["ramp"])[-1])
    z = [
        z_score(values.mean(dtype=float), values.var(dtype=float) / walks, f * exact)
        for f in (0.995, 1, 1.005)
    ]
    bound = largest_z(len(registry.MAJORANTS))
    assert abs(z[1]) < bound
    assert z[0] > bound and z[2] < -bound


def test_empty_space_costs_no_lookup(probes):
    for majorant in registry.MAJORANTS:
        headers = headers_of(majorant, registry.TECHNIQUES["delta"].header)
        length = exit_distance(*RAYS["oblique"])
        _, lookups = walk(probes("vacuum", majorant), headers, COLLISION_BODY, RAYS["oblique"], length)
        assert lookups == 0


def test_local_majorants_need_fewer_lookups(device):
    values = np.zeros((40, 40, 40), np.float32)
    values[:, :, 30:] = 1.0
    ray, cost = RAYS["oblique"], {}
    for majorant in registry.MAJORANTS:
        probe = Probe(device, scene_of(medium_of(values, 8.0)), majorant=majorant)
        headers = headers_of(majorant, registry.TRANSMITTANCES["ratio"].header)
        _, cost[majorant] = walk(probe, headers, TRANSMITTANCE_BODY, ray, exit_distance(*ray), walks=1 << 14)
    assert max(cost["grid"], cost["kdtree"]) < 0.6 * cost["global"]


def test_a_majorant_too_low_by_a_tenth_is_caught(device):
    """Violations are counted, and the distribution test rejects what delta tracking makes of it."""
    probe = Probe(device, scene_of(medium_of(FIELDS["constant"](), 1.5)), majorant="grid")
    for bounds in probe.prepared.bounds.values():
        bounds.maximum[...] *= np.float32(0.9)
    probe.buffers |= upload_scene(device, probe.prepared, probe.config)
    ray = RAYS["oblique"]
    length = exit_distance(*ray)
    record = np.array([*(ray[0] - probe.prepared.centre), *ray[1], length], np.float32)
    out = tuple(np.empty(WALKS, t) for t in (np.float32, np.uint32, np.uint32))
    headers = headers_of("grid", registry.TECHNIQUES["delta"].header)
    distances, violations, _ = probe.run(headers, COLLISION_BODY % 1, out, [record])
    assert violations.sum() > 0
    tau = optical_depth(FIELDS["constant"](), *ray, length, 1.5)
    assert collision_p_value(distances, tau, length) < FALSE_ALARM


@pytest.mark.parametrize("transmittance", ESTIMATED)
def test_small_transmittances_survive_roulette(device, transmittance):
    """Where most walks come below the roulette's threshold: an error of 1 % in a survivor's weight shows."""
    probe = Probe(device, scene_of(medium_of(FIELDS["ramp"](), 6.0)), majorant="global")
    ray, walks = RAYS["oblique"], 1 << 22
    length = exit_distance(*ray)
    headers = headers_of("global", registry.TRANSMITTANCES[transmittance].header)
    values, _ = walk(probe, headers, TRANSMITTANCE_BODY, ray, length, walks=walks)
    exact = np.exp(-optical_depth(FIELDS["ramp"](), *ray, length, 6.0)[-1])
    error = values.var(dtype=float) / walks
    assert exact < 0.1
    assert abs(z_score(values.mean(dtype=float), error, exact)) < largest_z(1)
    assert z_score(values.mean(dtype=float), error, 0.99 * exact) > largest_z(1)
