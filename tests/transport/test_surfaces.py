"""Surfaces, lights and media in one picture: furnaces, closed forms with lamps, depth, and hostile views.

Unless a test says otherwise its false-alarm rate is 1e-4 at fixed seeds (`assert_matches`).  Scenes share
kernels: `sampled` with next-event estimation, `found` without.
"""

from dataclasses import replace

import numpy as np
import pytest
from pictures import assert_matches, ball, box, camera_rays, gauss, hg, homogeneous, mean_and_error
from stat_tests import assert_same_picture, image_mean, largest_z, z_score
from surface_scenes import DARK, GLASS, SKY, found, icosphere, mesh_box, moved, sampled, surfaced
from tiers import quick_first

from clvol import render
from clvol.scene.materials import Bitmap, Conductor, Dielectric, Diffuse, Mask, RoughDielectric, TwoSided
from clvol.scene.records import PointEmitter, Shape, SpotEmitter

WHITE, BLACK = Diffuse((1.0,)), Diffuse((0.0,))
UNIT = (-1, -1, -1), (1, 1, 1)


def show(scene, spp=1 << 12, seed=1, **choices):
    """With light sampling where there is anything that asks for it, else without."""
    if len(scene.emitters) > 1:
        return render(scene, spp=spp, seed=seed, transmittance="ratio", majorant="grid", **choices)
    return render(scene, spp=spp, seed=seed, transmittance="none", absorption="weight", **choices)


def plate(height=0.0, half=1.0, down=False, **keywords):
    """A horizontal rectangle that faces up, or down."""
    to_world = np.zeros((4, 4))
    to_world[0, 0], to_world[2, 1], to_world[1, 2] = half, half, 1.0
    to_world[2, 1] *= -1
    to_world[:, 3] = 0, height, 0, 1
    return Shape("rectangle", to_world, flip_normals=down, **keywords)


# -- furnaces --------------------------------------------------------------------------------------

MILK = homogeneous(1.0, 1.0, hg(0.3))
FURNACES = {
    "white sphere": [surfaced(ball((0, 0, 0), 1.0), WHITE)],
    "white mesh": [surfaced(mesh_box(*UNIT), WHITE)],
    "mirror": [surfaced(icosphere(), Conductor()), surfaced(ball((1.2, 0, 0.5), 0.4), Conductor())],
    "glass sphere": [surfaced(ball((0, 0, 0), 1.0), GLASS)],
    "glass mesh": [surfaced(mesh_box(*UNIT), GLASS)],
    "mask": [surfaced(icosphere(), Mask(TwoSided(WHITE, WHITE), (0.3,)))],
    "milk in a glass sphere": [surfaced(ball((0, 0, 0), 1.0, MILK), GLASS)],
    "milk in a glass mesh": [surfaced(icosphere(medium=MILK), GLASS)],
    "milk in a mesh": [icosphere(medium=MILK)],
    "milk round a white sphere, in a mesh": [icosphere(medium=MILK), surfaced(ball((0, 0, 0.1), 0.4), WHITE)],
    "milk round glass round milk": [
        icosphere(medium=MILK),
        surfaced(
            ball(
                (0, 0, 0.1),
                0.4,
                MILK,
            ),
            GLASS,
        ),
    ],
}


@quick_first("name", FURNACES, count=3)
def test_a_furnace_found_by_its_paths_is_one_in_every_sample(name):
    """Each path weighs 1: refraction's eta² cancels to rounding, and roulette keeps what is worth 1."""
    result = show(found(FURNACES[name]), spp=256)
    assert np.abs(result.image - 1).max() < 1e-4
    assert result.stats["non_finite"] == 0


@pytest.mark.contract
@pytest.mark.parametrize("name", ["white sphere", "milk round a white sphere, in a mesh", "mask"])
def test_a_furnace_with_light_sampling_is_one(name):
    assert_matches(show(sampled(FURNACES[name]), spp=1 << 14, seed=2), 1.0)


@pytest.mark.contract
def test_in_glass_no_light_can_be_sampled_and_every_path_weighs_one():
    result = show(sampled(FURNACES["milk in a glass mesh"]), spp=256, seed=2)
    assert np.abs(result.image - 1).max() < 1e-4


@pytest.mark.contract
@pytest.mark.parametrize(
    ("medium", "known", "uncertain"),
    [(None, 0.98109, 0.00009), (MILK, 0.94195, 0.00023)],
    ids=["clear", "milky"],
)
def test_rough_glass_loses_what_scatters_twice_at_its_facets(medium, known, uncertain):
    """Mean of the picture and its standard error as Mitsuba 3.9.1 has them.

    By volpath, scalar_rgb, without roulette, 8 renders of 8192 samples a pixel.
    """
    shape = surfaced(ball((0, 0, 0), 1.0, medium), RoughDielectric(1.5, 1.0, "ggx", 0.1, 0.1))
    mean, error = mean_and_error(show(found([shape], fov=14.0), spp=3 << 12))
    error = np.hypot(error[0], uncertain)
    assert abs(mean[0] - known) < largest_z(1) * error, f"{mean[0]:.5f} ± {error:.5f}"
    assert 2 * largest_z(1) * error < 0.005 * known


@pytest.mark.contract
def test_a_half_space_behind_smooth_glass_reflects_what_giovanelli_says():
    """With n 1.5, albedo 0.9, isotropic: 0.2600 at normal incidence, 0.0400 of it specular (NUMBERS.md).

    By reciprocity, what is seen along the normal under a uniform sky; nothing gets through the slab.
    """
    slab = surfaced(box((-300, -300, 0), (300, 300, 40.0), homogeneous(1.0, 0.9)), GLASS)
    scene = found([slab], eye=(0.1, 0.2, -5.0), target=(0.1, 0.2, 0.0), fov=0.01, size=(2, 2))
    result = show(scene, spp=3 << 18, seed=3)
    mean, error = mean_and_error(result)
    assert 1.4 * largest_z(1) * error[0] < 0.005 * 0.2600
    assert abs(z_score(mean[0], error[0] ** 2, 0.2600)) < largest_z(1), f"{mean[0]:.4f} ± {error[0]:.4f}"


# -- lamps -----------------------------------------------------------------------------------------

EYE = {"eye": (0.4, 3.0, -3.0), "target": (0.2, 0.0, 0.1), "fov": 14.0}
FLOOR = plate(0.0, 20.0, bsdf=Diffuse((0.6,)))


def floor_points(scene, nodes=4):
    """Points (h, w, n, 3) of the floor y = 0 seen in each pixel, distance from the eye, and weights (n,)."""
    o, d, w = camera_rays(scene, nodes)
    t = -o[1] / d[..., 1]
    return o + t[..., None] * d, t, w


def near(scene):
    """Distance of the near plane along rays of the middle of the picture, which is narrow."""
    return scene.sensor.near_clip


def lamp_irradiance(points, height, half, sigma=0.0, nodes=24):
    """Of a square lamp of radiance 1 that faces down at that height, through an absorbing medium."""
    x, w = gauss(-half, half, nodes)
    total = 0.0
    for a, wa in zip(x, w, strict=True):
        for b, wb in zip(x, w, strict=True):
            square = (points[..., 0] - a) ** 2 + (points[..., 2] - b) ** 2 + height**2
            total = total + wa * wb * height**2 / square**2 * np.exp(-sigma * np.sqrt(square))
    return total


def lamp(height=1.5, half=0.5, radiance=2.0, **more):
    return plate(height, half, down=True, bsdf=BLACK, emission=(radiance,), **more)


FILTERS = {
    "nothing": ([], 1.0),
    "a null mesh": ([mesh_box((-9, 0.3, -9), (9, 0.6, 9))], 1.0),
    "a mask": ([plate(0.3, 9.0, bsdf=Mask(BLACK, (0.25,)))], 0.75),
    "a textured mask": (
        [plate(0.3, 9.0, bsdf=Mask(BLACK, Bitmap(np.full((2, 2, 3), 0.4, np.float32))))],
        0.6,
    ),
}


def floor_scene(shapes, lights=(DARK,), **more):
    return sampled([FLOOR, *shapes], lights, **EYE | more)


@pytest.mark.contract
@pytest.mark.parametrize("name", FILTERS)
def test_a_square_lamp_lights_a_floor_through_what_lets_light_pass(name):
    """The eye is below what is in the way of the light, so that only shadow rays pass it."""
    shapes, share = FILTERS[name]
    view = {"eye": (0.4, 0.25, -0.5), "target": (0.2, 0.0, 0.1), "fov": 14.0}
    scene = floor_scene([lamp(), *shapes], **view)
    points, _, w = floor_points(scene)
    answer = (0.6 / np.pi * 2.0 * share * lamp_irradiance(points, 1.5, 0.5)) @ w
    assert_matches(show(scene, spp=1 << 13, seed=4), answer[..., None])


@pytest.mark.contract
def test_a_square_lamp_in_an_absorbing_room_is_dimmed_on_both_ways():
    """The camera's rays start at the near plane."""
    sigma = 0.4
    room = mesh_box((-30, -30, -30), (30, 30, 30), homogeneous(sigma, 0.0))
    scene = floor_scene([lamp(), room], eye=(0.4, 0.5, -0.7))
    points, t, w = floor_points(scene)
    t = t - near(scene)
    answer = (0.6 / np.pi * 2.0 * lamp_irradiance(points, 1.5, 0.5, sigma) * np.exp(-sigma * t)) @ w
    assert_matches(show(scene, spp=1 << 16, seed=5), answer[..., None])


@pytest.mark.contract
def test_a_spherical_lamp_lights_a_floor_as_its_closed_form():
    """E = pi L r² cos / d²."""
    centre, radius = np.array([0.3, 1.4, 0.2]), 0.5
    scene = floor_scene([surfaced(ball(centre, radius), BLACK, emission=(2.0,))])
    points, _, w = floor_points(scene)
    to = centre - points
    square = (to**2).sum(-1)
    answer = (0.6 / np.pi * np.pi * 2.0 * radius**2 * to[..., 1] / square**1.5) @ w
    assert_matches(show(scene, spp=1 << 13, seed=6), answer[..., None])


@pytest.mark.contract
def test_a_point_light_through_a_pane_and_round_an_opaque_sphere():
    """A thin pane passes (1 - R) / (1 + R) at its angle; behind the sphere there is nothing at all."""
    place = np.array([0.2, 1.2, 0.1])
    pane = plate(0.5, 9.0, bsdf=Dielectric(1.5, 1.0, thin=True))
    view = {"eye": (0.6, 0.4, -0.5), "target": (0.2, 0.0, 0.1), "fov": 20.0}
    light = PointEmitter((3.0,), tuple(place))
    scene = floor_scene([pane], (DARK, light), **view, max_depth=2)
    points, _, w = floor_points(scene)
    to = place - points
    square = (to**2).sum(-1)
    cosine = to[..., 1] / np.sqrt(square)
    inner = np.sqrt(1 - (1 - cosine**2) / 1.5**2)
    r = ((cosine - 1.5 * inner) / (cosine + 1.5 * inner)) ** 2
    s = ((1.5 * cosine - inner) / (1.5 * cosine + inner)) ** 2
    reflected = (r + s) / 2
    answer = (0.6 / np.pi * 3.0 * cosine / square * (1 - reflected) / (1 + reflected)) @ w
    assert_matches(show(scene, spp=1 << 10, seed=7), answer[..., None])
    shaded = floor_scene(
        [surfaced(ball((0.2, 0.8, 0.1), 0.3), WHITE)],
        (DARK, light),
        **view,
        max_depth=2,
    )
    assert (show(shaded, spp=256).image == 0).all()


@pytest.mark.contract
def test_a_spot_in_fog_scatters_once_as_its_quadrature():
    """Seen from aside through an absorbing, scattering mesh; the beam's cone is wider than the picture."""
    sigma, albedo, g = 0.5, 0.8, 0.4
    room = mesh_box((-6, -6, -6), (6, 6, 6), homogeneous(sigma, albedo, hg(g)))
    place = np.array([0.3, 3.0, 0.2])
    turn = np.eye(4)
    turn[:3, :3] = [[1, 0, 0], [0, 0, -1], [0, 1, 0]]  # +z becomes -y
    turn[:3, 3] = place
    light = SpotEmitter((5.0,), turn, 80.0, 79.0)
    eye = (0.1, 0.2, -5.0)
    scene = sampled([room], (DARK, light), eye=eye, target=(0.1, 0.0, 0.0), fov=10.0, max_depth=2)
    o, d, w = camera_rays(scene, 3)
    t, dt = gauss(near(scene), 11.0 / d[..., 2], 64)
    x = o + t[..., None] * d[..., None, :]
    to = place - x
    far = np.linalg.norm(to, axis=-1)
    to /= far[..., None]
    axis = turn[:3, 2]
    angle = np.degrees(np.arccos(-(to @ axis)))
    beam = np.clip((80.0 - angle) / 1.0, 0.0, 1.0)
    cosine = (to * d[..., None, :]).sum(-1)
    phase = (1 - g * g) / (4 * np.pi * (1 + g * g - 2 * g * cosine) ** 1.5)
    source = sigma * albedo * np.exp(-sigma * (t - near(scene) + far)) * phase * 5.0 * beam / far**2
    answer = ((source * dt).sum(-1) @ w)[..., None]
    assert_matches(show(scene, spp=1 << 15, seed=8), answer)


@pytest.mark.contract
def test_paths_that_find_lamps_and_paths_that_sample_them_see_one_picture():
    """A bias of 1 % of either would be seen."""
    shapes = [
        FLOOR,
        lamp(1.5, 0.8),
        surfaced(ball((1.2, 0.6, 0.5), 0.5), BLACK, emission=(1.5,)),
        surfaced(icosphere((-0.2, 0.4, 0.0), 0.4), Mask(Diffuse((0.8,)), (0.6,))),
        mesh_box((-5, -1, -5), (5, 5, 5), homogeneous(0.15, 0.9, hg(0.3))),
    ]
    view = EYE | {"fov": 40.0, "size": (8, 8)}
    lights = (replace(SKY, radiance=(0.2,)),)
    a = show(sampled(shapes, lights, **view), spp=1 << 14, seed=9)
    b = show(found(shapes, lights, **view), spp=1 << 14, seed=10)
    assert_same_picture(a, b, tile=4)
    (mean, variance), (_, other) = image_mean(a), image_mean(b)
    assert (4.2 * np.sqrt(variance + other) < 0.01 * mean).all()


# -- depth and roulette ------------------------------------------------------------------------------


def integrating_sphere(depth, make=found, reflectance=0.7):
    """Inside of a sphere that emits 1 and reflects: the radiance is the sum of reflectance^k, k < depth."""
    wall = surfaced(ball((0, 0, 0), 2.0), Diffuse((reflectance,)), emission=(1.0,), flip_normals=True)
    holes = Mask(Diffuse((0.5,)), (0.0,))
    veils = [icosphere(radius=1.0), icosphere((0.5, 0, 0.2), 0.3), surfaced(icosphere(radius=1.4), holes)]
    return make([wall, *veils], eye=(0.1, 0.2, -0.3), target=(0, 0, 1), fov=60.0, max_depth=depth)


@quick_first("depth", [0, 1, 2, 3, 6], count=2)
def test_depth_counts_scatterings_and_neither_boundaries_nor_holes(depth):
    expected = sum(0.7**k for k in range(depth))
    result = show(integrating_sphere(depth), spp=256, roulette="depth")
    assert np.abs(result.image - expected).max() < 1e-4
    # no less with sampled lights: all are equal there
    light_sampled = show(integrating_sphere(depth, sampled), spp=256, roulette="depth", light_choice="power")
    assert np.abs(light_sampled.image - expected).max() < 1e-4


@pytest.mark.contract
def test_roulette_in_glass_leaves_the_picture_as_it_is():
    """It may start at once, and counts eta²: light in glass is not worth less than outside."""
    absorbing = homogeneous(1.0, 0.8)
    results = []
    for rr_depth, seed in ((1, 12), (10_000, 13)):
        scene = found([surfaced(ball((0, 0, 0), 1.0, absorbing), GLASS)], fov=20.0, rr_depth=rr_depth)
        results.append(show(scene, spp=3 << 14, seed=seed))
    assert_same_picture(*results, tile=1)
    (mean, variance), (_, other) = (image_mean(r) for r in results)
    assert (4.2 * np.sqrt(variance + other) < 0.005 * mean).all()


# -- hostile views -----------------------------------------------------------------------------------


@quick_first("medium", [None, MILK], ids=["clear", "foggy"])
@quick_first("target", [(0, 0, 1), (1, 1, 1), (1, 0, 0), (0.3, 0.2, 0.9)])
def test_no_light_leaks_into_a_closed_black_room(target, medium):
    """Along axes, at edges and corners, with the eye in the middle, on planes of symmetry."""
    walls = surfaced(mesh_box(*UNIT), TwoSided(BLACK, BLACK))
    veil = icosphere(radius=0.5, medium=medium)
    sky = (replace(SKY, radiance=(1e6,)),)
    scene = sampled([walls, veil], sky, eye=(0, 0, 0), target=target, fov=90.0, size=(8, 8))
    result = show(scene, spp=1 << 9)
    assert (result.image == 0).all() and result.stats["non_finite"] == 0


@pytest.mark.contract
def test_a_scene_far_from_the_origin_is_the_scene_at_the_origin():
    shapes = [
        surfaced(icosphere(medium=MILK), GLASS),
        surfaced(ball((0.8, 0.6, -1.0), 0.4), Diffuse((0.8,))),
        icosphere((-0.9, 0.4, -0.8), 0.5, homogeneous(1.0, 0.6)),
        plate(2.0, 0.7, down=True, bsdf=BLACK, emission=(3.0,)),
    ]
    here = sampled(shapes, size=(8, 8), fov=40.0)
    far = np.array([1e6, -1e6, 1e6])
    to_world = here.sensor.to_world.copy()
    to_world[:3, 3] += far
    there = replace(
        here,
        sensor=replace(here.sensor, to_world=to_world),
        shapes=tuple(moved(s, far) for s in here.shapes),
    )
    a, b = show(here, spp=1 << 12, seed=14), show(there, spp=1 << 12, seed=15)
    assert a.stats["non_finite"] == b.stats["non_finite"] == 0
    assert_same_picture(a, b, tile=4)
