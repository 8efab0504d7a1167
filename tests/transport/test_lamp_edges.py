"""Edges of lamps that the camera sees: the rays that refine them change noise, and no mean.

Closed forms where there are any: the part of a pixel that a lamp covers, times the transmittance up to it.
Else pictures are held to those that the samples alone make.  False-alarm rate 1e-4 at fixed seeds.
"""

from dataclasses import replace

import numpy as np
import pytest
from pictures import assert_matches, ball, box, gridded, hg, homogeneous, picture, volume
from stat_tests import assert_same_picture, image_mean, largest_z, z_score
from surface_scenes import HALF, icosphere, surfaced
from tiers import quick_where

import clvol
from clvol.rendering import lamp_edges
from clvol.scene.materials import Diffuse, Mask
from clvol.scene.records import (
    ConstantEmitter,
    ConstVolume,
    DirectionalEmitter,
    EnvmapEmitter,
    ReconstructionFilter,
    Shape,
)

BLACK, WHITE = Diffuse((0.0,)), Diffuse((0.8,))
RADIANCE = 5.0
EYE = (0.0, 0.0, -4.0)
TURN = 0.3


def plate(half=0.6, z=0.0, turn=TURN, **keywords):
    """A square lamp across the view, turned in its plane, that shines towards the camera."""
    to_world = clvol.translate([0.03, -0.05, z]) @ clvol.rotate([0, 0, 1], np.degrees(turn))
    to_world = to_world @ clvol.scale([half, half, 1.0])
    return Shape("rectangle", to_world, flip_normals=True, bsdf=BLACK, emission=(RADIANCE,), **keywords)


def seen(shapes, lights=(), size=(6, 6), **more):
    return picture(shapes, lights, EYE, (0, 0, 0), 30.0, size, **more)


def coverage(scene, half=0.6, turn=TURN, points=600):
    """Share of each pixel that `plate` covers, float64 (height, width, 1)."""
    film, tangent = scene.film, np.tan(np.radians(scene.sensor.fov) / 2)
    at = (np.arange(film.width * points) + 0.5) / points
    x = 4 * tangent * (1 - 2 * at / film.width)
    y = 4 * tangent * (film.height - 2 * at) / film.width
    x, y = x[None, :] - 0.03, y[:, None] + 0.05
    u, v = np.cos(turn) * x + np.sin(turn) * y, np.cos(turn) * y - np.sin(turn) * x
    inside = (np.abs(u) <= half) & (np.abs(v) <= half)
    return inside.reshape(film.height, points, film.width, points).mean((1, 3))[..., None]


def disturb(monkeypatch, kind):
    """Let the pixels that are refined be others than those that an edge passes."""

    def wrong(seen_there, radius):
        edges = right(seen_there, radius)
        return {"none": edges & False, "all": edges | True, "others": ~edges}[kind]

    right = lamp_edges.edge_pixels
    if kind != "right":
        monkeypatch.setattr(lamp_edges, "edge_pixels", wrong)


@quick_where("kind", ("right", "none", "all", "others"), {"right", "all"}.__contains__)
def test_what_a_pixel_sees_of_a_lamp_is_exact_whatever_is_refined(monkeypatch, kind):
    disturb(monkeypatch, kind)
    scene = seen([plate()])
    assert_matches(clvol.render(scene, spp=1 << 15, seed=3), RADIANCE * coverage(scene))


def test_two_samples_a_pixel_are_those_of_many():
    """Nothing else is there to see, so that all the noise is that of the finer rays."""
    scene = seen([plate()])
    expected = RADIANCE * coverage(scene)
    errors = {
        edges: np.mean(
            [
                np.square(
                    clvol.render(scene, spp=16, seed=s, sampler="joint", lamp_edges=edges).image - expected
                )
                for s in range(8)
            ]
        )
        for edges in ("refined", "sampled")
    }
    # 16 times the points: their variance falls faster than in proportion, by 16 ** 1.5 = 64
    assert errors["sampled"] > 20 * errors["refined"] > 0


FOG = {
    "homogeneous": homogeneous(0.5, 0.0),
    "grid": gridded(volume(np.full((4, 4, 4), 0.5), (-2.0, -2.0, -2.0), (2.0, 2.0, -0.5))),
}


@quick_where("kind", FOG, {"grid"}.__contains__)
def test_through_what_absorbs(kind):
    """A slab of 1.5 before the lamp, along the axis; more where a ray is slanted."""
    scene = seen([plate(), box((-2.0, -2.0, -2.0), (2.0, 2.0, -0.5), FOG[kind])])
    at = (np.arange(6 * 600) + 0.5) / 600
    across = np.tan(np.radians(15)) * (1 - 2 * at / 6)
    slant = np.sqrt(1 + across[None, :] ** 2 + across[:, None] ** 2)
    through = np.exp(-0.5 * 1.5 * slant).reshape(6, 600, 6, 600).mean((1, 3))[..., None]
    assert_matches(clvol.render(scene, spp=1 << 17, seed=4), RADIANCE * coverage(scene) * through)


SMOKE = volume(np.random.default_rng(1).random((6, 6, 6)), (-1.0, -1.0, -2.0), (1.0, 1.0, -0.6))
WALL = surfaced(box((-3.0, -3.0, 0.5), (3.0, 3.0, 1.0)), WHITE)


def smoky(*shapes, albedo=0.8, lights=(), **more):
    """A lamp, a wall behind it, and smoke that scatters before part of both."""
    medium = gridded(SMOKE, albedo, hg(0.4), scale=1.5)
    smoke = box((-1.0, -1.0, -2.0), (1.0, 1.0, -0.6), medium)
    return seen([*shapes, WALL, smoke], lights, size=(8, 8), max_depth=20, **more)


LAMPS = {
    "square": plate(),
    "disk": Shape("disk", clvol.scale([0.6, 0.6, 1.0]), flip_normals=True, bsdf=BLACK, emission=(RADIANCE,)),
    "ball": surfaced(ball((0.1, 0.0, 0.0), 0.4), BLACK, emission=(RADIANCE,)),
    "cylinder": Shape(
        "cylinder",
        clvol.translate([-0.5, 0, 0]) @ clvol.rotate([0, 1, 0], 90) @ clvol.scale([0.3, 0.3, 1]),
        bsdf=BLACK,
        emission=(RADIANCE,),
    ),
    "mesh": surfaced(icosphere((0.0, 0.1, 0.0), 0.45), BLACK, emission=(RADIANCE,)),
    "coloured": replace(plate(), emission=(4.0, 2.0, 1.0)),
    "textured": replace(plate(), emission=HALF),
    "behind a mask": plate(),
}
BEFORE = {
    "behind a mask": [
        Shape("rectangle", clvol.translate([0.3, 0, -0.3]) @ clvol.scale([0.4, 1.0, 1.0]), flip_normals=True,
              bsdf=Mask(WHITE, (0.4,)))
    ],
}  # fmt: skip


@quick_where("lamp", LAMPS, {"square", "behind a mask"}.__contains__)
def test_lamps_in_smoke_have_the_mean_that_samples_alone_find(lamp):
    scene = smoky(LAMPS[lamp], *BEFORE.get(lamp, ()))
    pictures = [
        clvol.render(scene, spp=8192, seed=seed, lamp_edges=edges)
        for seed, edges in ((11, "refined"), (12, "sampled"))
    ]
    assert_same_picture(*pictures, tile=1)
    (_, va), (b, vb) = (image_mean(p) for p in pictures)
    assert (np.sqrt(va + vb) < 0.005 * b).all()


CHOICES = {
    "delta shadows": {"transmittance": "delta"},
    "found alone": {"transmittance": "none"},
    "without the cache": {"shadow_cache": "off"},
    "weighted": {"technique": "weighted-delta"},
    "regular": {"technique": "regular"},
    "no lanes": {"lanes": "off"},
    "sobol": {"sampler": "sobol"},
}


@quick_where("choices", CHOICES, {"without the cache", "sobol"}.__contains__)
def test_every_technique_has_that_mean(choices):
    scene = smoky(plate())
    a = clvol.render(scene, spp=1024, seed=21, **CHOICES[choices])
    b = clvol.render(scene, spp=1024, seed=22, lamp_edges="sampled")
    z = z_score(*image_mean(a), *image_mean(b))
    assert np.abs(z).max() < largest_z(z.size)


@quick_where("view", ("lens", "gaussian", "crop", "one channel a path"), {"lens"}.__contains__)
def test_cameras_and_films_have_that_mean(view):
    scene = smoky(plate(), albedo=(0.9, 0.5, 0.2) if view == "one channel a path" else 0.8)
    if view == "lens":
        scene = replace(scene, sensor=replace(scene.sensor, aperture_radius=0.2, focus_distance=3.0))
    if view == "gaussian":
        scene = replace(scene, film=replace(scene.film, rfilter=ReconstructionFilter("gaussian", 2.0)))
    if view == "crop":
        scene = replace(scene, film=replace(scene.film, crop=(1, 2, 5, 4)))
    choices = {"absorption": "sample"} if view == "one channel a path" else {}
    pictures = [
        clvol.render(scene, spp=1024, seed=seed, lamp_edges=edges, **choices)
        for seed, edges in ((31, "refined"), (32, "sampled"))
    ]
    assert clvol.plan(scene, **choices).in_force["lamp_edges"] == "refined"
    assert_same_picture(*pictures, tile=1)


def test_edges_through_smoke_lose_their_noise():
    """Where the smoke is thin, most of it; the pixels beside the edge keep theirs."""
    thin = gridded(SMOKE, 0.8, hg(0.4), scale=0.02)
    scene = seen(
        [plate(), WALL, box((-1.0, -1.0, -2.0), (1.0, 1.0, -0.6), thin)], size=(16, 16), max_depth=20
    )
    noise = {}
    for edges in ("refined", "sampled"):
        images = [
            clvol.render(scene, spp=16, seed=s, sampler="joint", lamp_edges=edges).image for s in range(6)
        ]
        noise[edges] = np.var(images, axis=0, ddof=1)[..., 0]
    part = coverage(scene, points=64)[..., 0]
    edge = (part > 0.05) & (part < 0.95)
    assert noise["sampled"][edge].mean() > 4 * noise["refined"][edge].mean()
    assert noise["sampled"][part == 0].mean() < 1.2 * noise["refined"][part == 0].mean()


COLOURS = (0.05, 1.0, 3.0)
COLOURED = {
    "homogeneous": homogeneous(COLOURS, 0.3),
    "grid": replace(
        gridded(volume(np.ones((4, 4, 4)), (-2.0, -2.0, -2.0), (2.0, 2.0, -0.5)), 0.3), scale=COLOURS
    ),
    "coloured grid": gridded(
        volume(np.full((4, 4, 4, 3), COLOURS), (-2.0, -2.0, -2.0), (2.0, 2.0, -0.5)), 0.3
    ),
}


@quick_where("medium", COLOURED, {"coloured grid"}.__contains__)
def test_no_channel_gets_noise_that_it_had_not(medium):
    """Where one is absorbed far more than another, the guess of the transmittance is that of each."""
    fog = box((-2.0, -2.0, -2.0), (2.0, 2.0, -0.5), COLOURED[medium])
    scene = seen([plate(), WALL, fog], size=(12, 12), max_depth=6)
    noise = {}
    for edges in ("refined", "sampled"):
        images = [
            clvol.render(scene, spp=16, seed=s, sampler="joint", lamp_edges=edges).image for s in range(6)
        ]
        noise[edges] = np.var(images, axis=0, ddof=1).mean((0, 1))
    assert (noise["refined"] < 1.3 * noise["sampled"]).all()


def test_media_that_glow_may_be_as_bright_as_lamps():
    glowing = replace(homogeneous(0.5, 0.0), emission=ConstVolume((9.0,)))
    fog = box((-2.0, -2.0, -2.0), (2.0, 2.0, -0.5), glowing)
    assert clvol.plan(seen([plate(), fog])).in_force["lamp_edges"] == "none"


BAND = np.full((16, 32, 3), 0.1, np.float32)
BAND[6:10] = RADIANCE


@pytest.mark.parametrize("sky", ["none", "bright", "sun", "map"])
def test_lamps_that_do_not_outshine_are_left_alone(sky):
    """Before a sky of their radiance a lamp's edge has no noise, and refining it would make some."""
    lights = {
        "none": (),
        "bright": (ConstantEmitter((RADIANCE,)),),
        "map": (EnvmapEmitter(BAND, np.eye(4)),),
        "sun": (DirectionalEmitter((3 * RADIANCE,), (0.0, 0.0, 1.0)),),
    }[sky]
    pictures = [
        clvol.render(seen([plate()], lights), spp=4, seed=1, lamp_edges=edges).image
        for edges in ("refined", "sampled")
    ]
    assert np.array_equal(*pictures) == (sky != "none")


def test_a_faint_lamp_beside_a_bright_one_is_left_alone():
    faint = replace(plate(half=0.2), emission=(0.01,))
    behind = surfaced(ball((0.0, 0.0, -20.0), 0.5), BLACK, emission=(RADIANCE,))
    pictures = [
        clvol.render(seen([faint, behind], max_depth=4), spp=4, seed=1, lamp_edges=edges).image
        for edges in ("refined", "sampled")
    ]
    assert np.array_equal(*pictures)


def test_bits_do_not_depend_on_the_pool():
    scene = smoky(plate())
    pictures = [clvol.render(scene, spp=8, seed=5, sampler="joint", pool=pool).image for pool in (1024, 4096)]
    assert np.array_equal(*pictures)


def test_the_camera_behind_a_lamp_sees_no_edge_of_it():
    """A lamp that reaches behind the camera: nobody says where in the film it is, so all is looked at."""
    scene = seen(
        [replace(plate(), to_world=clvol.rotate([1, 0, 0], 90) @ clvol.translate([0, 0, 1]) @ clvol.scale(9))]
    )
    pictures = [
        clvol.render(scene, spp=2048, seed=seed, lamp_edges=edges)
        for seed, edges in ((41, "refined"), (42, "sampled"))
    ]
    assert pictures[0].image.max() > 0
    assert_same_picture(*pictures, tile=1)
