"""Media of microflakes that differ from place to place, and those in mixtures, against quadrature."""

import numpy as np
import pytest
from test_flakes import DENSITY, FLAKES, ONE, PLACE, RAYS, assert_mean, cube, density_at, medium, scene_of
from tiers import quick_first
from walks import unbiased

import clvol
from clvol.errors import OptionError
from clvol.planning import registry
from clvol.scene.flakes import FLATTEST, area_bounds, flake_matrix
from clvol.scene.records import Phase

RNG = np.random.default_rng(8)
ROOTS = RNG.normal(size=(3, 2, 2, 3, 3)) * 0.5
MATRICES = np.einsum("...ij,...kj->...ik", ROOTS, ROOTS) + 0.05 * np.eye(3)
MATRICES[1, 1, 0] = 0  # nothing is there
AT = ([0, 1, 2, 0, 0, 1], [0, 1, 2, 1, 2, 2])
GRID = MATRICES[..., AT[0], AT[1]].astype(np.float32)
VARIED = {"type": "sggx", "S": {"type": "gridvolume", "data": GRID, "to_world": PLACE}}


def by_points(registered):
    """Techniques or transmittances that look up single points."""
    family = "technique" if "delta" in registry.TECHNIQUES and registered == "technique" else "transmittance"
    entries = registry.FAMILIES[family]
    return [name for name in unbiased(registered) if not entries[name].interpolated]


TECHNIQUES, TRANSMITTANCES = by_points("technique"), by_points("transmittance")


def matrices_at(p):
    """S at points of the cube, float64 (n, 3, 3): between samples at the centres of cells."""
    size = np.array(GRID.shape[2::-1])
    place = np.clip((np.asarray(p) + 1) / 2 * size - 0.5, 0, size - 1)
    base = np.minimum(place.astype(int), size - 2)
    total = 0.0
    for corner in np.ndindex(2, 2, 2):
        share = np.where(corner, place - base, 1 - (place - base)).prod(axis=-1)
        x, y, z = (base + corner).T
        total = total + share[:, None] * GRID[z, y, x]
    return flake_matrix(total)


def areas_at(p, w):
    w = np.asarray(w, float) / np.linalg.norm(w)
    return np.sqrt(np.einsum("i,nij,j->n", w, matrices_at(p), w))


def depth_between(a, b, n=4000):
    """Optical depth along a line within the cube."""
    way = np.subtract(b, a)
    points = np.asarray(a) + ((np.arange(n) + 0.5) / n)[:, None] * way
    return (density_at(points) * areas_at(points, way)).mean() * np.linalg.norm(way)


def mean_area(a, b):
    """Along a line, weighted by the density."""
    points = np.asarray(a) + np.linspace(0, 1, 4000)[:, None] * np.subtract(b, a)
    return depth_between(a, b) / (density_at(points).mean() * np.linalg.norm(np.subtract(b, a)))


@quick_first("ray", RAYS)
@quick_first("technique", TECHNIQUES, count=2)
def test_what_is_seen_through_them_goes_by_place_and_direction(technique, ray):
    eye, target, a, b = RAYS[ray]
    expected = np.exp(-depth_between(a, b))
    scene = scene_of(eye, target, fog=cube(medium(phase=VARIED)), sky={"type": "constant"})
    result = clvol.render(scene, spp=8192, seed=2, technique=technique, majorant="grid")
    assert_mean(result, expected)
    # of an S that is everywhere as it is where the ray leaves, the picture would be another
    plain = depth_between(a, b) * areas_at([b], np.subtract(b, a)) / mean_area(a, b)
    assert abs(np.exp(-plain) / expected - 1) > 0.02


@quick_first("majorant", ["grid", "kdtree", "global"])
@quick_first("transmittance", TRANSMITTANCES)
def test_shadows_go_by_place_and_direction(transmittance, majorant):
    """A floor below the cube, which the sun reaches through it."""
    sun, point = np.array([0.3, 0.2, -1.0]), np.array([0.1, 0.0, -2.0])
    b = point - sun
    expected = np.exp(-depth_between(b - sun * 2.0, b)) * 1.1 / np.linalg.norm(sun) / np.pi
    floor = {
        "type": "rectangle",
        "to_world": clvol.translate([0, 0, -2.0]) @ clvol.scale(9.0),
        "bsdf": {"type": "diffuse", "reflectance": 1.0},
    }
    scene = scene_of(
        (point + np.array([-2.0, 0.4, 0.8])).tolist(),
        point.tolist(),
        width=1e-4,
        fog=cube(medium(phase=VARIED)),
        floor=floor,
        sun={"type": "directional", "direction": sun.tolist(), "irradiance": 1.1},
        integrator={"type": "volpath", "max_depth": 2},
    )
    result = clvol.render(scene, spp=8192, seed=2, transmittance=transmittance, majorant=majorant)
    assert_mean(result, expected, 0.01)


SUN = np.array([0.5, -0.3, -0.6]) / np.linalg.norm([0.5, -0.3, -0.6])
VIEW = np.array([0.0, 0.0, 1.0])


def values_at(p):
    """Of the phase function, for light along SUN that goes to a camera that looks along VIEW."""
    s, h = matrices_at(p), SUN + VIEW
    h = h / np.linalg.norm(h)
    inverse = np.linalg.inv(s)
    normals = 1 / (np.pi * np.sqrt(np.linalg.det(s)) * np.einsum("i,nij,j->n", h, inverse, h) ** 2)
    return normals / (4 * areas_at(p, SUN))


def scattered_once(value, area, depth, n=400):
    """Of light along SUN, by a camera that looks along VIEW at x, y = 0.1, 0.2."""
    z = -1 + 2 * (np.arange(n) + 0.5) / n
    points = np.stack([np.full(n, 0.1), np.full(n, 0.2), z], axis=1)
    total = 0.0
    for p, of_point, seen in zip(points, value(points), area(points), strict=True):
        far = np.min((1 + np.sign(SUN) * p) / np.abs(SUN))
        depths = depth([0.1, 0.2, -1], p), depth(p - far * SUN, p)
        total += density_at(p[None])[0] * seen * of_point * np.exp(-sum(depths))
    return 0.7 * total * 2 / n


def once(phase):
    return scene_of(
        (0.1, 0.2, -3.0),
        (0.1, 0.2, 1.0),
        width=0.002,
        fog=cube(medium(albedo=0.7, phase=phase)),
        sun={"type": "directional", "direction": SUN.tolist(), "irradiance": 1.0},
        integrator={"type": "volpath", "max_depth": 2},
    )


def test_light_scattered_once_is_its_integral():
    expected = scattered_once(values_at, lambda p: areas_at(p, SUN), lambda a, b: depth_between(a, b, 400))
    assert_mean(clvol.render(once(VARIED), spp=1 << 14, seed=2), expected)


PLAIN = {"type": "hg", "g": 0.3}


def plain_depth(a, b, n=400):
    points = np.asarray(a) + ((np.arange(n) + 0.5) / n)[:, None] * np.subtract(b, a)
    return density_at(points).mean() * np.linalg.norm(np.subtract(b, a))


@quick_first("varied", [False, True])
def test_in_a_mixture_they_leave_the_extinction_as_it_is(varied):
    """As Mitsuba 3.9.1 has it, where a blendphase has an area of 1."""
    share, s = 0.35, flake_matrix(tuple(ONE[0, 0, 0].tolist()))
    h = (SUN + VIEW) / np.linalg.norm(SUN + VIEW)

    def mixed(p):
        # from the camera's side, in whose direction Mitsuba and clvol ask: light comes along -VIEW there
        matrices = matrices_at(p) if varied else np.broadcast_to(s, (len(p), 3, 3))
        seen = np.sqrt(np.einsum("i,nij,j->n", VIEW, matrices, VIEW))
        peak = np.einsum("i,nij,j->n", h, np.linalg.inv(matrices), h)
        flakes = 1 / (np.pi * np.sqrt(np.linalg.det(matrices)) * peak**2) / (4 * seen)
        cosine, g = VIEW @ -SUN, 0.3
        hg = (1 - g * g) / (4 * np.pi * (1 + g * g - 2 * g * cosine) ** 1.5)
        return (1 - share) * flakes + share * hg

    expected = scattered_once(mixed, lambda p: np.ones(len(p)), plain_depth)
    phase = {"type": "blendphase", "weight": share, "a": VARIED if varied else FLAKES, "b": PLAIN}
    assert_mean(clvol.render(once(phase), spp=1 << 14, seed=2), expected)


@pytest.mark.contract
@pytest.mark.parametrize("technique", ["delta", "spectral", "decomposition"])
@pytest.mark.parametrize("phase", [VARIED, {"type": "blendphase", "weight": 0.4, "a": VARIED, "b": PLAIN}])
def test_nothing_shows_in_a_furnace(technique, phase):
    """Albedo 1, two media that overlap, and a colour in one of them."""
    other = {"type": "homogeneous", "sigma_t": 0.5, "albedo": 1.0, "phase": FLAKES}
    parts = {
        "fog": cube(medium(albedo=1.0, scale={"type": "rgb", "value": [1.0, 2.0, 4.0]}, phase=phase)),
        "ball": {"type": "sphere", "radius": 0.8, "interior": other, "bsdf": {"type": "null"}},
    }
    scene = scene_of((-2.0, -3.0, -2.0), (2.0, 3.0, 2.0), width=1.0, sky={"type": "constant"}, **parts)
    result = clvol.render(scene, spp=1024, seed=5, technique=technique, majorant="grid")
    assert_mean(result, np.ones(3), 0.01)


@pytest.mark.contract
def test_emission_is_absorption_along_the_ray():
    eye, target, a, b = RAYS["aslant"]
    scene = scene_of(eye, target, fog=cube(medium(emission=1.0, phase=VARIED)))
    assert_mean(clvol.render(scene, spp=8192, seed=2), 1 - np.exp(-depth_between(a, b)))


@pytest.mark.contract
def test_a_grid_of_nearly_one_matrix_is_nearly_that_matrix():
    nearly = np.broadcast_to(ONE, (2, 2, 2, 6)).copy()
    nearly[0, 0, 0, 0] *= 1 + 1e-6
    means, errors = [], []
    for s in (ONE, nearly):
        phase = {"type": "sggx", "S": {"type": "gridvolume", "data": s}}
        fog = cube(medium(albedo=0.9, scale=4.0, phase=phase))
        sun = {"type": "directional", "direction": SUN.tolist()}
        result = clvol.render(
            scene_of((3.0, 2.0, 1.0), (0, 0, 0), width=1.0, fog=fog, sun=sun), spp=1 << 14, seed=3
        )
        means.append(result.image.mean())
        errors.append(np.sqrt(result.variance.sum()) / result.image.size)
    assert max(errors) < 0.003 * means[0]
    assert abs(means[0] - means[1]) < 4.5 * np.hypot(*errors)


@pytest.mark.parametrize("family", ["technique", "transmittance"])
def test_what_integrates_samples_is_refused(family):
    parts = {"fog": cube(medium(albedo=0.5, phase=VARIED)), "sun": {"type": "directional"}}
    scene = scene_of(*RAYS["aslant"][:2], **parts)
    with pytest.raises(OptionError, match="microflakes that differ from place to place"):
        clvol.plan(scene, **{family: "regular"})
    mixed = {"type": "blendphase", "weight": 0.4, "a": VARIED, "b": PLAIN}
    parts["fog"] = cube(medium(albedo=0.5, phase=mixed))
    clvol.plan(scene_of(*RAYS["aslant"][:2], **parts), **{family: "regular"})


def test_bounds_hold_everywhere():
    points = np.random.default_rng(1).uniform(-1, 1, (500, 3))
    volume = (
        clvol.load_dict({"type": "scene", "s": {"type": "perspective"}, "fog": cube(medium(phase=VARIED))})
        .shapes[0]
        .interior.flakes
    )
    least, most = area_bounds(Phase("sggx", flakes=volume))
    found = np.sqrt(np.linalg.eigvalsh(matrices_at(points)))
    assert least == 0 and found.max() <= most < 1.2 * np.sqrt(np.linalg.eigvalsh(MATRICES).max())
    thin = np.array([1, 1, FLATTEST / 2, 0, 0, 0], np.float32)
    data = np.stack([thin, thin * 2]).reshape(2, 1, 1, 6)
    fog = cube(medium(phase={"type": "sggx", "S": {"type": "gridvolume", "data": data}}))
    with pytest.raises(clvol.SceneError, match=r"more than 1e-05 of the largest, at \[0, 0, 0\]"):
        clvol.load_dict({"type": "scene", "s": {"type": "perspective"}, "fog": fog})
    assert DENSITY.min() > 0
