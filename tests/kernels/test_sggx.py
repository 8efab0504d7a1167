"""The phase function sggx: its density, area and sampling, as Heitz et al. 2015 have them, in float64.

χ² tests have a false-alarm rate of FALSE_ALARM each; `test_the_chi_square_test_rejects_another_matrix` shows
that they can fail.
"""

from dataclasses import replace

import numpy as np
import pytest
from probe import Probe, grid_volume, medium_of, scene_of
from sampling import DRAWS, uniforms
from stat_tests import FALSE_ALARM, chi2_p_value

from clvol.scene.flakes import flake_matrix, largest_area
from clvol.scene.phase import phase_lobes
from clvol.scene.records import Phase

TURN = np.linalg.qr(np.random.default_rng(4).normal(size=(3, 3)))[0]


def flakes_of(*eigenvalues):
    """Six numbers of a matrix with these eigenvalues, about axes that lie anyhow."""
    s = TURN @ np.diag(eigenvalues) @ TURN.T
    return tuple(float(np.float32(v)) for v in (*np.diag(s), s[0, 1], s[0, 2], s[1, 2]))


FLAKES = {
    "sphere": (0.5, 0.5, 0.5, 0.0, 0.0, 0.0),
    "any": (0.3, 0.9, 0.2, 0.1, -0.05, 0.15),
    "fibre": flakes_of(1.0, 1.0, 0.01),
    "flat": flakes_of(0.02, 0.03, 1.0),
    "large": flakes_of(40.0, 5.0, 9.0),
}
WO = np.array([0.48, -0.6, 0.64])


def probe_of(device, flakes, albedo=0.5):
    return Probe(device, scene_of(medium_of(1.0, albedo=albedo, phase=Phase("sggx", flakes=flakes))))


def area(flakes, w):
    return np.sqrt(np.einsum("...i,ij,...j", w, flake_matrix(flakes), w))


def density(flakes, wo, wi):
    """D(h) / 4 sigma, for directions of travel."""
    s, h = flake_matrix(flakes), wi - wo
    h = h / np.linalg.norm(h, axis=-1, keepdims=True)
    of_normals = 1 / (
        np.pi * np.sqrt(np.linalg.det(s)) * np.einsum("...i,ij,...j", h, np.linalg.inv(s), h) ** 2
    )
    return of_normals / (4 * area(flakes, wo))


def directions(n, seed=3):
    d = np.random.default_rng(seed).normal(size=(n, 3))
    return (d / np.linalg.norm(d, axis=1, keepdims=True)).astype(np.float32)


def sphere_cells(n=32):
    """Cell of directions, slices of equal height by azimuths; directions and weights of quadrature."""
    x, w = np.polynomial.legendre.leggauss(8)

    def cell(d):
        slice_ = np.clip(((d[:, 2] + 1) / 2 * n).astype(int), 0, n - 1)
        around = np.clip(((np.arctan2(d[:, 1], d[:, 0]) / np.pi + 1) * n).astype(int), 0, 2 * n - 1)
        return slice_ * 2 * n + around

    edges = np.linspace(-1, 1, n + 1)
    z = (edges[:-1, None] + (x + 1) / n).reshape(-1)
    phi = -np.pi + (np.pi / n) * (np.arange(2 * n)[:, None] + (x + 1) / 2).reshape(-1)
    z, phi = np.meshgrid(z, phi, indexing="ij")
    r = np.sqrt(1 - z**2)
    nodes = np.stack([r * np.cos(phi), r * np.sin(phi), z], axis=-1)
    weight = np.outer(np.tile(w / n, n), np.tile(w * np.pi / (2 * n), 2 * n))
    return cell, nodes, weight


@pytest.mark.parametrize("name", FLAKES)
def test_the_pdf_and_the_area_are_the_formulas(device, name):
    wo, wi = directions(4096), directions(4096, seed=9)
    body = """
        const float3 wo = vload3(i, in0), wi = vload3(i, in1);
        out0[2 * i] = phase_pdf(scene, scene->media, wo, wi);
        out0[2 * i + 1] = projected_area(scene, scene->media, wo);"""
    out = np.zeros((4096, 2), np.float32)
    probe_of(device, FLAKES[name]).run(["phase/phase.h"], body, [out], [wo, wi])
    wo, wi = wo.astype(float), wi.astype(float)
    np.testing.assert_allclose(out[:, 1], area(FLAKES[name], wo), rtol=3e-6)
    apart = np.linalg.norm(wi - wo, axis=1) > 0.05
    np.testing.assert_allclose(out[apart, 0], density(FLAKES[name], wo, wi)[apart], rtol=3e-4)
    assert largest_area(Phase("sggx", flakes=FLAKES[name])) >= area(FLAKES[name], wo).max() * (1 - 1e-6)


@pytest.mark.parametrize("name", FLAKES)
def test_it_integrates_to_one_and_is_reciprocal(device, name):
    _, nodes, weight = sphere_cells()
    given = nodes.reshape(-1, 3).astype(np.float32)
    x, y, z = WO
    body = f"""
        const float3 wo = (float3)({x}f, {y}f, {z}f), wi = vload3(i, in0);
        __global const Medium *medium = scene->media;
        out0[2 * i] = phase_pdf(scene, medium, wo, wi) * projected_area(scene, medium, wo);
        out0[2 * i + 1] = phase_pdf(scene, medium, -wi, -wo) * projected_area(scene, medium, wi);"""
    out = np.zeros((len(given), 2), np.float32)
    probe_of(device, FLAKES[name]).run(["phase/phase.h"], body, [out], [given])
    total = (out[:, 0].astype(float) * weight.reshape(-1)).sum() / area(FLAKES[name], WO)
    assert abs(total - 1) < 1e-3, total
    np.testing.assert_allclose(out[:, 0], out[:, 1], rtol=2e-3)


def drawn(device, flakes):
    """Directions, and the pdfs they were drawn and are found with."""
    x, y, z = WO
    body = (
        uniforms("u", "v", "unused", "choice")
        + f"""
        const float3 wo = (float3)({x}f, {y}f, {z}f);
        float pdf;
        const float3 wi = phase_sample(scene, scene->media, wo, u, v, choice, &pdf);
        vstore4((float4)(wi, pdf), i, out0);
        out1[i] = phase_pdf(scene, scene->media, wo, wi);"""
    )
    out, evaluated = np.zeros((DRAWS, 4), np.float32), np.zeros(DRAWS, np.float32)
    probe_of(device, flakes).run(["phase/phase.h"], body, [out, evaluated])
    return out[:, :3].astype(float), out[:, 3], evaluated


def p_value(d, flakes):
    cell, nodes, weight = sphere_cells()
    mass = density(flakes, WO, nodes) * weight
    n = int(np.sqrt(mass.size / 64 / 2))
    expected = mass.reshape(n, 8, 2 * n, 8).sum((1, 3)).reshape(-1)
    expected *= DRAWS / expected.sum()
    found = np.bincount(cell(d), minlength=expected.size)
    rare = expected < 20
    if rare.any():
        found, expected = (
            np.append(found[~rare], found[rare].sum()),
            np.append(expected[~rare], expected[rare].sum()),
        )
    return chi2_p_value(found, expected)


@pytest.mark.parametrize("name", FLAKES)
def test_directions_follow_the_pdf(device, name):
    d, pdf, evaluated = drawn(device, FLAKES[name])
    np.testing.assert_allclose(np.linalg.norm(d, axis=1), 1, atol=1e-6)
    assert p_value(d, FLAKES[name]) > FALSE_ALARM
    apart = np.linalg.norm(d - WO, axis=1) > 0.05
    np.testing.assert_allclose(evaluated[apart], pdf[apart], rtol=5e-4)
    assert apart.mean() > 0.9 and np.isfinite(evaluated).all()


def test_the_chi_square_test_rejects_another_matrix(device):
    d, _, _ = drawn(device, FLAKES["any"])
    other = (0.3, 0.9, 0.2, 0.11, -0.05, 0.15)
    assert p_value(d, other) < FALSE_ALARM


def test_straight_on_has_a_density(device):
    out = np.zeros(1, np.float32)
    body = "const float3 w = (float3)(0.0f, 0.6f, 0.8f); out0[i] = phase_pdf(scene, scene->media, w, w);"
    probe_of(device, FLAKES["any"]).run(["phase/phase.h"], body, [out])
    assert np.isfinite(out).all() and out[0] > 0


def test_flakes_of_a_sphere_mirror_light_evenly(device):
    """All directions alike, as Lambert's mirror ball: 1 / 4 pi."""
    d, pdf, _ = drawn(device, FLAKES["sphere"])
    np.testing.assert_allclose(pdf, 1 / (4 * np.pi), rtol=1e-5)
    assert np.abs(d.mean(0)).max() < 4 / np.sqrt(DRAWS)


def test_equal_ones_are_one_lobe():
    phase = Phase("sggx", flakes=FLAKES["any"])
    assert phase_lobes(phase) == [(phase, 1.0)]


def woven_of():
    """A grid of matrices, float32 (2, 3, 2, 6)."""
    roots = np.random.default_rng(8).normal(size=(2, 3, 2, 3, 3)) * 0.5
    matrices = np.einsum("...ij,...kj->...ik", roots, roots) + 0.05 * np.eye(3)
    return matrices[..., [0, 1, 2, 0, 0, 1], [0, 1, 2, 1, 2, 2]].astype(np.float32)


WOVEN = woven_of()
MITSUBAS = [  # value and area of Mitsuba 3.9.1's sggx of that grid, at `places()` and `ways()`
    (0.014239144511520863, 0.7259293794631958),
    (0.07425570487976074, 1.2318916320800781),
    (0.016579564660787582, 0.8581716418266296),
    (0.06575733423233032, 0.9463836550712585),
    (0.017622431740164757, 0.8814587593078613),
    (0.03487466648221016, 0.7953313589096069),
]


def places():
    return np.random.default_rng(5).uniform(0, 1, (6, 3)).astype(np.float32)


def ways():
    """Directions of travel before and after, float32 (6, 2, 3)."""
    d = np.random.default_rng(3).normal(size=(6, 2, 3))
    return (d / np.linalg.norm(d, axis=-1, keepdims=True)).astype(np.float32)


def flakes_at(p):
    """The six numbers at points of the unit cube, between samples at the centres of cells."""
    size = np.array(WOVEN.shape[2::-1])
    place = np.clip(np.asarray(p, float) * size - 0.5, 0, size - 1)
    base = np.minimum(place.astype(int), size - 2)
    total = 0.0
    for corner in np.ndindex(2, 2, 2):
        share = np.where(corner, place - base, 1 - (place - base)).prod(axis=-1)
        x, y, z = (base + corner).T
        total = total + share[:, None] * WOVEN[z, y, x]
    return total


def woven(device, albedo=0.5, phase=None):
    """A probe of a medium of these flakes, and one beside it whose flakes are the same everywhere."""
    phase = phase or Phase("sggx", flakes=grid_volume(WOVEN))
    density = np.ones((2, 2, 2))
    phases = phase, Phase("sggx", flakes=FLAKES["any"])
    one, other = (medium_of(density, albedo=albedo, phase=p) for p in phases)
    scene = scene_of(one)
    return Probe(device, replace(scene, shapes=(*scene.shapes, replace(scene.shapes[0], interior=other))))


CENTRE = np.float32(0.5)
"""Of the unit cube, along each axis: where the device has its origin."""
WOVEN_BODY = """
    const float3 p = vload3(i, in0), wo = vload3(2 * i, in1), wi = vload3(2 * i + 1, in1);
    for (int m = 0; m < 2; ++m) {
        __global const Medium *medium = scene->media + m;
        Ray ray;
        ray.o = p - 0.25f * wo;
        ray.d = wo;
        const MediumRay in = medium_ray(scene, medium, ray, 1.0f, 0);
        const float3 place = in.index_ray.o + 0.25f * in.index_ray.d;
        out0[4 * i + 2 * m] = varied_phase_pdf(scene, medium, p, wo, wi);
        out0[4 * i + 2 * m + 1] = in.scale * area_share(&in, place);
    }"""
WOVEN_HEADERS = ["phase/varied.h", "stages/medium_ray.h", "tracking/walk.h"]


def test_they_differ_from_place_to_place_as_mitsubas_do(device):
    out = np.zeros((6, 2, 2), np.float32)
    woven(device).run(WOVEN_HEADERS, WOVEN_BODY, [out], [places() - CENTRE, ways()])
    np.testing.assert_allclose(out[:, 0], MITSUBAS, rtol=2e-5)
    wo, wi = np.moveaxis(ways().astype(float), 1, 0)
    for n, six in enumerate(flakes_at(places())):
        np.testing.assert_allclose(out[n, 0], [density(six, wo[n], wi[n]), area(six, wo[n])], rtol=2e-5)
    even = FLAKES["any"]
    np.testing.assert_allclose(out[:, 1, 0], density(even, wo, wi), rtol=2e-5)
    np.testing.assert_allclose(out[:, 1, 1], area(even, wo), rtol=2e-5)


@pytest.mark.parametrize("place", [0, 3])
def test_directions_follow_the_pdf_of_their_place(device, place):
    at, (x, y, z) = places()[place] - CENTRE, WO
    body = (
        uniforms("u", "v", "unused", "choice")
        + f"""
        const float3 wo = (float3)({x}f, {y}f, {z}f), p = (float3)({at[0]}f, {at[1]}f, {at[2]}f);
        float pdf;
        const float3 wi = varied_phase_sample(scene, scene->media, p, wo, u, v, choice, &pdf);
        vstore4((float4)(wi, pdf), i, out0);"""
    )
    out = np.zeros((DRAWS, 4), np.float32)
    woven(device).run(WOVEN_HEADERS, body, [out])
    d = out[:, :3].astype(float)
    here, elsewhere = (tuple(flakes_at(places()[[n]])[0]) for n in (place, 1))
    assert p_value(d, here) > FALSE_ALARM > p_value(d, elsewhere)
    apart = np.linalg.norm(d - WO, axis=1) > 0.05
    np.testing.assert_allclose(out[apart, 3], density(here, WO, d[apart]), rtol=2e-3)


def test_where_there_are_none_nothing_breaks(device):
    """A matrix of zeros: no area, and a phase function that is finite."""
    empty = np.zeros_like(WOVEN)
    empty[1] = WOVEN[1]
    out = np.zeros((1, 2, 2), np.float32)
    p = np.array([[0.5, 0.5, 0.1]], np.float32) - CENTRE
    probe = woven(device, phase=Phase("sggx", flakes=grid_volume(empty)))
    probe.run(WOVEN_HEADERS, WOVEN_BODY, [out], [p, ways()[:1]])
    assert out[0, 0, 1] == 0
    np.testing.assert_allclose(out[0, 0, 0], 1 / (4 * np.pi), rtol=1e-5)
