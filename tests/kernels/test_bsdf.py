"""BSDFs on the device: what they sample against their pdf, what physics asks of them, and what Mitsuba says.

χ² tests have a false-alarm rate of 1e-4 each, at fixed seeds.  All BSDFs are in one program, as in a scene
that has everything.
"""

import numpy as np
import pytest
from material_probe import MaterialProbe, read
from mitsuba_bsdfs import BSDFS, DELTAS, INCIDENT, PAIRS, RED, TINT, VALUES
from scipy import special
from stat_tests import FALSE_ALARM, chi2_p_value

from clvol.scene.material_facts import is_transmissive

DRAWS = 100_000
MORE = {
    "white": {"type": "diffuse", "reflectance": 1.0},
    "glass": {"type": "dielectric"},
    "equal": {"type": "dielectric", "int_ior": 1.3, "ext_ior": 1.3},
    "thin equal": {"type": "thindielectric", "int_ior": 1.3, "ext_ior": 1.3},
    "frosted": {"type": "roughdielectric", "alpha": 0.02},
    "frosted ggx": {"type": "roughdielectric", "alpha": 0.02, "distribution": "ggx", "int_ior": 1.2},
    "almost smooth": {"type": "roughconductor", "alpha": 0.0},
    "almost smooth ggx": {"type": "roughconductor", "alpha": 0.0, "distribution": "ggx"},
    "almost smooth glass": {"type": "roughdielectric", "alpha": 0.0, "distribution": "ggx"},
    "almost equal": {"type": "roughdielectric", "int_ior": 1.0001, "ext_ior": 1.0, "alpha": 0.5},
    "brushed": {"type": "roughconductor", "alpha_u": 0.1, "alpha_v": 0.8},
    "blunt": {"type": "roughconductor", "alpha": 1.0},
    "black plastic": {"type": "plastic", "diffuse_reflectance": 0.0},
    "dull plastic": {"type": "roughplastic", "diffuse_reflectance": 1.0, "specular_reflectance": 0.0},
    "null": {"type": "null"},
    "masked pane": {
        "type": "mask",
        "opacity": 0.3,
        "nested": {"type": "thindielectric", "specular_transmittance": RED},
    },
}
NAMES = [*BSDFS, *MORE]
FINITE = [name for name in VALUES if VALUES[name]]
"""BSDFs with more than delta lobes."""
ANGLES = {
    "above": (0.4, 0.3, 0.9),
    "grazing": (-0.9, 0.4, 0.06),
    "normal": (0, 0, 1),
    "below": (0.3, -0.5, -0.6),
}


def unit(*xyz):
    return np.array(xyz) / np.linalg.norm(xyz)


@pytest.fixture(scope="module")
def probe(device):
    found = MaterialProbe(device, [read(description) for description in (BSDFS | MORE).values()])
    found.number = {name: int(side) for name, side in zip(NAMES, found.sides[:, 0], strict=True)}
    return found


def randoms(count, seed=1):
    return np.random.default_rng(seed).random((count, 3), np.float32)


# -- sampling ----------------------------------------------------------------------------------------


def expected_shares(probe, number, wi, bins, order=10):
    """Integral of the pdf over bins of (cos theta, phi), by Gauss's rule in each."""
    rows, columns = bins
    nodes, weights = np.polynomial.legendre.leggauss(order)
    z = -1 + (np.arange(rows)[:, None] + 0.5 + 0.5 * nodes) * 2 / rows
    phi = (np.arange(columns)[:, None] + 0.5 + 0.5 * nodes) * 2 * np.pi / columns
    z, phi = np.broadcast_arrays(z[:, None, :, None], phi[None, :, None, :])
    r = np.sqrt(1 - z**2)
    wo = np.stack([r * np.cos(phi), r * np.sin(phi), z], axis=-1)
    _, pdf = probe.value(number, wi, wo.reshape(-1, 3))
    area = np.pi / (rows * columns)  # of a bin, 4 pi / count, over the 4 that the weights sum to
    return area * np.einsum("abij,i,j->ab", pdf.reshape(z.shape).astype(float), weights, weights)


def p_value(probe, drawn_from, number, wi, seed=1, bins=(48, 48)):
    """p-value of one material's samples under the pdf of another; what has no pdf is a bin too."""
    samples = probe.sample(drawn_from, wi, randoms(DRAWS, seed))
    shares = expected_shares(probe, number, wi, bins)
    wo = samples.wo[samples.found & (samples.pdf > 0)].astype(float)
    row = np.clip(((wo[:, 2] + 1) * bins[0] / 2).astype(int), 0, bins[0] - 1)
    column = (np.arctan2(wo[:, 1], wo[:, 0]) / (2 * np.pi) % 1 * bins[1]).astype(int) % bins[1]
    counts = np.bincount(row * bins[1] + column, minlength=shares.size)
    observed = [*counts, DRAWS - len(wo)]
    expected = np.array([*shares.reshape(-1), max(1 - shares.sum(), 1e-6)]) * DRAWS
    return chi2_p_value(observed, np.maximum(expected, 1e-9))


@pytest.mark.parametrize("angle", ANGLES)
@pytest.mark.parametrize("name", FINITE)
def test_samples_have_their_pdf(probe, name, angle):
    if angle == "below" and not is_transmissive(read(BSDFS[name])):
        samples = probe.sample(probe.number[name], unit(*ANGLES[angle]), randoms(100))
        assert not samples.found.any()
        return
    assert p_value(probe, probe.number[name], probe.number[name], unit(*ANGLES[angle])) > FALSE_ALARM


def test_samples_of_another_roughness_are_caught(probe, device):
    other = MaterialProbe(device, [read(BSDFS["chrome"]), read(BSDFS["chrome"] | {"alpha": 0.306})])
    wi = unit(*ANGLES["above"])
    assert p_value(other, 0, 0, wi) > FALSE_ALARM
    assert p_value(other, 1, 0, wi) < FALSE_ALARM


@pytest.mark.parametrize("name", FINITE)
def test_weight_times_pdf_is_value(probe, name):
    for direction in ANGLES.values():
        samples = probe.sample(probe.number[name], unit(*direction), randoms(3000))
        value, pdf = probe.value(probe.number[name], unit(*direction), samples.wo)
        at = samples.found & (samples.pdf > 0)
        assert np.allclose(samples.pdf[at], pdf[at], rtol=2e-3)
        assert np.allclose(samples.weight[at] * samples.pdf[at, None], value[at], rtol=3e-3, atol=1e-5)


def test_beckmann_slopes_at_normal_incidence(probe):
    """They are normal variates then, of the inverse error function: closer than χ² can tell."""
    u, v = np.meshgrid(np.linspace(0.001, 0.999, 41), np.linspace(0.001, 0.999, 41))
    up = unit(0, 0, 1)
    numbers = np.stack([u.ravel(), v.ravel(), np.full(u.size, 0.5)], axis=1).astype(np.float32)
    m = probe.sample(probe.number["chrome"], up, numbers).wo + up
    slopes = -m[:, :2] / m[:, 2:]
    assert np.allclose(slopes, 0.3 * special.erfinv(2.0 * numbers[:, :2] - 1), rtol=1e-4, atol=2e-6)


def test_events_of_probability_zero_and_one_are_certain(probe):
    never, always = 2.0**-33, 1.0  # the least and the largest that uniform_float gives
    wi = np.array([unit(0.9, -0.3, -0.15), unit(0.3, 0.1, -0.9)])  # total reflection, and not
    inside = probe.sample(probe.number["glass"], wi[[0, 0]], [(0.5, 0.5, never), (0.5, 0.5, always)])
    assert (inside.wo[:, 2] < 0).all() and (inside.weight == 1).all()
    for name in ("equal", "thin equal"):
        equal = probe.sample(probe.number[name], wi, [(0.5, 0.5, never)] * 2)
        assert np.allclose(equal.wo, -wi, atol=1e-6) and (equal.weight == 1).all()
    black = probe.sample(probe.number["black plastic"], -wi, [(0.5, 0.5, always)] * 2)
    assert np.allclose(black.wo, -wi * (-1, -1, 1), atol=1e-6)
    dull = probe.sample(probe.number["dull plastic"], -wi, [(0.5, 0.5, never)] * 2)
    assert np.allclose(dull.wo[0], dull.wo[1])  # of the base, whatever wi


# -- physics -----------------------------------------------------------------------------------------


def random_directions(count, seed):
    return np.array([unit(*row) for row in np.random.default_rng(seed).normal(size=(count, 3))])


@pytest.mark.parametrize("name", FINITE)
def test_reciprocity(probe, name):
    """f(wi, wo) = f(wo, wi); of refraction, f / eta² of the side that light comes from.

    What passes a principled sheet is cut by a rule of Mitsuba's that is not reciprocal.
    """
    wi, wo = random_directions(2000, 3), random_directions(2000, 4)
    if name == "principled sheet":
        wo[:, 2] = np.copysign(wo[:, 2], wi[:, 2])
    there, _ = probe.value(probe.number[name], wi, wo)
    back, _ = probe.value(probe.number[name], wo, wi)
    index = probe.table.materials["ior"][probe.number[name]]
    scale = np.where(wi[:, 2] * wo[:, 2] < 0, np.where(wi[:, 2] > 0, index, 1 / index), 1.0) ** 2
    there, back = there * (scale / np.abs(wo[:, 2]))[:, None], back / np.abs(wi[:, 2])[:, None]
    assert np.allclose(there, back, rtol=5e-3, atol=1e-5 * there.max())
    assert (there > 0).any()


@pytest.mark.parametrize("name", NAMES)
def test_no_bsdf_makes_energy(probe, name):
    """Up to the fit for Beckmann's shadowing, which Mitsuba has as well: 0.35 %."""
    for direction in ANGLES.values():
        samples = probe.sample(probe.number[name], unit(*direction), randoms(20_000))
        power = samples.weight.max(1) * samples.eta**2 * samples.found
        noise = 4 * power.std() / np.sqrt(len(power))
        assert power.mean() <= 1.0035 + noise


def test_what_is_white_loses_nothing(probe):
    for name in ("white", "mirror", "equal", "thin equal"):
        samples = probe.sample(probe.number[name], unit(0.3, 0.5, 0.2), randoms(1000))
        assert samples.found.all() and (samples.weight == 1).all()
    for direction in ANGLES.values():
        glass = probe.sample(probe.number["glass"], unit(*direction), randoms(1000))
        assert np.allclose(glass.weight * glass.eta[:, None] ** 2, 1, rtol=1e-6)


def test_rough_glass_loses_little(probe):
    """What one bounce between facets would bring back is missing: about alpha² of the light."""
    for name in ("frosted", "frosted ggx"):
        for angle in ("above", "normal", "below"):
            samples = probe.sample(probe.number[name], unit(*ANGLES[angle]), randoms(20_000))
            power = (samples.weight.max(1) * samples.eta**2 * samples.found).mean()
            assert 0.996 < power <= 1.0001


@pytest.mark.parametrize("name", NAMES)
def test_hard_cases_are_finite(probe, name):
    """Grazing and normal incidence, the least roughness, indices almost equal, random numbers of 0 and 1."""
    least, most = 2.0**-33, 1.0
    corners = np.array(np.meshgrid(*[[least, 0.5, most]] * 3)).reshape(3, -1).T
    numbers, others = np.concatenate([corners, randoms(200, 5)]), random_directions(200, 6)
    number = probe.number[name]
    for z in (1.0, 0.5, 1e-3, 1e-6, 1e-12, 1e-30):
        for sign in (1, -1):
            wi = (np.sqrt(1 - z**2) * 0.6, np.sqrt(1 - z**2) * -0.8, sign * z)
            samples = probe.sample(number, wi, numbers)
            at = samples.found
            assert np.allclose(np.linalg.norm(samples.wo[at], axis=1), 1, atol=1e-4)
            directions = np.concatenate([samples.wo[at], others])
            for values in (samples.weight[at], samples.pdf[at], *probe.value(number, wi, directions)):
                assert np.isfinite(values).all() and (values >= 0).all()


# -- Mitsuba -----------------------------------------------------------------------------------------


@pytest.mark.parametrize("name", BSDFS)
def test_values_are_mitsubas(probe, name):
    """Tables of rough plastics agree to 5e-4; pdfs of Beckmann differ by the fit that Mitsuba has in them."""
    value, pdf = probe.value(probe.number[name], PAIRS[:, 0], PAIRS[:, 1])
    reference = np.zeros((len(PAIRS), 4))
    for number, row in VALUES[name].items():
        reference[number] = row
    assert np.allclose(
        value,
        reference[:, :3],
        rtol=1e-5 if BSDFS[name]["type"] in ("diffuse", "plastic") else 1e-3,
        atol=1e-12,
    )
    assert np.allclose(pdf, reference[:, 3], rtol=4e-3, atol=1e-12)


@pytest.mark.parametrize("name", BSDFS)
def test_delta_lobes_are_mitsubas(probe, name):
    choice = np.tile([1e-6, 1 - 1e-6], len(INCIDENT))
    numbers = np.stack([np.full(len(choice), 0.3), np.full(len(choice), 0.4), choice], axis=1)
    samples = probe.sample(probe.number[name], INCIDENT.repeat(2, axis=0), numbers)
    for number, row in DELTAS[name].items():
        assert samples.found[number] and samples.pdf[number] == 0
        found = [*samples.wo[number], *samples.weight[number], samples.eta[number]]
        assert np.allclose(found, row, atol=2e-6)
    delta = np.flatnonzero(samples.found & (samples.pdf == 0))
    assert set(delta) == set(DELTAS[name])


def test_what_passes_straight_on(probe):
    """Null and the transmission of a pane.

    Mitsuba's eval_null_transmission of the masked pane is 0.7 + 0.3 times that of the pane, 0.9088304 of the
    light at this angle.
    """
    wi = unit(0.5, 0.2, 0.6)
    pane, opacity = probe.null(probe.number["masked pane"], wi)
    assert np.allclose(opacity, 0.3)
    assert np.allclose(pane, 0.7 + 0.3 * 0.9088304 * np.array(RED["value"]), rtol=1e-5)
    assert (probe.null(probe.number["null"], wi)[0] == 1).all()
    assert (probe.null(probe.number["roughdielectric"], wi)[0] == 0).all()
    through = probe.sample(probe.number["masked pane"], wi, [(0.5, 0.5, 0.99), (0.5, 0.5, 0.01)])
    assert through.passes.tolist() == [True, False] and np.allclose(through.wo[0], -wi)
    assert np.allclose(through.weight[0], RED["value"])
    nothing = probe.sample(probe.number["null"], wi, [(0.5, 0.5, 0.5)])
    assert nothing.passes.all() and np.allclose(nothing.wo, -wi) and (nothing.weight == 1).all()


def test_roughness_from_a_texture(probe, device):
    """At a place where the checkerboard has a colour, all is as with that number."""
    board = {"type": "checkerboard", "color0": 0.25, "color1": 0.5}
    for textured, plain in (
        ({"type": "roughconductor", "alpha_u": board, "alpha_v": 0.3}, {"alpha_u": 0.5, "alpha_v": 0.3}),
        ({"type": "roughdielectric", "alpha": board, "distribution": "ggx"}, {"alpha": 0.5}),
        ({"type": "principled", "roughness": board, "metallic": 0.5}, {"roughness": 0.5}),
        ({"type": "principledthin", "spec_trans": board}, {"spec_trans": 0.5}),
    ):
        both = MaterialProbe(device, [read(textured), read(textured | plain)])
        one, other = (both.value(n, PAIRS[:, 0], PAIRS[:, 1], uv=(0.75, 0.25)) for n in both.sides[:, 0])
        assert np.allclose(one[0], other[0], rtol=1e-5) and np.allclose(one[1], other[1], rtol=1e-5)
        elsewhere, _ = both.value(both.sides[0, 0], PAIRS[:, 0], PAIRS[:, 1], uv=(0.25, 0.25))
        assert not np.allclose(elsewhere, one[0], rtol=1e-2)


INDICES = np.array([[[0.2, 1.1, 2.0], [3.0, 2.0, 0.5]]], np.float32)
INDEX_MAP = {"type": "bitmap", "bitmap": INDICES, "filter_type": "nearest", "raw": True}
METAL_MAP = {
    "eta": INDEX_MAP,
    "k": {"type": "checkerboard", "color0": 2.0, "color1": {"type": "rgb", "value": [0.1, 0.2, 0.3]}},
}


MITSUBAS_METAL = {
    (0.2, 0.2): (0.426573, 0.239689, 0.192963),
    (0.7, 0.2): (0.126205, 0.0598368, 0.12953),
    (0.2, 0.7): (0.42128, 0.00685087, 0.0622978),
}
"""By (u, v) what ``sample`` of Mitsuba 3.9.1 gave for half the light at (0.6, 0, 0.8)."""


@pytest.mark.parametrize("kind", ["conductor", "roughconductor"])
def test_indices_of_metals_from_textures(device, kind):
    """At every place all is as with the indices there."""
    rest = {"type": kind, "specular_reflectance": TINT} | ({"alpha": 0.3} if kind == "roughconductor" else {})
    for uv, eta, k in (
        ((0.2, 0.2), INDICES[0, 0], (2.0, 2.0, 2.0)),
        ((0.7, 0.2), INDICES[0, 1], (0.1, 0.2, 0.3)),
        ((0.2, 0.7), INDICES[0, 0], (0.1, 0.2, 0.3)),
    ):
        plain = {"eta": {"type": "rgb", "value": eta.tolist()}, "k": {"type": "rgb", "value": list(k)}}
        both = MaterialProbe(device, [read(rest | METAL_MAP), read(rest | plain)])
        numbers = [(0.1 + 0.2 * n, 0.5, 0.3) for n in range(4)]
        one, other = (both.sample(n, unit(0.5, 0.2, 0.6), numbers, uv=uv) for n in both.sides[:, 0])
        assert one.found.all() and np.allclose(one.weight, other.weight, rtol=1e-5)
        if kind == "roughconductor":
            one, other = (both.value(n, PAIRS[:, 0], PAIRS[:, 1], uv=uv)[0] for n in both.sides[:, 0])
            assert np.allclose(one, other, rtol=1e-5) and one.max() > 0


def test_a_textured_mirror_reflects_as_mitsubas(device):
    both = MaterialProbe(device, [read({"type": "conductor", "specular_reflectance": 0.5} | METAL_MAP)])
    for uv, expected in MITSUBAS_METAL.items():
        found = both.sample(both.sides[0, 0], np.array([0.6, 0.0, 0.8]), [(0.5, 0.3, 0.4)], uv=uv)
        assert np.allclose(found.weight[0], expected, rtol=1e-5)


def test_the_back_of_a_masked_principled_is_black(device):
    masked = MaterialProbe(device, [read({"type": "mask", "opacity": 0.5, "inner": BSDFS["principled"]})])
    front, back = (masked.value(n, PAIRS[:5, 0], PAIRS[:5, 1])[0] for n in masked.sides[0])
    assert (front > 0).all() and (back == 0).all()


def test_one_channel_is_that_channel(probe, device):
    """A path that follows one channel gets its component of everything."""
    names = ("ggx metal", "roughplastic", "principled")
    kinds = {"ROUGH_CONDUCTOR", "ROUGH_PLASTIC", "PRINCIPLED"}
    one = MaterialProbe(device, [read(BSDFS[name]) for name in names], kinds, channel=1)
    for number, name in enumerate(names):
        value, pdf = probe.value(probe.number[name], PAIRS[:, 0], PAIRS[:, 1])
        found, found_pdf = one.value(number, PAIRS[:, 0], PAIRS[:, 1])
        assert np.allclose(found, value[:, 1:2], rtol=1e-6) and np.allclose(found_pdf, pdf, rtol=1e-6)
