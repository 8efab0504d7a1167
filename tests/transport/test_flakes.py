"""Media of microflakes, whose extinction goes by direction: every estimator against closed forms."""

import numpy as np
import pytest
from tiers import quick_first
from walks import unbiased

import clvol
from clvol.scene.flakes import flake_matrix
from clvol.scene.records import Phase

S6 = (0.35, 0.75, 0.15, 0.1, -0.05, 0.12)
S = flake_matrix(S6)
TECHNIQUES, TRANSMITTANCES = unbiased("technique"), unbiased("transmittance")
ONE = np.broadcast_to(np.array(S6, np.float32), (1, 2, 1, 6))
FLAKES = {"type": "sggx", "S": {"type": "gridvolume", "data": ONE}}
DENSITY = np.random.default_rng(2).uniform(0.05, 0.75, (5, 6, 4)).astype(np.float32)
PLACE = clvol.translate([-1, -1, -1]) @ clvol.scale(2.0)


def area(w):
    w = np.asarray(w, float)
    return float(np.sqrt(w @ S @ w) / np.linalg.norm(w))


def medium(kind="heterogeneous", **more):
    grid = {"type": "gridvolume", "data": DENSITY, "to_world": PLACE}
    sigma_t = grid if kind == "heterogeneous" else 0.8
    return {"type": kind, "sigma_t": sigma_t, "albedo": 0.0, "phase": FLAKES, **more}


def cube(inside):
    return {"type": "cube", "interior": inside, "bsdf": {"type": "null"}}


def scene_of(eye, target, size=4, width=0.02, **parts):
    sensor = {
        "type": "orthographic",
        "to_world": clvol.look_at(eye, target, [0.1, 0.3, 1.0]) @ clvol.scale([width, width, 1.0]),
        "film": {"type": "hdrfilm", "width": size, "height": size, "rfilter": {"type": "box"}},
    }
    return clvol.load_dict({"type": "scene", "sensor": sensor, **parts})


def density_at(p):
    """Trilinear density of samples at cells' centres, at points of the cube."""
    place = (np.asarray(p) + 1) / 2 * np.array(DENSITY.shape[::-1]) - 0.5
    place = np.clip(place, 0, np.array(DENSITY.shape[::-1]) - 1)
    base = np.minimum(place.astype(int), np.array(DENSITY.shape[::-1]) - 2)
    total = 0.0
    for corner in np.ndindex(2, 2, 2):
        share = np.where(corner, place - base, 1 - (place - base)).prod(axis=-1)
        x, y, z = (base + corner).T
        total = total + share * DENSITY[z, y, x]
    return total


def depth_between(a, b, n=4000):
    """Optical depth of the grid, without the area, along a line within the cube."""
    t = (np.arange(n) + 0.5) / n
    length = np.linalg.norm(np.subtract(b, a))
    return density_at(np.asarray(a) + t[:, None] * np.subtract(b, a)).mean() * length


def assert_mean(result, expected, most=0.005):
    """The picture's mean, within 4.5 standard errors that are small enough to tell."""
    mean = result.image.mean(axis=(0, 1), dtype=float)
    error = np.sqrt(result.variance.sum(axis=(0, 1), dtype=float)) / (
        result.image.shape[0] * result.image.shape[1]
    )
    assert (error < most * expected).all(), (mean, expected, error)
    assert (np.abs(mean - expected) < 4.5 * error + 2e-4 * expected).all(), (mean, expected, error)
    for count in ("non_finite", "majorant_violations", "walks_exhausted"):
        assert result.stats[count] == 0


RAYS = {
    "along z": ((0.1, 0.2, -3.0), (0.1, 0.2, 1.0), (0.1, 0.2, -1.0), (0.1, 0.2, 1.0)),
    "along y": ((0.3, -3.0, 0.1), (0.3, 1.0, 0.1), (0.3, -1.0, 0.1), (0.3, 1.0, 0.1)),
    "aslant": ((-2.0, -3.0, -2.0), (2.0, 3.0, 2.0), (-2 / 3, -1.0, -2 / 3), (2 / 3, 1.0, 2 / 3)),
}


@quick_first("ray", RAYS)
@quick_first("technique", TECHNIQUES)
def test_what_is_seen_through_them_goes_by_direction(technique, ray):
    eye, target, a, b = RAYS[ray]
    expected = np.exp(-area(np.subtract(b, a)) * depth_between(a, b))
    plain = np.exp(-depth_between(a, b))
    scene = scene_of(eye, target, fog=cube(medium()), sky={"type": "constant"})
    result = clvol.render(scene, spp=8192, seed=2, technique=technique, majorant="grid")
    assert_mean(result, expected)
    assert abs(plain / expected - 1) > 0.04


@quick_first("kind", ["homogeneous", "heterogeneous"])
@quick_first("transmittance", TRANSMITTANCES)
def test_shadows_go_by_the_direction_of_light(transmittance, kind):
    """A floor below the cube, which the sun reaches through it."""
    sun = np.array([0.3, 0.2, -1.0])
    point = np.array([0.1, 0.0, -2.0])
    b = point - sun
    a = b - sun * 2.0
    depth = depth_between(a, b) if kind == "heterogeneous" else 0.8 * np.linalg.norm(a - b)
    expected = np.exp(-area(sun) * depth) * 1.1 / np.linalg.norm(sun) / np.pi
    floor = {
        "type": "rectangle",
        "to_world": clvol.translate([0, 0, -2.0]) @ clvol.scale(9.0),
        "bsdf": {"type": "diffuse", "reflectance": 1.0},
    }
    light = {"type": "directional", "direction": sun.tolist(), "irradiance": 1.1}
    eye = (point + np.array([-2.0, 0.4, 0.8])).tolist()  # below the cube
    limit = {"type": "volpath", "max_depth": 2}
    scene = scene_of(
        eye, point.tolist(), width=1e-4, fog=cube(medium(kind)), floor=floor, sun=light, integrator=limit
    )
    result = clvol.render(scene, spp=8192, seed=2, transmittance=transmittance)
    assert_mean(result, expected, 0.01)


def scattered_once(sun, kind, n=400):
    """Of light along `sun` that is scattered once to a camera that looks along +z at x, y = 0.1, 0.2."""
    sun = np.asarray(sun, float) / np.linalg.norm(sun)
    view = np.array([0.0, 0.0, 1.0])  # the camera's rays; light goes the other way
    h = sun + view
    h /= np.linalg.norm(h)
    normals = 1 / (np.pi * np.sqrt(np.linalg.det(S)) * (h @ np.linalg.inv(S) @ h) ** 2)
    phase = normals / (4 * area(view))
    z = -1 + 2 * (np.arange(n) + 0.5) / n
    total = 0.0
    for at in z:
        p = np.array([0.1, 0.2, at])
        with np.errstate(divide="ignore"):
            far = np.min(np.where(sun != 0, (1 + np.sign(sun) * p) / np.abs(sun), np.inf))
        entry = p - far * sun
        if kind == "heterogeneous":
            depths = depth_between([0.1, 0.2, -1], p, 500), depth_between(entry, p, 500)
            sigma = density_at(p[None])[0]
        else:
            depths, sigma = (0.8 * (at + 1), 0.8 * far), 0.8
        total += sigma * np.exp(-area(view) * depths[0] - area(sun) * depths[1])
    return 0.7 * phase * area(view) * total * 2 / n


@quick_first("kind", ["homogeneous", "heterogeneous"])
def test_light_scattered_once_is_its_integral(kind):
    sun = [0.5, -0.3, -0.6]
    light = {"type": "directional", "direction": sun, "irradiance": 1.0}
    limit = {"type": "volpath", "max_depth": 2}
    scene = scene_of(
        (0.1, 0.2, -3.0),
        (0.1, 0.2, 1.0),
        width=0.002,
        fog=cube(medium(kind, albedo=0.7)),
        sun=light,
        integrator=limit,
    )
    result = clvol.render(scene, spp=1 << 14, seed=2)
    assert_mean(result, scattered_once(sun, kind))


@quick_first("technique", ["delta", "regular", "spectral", "decomposition"])
@quick_first("majorant", ["grid", "kdtree", "global"])
def test_nothing_shows_in_a_furnace(technique, majorant):
    """Albedo 1, two media that overlap, and a colour in one of them."""
    other = {"type": "homogeneous", "sigma_t": 0.5, "albedo": 1.0, "phase": {"type": "hg", "g": 0.4}}
    parts = {
        "fog": cube(medium(albedo=1.0, scale={"type": "rgb", "value": [1.0, 2.0, 4.0]})),
        "ball": {"type": "sphere", "radius": 0.8, "interior": other, "bsdf": {"type": "null"}},
    }
    scene = scene_of((-2.0, -3.0, -2.0), (2.0, 3.0, 2.0), width=1.0, sky={"type": "constant"}, **parts)
    result = clvol.render(scene, spp=1024, seed=5, technique=technique, majorant=majorant)
    assert_mean(result, np.ones(3), 0.01)


def test_emission_is_absorption_along_the_ray():
    """1 - T of a medium that only absorbs and emits 1."""
    eye, target, a, b = RAYS["aslant"]
    scene = scene_of(eye, target, fog=cube(medium(emission=1.0)))
    expected = 1 - np.exp(-area(np.subtract(b, a)) * depth_between(a, b))
    assert_mean(clvol.render(scene, spp=8192, seed=2), expected)


def phase_of(description):
    fog = cube({"type": "homogeneous", "phase": description})
    scene = clvol.load_dict({"type": "scene", "s": {"type": "perspective"}, "fog": fog})
    return scene.shapes[0].interior.phase


def test_six_numbers_will_do():
    as_read = tuple(float(np.float32(v)) for v in S6)
    assert phase_of(FLAKES) == Phase("sggx", flakes=as_read)
    assert phase_of({"type": "sggx", "S": "0.35, 0.75, 0.15, 0.1, -0.05, 0.12"}).flakes == S6
    assert phase_of({"type": "sggx", "S": np.array(S6)}).flakes == S6


VARIED = np.concatenate([ONE, ONE * 0.5], axis=0)
VARIED_FLAKES = {"type": "sggx", "S": {"type": "gridvolume", "data": VARIED}}


@pytest.mark.parametrize(
    ("description", "message"),
    [
        ({"type": "sggx"}, "an sggx needs S, a volume of six channels: S_xx"),
        ({"type": "sggx", "S": "1, 1, 1"}, "has six numbers, .*; got 3"),
        ({"type": "sggx", "S": "1, 1, x"}, "which is no number"),
        ({"type": "sggx", "S": "1, 1, 1, 1, 1, 1"}, "must be positive definite; its eigenvalues are"),
        ({"type": "sggx", "S": "1, 1, 1, 0, 0, nan"}, "must be finite"),
        ({"type": "sggx", "S": "1e7, 1e7, 1e7, 0, 0, 0"}, "an eigenvalue of 1e"),
        ({"type": "sggx", "S": {"type": "constvolume", "value": 0.5}}, "must be a gridvolume of six"),
        ({"type": "sggx", "S": {"type": "gridvolume", "data": np.ones((2, 2, 2))}}, "has six numbers"),
        ({"type": "sggx", "S": {"type": "gridvolume", "data": VARIED}}, "where sigma_t does not; give a het"),
        (
            {"type": "sggx", "S": {"type": "gridvolume", "data": np.concatenate([ONE, -ONE])}},
            r"must be positive definite; .*, at \[1, 0, 0\]",
        ),
        (
            {"type": "sggx", "S": {"type": "gridvolume", "data": np.concatenate([ONE, ONE * np.inf])}},
            "must be finite",
        ),
        (
            {"type": "blendphase", "weight": 0.5, "a": VARIED_FLAKES, "b": dict(VARIED_FLAKES)},
            "a mixture takes one sggx whose S differs",
        ),
    ],
    ids=lambda value: "",
)
def test_mistakes_are_named(description, message):
    with pytest.raises(clvol.SceneError, match=message):
        phase_of(description)


def test_six_channels_are_for_nothing_else():
    for inside in (
        {"type": "heterogeneous", "sigma_t": {"type": "gridvolume", "data": np.ones((2, 2, 2, 6))}},
        {"type": "homogeneous", "albedo": {"type": "gridvolume", "data": np.ones((2, 2, 2, 6))}},
    ):
        with pytest.raises(clvol.SceneError, match="six channels: they are for the S of an sggx alone"):
            clvol.load_dict({"type": "scene", "s": {"type": "perspective"}, "fog": cube(inside)})
