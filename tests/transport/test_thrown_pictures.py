"""Pictures that projectors throw, on a floor and into fog, against closed forms and quadrature in float64."""

import numpy as np
import pytest
from pictures import camera_rays
from stat_tests import largest_z, require_precision, z_score

import clvol

COLOURS = np.array([[[1.0, 0.3, 0.2], [0.2, 0.5, 0.9]]], np.float32)
LEFT_AND_RIGHT = {"type": "bitmap", "bitmap": COLOURS, "filter_type": "nearest"}
FOV, SCALE, EYE, LAMP = 30.0, 5.0, (0.5, 0.5, -3.0), (0.5, 2.5, 0.5)
WHOLE = {"type": "hdrfilm", "width": 8, "height": 8, "rfilter": {"type": "box"}}


def scene_of(irradiance, **more):
    projector = {
        "type": "projector",
        "fov": FOV,
        "scale": SCALE,
        "irradiance": irradiance,
        "to_world": clvol.look_at(LAMP, (0.5, 0.5, 0.5), (0, 0, 1)),
    }
    return clvol.load_dict({"type": "scene", "projector": projector} | more)


def test_a_floor_shows_the_picture_evenly():
    """A diffuse floor across the axis: reflectance · scale · picture / z², whatever the angle."""
    floor = {
        "type": "rectangle",
        "to_world": clvol.translate((0.5, 0.0, 0.5)) @ clvol.rotate((1, 0, 0), -90),
        "bsdf": {"type": "diffuse", "reflectance": 0.6},
    }
    above = clvol.look_at((0.5, 3.0, 0.5), (0.5, 0.0, 0.5), (0, 0, 1))
    sensor = {"type": "orthographic", "to_world": above, "film": WHOLE}
    depth = {"type": "path", "max_depth": 2}
    result = clvol.render(scene_of(LEFT_AND_RIGHT, floor=floor, sensor=sensor, integrator=depth), spp=64)
    # 1.34 wide and half as high on the floor; both look down alike, so that left is left
    expected = np.broadcast_to(np.repeat(COLOURS, 4, axis=1) * 0.6 * SCALE / 2.5**2, (8, 8, 3)).copy()
    edge = np.tan(np.radians(FOV / 2)) * 2.5
    inner = np.s_[3:5, 2:6]
    assert edge > 0.5 and edge / 2 > 0.25
    np.testing.assert_allclose(result.image[inner], expected[inner], rtol=1e-5)
    assert not result.image[[0, 1, 6, 7]].any() and not result.image[:, [0, 7]].any()


def single_scattering(scene, sigma, albedo, nodes=1600):
    """Means of the film's left and right half, float64 (2, 3): rays through the cube (0, 1)³."""
    eye, directions, weights = camera_rays(scene, nodes=12)
    means = np.zeros((2, 3))
    half = np.tan(np.radians(FOV / 2))
    t = (np.arange(nodes) + 0.5) / nodes
    height, width = directions.shape[:2]
    for row, column in np.ndindex(height, width):
        d = directions[row, column]
        enter, leave = 3.0 / d[:, 2:], 4.0 / d[:, 2:]
        at = enter + t * (leave - enter)
        p = np.asarray(eye) + at[..., None] * d[:, None, :]
        away = p - np.array(LAMP)
        depth = -away[..., 1]
        # local +x, the picture's left, is the world's: up (+z) x down
        u, v = 0.5 - away[..., 0] / (2 * half * depth), 0.5 - away[..., 2] / (half * depth)
        inside = (u >= 0) & (u <= 1) & (v >= 0) & (v <= 1)
        distance = np.linalg.norm(away, axis=-1)
        cosine = depth / distance
        intensity = np.where(inside, np.pi * SCALE / cosine**3 / distance**2, 0.0)
        lit = intensity * np.exp(-sigma * ((1 - p[..., 1]) / cosine + at - enter))
        scattered = weights[:, None] * lit * sigma * albedo / (4 * np.pi) * (leave - enter) / nodes
        for part, share in enumerate((u < 0.5, u >= 0.5)):
            means[2 * column // width] += COLOURS[0, part] * (scattered * share).sum() * 2 / (height * width)
    return means


@pytest.mark.contract
@pytest.mark.parametrize("lanes", ["8", "off"])
def test_fog_shows_the_beam(lanes):
    sigma, albedo = 1.5, 0.8
    box = clvol.translate((0.5, 0.5, 0.5)) @ clvol.scale(0.5)
    volume = {"type": "gridvolume", "data": np.full((6, 6, 6), sigma)}
    fog = {"type": "heterogeneous", "sigma_t": volume, "albedo": albedo}
    cube = {"type": "cube", "to_world": box, "bsdf": {"type": "null"}, "interior": fog}
    view = clvol.look_at(EYE, (0.5, 0.5, 0.5), (0, 1, 0))
    film = WHOLE | {"width": 4, "height": 4}
    sensor = {"type": "perspective", "fov": 13.0, "to_world": view, "film": film}
    limit = {"type": "volpath", "max_depth": 2}
    scene = scene_of(LEFT_AND_RIGHT, cube=cube, sensor=sensor, integrator=limit)
    result = clvol.render(scene, spp=1 << 18, seed=3, lanes=lanes)
    found = result.image.astype(float).reshape(4, 2, 2, 3).mean((0, 2))
    variance = result.variance.astype(float).reshape(4, 2, 2, 3).sum((0, 2)) / 64
    expected = single_scattering(scene, sigma, albedo)
    require_precision(np.sqrt(variance), 0.005 / 3 * expected, lanes)
    # quadrature across the beam's edge is right to 1e-4
    z = z_score(found, variance + (1e-4 * expected) ** 2, expected)
    assert np.abs(z).max() < largest_z(2 * z.size)
