"""Many walks along one ray through a field, on the device functions, and their float64 answers."""

import functools

import numpy as np
from fields import CHROMATIC, FIELDS, RAYS, exit_distance, optical_depth
from probe import Probe, grid_volume, scene_of
from stat_tests import chi2_p_value, require_samples, z_score

from clvol.planning import registry
from clvol.scene.records import ConstVolume, Medium

SCALES = {"constant": 1.5, "ramp": 2.0, "sparse": 25.0, "vacuum": 1.0}
BINS = 40

RAY_BODY = """
    const uint4 k = philox4x32((uint4)(i, 0u, 0u, 0u), (uint2)((uint)in0[8], 77u));
    Stream stream = stream_begin(k.z, k.w);
    Tally tally = {0, 0, 0, 0, 0, 0, 0.0f};
    Ray ray;
    ray.o = (float3)(in0[0], in0[1], in0[2]);
    ray.d = (float3)(in0[3], in0[4], in0[5]);
    const MediumRay medium_part = medium_ray(scene, scene->media, ray, in0[6], (int)in0[7]);
    const MediumRay *in = &medium_part;
"""
COLLISION_BODY = (
    RAY_BODY
    + """
    Collision collision;
    collision.beta = (Spectrum)(1.0f);
    collision.emission = (Spectrum)(0.0f);
    out0[i] = sample_collision(in, k.x, &stream, &tally, &collision) ? collision.t : -1.0f;
#if CLVOL_SPECTRUM == 3
    vstore3(collision.beta, i, out1);
    vstore3(collision.emission, i, out4);
#else
    out1[i] = collision.beta;
    out4[i] = collision.emission;
#endif
    out2[i] = tally.violations + tally.exhausted + tally.stopped;
    out3[i] = tally.lookups;
"""
)
TRANSMITTANCE_BODY = (
    RAY_BODY
    + """
    const Extinction transmittance = estimate_transmittance(in, k.x, &stream, &tally);
#if CLVOL_EXTINCTION == 3
    vstore3(transmittance, i, out0);
#else
    out0[i] = transmittance;
#endif
    out1[i] = tally.violations + tally.exhausted + tally.stopped;
    out2[i] = tally.lookups;
"""
)


def field_of(name):
    """Values [z, y, x(, channel)] of a field and the medium's scale, a tuple."""
    if name in CHROMATIC:
        made, scale = CHROMATIC[name]
        return made(), scale
    return FIELDS[name](), (SCALES[name],)


def scene_with(name, albedo=0.5, **keywords):
    """A field as the medium of the unit cube."""
    values, scale = field_of(name)
    medium = Medium(grid_volume(values), ConstVolume((albedo,)), scale, homogeneous=False, **keywords)
    return scene_of(medium)


@functools.cache
def exact_depth(field, ray):
    """Optical depth along one of RAYS through the unit cube, per channel: float64 (channels, steps + 1)."""
    name, ray, length = field, RAYS[ray], exit_distance(*RAYS[ray])
    values, scale = field_of(name)
    channels = max(len(scale), 1 if values.ndim == 3 else values.shape[3])
    return np.stack(
        [
            optical_depth(
                values if values.ndim == 3 else values[..., c],
                *ray,
                length,
                scale[c if len(scale) > 1 else 0],
            )
            for c in range(channels)
        ]
    )


def headers_of(plan, family):
    """What a kernel round one tracker includes."""
    analytic = {"technique": "homogeneous", "transmittance": "homogeneous_transmittance"}[family]
    chosen = [f"CLVOL_{family.upper()}_HEADER"] if plan.features.heterogeneous else []
    return [*chosen, f"tracking/{analytic}.h", "stages/medium_ray.h"]


def record_of(probe, ray, length, channel=0, seed=1):
    """The ray as the bodies above read it, and the seed: a number in their text would be a kernel more."""
    origin, direction = ray
    return np.array([*(origin - probe.prepared.centre), *direction, length, channel, seed], np.float32)


def sample_walks(probe, ray, length, walks, seed=1, channel=0):
    """(t or -1, weights (walks, spectrum), emission (walks, spectrum), flaws, look-ups) of many walks."""
    n, u = probe.plan.spectrum, np.uint32
    out = (
        np.empty(walks, np.float32),
        np.empty((walks, n), np.float32),
        np.empty(walks, u),
        np.empty(walks, u),
        np.empty((walks, n), np.float32),
    )
    record = record_of(probe, ray, length, channel, seed)
    t, weights, flaws, lookups, emission = probe.run(
        headers_of(probe.plan, "technique"), COLLISION_BODY, out, [record]
    )
    return t, weights, emission, flaws, lookups


def transmittance_walks(probe, ray, length, walks, seed=1, channel=0):
    """(estimates (walks, extinction), flaws, look-ups) of many shadow rays."""
    out = (
        np.empty((walks, probe.plan.extinction), np.float32),
        np.empty(walks, np.uint32),
        np.empty(walks, np.uint32),
    )
    record = record_of(probe, ray, length, channel, seed)
    return probe.run(headers_of(probe.plan, "transmittance"), TRANSMITTANCE_BODY, out, [record])


def bin_edges(tau, length):
    """BINS bins of equal probability along the ray, as ray parameters, and the probability of each."""
    cdf = -np.expm1(-tau)
    t = np.linspace(0, length, len(tau))
    edges = np.interp(np.linspace(0, cdf[-1], BINS + 1)[1:-1], cdf, t)
    return edges, np.diff(np.concatenate([[0], np.interp(edges, t, cdf), [cdf[-1]]]))


def collision_p_value(distances, tau, length):
    """χ² of unweighted distances (−1: none) in bins of equal probability, and the escapes."""
    escape = np.exp(-tau[-1])
    if tau[-1] == 0:
        return 1.0 if (distances < 0).all() else 0.0
    edges, expected = bin_edges(tau, length)
    hit = distances[distances >= 0]
    counts = np.bincount(np.searchsorted(edges, hit), minlength=BINS)
    return chi2_p_value([*counts, len(distances) - len(hit)], len(distances) * np.append(expected, escape))


def weighted_z(distances, weights, tau, length):
    """|z| of the summed weights in each bin of equal probability, and of the escapes' (the last)."""
    edges, expected = bin_edges(tau, length)
    where = np.where(distances >= 0, np.searchsorted(edges, distances), BINS)
    weights, walks = weights.astype(float), len(distances)
    means = np.bincount(where, weights, BINS + 1) / walks
    squares = np.bincount(where, weights**2, BINS + 1) / walks
    return np.abs(z_score(means, (squares - means**2) / walks, np.append(expected, np.exp(-tau[-1]))))


def assert_weighted_collisions(distances, weights, tau, length, bound, where):
    """Summed weights of the bins and of the escapes agree with the exact distribution.

    Where they do not, but one walk may weigh as much as a tenth of the smallest of these sums, that is noise.
    """
    z = weighted_z(distances, weights, tau, length)
    if not z.max() < bound:
        smallest = min(-np.expm1(-tau[-1]) / BINS, np.exp(-tau[-1]))
        require_samples(smallest * len(weights), weights, where)
        raise AssertionError(f"{where}: wrong by {z.max():.2f} sigma")


def unbiased(family):
    """Names of a family that walk volumes and claim to be unbiased."""
    return [name for name, choice in registry.FAMILIES[family].items() if choice.header and not choice.biased]


def probes_of(device, **always):
    """A function that returns the probe of a field and choices, made when first asked for."""

    @functools.cache
    def get(field, **choices):
        return Probe(device, scene_with(field), **always, **choices)

    return get
