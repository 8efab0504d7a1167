"""Device functions that decide by what lights bring: the choice among them, and the control of a peak."""

import numpy as np
import pytest
from pictures import ball, box, gridded, hg_value, picture, unit, volume
from probe import Probe, medium_of, scene_of

import clvol
from clvol.scene.materials import Bitmap
from clvol.scene.records import (
    BlendPhase,
    ConstantEmitter,
    DirectionalEmitter,
    Phase,
    PointEmitter,
    ProjectorEmitter,
    SpotEmitter,
)

# -- the choice --------------------------------------------------------------------------------------

CHOOSE = """
    const float3 p = vload3(i, in0);
    for (uint light = 0; light < scene->render->emitters; ++light)
        out0[i * scene->render->emitters + light] = light_probability(scene, light, p);
    uint wrong = 0;
    for (uint n = 0; n < PICKS; ++n) {
        float pick = ((float)n + 0.5f) / (float)PICKS, chosen;
        const uint light = choose_light(scene, p, &pick, &chosen);
        out1[i * scene->render->emitters + light] += 1.0f / (float)PICKS;
        wrong += !(pick >= 0.0f && pick < 1.0f);
        wrong += chosen != out0[i * scene->render->emitters + light];
    }
    out2[i] = wrong;
"""
PICKS = 4096


def many_lights(points):
    """A sun, a spot, a projector, a lamp and points, in and round a fog of lumps; and a sky, never chosen."""
    corners = (0.0, 0.0, 0.0), (1.0, 1.0, 1.0)
    fog = gridded(volume(np.random.default_rng(2).random((5, 5, 5)) * 9, *corners), 0.9)
    spot = SpotEmitter((3.0,), clvol.look_at((0.5, 2.5, 0.5), (0.5, 0.5, 0.5), (1, 0, 0)), 30.0, 20.0)
    thrown = ProjectorEmitter((2.0,), 0.5, clvol.look_at((2, 2, 0.5), (0.5, 0.5, 0.5), (1, 0, 0)), 30.0)
    lamp = ball((2.0, 0.5, 0.5), 0.2)
    lamp = type(lamp)("sphere", lamp.to_world, emission=(5.0,))
    far = [PointEmitter((0.3 + n,), (0.1 * n - 0.4, 0.4, 0.5)) for n in range(points)]
    emitters = [ConstantEmitter((0.2,)), DirectionalEmitter((2.0,), (0.0, -1.0, 0.0)), spot, thrown, *far]
    return picture([box(*corners, fog), lamp], emitters, (0.5, 0.5, -3.0), (0.5, 0.5, 0.5))


@pytest.mark.parametrize("shadow_cache", ["on", "off"])
@pytest.mark.parametrize("points", [2, 30], ids=["all are weighed", "some are weighed"])
def test_lights_are_chosen_with_the_probability_that_is_said(device, points, shadow_cache):
    scene = many_lights(points)
    lights = points + 4
    probe = Probe(device, scene, shadow_cache=shadow_cache)
    at = np.random.default_rng(1).uniform(-0.6, 1.6, (64, 3)).astype(np.float32)
    said, counted = np.zeros((64, lights), np.float32), np.zeros((64, lights), np.float32)
    _, _, wrong = probe.run(
        ["emitter/emitter.h"],
        CHOOSE.replace("PICKS", f"{PICKS}u"),
        [said, counted, np.zeros(64, np.uint32)],
        [at],
        stage="shade",
    )
    assert not wrong.any()
    assert (said > 0).all()
    assert np.abs(said.sum(axis=1) - 1).max() < 1e-5
    assert np.abs(counted - said).max() < 3 / PICKS
    assert said.std(axis=0).max() > 0.03  # they do depend on the place


PICTURE = np.full((4, 6, 3), 0.25, np.float32)
PICTURE[0, 0] = (0.0, 6.0, 3.0)
"""Of mean 0.333; 0.25 nearly everywhere."""


@pytest.mark.parametrize("kind", ["projector", "spot"])
def test_a_light_that_throws_a_picture_is_chosen_by_its_mean(device, kind):
    """Beside a point light of the intensity that it has on its axis without the picture."""
    at, bitmap = clvol.look_at((0.5, 2.5, 0.5), (0.5, 0.5, 0.5), (1, 0, 0)), Bitmap(PICTURE)
    if kind == "spot":
        thrown, strength = SpotEmitter((3.0,), at, 60.0, 55.0, texture=bitmap), 3.0
    else:
        thrown, strength = ProjectorEmitter(bitmap, 3.0, at, 60.0), 3.0 * np.pi
    plain = PointEmitter((strength,), (0.5, 2.5, 0.5))
    fog = box((0.0, 0.0, 0.0), (1.0, 1.0, 1.0), medium_of(1.0, albedo=0.9))
    scene = picture([fog], [thrown, plain], (0.5, 0.5, -3.0), (0.5, 0.5, 0.5))
    probe = Probe(device, scene, shadow_cache="off", light_choice="contribution")
    said = np.zeros((1, 2), np.float32)
    body = """
        for (uint light = 0; light < 2; ++light)
            out0[light] =
                light_probability(scene, light, vload3(0, in0)) - 0.25f * scene->emitters[light].select_pdf;
        if (scene->emitters[0].kind == EMITTER_POINT) {
            const float first = out0[0];
            out0[0] = out0[1];
            out0[1] = first;
        }"""
    probe.run(["emitter/emitter.h"], body, [said], [np.zeros((1, 3), np.float32)], stage="shade")
    mean = PICTURE.mean()
    np.testing.assert_allclose(said[0], 0.75 * np.array([mean, 1]) / (1 + mean), rtol=1e-4)


# -- convolutions ------------------------------------------------------------------------------------

CONVOLVE = (
    "    out0[i] = phase_convolved(scene, scene->media, in1[i], vload3(2 * i, in0), vload3(2 * i + 1, in0));"
)
RAYLEIGH = Phase("rayleigh")
PHASES = {
    "hg": Phase("hg", 0.8),
    "backward": Phase("hg", -0.6),
    "isotropic": Phase(),
    "rayleigh": RAYLEIGH,
    "blend": BlendPhase(0.3, Phase("hg", 0.7), Phase("hg", -0.4)),
}


def values(phase, cosine):
    """A phase function, per steradian."""
    if isinstance(phase, BlendPhase):
        first, second = (values(part, cosine) for part in (phase.first, phase.second))
        return (1 - phase.weight) * first + phase.weight * second
    if phase.kind == "rayleigh":
        return 3 / (16 * np.pi) * (1 + cosine**2)
    return hg_value(phase.g if phase.kind == "hg" else 0.0, cosine)


def sphere(nodes=160):
    """Directions and weights that integrate over the sphere."""
    z, w = np.polynomial.legendre.leggauss(nodes)
    turn = 2 * np.pi * (np.arange(2 * nodes) + 0.5) / (2 * nodes)
    r = np.sqrt(1 - z * z)[:, None]
    d = np.stack([r * np.cos(turn), r * np.sin(turn), np.broadcast_to(z[:, None], (nodes, 2 * nodes))], -1)
    return d.reshape(-1, 3), np.repeat(w * np.pi / nodes, 2 * nodes)


@pytest.mark.parametrize("name", PHASES)
def test_convolutions_are_those_of_quadrature(device, name):
    medium = medium_of(np.ones((3, 3, 3)), albedo=0.9, phase=PHASES[name])
    probe = Probe(device, scene_of(medium, [DirectionalEmitter((1.0,), (0.0, -1.0, 0.0))]))
    random = np.random.default_rng(4)
    pairs = np.array([[unit(v) for v in random.normal(size=(2, 3))] for _ in range(12)])
    g = np.tile([0.8, -0.5, 0.3], 4)
    [found] = probe.run(
        ["phase/convolution.h"],
        CONVOLVE,
        [np.zeros(12, np.float32)],
        [pairs.astype(np.float32), g.astype(np.float32)],
        stage="shade",
    )
    w, weights = sphere()
    expected = [
        (weights * values(PHASES[name], w @ start) * hg_value(lobe, w @ end)).sum()
        for (start, end), lobe in zip(pairs, g, strict=True)
    ]
    assert np.allclose(found, expected, rtol=2e-5)
