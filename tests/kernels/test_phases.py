"""Phase functions: drawn as they are evaluated, of integral one, alone and in mixtures.

χ² tests have a false-alarm rate of 1e-4 each; `test_the_chi_square_test_rejects_a_wrong_density` and wrong
parameters inside the tests show that they can fail.  Everything else is compared in float64.
"""

from dataclasses import replace

import numpy as np
import pyopencl as cl
import pytest
from pictures import gauss, hg, hg_value
from probe import Probe, medium_of, scene_of
from sampling import DRAWS, uniform_p_value, uniforms
from stat_tests import FALSE_ALARM, image_mean, largest_z, z_score
from tiers import quick_where

import clvol
from clvol import layout
from clvol.scene.phase import phase_lobes
from clvol.scene.records import BlendPhase, DirectionalEmitter, Integrator, Phase, PhaseTable

ISOTROPIC, RAYLEIGH = Phase(), Phase("rayleigh")


def table(values, angles=()):
    return Phase("tabphase", table=PhaseTable(tuple(map(float, values)), tuple(map(float, angles))))


PEAK = np.concatenate([[0.0], np.geomspace(1e-2, 180, 200)])
MIE = table(1 / (1 + (PEAK / 0.5) ** 2) ** 1.5 + 1e-5 * (1 + np.cos(np.radians(PEAK)) ** 2), PEAK)
MIXTURES = {
    "a table": table([0.5, 1, 3, 2, 7]),
    "a table with gaps": table([0, 0, 3, 0, 0, 1, 0, 0]),
    "a table of two": table([1, 0]),
    "a table of a sharp peak": MIE,
    "tables and another": BlendPhase(0.4, BlendPhase(0.5, table([2, 1, 1]), table([0, 1])), hg(0.5)),
    "rayleigh": RAYLEIGH,
    "two of a kind": BlendPhase(0.3, hg(0.8), hg(-0.4)),
    "two kinds": BlendPhase(0.6, hg(0.6), RAYLEIGH),
    "nested": BlendPhase(0.25, BlendPhase(0.5, hg(0.8), ISOTROPIC), BlendPhase(0.9, hg(-0.3), RAYLEIGH)),
    "a rare one": BlendPhase(1e-3, ISOTROPIC, hg(0.99)),
    "only the first": BlendPhase(0.0, hg(0.5), RAYLEIGH),
    "only the second": BlendPhase(1.0, hg(0.5), RAYLEIGH),
}
QUICK = "a table of a sharp peak", "tables and another", "rayleigh", "two of a kind", "nested"
GS = [0.0, 1e-4, -1e-4, 0.5, -0.7, 0.99, -0.99, 0.999999, -0.999999]


def phase_probe(device, phase):
    return Probe(device, scene_of(medium_of(1.0, albedo=0.5, phase=phase)))


@pytest.fixture(scope="module")
def hg_probe(device):
    """Any g: the lobe's record is overwritten before each run."""
    return phase_probe(device, hg(0.5))


def set_lobes(probe, *lobes):
    """Lobes (kind, g, weight) in place of those of the scene, which has as many."""
    table = np.array([(layout.enum("PHASE", kind), g, weight) for kind, g, weight in lobes], layout.PHASE)
    flags = cl.mem_flags.READ_ONLY | cl.mem_flags.COPY_HOST_PTR
    probe.buffers["phases"] = cl.Buffer(probe.device.context, flags, hostbuf=table)


def sampled_phase(probe, backward=False):
    """Per draw: 1 - cosine of the angle off the way ahead (or back), azimuth, sampled and evaluated pdf."""
    out = np.zeros((DRAWS, 4), np.float32)
    body = (
        uniforms("u", "v", "unused", "choice")
        + f"""
        const float3 wo = (float3)(0.48f, -0.6f, 0.64f);
        const float3 side = (float3)(0.8f, 0.0f, -0.6f), third = cross(wo, side);
        float pdf;
        const float3 wi = phase_sample(scene, scene->media, wo, u, v, choice, &pdf);
        const float3 h = {"-wo" if backward else "wo"} - wi;
        const float azimuth = atan2(dot(wi, third), dot(wi, side));
        const float evaluated = phase_pdf(scene, scene->media, wo, wi);
        vstore4((float4)(0.5f * dot(h, h), azimuth, pdf, evaluated), i, out0);"""
    )
    probe.run(["phase/phase.h"], body, [out])
    return out.astype(float).T


def cdf(phase, x):
    """Share of directions whose 1 - cosine is at most x."""
    if isinstance(phase, BlendPhase):
        return (1 - phase.weight) * cdf(phase.first, x) + phase.weight * cdf(phase.second, x)
    if phase.kind == "rayleigh":
        return (x**3 - 3 * x**2 + 6 * x) / 8
    if phase.kind == "tabphase":
        return table_cdf(phase.table, x)
    g = phase.g
    if abs(g) < 1e-3:  # the density is 1/2 (1 + 3 g cos) up to g²
        return x / 2 + 3 * g * (x / 2 - x * x / 4)
    return (1 - g * g) / (2 * g) * (1 / (1 - g) - 1 / np.sqrt((1 - g) ** 2 + 2 * g * x))


def table_nodes(table):
    """1 - cos and value per solid angle of a table's points, normalised, in float64."""
    values = np.array(table.values)
    if table.angles:
        nodes = 1 - np.cos(np.radians(np.array(table.angles, np.longdouble))).astype(float)
        nodes[1:] = np.maximum(nodes[1:], 1e-12)
    else:
        nodes, values = np.linspace(0, 2, values.size), values[::-1]
    return nodes, values / (2 * np.pi * np.trapezoid(values, nodes))


def table_cdf(table, x):
    nodes, values = table_nodes(table)
    parts = np.pi * np.diff(nodes) * (values[1:] + values[:-1])
    n = np.clip(np.searchsorted(nodes, x, side="right") - 1, 0, nodes.size - 2)
    s = (x - nodes[n]) / (nodes[n + 1] - nodes[n])
    own = np.pi * (nodes[n + 1] - nodes[n]) * s * (2 * values[n] + (values[n + 1] - values[n]) * s)
    return np.concatenate([[0.0], np.cumsum(parts)])[n] + own


def value(phase, cosine):
    """The phase function in float64."""
    if isinstance(phase, BlendPhase):
        return (1 - phase.weight) * value(phase.first, cosine) + phase.weight * value(phase.second, cosine)
    if phase.kind == "rayleigh":
        return 3 / (16 * np.pi) * (1 + cosine**2)
    if phase.kind == "tabphase":
        nodes, values = table_nodes(phase.table)
        return np.interp(1 - cosine, nodes, values)
    return hg_value(phase.g, cosine)


def mean_cosine(phase):
    if isinstance(phase, BlendPhase):
        return (1 - phase.weight) * mean_cosine(phase.first) + phase.weight * mean_cosine(phase.second)
    if phase.kind == "tabphase":
        nodes, _ = table_nodes(phase.table)
        x, w = (a.ravel() for a in gauss(nodes[:-1], nodes[1:], 2))
        return float(2 * np.pi * (value(phase, 1 - x) * (1 - x) * w).sum())
    return phase.g


def phase_p_value(phase, x, azimuth):
    """χ² over 32 slices of equal probability by 8 azimuths."""
    low, high = np.zeros(31), np.full(31, 2.0)
    for _ in range(80):
        middle = (low + high) / 2
        below = cdf(phase, middle) < np.arange(1, 32) / 32
        low, high = np.where(below, middle, low), np.where(below, high, middle)
    cells = 8 * np.searchsorted(low, x) + np.clip((azimuth / np.pi + 1) * 4, 0, 7.999).astype(int)
    return uniform_p_value(cells, 256)


# -- Henyey-Greenstein and isotropic -----------------------------------------------------------------


@pytest.mark.parametrize("g", GS)
def test_henyey_greenstein_directions_follow_the_phase_function(hg_probe, g):
    """χ² where a float direction resolves the lobe; mean cosine g and second Legendre moment g² always.

    Distances are from the peak, which is behind where g < 0.
    """
    set_lobes(hg_probe, ("hg", g, 1.0))
    g = float(np.float32(g))
    x, azimuth, pdf, evaluated = sampled_phase(hg_probe, backward=g < 0)
    a = abs(g)
    if a < 0.9999:
        assert phase_p_value(hg(a), x, azimuth) > FALSE_ALARM
        assert phase_p_value(hg(a + 0.01 if a < 0.5 else a - 0.01), x, azimuth) < 1e-9
    cosine = (1 - x) * (-1 if g < 0 else 1)
    for n, moment in ((1, cosine), (2, 1.5 * cosine**2 - 0.5)):
        error = moment.std() / np.sqrt(DRAWS) + 1e-7  # 1e-7: directions are floats
        assert abs(moment.mean() - g**n) < 3.9 * error, f"Legendre moment {n}"
    assert np.isfinite(pdf).all() and (pdf > 0).all()
    # near the peak a direction's rounding moves the pdf that is looked up for it
    blur = 3e-7 * np.sqrt(x) + 1e-13
    tolerance = 1e-5 + 3 * a * blur / ((1 - a) ** 2 / 2 + a * x)
    assert (np.abs(evaluated / pdf - 1) < tolerance).all()


def test_isotropic_directions_are_uniform(device):
    x, azimuth, pdf, evaluated = sampled_phase(phase_probe(device, ISOTROPIC))
    assert phase_p_value(ISOTROPIC, x, azimuth) > FALSE_ALARM
    np.testing.assert_allclose(pdf, 1 / (4 * np.pi), rtol=1e-6)
    np.testing.assert_allclose(evaluated, pdf, rtol=1e-6)


@pytest.mark.parametrize("g", GS)
def test_the_henyey_greenstein_pdf_is_the_formula_and_integrates_to_one(hg_probe, g):
    """Over the distance from the peak: 1 - cos, or 1 + cos where g < 0."""
    edges = np.concatenate([[0.0], np.geomspace(1e-16, 2.0, 120)])
    x, w = (a.ravel() for a in gauss(edges[:-1], edges[1:], 8))
    x32, out, g32 = x.astype(np.float32), np.zeros(x.size, np.float32), float(np.float32(g))
    a = abs(g32)
    hg_probe.run(["phase/phase.h"], f"out0[i] = hg_density({a!r}f, in0[i]);", [out], [x32])
    exact = (1 - a * a) / (4 * np.pi * ((1 - a) ** 2 + 2 * a * x32.astype(float)) ** 1.5)
    assert np.abs(out / exact - 1).max() < 2e-6
    assert abs(2 * np.pi * (out * w).sum() - 1) < 1e-5
    if a < 0.9:  # and that is the textbook's form
        cosine = (1 - x) * np.sign(g32 + 1e-9)
        np.testing.assert_allclose(exact, hg_value(g32, cosine), rtol=1e-5)


def test_the_chi_square_test_rejects_a_wrong_density(hg_probe):
    set_lobes(hg_probe, ("hg", 0.5, 1.0))
    x, azimuth, _, _ = sampled_phase(hg_probe)
    assert phase_p_value(hg(0.505), x, azimuth) < FALSE_ALARM
    assert phase_p_value(hg(0.5), x, np.abs(azimuth)) < FALSE_ALARM


# -- Rayleigh ----------------------------------------------------------------------------------------


def test_rayleigh_directions_are_inverted_to_float_precision_from_both_poles(hg_probe):
    small = np.geomspace(2.0**-33, 0.5, 4000)
    u = np.unique(np.concatenate([small, 1 - small[small > 2.0**-24], np.linspace(0, 1, 1001)[1:-1]]))
    u = u.astype(np.float32)[u.astype(np.float32) < 1]
    out = np.zeros((u.size, 2), np.float32)
    hg_probe.run(["phase/phase.h"], "vstore2(rayleigh_cosine(in0[i]), i, out0);", [out], [u])
    nearer = np.minimum(u.astype(float), 1 - u.astype(float))
    x = nearer * 4 / 3
    for _ in range(50):
        x -= (((x - 3) * x + 6) * x - 8 * nearer) / (3 * (x * x - 2 * x + 2))
    assert np.abs(out.min(axis=1) / x - 1).max() < 3e-7
    assert np.abs(out.sum(axis=1) - 2).max() < 3e-7
    assert (np.diff(out[:, 0]) <= 0).all()  # 1 - cos falls as u grows, as for Henyey-Greenstein


# -- mixtures ----------------------------------------------------------------------------------------


@quick_where("name", MIXTURES, QUICK.__contains__)
def test_directions_of_a_mixture_follow_its_phase_function(device, name):
    phase = MIXTURES[name]
    x, azimuth, pdf, evaluated = sampled_phase(phase_probe(device, phase))
    assert phase_p_value(phase, x, azimuth) > FALSE_ALARM
    assert abs((1 - x).mean() - mean_cosine(phase)) < 3.9 * x.std() / np.sqrt(DRAWS)
    atol = 2e-6 if name == "a table with gaps" else 0  # where it is 0, it is as near 0 as x is exact
    np.testing.assert_allclose(
        pdf, value(phase, 1 - x), rtol=2e-3 if name == "a rare one" else 3e-5, atol=atol
    )
    np.testing.assert_allclose(evaluated, pdf, rtol=3e-5, atol=atol)


def test_a_wrong_weight_is_noticed(device):
    phase = MIXTURES["nested"]
    x, azimuth, _, _ = sampled_phase(phase_probe(device, phase))
    assert phase_p_value(replace(phase, weight=phase.weight + 0.02), x, azimuth) < FALSE_ALARM


def kinks(phase):
    """Cosines at the points of a phase function's tables."""
    if isinstance(phase, BlendPhase):
        return [*kinks(phase.first), *kinks(phase.second)]
    cosines = [] if phase.table is None else 1 - table_nodes(phase.table)[0]
    return [c for c in cosines if -1 < c < 1 - 1e-4]


@quick_where("name", MIXTURES, QUICK.__contains__)
def test_a_mixture_integrates_to_one(device, name):
    edges = np.unique(np.append(1 - np.geomspace(2, 1e-4, 41), kinks(MIXTURES[name])))
    cosine, w = (a.ravel() for a in gauss(edges[:-1], edges[1:], 8))
    body = """
        const float c = in0[i];
        out0[i] = phase_pdf(scene, scene->media, (float3)(0.0f, 0.0f, 1.0f),
                            (float3)(sqrt((1.0f - c) * (1.0f + c)), 0.0f, c));"""
    out = np.zeros(cosine.size, np.float32)
    phase_probe(device, MIXTURES[name]).run(["phase/phase.h"], body, [out], [cosine.astype(np.float32)])
    left_out = cdf(MIXTURES[name], 1e-4)
    assert abs(2 * np.pi * (out * w).sum() + left_out - 1) < 1e-5


def test_a_lobe_of_weight_zero_is_never_chosen(device):
    """Whatever the number, even 1, which uniform_float may round to."""
    probe = phase_probe(device, BlendPhase(0.5, hg(0.9), ISOTROPIC))
    choices = np.array([0.0, 2.0**-33, 0.25, 0.5, 1 - 2.0**-24, 1.0], np.float32)
    body = """
        float pdf;
        const float3 wo = (float3)(0.0f, 0.0f, 1.0f);
        const float3 wi = phase_sample(scene, scene->media, wo, 0.3f, 0.4f, in0[i], &pdf);
        out0[i] = wi.z;"""
    for weights in ((0.0, 1.0), (1e-30, 1.0)):
        out = np.zeros(choices.size, np.float32)
        set_lobes(probe, ("hg", 0.9, weights[0]), ("isotropic", 0.0, weights[1]))
        probe.run(["phase/phase.h"], body, [out], [choices])
        forward = np.abs(out - 0.4) > 1e-6  # 0.4: the isotropic lobe's answer to u = 0.3
        assert forward.tolist() == [bool(weights[0])] + [False] * 5


def test_lobes_are_merged_and_sorted_and_those_of_no_weight_left_out():
    phase = BlendPhase(0.25, BlendPhase(0.5, hg(0.8), RAYLEIGH), BlendPhase(0.0, hg(0.8), ISOTROPIC))
    assert phase_lobes(phase) == [(RAYLEIGH, 0.375), (hg(0.8), 0.625)]
    assert phase_lobes(BlendPhase(1e-50, RAYLEIGH, ISOTROPIC)) == [(RAYLEIGH, 1.0)]
    assert phase_lobes(BlendPhase(1.0, RAYLEIGH, ISOTROPIC)) == [(ISOTROPIC, 1.0)]


def test_loops_are_compiled_for_mixtures_only(device):
    blended = {name: phase_probe(device, phase).plan.macros for name, phase in MIXTURES.items()}
    with_loop = {name for name, defines in blended.items() if defines["CLVOL_HAS_BLEND"]}
    assert with_loop == {"two of a kind", "two kinds", "nested", "a rare one", "tables and another"}
    with_rayleigh = {name for name, defines in blended.items() if defines["CLVOL_PHASE_RAYLEIGH"]}
    assert with_rayleigh == {"rayleigh", "two kinds", "nested", "only the second"}


def test_light_scattered_once_is_the_weighted_mean_of_that_of_the_parts():
    first, second, weight = hg(0.7), RAYLEIGH, 0.3

    def image(phase, seed):
        medium = medium_of(1.5, albedo=0.9, phase=phase)
        sun = [DirectionalEmitter((1.0,), (0.0, -0.6, 0.8))]
        scene = scene_of(medium, sun, Integrator(max_depth=2), size=(16, 16))
        return image_mean(clvol.render(scene, spp=2048, seed=seed))

    (a, va), (b, vb), (c, vc) = (
        image(p, n) for n, p in enumerate((first, second, BlendPhase(weight, first, second)))
    )
    expected, variance = (1 - weight) * a + weight * b, (1 - weight) ** 2 * va + weight**2 * vb
    assert np.abs(z_score(c, vc, expected, variance)).max() < largest_z(c.size)
    assert np.abs(z_score(c, vc, b, vb)).max() > 10  # the parts differ enough to tell
