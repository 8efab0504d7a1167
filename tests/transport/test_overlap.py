"""Media that overlap are one medium of summed coefficients, in every technique (METHODS §6).

No second render says what is right: emission and single scattering have quadratures, many scatterings the
law of Kirchhoff (what absorbs and emits L_e in an environment of L_e does not show).  False-alarm rate 1e-4
a test at fixed seeds.  A bias of 0.5 % of the mean would be seen in every picture of emission; in those of
scattering if all techniques shared it, and of one technique alone 1 %.
"""

import functools
import itertools

import numpy as np
import pytest
from pictures import (
    assert_matches,
    assert_pooled,
    box,
    gauss,
    hg,
    hg_value,
    picture,
    unit,
    volume,
)
from walks import unbiased

from clvol import render
from clvol.device import programs
from clvol.scene.records import ConstantEmitter, ConstVolume, DirectionalEmitter, Medium

WIDE = 300.0
SUN = unit((0.5, 0.3, -0.9))  # travels towards the viewer, who looks along +z
PAIRS = list(zip(unbiased("technique"), itertools.cycle(unbiased("transmittance")), strict=False))
GLOW_SPP = {"grey": 1 << 17, "mixed": 1 << 18}
CASES = [(kind, *pair) for kind in ("grey", "mixed") for pair in PAIRS]


class Layers:
    """Three slabs across z that overlap, two by two and all at once.

    They are two grids whose density varies with z, and a homogeneous one.  Of the `mixed` ones two are
    chromatic and one is grey.
    """

    spans = ((0.0, 1.0), (0.3, 1.5), (0.6, 2.0))
    profiles = ((0.2, 1.0, 0.1, 0.6), (1.0, 0.3, 0.8), (1.0,))
    kinds = {  # noqa: RUF012
        "grey": ((0.7,), (0.8,), (0.4,)),
        "mixed": ((0.8, 0.5, 0.3), (0.8,), (0.3, 0.4, 0.6)),
    }
    albedos = (0.6, 0.9, 0.7)
    phases = (hg(0.3), hg(-0.1), hg(0.2))
    radiances = (1.0, 4.0, 2.0)

    def __init__(self, kind):
        self.scales = self.kinds[kind]

    def shapes(self, radiances, albedos):
        found = []
        for n, ((lower, upper), profile) in enumerate(zip(self.spans, self.profiles, strict=True)):
            corners = (-WIDE, -WIDE, lower), (WIDE, WIDE, upper)
            sigma = ConstVolume((1.0,))
            if len(profile) > 1:
                values = np.broadcast_to(np.array(profile)[:, None, None], (len(profile), 2, 2))
                sigma = volume(values, *corners, "nearest")
            medium = Medium(
                sigma,
                ConstVolume((albedos[n],)),
                self.scales[n],
                self.phases[n],
                homogeneous=len(profile) == 1,
                emission=ConstVolume((radiances[n],)),
            )
            found.append(box(*corners, medium))
        return found

    def sigma(self, n, z):
        """The extinction of slab n at depths z, (len(z), channels)."""
        (lower, upper), profile = self.spans[n], self.profiles[n]
        place = (z - lower) / (upper - lower)
        index = np.clip((place * len(profile)).astype(int), 0, len(profile) - 1)
        density = np.where((place > 0) & (place < 1), np.array(profile)[index], 0.0)
        return density[:, None] * np.array(self.scales[n])

    def edges(self):
        parts = [np.linspace(*s, len(p) + 1) for s, p in zip(self.spans, self.profiles, strict=True)]
        return np.unique(np.round(np.concatenate(parts), 12))

    def answer(self, sun, radiances=(0.0, 0.0, 0.0)):
        """What is seen along +z of emission and of the sun's light scattered once, by quadrature."""
        edges = self.edges()
        middle = (edges[1:] + edges[:-1]) / 2
        parts = [self.sigma(n, middle) for n in range(3)]
        total = sum(parts)
        depth = np.concatenate([np.zeros((1, total.shape[1])), np.cumsum(total * np.diff(edges)[:, None], 0)])
        z, dz = gauss(edges[:-1], edges[1:], 8)
        seen = depth[:-1, None] + (z - edges[:-1, None])[..., None] * total[:, None]
        lit = np.exp(-(depth[-1] - seen) / -SUN[2])
        source = 0.0
        for part, albedo, phase, glow in zip(parts, self.albedos, self.phases, radiances, strict=True):
            scattered = albedo * sun * hg_value(phase.g, -SUN[2]) * lit
            source = source + part[:, None] * ((1 - albedo) * glow + scattered)
        return np.einsum("cz,czk->k", dz, np.exp(-seen) * source)


def seen(shapes, sky, sun, **integrator):
    lights = [ConstantEmitter((sky,)), DirectionalEmitter((sun,), tuple(SUN))]
    return picture(shapes, lights, (0.1, 0.2, -5.0), (0.1, 0.2, 0.0), 0.01, (2, 2), **integrator)


def once(layers, spp=1 << 17, seed=1, **choices):
    """The sun's light scattered once."""
    scene = seen(layers.shapes((0.0, 0.0, 1e-9), layers.albedos), 0.0, 4.0, max_depth=2)
    return render(scene, spp=spp, seed=seed, majorant="grid", **choices)


def seed_of(*case):
    """Of each case its own, so that their errors are independent."""
    return 100 * (1 + CASES.index(case))


@functools.cache
def scattered_once(*case):
    kind, technique, transmittance = case
    choices = {"technique": technique, "transmittance": transmittance}
    result = once(Layers(kind), seed=seed_of(*case), **choices)
    assert result.metadata["technique"] == technique and result.metadata["transmittance"] == transmittance
    return result


@functools.cache
def in_their_own_radiance(*case):
    kind, technique, transmittance = case
    layers = Layers(kind)
    scene = seen(layers.shapes((1.0, 1.0, 1.0), layers.albedos), 1.0, 0.0, max_depth=1_000_000)
    choices = {"technique": technique, "transmittance": transmittance, "majorant": "grid"}
    return render(scene, spp=1 << 14, seed=seed_of(*case) + 3, **choices)


@pytest.mark.contract
@pytest.mark.parametrize("case", CASES, ids="-".join)
def test_overlapping_media_glow_and_scatter_as_their_sum(case):
    kind, technique, transmittance = case
    layers = Layers(kind)
    result = scattered_once(*case)
    assert_matches(result, layers.answer(4.0), bias=0.01)
    assert result.stats["largest_weight"] < 30
    scene = seen(layers.shapes(layers.radiances, layers.albedos), 0.0, 0.0, max_depth=1)
    choices = {"technique": technique, "transmittance": transmittance, "majorant": "grid"}
    assert_matches(
        render(scene, spp=GLOW_SPP[kind], seed=seed_of(*case) + 2, **choices),
        layers.answer(0.0, layers.radiances),
    )


@pytest.mark.contract
@pytest.mark.parametrize("case", CASES, ids="-".join)
def test_overlapping_media_in_their_own_radiance_do_not_show(case):
    assert_matches(in_their_own_radiance(*case), 1.0, bias=0.01)


@pytest.mark.contract
@pytest.mark.parametrize("kind", Layers.kinds)
@pytest.mark.parametrize("pictures", [scattered_once, in_their_own_radiance])
def test_no_bias_is_shared_by_all_techniques(pictures, kind):
    answer = Layers(kind).answer(4.0) if pictures is scattered_once else 1.0
    assert_pooled([(pictures(*case), answer) for case in CASES if case[0] == kind])


def test_a_medium_that_is_not_added_is_noticed():
    """Of one that is a tenth thinner the picture is its own, and not that of the whole one."""
    layers = Layers("grey")
    layers.scales = (*layers.scales[:2], (0.9 * layers.scales[2][0],))
    result = once(layers, technique="delta", transmittance="ratio")
    assert_matches(result, layers.answer(4.0), bias=0.01)
    with pytest.raises(AssertionError, match="deviates"):
        assert_matches(result, Layers("grey").answer(4.0), bias=0.01)


@pytest.mark.contract
def test_weights_that_are_not_multiplied_are_noticed(monkeypatch):
    """The walk that wins keeps its own weight alone; without any repetition the mean stays right."""
    original = programs.kernel_source
    repeated = "pass == 1 && segment.medium == winner"

    def source(name):
        text = original(name)
        if name == "stages/segment_sample.h":
            assert repeated in text
            return text.replace(repeated, "pass == 1")
        return text

    monkeypatch.setattr(programs, "kernel_source", source)
    layers = Layers("mixed")
    result = once(layers, technique="spectral", transmittance="ratio")
    with pytest.raises(AssertionError, match="deviates"):
        assert_matches(result, layers.answer(4.0), bias=0.01)
