"""Pictures of what camera paths first meet: depth, normal, albedo and position, against geometry."""

import numpy as np
import pytest
from fields import FIELDS
from pictures import ball, camera_rays, gridded, homogeneous, picture, volume
from stat_tests import largest_z
from tiers import quick_first

import clvol
from clvol.scene.materials import Dielectric, Diffuse, Plastic
from clvol.scene.records import ConstantEmitter, Shape

FIRST_HIT = ("depth", "normal", "albedo", "position")
SKY = (ConstantEmitter(),)
EYE, TARGET = (0.0, 0.0, 4.0), (0.0, 0.0, 0.0)
RED = (0.8, 0.2, 0.1)


def wall(z, bsdf, half=10.0, offset=(0.0, 0.0, 0.0)):
    to_world = np.diag([half, half, 1.0, 1.0])
    to_world[:3, 3] = np.add((0.0, 0.0, z), offset)
    return Shape("rectangle", to_world, bsdf=bsdf)


@pytest.mark.parametrize("offset", [(0.0, 0.0, 0.0), (4e5, -3e5, 2e5)])
def test_a_wall_shows_its_distance_normal_colour_and_place(offset):
    shapes = [wall(-1.0, Diffuse(RED), offset=offset), ball(np.add((0, 0, 2), offset), 0.5)]
    scene = picture(shapes, SKY, np.add(EYE, offset), np.add(TARGET, offset), size=(6, 6))
    result = clvol.render(scene, spp=64, aov=FIRST_HIT)
    eye, directions, weights = camera_rays(scene)
    t = (np.array(offset)[2] - 1.0 - eye[2]) / directions[..., 2]
    points = eye + t[..., None] * directions
    # samples fall anywhere in a pixel: their mean lies within a fraction of a pixel of the pixel's mean
    assert np.allclose(result.aovs["depth"], t @ weights, rtol=2e-3)
    assert np.allclose(result.aovs["position"], np.einsum("hwnc,n->hwc", points, weights), atol=0.12)
    assert np.allclose(result.aovs["position"][..., 2], offset[2] - 1.0, atol=1e-5 + 1e-7 * abs(offset[2]))
    assert np.allclose(result.aovs["normal"], (0, 0, 1), atol=1e-6)
    assert np.allclose(result.aovs["albedo"], RED, atol=1e-6)


def test_coats_show_their_base_glass_its_tint_and_nothing_shows_zero():
    half = wall(0.0, Plastic(RED), half=1.0, offset=(-1.0, 0, 0))
    glass = wall(0.0, Dielectric(specular_reflectance=(0.9,)), half=1.0, offset=(1.0, 0, 0))
    result = clvol.render(picture([half, glass], SKY, EYE, TARGET, fov=60, size=(8, 8)), spp=4, aov=FIRST_HIT)
    albedo = result.aovs["albedo"]
    assert np.allclose(albedo[4, 3], RED) and np.allclose(albedo[4, 4], 0.9)
    for name in FIRST_HIT:
        assert (result.aovs[name][0] == 0).all()


@quick_first("technique", ["delta", "spectral", "regular"])
def test_media_show_their_first_collisions_in_every_technique(technique):
    values = FIELDS["ramp"]()
    medium = gridded(volume(values, (-1, -1, -1), (1, 1, 1)), RED, scale=(0.5, 1.0, 2.0))
    scene = picture([ball((0, 0, 0), 2.0, medium)], SKY, EYE, TARGET, fov=20, size=(4, 4))
    reference = clvol.render(scene, spp=4096, aov=FIRST_HIT, technique="weighted-delta", seed=1)
    result = clvol.render(scene, spp=4096, aov=FIRST_HIT, technique=technique, seed=2)
    assert (result.aovs["normal"] == 0).all()
    for name in ("depth", "albedo", "position"):
        difference = result.aovs[name] - reference.aovs[name]
        # a sample's spread is below its largest value: 5, or 3 for a path a channel
        bound = largest_z(3) * 5 * np.sqrt(2 / (4096 * 16))
        assert (np.abs(difference.mean((0, 1))) < bound).all(), name
        assert (np.abs(result.aovs[name]).mean((0, 1)) > 0).any()


def test_the_first_hit_costs_nothing_where_it_is_not_asked_for():
    shapes = [ball((0, 0, 0), 1.0, homogeneous(1.0, 0.5))]
    scene = picture(shapes, SKY, EYE, TARGET)
    plain, with_it = clvol.render(scene, spp=16), clvol.render(scene, spp=16, aov=FIRST_HIT)
    assert (plain.image == with_it.image).all()
    assert with_it.stats["bytes_per_slot"] - plain.stats["bytes_per_slot"] == 4 * (1 + 3 + 3 + 3 + 1)
