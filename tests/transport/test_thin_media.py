"""Media much thinner than single precision tells apart from where the camera is.

Entry and exit are measured from close by, so that a slab of one optical depth looks alike down to a hundredth
of a micrometre.
"""

from dataclasses import replace

import numpy as np
import pytest
from pictures import assert_mean, ball, box, camera_rays, gridded, homogeneous, picture, volume
from surface_scenes import SKY, SPECK, mesh_box, surfaced
from tiers import quick_first

import clvol
from clvol.scene.materials import Diffuse
from clvol.scene.records import ConstVolume

EYE = (0.1, 0.2, -0.97)
RAMP = np.broadcast_to((2 * (np.arange(8) + 0.5) / 8)[:, None, None], (8, 8, 8))  # across the slab, mean 1
THICKNESSES = (1e-6, 1e-8)


def slab(thickness, kind, albedo=0.0, **more):
    """A box of optical depth 1 straight through, in the middle of the scene."""
    lower, upper = (-0.5, -0.5, -thickness / 2), (0.5, 0.5, thickness / 2)
    if kind == "homogeneous":
        medium = homogeneous(1 / thickness, albedo)
    else:
        medium = gridded(volume(RAMP, lower, upper), albedo, scale=1 / thickness)
    return box(lower, upper, replace(medium, **more))


def view(shapes, surfaces, fov=1e-4):
    """Through a window so small that all rays are alike.

    A surface far off, if asked for, makes rays go from surface to surface.
    """
    far = [surfaced(ball((0.0, 5.0, 0.0), SPECK), Diffuse((0.0,)))] if surfaces else []
    return picture([*shapes, *far], [SKY], EYE, (0, 0, 0), fov)


def slant(scene):
    """Path length through a slab of thickness 1, over 1."""
    _, directions, _ = camera_rays(scene, 1)
    return 1 / directions[0, 0, 0, 2]


def rendered(scene):
    return clvol.render(scene, spp=4096, seed=2, sampler="sobol")


@pytest.mark.contract
@pytest.mark.parametrize("surfaces", [False, True], ids=["alone", "surfaces"])
@pytest.mark.parametrize("kind", ["homogeneous", "grid"])
def test_a_thin_slab_absorbs_and_emits_like_a_thick_one(kind, surfaces):
    for thickness in THICKNESSES:
        scene = view([slab(thickness, kind, emission=ConstVolume((3.0,)))], surfaces)
        share = np.exp(-slant(scene))
        assert_mean(rendered(scene), share + 3.0 * (1 - share))


@quick_first("surfaces", [False, True], ids=["alone", "surfaces"])
def test_a_thin_ball_absorbs_like_a_thick_one(surfaces):
    for radius in (1e-5, 1e-6):
        scene = view([ball((0.0, 0.0, 0.0), radius, homogeneous(1 / radius))], surfaces, fov=2 * radius)
        assert_mean(rendered(scene), np.exp(-2.0))


@pytest.mark.contract
@pytest.mark.parametrize("kind", ["homogeneous", "grid"])
def test_a_thin_slab_scatters_like_a_thick_one(kind):
    """The same random numbers make the same paths, scaled."""
    images = [
        clvol.render(view([slab(thickness, kind, albedo=0.5)], True), spp=256, seed=2).image
        for thickness in (1e-4, 1e-8)
    ]
    assert abs(images[0] - images[1]).mean() < 2e-3
    assert 0.5 < images[0].mean() < 0.6
    furnace = clvol.render(view([slab(1e-8, kind, albedo=1.0)], True), spp=64, seed=2).image
    assert abs(furnace - 1).max() < 1e-5


def shifted(shape, offset):
    medium = shape.interior
    if hasattr(medium.sigma_t, "index_to_world"):
        to_world = clvol.translate(offset) @ medium.sigma_t.index_to_world
        medium = replace(medium, sigma_t=replace(medium.sigma_t, index_to_world=to_world))
    return replace(shape, interior=medium, to_world=clvol.translate(offset) @ shape.to_world)


def opposite(offset):
    return surfaced(ball(tuple(-x for x in offset), SPECK), Diffuse((0.0,)))


@quick_first("kind", ["homogeneous", "grid"])
def test_places_in_a_thin_slab_are_refused_where_rounding_takes_them(kind):
    """Far from the centre only: what scatters there would leave the slab by rounding alone."""
    offset = (0.0, 0.0, 4.0)
    thin, thick = (
        picture([shifted(slab(h, kind, 0.5), offset), opposite(offset)], [SKY], (0, 0, 9), (0, 0, 0))
        for h in (1e-6, 1e-3)
    )
    with pytest.raises(clvol.Error, match="too thin to scatter or vary"):
        clvol.render(thin, spp=1)
    clvol.render(thick, spp=1)


def test_a_thin_uniform_slab_absorbs_anywhere():
    offset = (0.0, 0.0, 4.0)
    eye = np.add(EYE, offset)
    shapes = [shifted(slab(1e-6, "homogeneous"), offset), opposite(offset)]
    scene = picture(shapes, [SKY], eye, offset, 1e-4)
    assert_mean(rendered(scene), np.exp(-slant(scene)))


def test_a_thin_boundary_is_warned_of(caplog):
    """A mesh is met where it is: entry and exit are rounded each."""
    pane = mesh_box((-1, -1, 0), (1, 1, 1e-6), homogeneous(1.0))
    scene = picture([replace(pane, name="pane")], [SKY], EYE, (0, 0, 0))
    clvol.render(scene, spp=1)
    assert "pane bounds a medium and is 2e-06 thick, too thin to be measured" in caplog.text


def test_the_view_of_a_ray_knows_how_thin_a_slab_is():
    scene = view([slab(1e-8, "homogeneous")], surfaces=False)
    shown = clvol.trace_ray(scene, 2, 2, techniques=["delta"], transmittances=["ratio"])
    assert shown.place.length == pytest.approx(1e-8 * slant(scene), rel=1e-5)
    assert shown.depth[0, -1] == pytest.approx(slant(scene), rel=1e-4)
