"""Hard cases: far from the origin, far cameras, very thick and very thin media, huge and tiny scenes."""

from dataclasses import replace

import numpy as np
import pytest
from fields import sparse
from probe import medium_of, scene_of
from stat_tests import assert_same_picture, image_mean, largest_z
from tiers import quick_first

import clvol
from clvol.scene.records import (
    ConstantEmitter,
    ConstVolume,
    DirectionalEmitter,
    EnvmapEmitter,
    Film,
    GridVolume,
    Integrator,
    Perspective,
    PointEmitter,
    ReconstructionFilter,
)

LIGHTS = (ConstantEmitter((0.5,)), DirectionalEmitter((2.0,), (0.6, -0.8, 0.0)))


def lumpy_scene(**keywords):
    values = sparse((24, 24, 24)) + np.float32(0.02)
    return scene_of(medium_of(values, 20.0, 0.8), size=(24, 24), **keywords)


def moved(scene, matrix):
    """The same scene with everything (camera, shape, volume, lights) under a rigid motion and scaling."""
    shape = scene.shapes[0]
    medium, factor = shape.interior, np.cbrt(np.linalg.det(matrix[:3, :3]))
    sigma_t = medium.sigma_t
    if isinstance(sigma_t, GridVolume):
        sigma_t = replace(sigma_t, index_to_world=matrix @ sigma_t.index_to_world)
    medium = replace(medium, sigma_t=sigma_t, scale=medium.scale[0] / factor)
    eye = matrix @ scene.sensor.to_world
    eye[:3, :3] /= factor
    sensor = replace(
        scene.sensor,
        to_world=eye,
        near_clip=scene.sensor.near_clip * factor,
        far_clip=scene.sensor.far_clip * factor,
    )
    emitters = tuple(
        replace(e, position=tuple((matrix @ [*e.position, 1])[:3]), intensity=(e.intensity[0] * factor**2,))
        if isinstance(e, PointEmitter)
        else e
        for e in scene.emitters
    )
    shape = replace(shape, to_world=matrix @ shape.to_world, interior=medium)
    return replace(scene, sensor=sensor, shapes=(shape,), emitters=emitters)


@quick_first("offset", [1e6, -3e7])
def test_a_scene_far_from_the_origin_looks_the_same(offset):
    """Positions are taken relative to the scene in double: not even the noise changes much."""
    scene = lumpy_scene(emitters=(*LIGHTS, PointEmitter((0.4,), (0.2, 1.4, 0.1))))
    here = clvol.render(scene, spp=16)
    there = clvol.render(moved(scene, clvol.translate([offset, 2 * offset, -offset])), spp=16)
    assert_same_picture(here, there)
    assert np.abs(here.image - there.image).mean() < 0.02 * here.image.mean()


@pytest.mark.parametrize("factor", [1e-6, 1e6])
def test_the_unit_of_length_does_not_matter(factor):
    scene = lumpy_scene(emitters=(*LIGHTS, PointEmitter((0.4,), (0.2, 1.4, 0.1))))
    a, b = (clvol.render(s, spp=32) for s in (scene, moved(scene, clvol.scale(factor))))
    assert_same_picture(a, b)


def test_a_camera_a_million_lengths_away_sees_the_cloud_sharply():
    """Rays start on a plane just before the scene: pixels stay distinct and the silhouette exact."""
    distance, edge = 1e6, 1.25
    eye = np.eye(4)
    eye[:3, 3] = 0.5, 0.5, -distance
    fov = 2 * np.degrees(np.arctan(edge / 2 / (distance + 0.5)))
    sensor = Perspective(eye, fov, near_clip=1.0, far_clip=1e9)
    medium = medium_of(np.full((8, 8, 8), 1.0, np.float32), 3.0, 0.0)
    result = clvol.render(scene_of(medium, size=(20, 20), sensor=sensor), spp=400)
    inside = np.zeros((20, 20), bool)
    inside[2:18, 2:18] = True  # the unit cube over 20 / 1.25 = 16 pixels
    assert (result.image[~inside] == 1.0).all()
    z = (result.image[inside] - np.exp(-3.0)) / np.sqrt(result.variance[inside])
    assert np.abs(z).max() < largest_z(z.size)


def test_a_medium_beyond_the_far_plane_is_not_entered():
    scene = lumpy_scene()
    scene = replace(scene, sensor=replace(scene.sensor, far_clip=1.0))
    assert (clvol.render(scene, spp=1).image == 1.0).all()


@pytest.mark.parametrize("as_grid", [False, True])
def test_a_very_thick_white_medium_loses_no_energy(as_grid):
    """Optical thickness 150, albedo 1, no depth cap: every path comes out again, if after 10⁴ bounces."""
    values = np.full((4, 4, 4), 1.0, np.float32) if as_grid else 1.0
    result = clvol.render(scene_of(medium_of(values, 150.0, 1.0), size=(4, 4)), spp=8)
    mean, variance = image_mean(result)
    assert np.abs(mean - 1).max() < 1e-6 + 4 * np.sqrt(variance.max())
    assert result.stats["energy_lost_to_caps"] == 0


@pytest.mark.contract
@pytest.mark.parametrize("scale", [1e-7, 1e-5, 1e-3])
def test_a_very_thin_medium_scatters_as_often_as_it_should(scale):
    """Radiance under one directional light is proportional to the optical thickness, however small."""
    light = (DirectionalEmitter((1.0,), (0.0, -1.0, 0.0)),)
    scene = scene_of(medium_of(1.0, scale, 1.0), emitters=light, size=(1, 1))
    scene = replace(scene, sensor=replace(scene.sensor, fov=0.01))
    spp = 1 << 24 if scale < 1e-4 else 1 << 20
    mean, _ = image_mean(clvol.render(scene, spp=spp))
    expected = -np.expm1(-scale) / (4 * np.pi)
    # collisions are rare events: Poisson, so the variance comes from the expectation
    error = np.sqrt(expected / (4 * np.pi) / spp)
    assert abs(mean[0] - expected) < largest_z(3) * error + 1e-3 * expected


def test_cutting_paths_is_reported():
    scene = lumpy_scene(emitters=LIGHTS, integrator=Integrator(max_depth=2))
    stats = clvol.render(scene, spp=4).stats
    assert stats["paths_cut_by_max_depth"] > 0
    assert 0 < stats["energy_lost_to_caps"] < 1


def test_nothing_in_an_image_is_nan_and_a_nan_would_be_counted(monkeypatch):
    scene = lumpy_scene(emitters=LIGHTS)
    result = clvol.render(scene, spp=4)
    assert np.isfinite(result.image).all() and result.stats["non_finite"] == 0
    broken = replace(scene, emitters=(ConstantEmitter((float("nan"),)),))
    result = clvol.render(broken, spp=4)
    assert result.stats["non_finite"] > 0, "never replaced silently"
    assert not np.isfinite(result.image).all()


def test_a_vacuum_is_invisible_and_free():
    result = clvol.render(scene_of(medium_of(np.zeros((9, 9, 9), np.float32))), spp=2)
    assert (result.image == 1.0).all() and result.stats["lookups"] == 0


def test_a_medium_of_sigma_t_zero_is_invisible():
    result = clvol.render(scene_of(medium_of(0.0)), spp=2)
    assert (result.image == 1.0).all()


def test_constvolume_in_a_heterogeneous_medium_is_clipped_to_its_box():
    """Mitsuba's rule: a number as sigma_t fills the unit cube under its to_world."""
    medium = replace(medium_of(2.0), homogeneous=False)
    medium = replace(medium, sigma_t=ConstVolume((2.0,), np.diag([1.0, 1.0, 0.5, 1.0])))
    sensor = Perspective(np.array([[1, 0, 0, 0.5], [0, 1, 0, 0.5], [0, 0, 1, -1], [0, 0, 0, 1.0]]), 0.01)
    result = clvol.render(scene_of(medium, size=(2, 2), sensor=sensor), spp=20_000)
    z = (result.image - np.exp(-1.0)) / np.sqrt(result.variance)
    assert np.abs(z).max() < largest_z(z.size)


def test_a_film_too_large_for_the_device_is_a_clear_error():
    scene = lumpy_scene()
    huge = replace(scene, film=replace(scene.film, width=65536, height=65536))
    with pytest.raises(clvol.Error, match=r"film of 4294967296 pixels .* render fewer pixels"):
        clvol.render(huge, spp=1)


def test_the_last_filter_sample_at_the_films_edge_is_still_on_the_film():
    """Cut filters are inverted up to their last bin, whose width may round to nothing.

    Sample 1572998 of a corner column draws it.
    """
    film = Film(16, 16, ReconstructionFilter("gaussian", 7.24, 1.81))
    scene = replace(
        scene_of(medium_of(1.0)), film=film, emitters=(EnvmapEmitter(np.ones((3, 2, 3)), np.eye(4)),)
    )
    result = clvol.render(scene, samples=(1572998, 1))
    assert np.isfinite(result.image).all()


@pytest.mark.contract
def test_a_lamp_far_away_is_a_sun():
    """Lights have no part in the coordinates that positions are taken in."""
    scene, distance = lumpy_scene(emitters=(DirectionalEmitter((2.0,), (0.6, -0.8, 0.0)),)), 1e7
    place = (0.5 - 0.6 * distance, 0.5 + 0.8 * distance, 0.5)
    lamp = replace(scene, emitters=(PointEmitter((2.0 * distance**2,), place),))
    assert_same_picture(clvol.render(scene, spp=256), clvol.render(lamp, spp=256, seed=1), tile=4)


def test_a_coefficient_beyond_floats_is_a_clear_error():
    values = np.full((4, 4, 4), 1e20, np.float32)
    for majorant in ("global", "grid", "kdtree"):
        with pytest.raises(clvol.Error, match="too large for a float"):
            clvol.render(scene_of(medium_of(values, 1e30)), spp=1, majorant=majorant)


def test_energy_lost_to_caps_is_the_share_of_each_path_in_the_image():
    """A path that follows one of three channels is a third of a sample."""
    limit = Integrator(max_depth=2)
    grey = clvol.render(scene_of(medium_of(np.full((3, 3, 3), 3.0), 1.0, 0.9), integrator=limit), spp=256)
    medium = medium_of(np.full((3, 3, 3, 3), [3.0, 3.0, 3.0001]), 1.0, 0.9)
    coloured = clvol.render(scene_of(medium, integrator=limit), spp=256, technique="delta")
    lost = [r.stats["energy_lost_to_caps"] for r in (grey, coloured)]
    assert lost[1] == pytest.approx(lost[0], rel=0.05)
    assert (grey.stats["paths"], coloured.stats["paths"]) == (256 * 64, 3 * 256 * 64)


def test_pictures_of_different_scenes_do_not_merge():
    a = clvol.render(scene_of(medium_of(3.0)), samples=(0, 4))
    b = clvol.render(scene_of(medium_of(9.0)), samples=(4, 4))
    with pytest.raises(clvol.Error, match="different scenes"):
        clvol.merge([a, b])


@pytest.mark.parametrize("options", [{"spp": 2.5}, {"samples": (0.5, 2)}, {"pool": -5}])
def test_numbers_that_make_no_sense_are_refused(options):
    with pytest.raises(clvol.Error):
        clvol.render(scene_of(medium_of(1.0)), **options)
