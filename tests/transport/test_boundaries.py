"""Media bounded by meshes, spheres and solids: what a ray passes through is what METHODS §6 says.

Most pictures here show a sky of radiance 1 through absorbing media, held to the optical depths of an oracle
that shares no code with the renderer (`surface_scenes`).  Unless a test says otherwise its false-alarm rate
is 1e-4 at fixed seeds, and a picture off by 0.5 % on the mean would be rejected; of a single arrangement,
one off by 1 %, and all of them together if they shared a bias of 0.5 %.
"""

import functools
import logging
from dataclasses import replace

import numpy as np
import pytest
import trimesh
from pictures import assert_matches, assert_pooled, ball, box, box_interval, camera_rays, hg, homogeneous
from stat_tests import assert_same_picture, image_mean, largest_z
from surface_scenes import (
    GLASS,
    SKY,
    crossings,
    found,
    icosphere,
    mesh_box,
    meshed,
    sampled,
    seen_sky,
    solid_grid,
    surfaced,
)
from tiers import quick_where

from clvol import render
from clvol.device import programs
from clvol.errors import SceneError
from clvol.scene import boundaries
from clvol.scene.materials import Dielectric, Diffuse
from clvol.scene.records import DirectionalEmitter

SPP = 1 << 13
BLACK = Diffuse((0.0,))
OUTSIDE, MIDDLE = (0.13, 0.21, -4.0), (0.03, 0.04, -0.1)
TORUS = trimesh.creation.torus(0.7, 0.3, 14, 8).apply_transform(
    trimesh.transformations.rotation_matrix(1.3, (1, 0.1, 0))
)


def fog(sigma=0.5, **more):
    return homogeneous(sigma, 0.0, **more)


def grid_fog(sigma=0.5, reach=3.0):
    return solid_grid(sigma, (-reach, -reach, -reach), (reach, reach, reach))


def show(shapes, spp=SPP, seed=1, **view):
    return render(sampled(shapes, **view), spp=spp, seed=seed, transmittance="ratio", majorant="grid")


def pictured(shapes, seed=1, bias=0.01, **view):
    """Result and oracle, with the paths it takes.

    Each arrives or does not, which is all there is of variance.
    """
    answer = seen_sky(sampled(shapes, **view), shapes)
    share = answer.mean()
    paths = (1 - share) / share * (2.2 * largest_z(1) / bias) ** 2
    return show(shapes, int(np.ceil(paths / answer.size)), seed, **view), answer


def assert_oracle(shapes, **view):
    assert_matches(*pictured(shapes, **view), bias=0.01)


# -- absorbing media of every kind of boundary ---------------------------------------------------------

A, B, C = fog(0.15), fog(0.3), fog(0.5)
SOLID = surfaced(ball((0.3, 0.1, -0.2), 0.3), BLACK)

ARRANGEMENTS = {
    "an icosphere": [icosphere(medium=A)],
    "a grid in an icosphere": [icosphere(medium=grid_fog())],
    "a torus, several times through": [meshed(TORUS, C)],
    "a torus of grid": [meshed(TORUS, grid_fog(1.0))],
    "a sphere with a bubble": [ball((0, 0, 0), 1.0, B), replace(ball((0.2, 0.1, 0), 0.5), exterior=B)],
    "a mesh with a mesh bubble": [icosphere(medium=B), icosphere((0.2, 0.1, 0), 0.4, exterior=B)],
    "B replaces A": [icosphere(medium=A), replace(icosphere((0.2, 0, 0), 0.4, C), exterior=A)],
    "B replaces an interval": [
        box((-1, -1, -1), (1, 1, 1), A),
        replace(ball((0.2, 0, 0), 0.4, C), exterior=A),
    ],
    "B adds to A": [icosphere(medium=A), icosphere((0.6, 0, 0), 0.8, B)],
    "a grid adds to a medium": [icosphere(medium=A), icosphere((0.6, 0, 0), 0.8, grid_fog(0.6))],
    "three deep": [
        icosphere(medium=A, radius=1.1),
        replace(ball((0, 0, 0), 0.8, B), exterior=A),
        replace(mesh_box((-0.3, -0.3, -0.3), (0.3, 0.4, 0.3), C), exterior=B),
    ],
    "three deep, the middle unnamed": [
        icosphere(medium=A, radius=1.1),
        replace(icosphere(radius=0.7, medium=B)),
        replace(mesh_box((-0.3, -0.3, -0.3), (0.3, 0.4, 0.3), C), exterior=A),
    ],
    "one medium in three meshes": [
        icosphere((-0.4, 0, 0), 0.6, A),
        icosphere((0.4, 0.1, 0), 0.7, A),
        icosphere((0, 0.5, 1.5), 0.5, A),
    ],
    "one grid in two meshes": (lambda g: [icosphere((-0.3, 0, 0), 0.6, g), icosphere((0.4, 0.1, 0), 0.7, g)])(
        grid_fog(0.8)
    ),
    "one medium in two cubes": [box((-1, -1, -1), (0.4, 1, 1), A), box((-0.3, -0.8, -1), (1, 1, 1), A)],
    "a solid": [icosphere(medium=B), SOLID],
    "a solid that names what is round it": [icosphere(medium=B), replace(SOLID, exterior=B)],
    "a solid through the boundary": [icosphere(medium=B), surfaced(ball((0.9, 0.1, -0.2), 0.4), BLACK)],
    "matched glass": [surfaced(icosphere(medium=B), Dielectric(1.0, 1.0)), icosphere((0.2, 0, 0), 0.4, A)],
}


CAMERA_INSIDE = {"eye": MIDDLE, "target": (0.2, 0.3, 5.0), "fov": 70.0}
INSIDE = [
    "an icosphere",
    "a grid in an icosphere",
    "a sphere with a bubble",
    "B replaces A",
    "B replaces an interval",
    "B adds to A",
    "three deep",
    "one grid in two meshes",
    "a solid",
    "matched glass",
]


CASES = [*((name, "outside") for name in ARRANGEMENTS), *((name, "inside") for name in INSIDE)]


@functools.cache
def arrangement(*case):
    """Each with a seed of its own, so that their errors are independent."""
    view = CAMERA_INSIDE if case[1] == "inside" else {"fov": 16.0}
    return pictured(ARRANGEMENTS[case[0]], seed=100 + CASES.index(case), **view)


@quick_where("case", CASES, ("B replaces A", "inside").__eq__, ids=", ".join)
def test_media_are_where_their_boundaries_say(case):
    """The camera finds by itself what it is inside of."""
    assert_matches(*arrangement(*case), bias=0.01)


@pytest.mark.contract
@pytest.mark.parametrize("where", ["outside", "inside"])
def test_no_bias_is_shared_by_all_arrangements(where):
    assert_pooled([arrangement(*case) for case in CASES if case[1] == where])


@pytest.mark.contract
def test_a_boundary_between_the_eye_and_the_near_plane_has_been_passed():
    shapes = ARRANGEMENTS["three deep"]
    scene = sampled(shapes)
    scene = replace(scene, sensor=replace(scene.sensor, near_clip=3.4))  # inside A, before B
    result = render(scene, spp=2 * SPP, transmittance="ratio", majorant="grid")
    assert_matches(result, seen_sky(scene, shapes))


def test_masks_that_hold_nothing_are_noticed(monkeypatch):
    """Power: a medium that is there whatever its boundaries say, and one that stays behind a crossing."""
    name = "B replaces A"
    original = boundaries.Boundaries.masks

    def without_exteriors(found):
        masks = original(found)
        masks[:, 1] = 0
        return masks

    monkeypatch.setattr(boundaries.Boundaries, "masks", without_exteriors)
    for view in {}, CAMERA_INSIDE:
        with pytest.raises(AssertionError, match="deviates"):
            assert_oracle(ARRANGEMENTS[name], **view)


@pytest.mark.contract
@pytest.mark.parametrize(
    ("old", "new", "view"),
    [
        ("dot_of(ng, d) < 0.0f", "dot_of(ng, d) > 0.0f", {"fov": 16.0}),
        ("inside->word[shape->boundary >> 5] |= bit", "(void)bit", {"fov": 16.0}),
        ("dot_of(surface.ng, ray.d) > 0.0f", "dot_of(surface.ng, ray.d) < 0.0f", CAMERA_INSIDE),
    ],
    ids=["the wrong way round", "never inside", "the camera outside"],
)
def test_a_boundary_crossed_wrongly_is_noticed(old, new, view, monkeypatch):
    """Power: errors planted in the kernels' crossings, and in what a camera finds."""
    original = programs.kernel_source

    def source(name):
        text = original(name)
        if name != "stages/boundary.h":
            return text
        assert text.count(old) == 1
        return text.replace(old, new)

    monkeypatch.setattr(programs, "kernel_source", source)
    with pytest.raises(AssertionError, match="deviates"):
        assert_oracle(ARRANGEMENTS["a sphere with a bubble"], **view)


# -- infinite media, glass -----------------------------------------------------------------------------


def test_a_medium_that_is_only_ever_an_exterior_is_everywhere_else():
    """Nothing of the sky gets through, and a lamp is dimmed but for the clear bubble on the way."""
    shapes = [replace(icosphere(), exterior=A)]
    for eye in OUTSIDE, MIDDLE:
        assert (show(shapes, spp=256, eye=eye).image == 0).all()
    lamp = surfaced(ball((0, 0, 3), 0.5), BLACK, emission=(2.0,))
    scene = sampled(
        [*shapes, lamp], (SKY,), eye=(0.11, 0.07, -2.0), target=(0.11, 0.07, 3), fov=0.01, size=(2, 2)
    )
    way = 5.0 - np.sqrt(0.25 - 0.11**2 - 0.07**2) - _chord(shapes[0], (0.11, 0.07, -2.0))
    result = render(scene, spp=3 << 16, transmittance="ratio", majorant="grid")
    assert_matches(result, 2.0 * np.exp(-0.15 * way))


def _chord(shape, eye):
    t, _ = crossings(shape, np.array([eye]), np.array([[0.0, 0.0, 1.0]]))
    return t[0, 1] - t[0, 0]


@pytest.mark.contract
@pytest.mark.parametrize("kind", ["box", "mesh"])
def test_an_absorbing_slab_of_glass_reflects_and_transmits_its_geometric_series(kind):
    """Normal incidence, a sky of 1 on both sides: R + (1 - R)² e / (1 - R e)."""
    reflectance, sigma = 0.04, 0.5
    lower, upper = (-50, -50, 0), (50, 50, 1.0)
    make = box if kind == "box" else mesh_box
    slab = surfaced(make(lower, upper, fog(sigma)), GLASS)
    scene = sampled([slab], eye=(0.1, 0.2, -5.0), target=(0.1, 0.2, 0.0), fov=0.1, size=(2, 2))
    e = np.exp(-sigma)
    answer = reflectance + (1 - reflectance) ** 2 * e / (1 - reflectance * e)
    assert_matches(render(scene, spp=1 << 18, transmittance="ratio", majorant="grid"), answer)


# -- scattering ----------------------------------------------------------------------------------------

LIGHTS = (SKY, DirectionalEmitter((2.0,), (0.6, -0.64, 0.48)))


def scattering(make, **more):
    """A scattering grid with a bubble of something else, in a room of fog, round a solid; lit from aside."""
    grid = solid_grid(1.5, (-1, -1, -1), (1, 1, 1), 0.9, phase=hg(0.5))
    shapes = [
        make((-1, -1, -1), (1, 0.8, 1), grid),
        make((-2, -1.5, -2), (2, 2, 2), homogeneous(0.15, 0.8)),
        surfaced(ball((0.2, -0.2, 0.1), 0.4), Diffuse((0.7,))),
        replace(ball((-0.5, 0.2, -0.4), 0.3, homogeneous(0.5, 0.5)), exterior=grid),
    ]
    return sampled(shapes, LIGHTS, size=(8, 8), **more)


@pytest.mark.contract
def test_media_in_meshes_scatter_as_media_in_intervals():
    a, b = (
        render(scattering(make), spp=1 << 13, seed=seed, transmittance="ratio", majorant="grid")
        for make, seed in ((box, 5), (mesh_box, 6))
    )
    assert a.stats["non_finite"] == b.stats["non_finite"] == 0
    assert_same_picture(a, b, tile=4)
    (mean, variance), (_, other) = image_mean(a), image_mean(b)
    assert (4.2 * np.sqrt(variance + other) < 0.005 * mean).all()


@pytest.mark.contract
def test_a_lens_across_a_boundary_finds_what_each_of_its_rays_is_in():
    results = []
    for make, seed in (box, 7), (mesh_box, 8):
        scene = scattering(make, eye=(0.3, 0.8, -0.3), target=(0.1, -1.0, 0.2))
        scene = replace(scene, sensor=replace(scene.sensor, aperture_radius=0.3, focus_distance=1.0))
        results.append(render(scene, spp=1 << 11, seed=seed, transmittance="ratio", majorant="grid"))
    assert_same_picture(*results, tile=4)


# -- meshes that bound nothing properly ------------------------------------------------------------------


def _flawed(kind):
    sphere = trimesh.creation.icosphere(1, 0.6)
    if kind == "open":
        sphere.update_faces(np.arange(len(sphere.faces)) % 7 != 0)
    elif kind == "inconsistent":
        sphere.faces[::5] = sphere.faces[::5, ::-1]
    elif kind == "inside out":
        sphere.invert()
    return sphere


FLAWS = ["open", "inconsistent", "inside out", "turned by flip_normals"]


@pytest.mark.parametrize("kind", FLAWS)
def test_a_flawed_mesh_neither_makes_light_nor_loses_it_nor_keeps_a_path(kind):
    """Where nothing absorbs, every path reaches the white sky in the end, with all of its weight.

    All but those that meet the black ball inside, which no light passes.
    """
    shape = meshed(_flawed(kind), homogeneous(2.0, 1.0), flip_normals=kind == "turned by flip_normals")
    wide = {"fov": 60.0, "size": (12, 12)}
    alone = render(found([shape], **wide), spp=256, seed=1, transmittance="none", majorant="grid")
    lit = show([shape], spp=256, **wide)
    assert alone.image == pytest.approx(1.0, abs=1e-6)
    mean, variance = image_mean(lit)  # shadow rays pass boundaries by the same rules
    assert (np.abs(mean - 1) < largest_z(3) * np.sqrt(variance)).all() and (variance < 0.001**2).all()
    for result in alone, lit:
        assert result.stats["walks_exhausted"] == result.stats["non_finite"] == 0
    clear = replace(shape, interior=homogeneous(0.5, 0.0))
    solid = surfaced(ball((0.0, 0.0, 0.0), 0.4), BLACK)
    result = show([clear, solid], spp=64, fov=6.0, size=(6, 6))
    assert (result.image == 0).all()


@pytest.mark.parametrize("kind", FLAWS)
def test_a_flawed_mesh_is_named_and_spoils_only_its_own_surroundings(kind, caplog):
    medium = homogeneous(2.0, 0.99)
    shape = meshed(_flawed(kind), medium, name="the leaky one", flip_normals=kind == "turned by flip_normals")
    with caplog.at_level(logging.WARNING, logger="clvol"):
        result = show([shape], spp=256, fov=60.0, size=(12, 12))
    assert "the leaky one" in caplog.text
    assert np.isfinite(result.image).all() and result.stats["non_finite"] == 0
    clear = ~_meets_box(sampled([], fov=60.0, size=(12, 12)), 0.6 * 1.001)
    assert 20 < clear.sum() < 130
    assert (result.image[clear] == 1).all()


@pytest.mark.parametrize("kind", ["proper", "inside out and flipped back", "mirrored"])
def test_a_proper_mesh_is_not_warned_of(kind, caplog):
    shape = meshed(_flawed("proper"), A)
    if kind == "inside out and flipped back":
        shape = replace(meshed(_flawed("inside out"), A), flip_normals=True)
    if kind == "mirrored":
        shape = replace(shape, to_world=np.diag([-1.0, 1.0, 1.0, 1.0]))
    with caplog.at_level(logging.WARNING, logger="clvol"):
        assert_oracle([shape], fov=14.0)
    assert not caplog.text


def test_a_closed_mesh_inside_out_is_turned(caplog):
    """The picture is that of the proper mesh, bit for bit."""
    pictures = [
        show([meshed(_flawed(kind), A, name="the turned one")], spp=64, fov=14.0)
        for kind in ("proper", "inside out")
    ]
    np.testing.assert_array_equal(*(picture.image for picture in pictures))
    assert pictures[0].image.min() < 1
    assert "the turned one bounds a medium, but has triangles that face inwards" in caplog.text


@pytest.mark.parametrize("size", [1e-200, 1e38, 1e300])
def test_a_mesh_scaled_out_of_range_is_an_error_that_names_it(size):
    shape = replace(
        meshed(_flawed("proper"), A, name="the odd one"), to_world=np.diag([size, size, size, 1.0])
    )
    with pytest.raises(SceneError, match="the odd one"):
        show([shape], spp=1)


def _meets_box(scene, half):
    """Whether any of a pixel's rays meets the cube of that half edge, (h, w)."""
    o, d, _ = camera_rays(scene, 9)
    enter, leave = box_interval(o, d, (-half,) * 3, (half,) * 3)
    return (leave > enter).any(-1)
