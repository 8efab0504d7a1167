"""What the cache of lights decides changes no mean, whatever it holds.

That is which shadow rays are traced, which light is sampled, and what a control variate subtracts.  Single
scattering of a sun in a grid of one density is known.  Pictures of more scatterings or lights are held to
those of a render without any of it.
"""

import numpy as np
import pytest
from pictures import box, gauss, gridded, hg, hg_value, picture, volume
from stat_tests import image_mean, largest_z, require_precision, z_score
from tiers import quick_where

import clvol
from clvol.rendering import upload
from clvol.scene.records import (
    ConstantEmitter,
    DirectionalEmitter,
    PointEmitter,
    ProjectorEmitter,
    SpotEmitter,
)

OFF = {"shadow_cache": "off", "light_choice": "power", "next_event": "plain"}
WRONG = ("zero", "one", "random", "right")
SIGMA, G = 1.0, 0.5
SUN = DirectionalEmitter((2.0,), (0.0, -1.0, 0.0))


def disturb(monkeypatch, kind):
    """Let the cache hold something else than transmittances."""

    def wrong(device, prepared, buffers):
        found = fill(device, prepared, buffers)
        count = found["light_transmittance"].size // 4
        values = {"zero": np.zeros, "one": np.ones, "random": np.random.default_rng(5).random}[kind](count)
        found["light_transmittance"] = device.memory.upload(values.astype(np.float32), "a test")
        return found

    fill = upload.light_cache_buffers
    if kind != "right":
        monkeypatch.setattr(upload, "light_cache_buffers", wrong)


def fog(density, albedo, g, **integrator):
    """A cube of fog of an array's density, before a camera that looks along +z."""
    corners = (0.0, 0.0, 0.0), (1.0, 1.0, 1.0)
    medium = gridded(volume(np.asarray(density, float), *corners), albedo, hg(g))
    return lambda emitters, shapes=(), size=(4, 4): picture(
        [box(*corners, medium), *shapes],
        emitters,
        (0.5, 0.5, -3.0),
        (0.5, 0.5, 0.5),
        13.0,
        size,
        **integrator,
    )


def single_scattering(scene, albedo):
    """Mean radiance of the film under SUN, float64: rays nearly along z through uniform fog."""
    size, tangent = scene.film.width, np.tan(np.radians(scene.sensor.fov) / 2)
    at, weights = gauss(np.linspace(-1, 1, size + 1)[:-1], np.linspace(-1, 1, size + 1)[1:], 4)
    at, weights = at.ravel() * tangent, weights.ravel() / 2
    x, y = np.meshgrid(at, at, indexing="ij")
    d = np.stack([x, y, np.ones_like(x)], -1)
    d /= np.linalg.norm(d, axis=-1, keepdims=True)
    enter, leave = 3.0 / d[..., 2], 4.0 / d[..., 2]
    t, dt = gauss(enter, leave, 12)
    height = 0.5 + t * d[..., 1, None]
    through = np.exp(-SIGMA * (t - enter[..., None])) * np.exp(-SIGMA * (1 - height))
    phase = hg_value(G, d[..., 1])
    radiance = (through * dt).sum(-1) * SIGMA * albedo * phase * SUN.irradiance[0]
    return float((radiance * np.outer(weights, weights)).sum())


@quick_where("kind", WRONG, {"random", "right"}.__contains__)
def test_single_scattering_is_exact_whatever_the_cache_holds(monkeypatch, kind):
    disturb(monkeypatch, kind)
    scene = fog(np.full((6, 6, 6), SIGMA), 0.9, G, max_depth=2)([SUN])
    spp = 1 << (18 if kind == "zero" else 16)
    result = clvol.render(scene, spp=spp, seed=11, shadow_cache="on", next_event="control")
    mean, variance = image_mean(result)
    expected = single_scattering(scene, 0.9)
    require_precision(np.sqrt(variance), (0.008 if kind == "zero" else 0.005 / 3) * expected, kind)
    assert np.abs(z_score(mean, variance, expected)).max() < largest_z(len(WRONG))


def lumps():
    """Dense lumps with gaps."""
    return np.random.default_rng(3).random((8, 8, 8)) ** 3 * 24.0


LAMPS = {
    "a sun": [SUN],
    "sun and sky": [ConstantEmitter((0.5,)), SUN],
    "far and near": [PointEmitter((40.0,), (0.5, 6.0, 0.5)), PointEmitter((0.1,), (0.5, 0.5, -0.3)), SUN],
    "a spot": [SpotEmitter((6.0,), clvol.look_at((0.5, 2.5, 0.5), (0.5, 0.5, 0.5), (1, 0, 0)), 40.0, 25.0)],
    "a projector": [
        ProjectorEmitter((4.0,), 1.0, clvol.look_at((0.5, 2.5, 0.5), (0.5, 0.5, 0.5), (1, 0, 0)), 30.0)
    ],
}
SPP = 1 << 14
_plain = {}


def plain(name, g):
    """The picture of more scatterings without any of it, light by light: its mean and variance."""
    if (name, g) not in _plain:
        scenes = [fog(lumps(), 0.95, g)([lamp]) for lamp in LAMPS[name]]
        parts = [image_mean(clvol.render(scene, spp=SPP, seed=n, **OFF)) for n, scene in enumerate(scenes)]
        _plain[name, g] = np.sum(parts, axis=0)
    return _plain[name, g]


CASES = [("a sun", 0.8, kind) for kind in WRONG] + [
    ("sun and sky", 0.3, "right"),
    ("sun and sky", 0.3, "random"),
    ("far and near", -0.6, "right"),
    ("far and near", -0.6, "zero"),
    ("a spot", 0.6, "right"),
    ("a projector", 0.6, "right"),
]


@pytest.mark.contract
@pytest.mark.parametrize(("name", "g", "kind"), CASES)
def test_many_scatterings_have_the_mean_of_a_plain_render(monkeypatch, name, g, kind):
    expected, noise = plain(name, g)
    disturb(monkeypatch, kind)
    result = clvol.render(fog(lumps(), 0.95, g)(LAMPS[name]), spp=SPP, seed=21)
    assert [result.metadata[family] for family in ("shadow_cache", "next_event")] == ["on", "control"]
    mean, variance = image_mean(result)
    require_precision(np.sqrt(variance + noise), 0.015 * expected, f"{name}, {kind}")
    assert np.abs(z_score(mean, variance, expected, noise)).max() < largest_z(len(CASES))


def noise(scene, **choices):
    """Mean over the film of the variance of a sample."""
    return float(clvol.render(scene, spp=1024, seed=5, **choices).variance.mean()) * 1024


def test_the_control_takes_noise_of_a_peak_away():
    scene = fog(lumps(), 0.99, 0.8)(LAMPS["a sun"])
    assert noise(scene, shadow_cache="on") < 0.85 * noise(scene, shadow_cache="on", next_event="plain")


def test_a_strong_far_and_a_weak_near_light_are_each_sampled_where_they_matter():
    near = PointEmitter((0.2,), (0.5, 0.5, -0.3))
    scene = fog(np.full((4, 4, 4), 1.0), 0.9, 0.0)([PointEmitter((40.0,), (0.5, 10.0, 0.5)), near])
    assert noise(scene) < 0.5 * noise(scene, light_choice="power")
