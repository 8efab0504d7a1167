"""The sun's disk: how its directions are drawn and what is seen of it, against density and energy."""

import numpy as np
import pytest
from probe import Probe, medium_of, scene_of
from sampling import uniforms
from stat_tests import FALSE_ALARM, chi2_p_value, sidak

from clvol.scene.records import ConstantEmitter, Integrator, SunEmitter

DRAWS = 1 << 16
IRRADIANCE = (0.5, 1.0, 2.0)
TILTED = np.array([0.48, -0.6, 0.64])
ACROSS = np.array([0.8, 0.0, -0.6])
SUNS = {
    "Earth's": (0.5358, TILTED, None),
    "tiny": (0.01, TILTED, None),
    "huge": (150.0, TILTED, None),
    "half set": (0.5358, ACROSS, np.cross(ACROSS, (0.0, 1.0, 0.0))),
}
BODY = (
    uniforms("pick", "u", "v")
    + """
    const float3 p = (float3)(0.1f, 0.2f, 0.3f);
    const LightSample light = sample_light(scene, p, pick, u, v);
    const bool is_sun = light.number == sun_number(scene);
    vstore3(light.direction, i, out0);
    vstore3(light.value, i, out1);
    vstore3(sun_radiance(scene->emitters + sun_number(scene), light.direction), i, out2);
    out3[2 * i] = is_sun ? light.pdf : 0.0f;
    out3[2 * i + 1] = sun_pdf(scene, p);
"""
)


@pytest.fixture(scope="module", params=SUNS)
def drawn(request, device):
    """A sun and draws of it: directions, values, radiances seen there, densities drawn with and said."""
    aperture, towards, up = SUNS[request.param]
    sun = SunEmitter(IRRADIANCE, tuple(towards), aperture, None if up is None else tuple(up))
    lights = [ConstantEmitter((0.1,)), sun]
    probe = Probe(device, scene_of(medium_of(1.0, albedo=0.5), lights, Integrator()))
    out = [np.zeros((DRAWS, n), np.float32) for n in (3, 3, 3, 2)]
    out = [
        a.astype(float)
        for a in probe.run(["core/random.h", "emitter/emitter.h"], BODY, out, [], stage="shade")
    ]
    return sun, [a[out[3][:, 0] > 0] for a in out]


def test_directions_are_uniform_over_the_disk(drawn):
    sun, (direction, *_) = drawn
    axis = np.array(sun.sun_direction)
    height = ((direction - axis) ** 2).sum(1) / 2 / (sun.solid_angle / (2 * np.pi))
    first = np.cross(axis, (0.3, 0.5, 0.1))
    turn = np.arctan2(
        direction @ np.cross(axis, first / np.linalg.norm(first)), direction @ first / np.linalg.norm(first)
    )
    # single precision leaves a disk of a hundredth of a degree some 1e-3 of its radius
    cells = np.clip((height * 8).astype(int), 0, 7) * 12 + ((turn / (2 * np.pi) % 1) * 12).astype(int)
    p_value = chi2_p_value(np.bincount(cells, minlength=96), np.full(96, len(cells) / 96))
    assert p_value > sidak(FALSE_ALARM, len(SUNS)), p_value


def test_a_draw_has_the_density_that_is_said_and_the_radiance_that_is_seen(drawn):
    sun, (direction, value, seen, pdf) = drawn
    assert np.allclose(pdf[:, 0], pdf[:, 1], rtol=1e-6)
    edge = ((direction - sun.sun_direction) ** 2).sum(1) * np.pi / sun.solid_angle > 0.99
    cut = np.zeros(len(edge), bool) if sun.up is None else np.abs(direction @ sun.up) < 1e-6
    inner = ~edge & ~cut
    assert np.allclose(value[inner] * pdf[inner, :1], seen[inner], rtol=1e-5)
    risen = inner if sun.up is None else inner & (direction @ sun.up > 0)
    assert np.allclose(seen[risen], np.array(IRRADIANCE) / sun.solid_angle, rtol=1e-5)
    assert not seen[inner & ~risen].any()


def test_the_energy_is_that_of_the_sun_whatever_its_size(drawn):
    """Normal to the sun: the mean of value times cosine, which a set half lacks."""
    sun, (direction, value, _, pdf) = drawn
    mean = (value * (direction @ sun.sun_direction)[:, None]).mean(0) * pdf[0, 1] * sun.solid_angle
    foreshortened = np.cos(np.radians(sun.aperture / 4)) ** 2  # mean cosine over the disk
    share = 1.0 if sun.up is None else 0.5
    error = 5 * 0.5 / np.sqrt(len(value)) if sun.up is not None or sun.aperture > 90 else 1e-4
    assert np.abs(mean / np.array(IRRADIANCE) / foreshortened / share - 1).max() < 2 * error


def test_beside_the_disk_there_is_no_sun(device):
    sun = SunEmitter((1.0,), tuple(TILTED), 2.0)
    probe = Probe(device, scene_of(medium_of(1.0, albedo=0.5), [ConstantEmitter((0.1,)), sun]))
    across = np.cross(TILTED, (1.0, 0.0, 0.0))
    across /= np.linalg.norm(across)
    angles = np.radians([0.0, 0.5, 0.999, 1.001, 2.0, 90.0, 180.0])[:, None]
    looks = (np.cos(angles) * TILTED + np.sin(angles) * across).astype(np.float32)
    [seen] = probe.run(
        ["emitter/emitter.h"],
        "vstore3(sun_radiance(scene->emitters + sun_number(scene), vload3(i, in0)), i, out0);",
        [np.zeros((len(looks), 3), np.float32)],
        [looks],
        stage="shade",
    )
    assert (seen[:, 0] > 0).tolist() == [True, True, True, False, False, False, False]
