"""Area lights with textures: what is seen of them, and what they send to a floor, against quadrature."""

import numpy as np
import pytest
from tiers import quick_first

import clvol

PIXELS = np.array([[[4, 0, 1], [0, 0, 0]], [[0.5, 2, 1], [30, 9, 1]], [[1, 1, 0], [0, 3, 2]]], np.float32)
BITMAP = {"type": "bitmap", "bitmap": PIXELS, "raw": True, "filter_type": "nearest", "wrap_mode": "clamp"}
BOARD = {
    "type": "checkerboard",
    "color0": {"type": "rgb", "value": [5, 1, 0]},
    "color1": {"type": "rgb", "value": [0, 1, 3]},
    "to_uv": clvol.scale([3, 2, 1]),
}
POINT = np.array([0.3, 0.2, 0.0])
DOWN = clvol.translate([0.1, -0.2, 1.5]) @ clvol.rotate([1, 0, 0], 170.0) @ clvol.scale([0.8, 0.5, 1.0])


def bitmap_at(u, v):
    x, y = np.minimum((u * 2).astype(int), 1), np.minimum((v * 3).astype(int), 2)
    return PIXELS[y, x]


def board_at(u, v):
    right, upper = (3 * u) % 1 > 0.5, (2 * v) % 1 > 0.5
    return np.where((right == upper)[..., None], [5, 1, 0], [0, 1, 3])


def midpoints(n):
    return np.meshgrid((np.arange(n) + 0.5) / n, (np.arange(n) + 0.5) / n, indexing="ij")


def rectangle(u, v):
    """Points, normals and weights of a rectangle's (u, v)."""
    return np.stack([2 * u - 1, 2 * v - 1, 0 * u], -1), np.broadcast_to([0.0, 0, 1], (*u.shape, 3)), 4.0


def disk(u, v):
    p = np.stack([u * np.cos(2 * np.pi * v), u * np.sin(2 * np.pi * v), 0 * u], -1)
    return p, np.broadcast_to([0.0, 0, 1], (*u.shape, 3)), 2 * np.pi * u


def sphere(u, v):
    turn, polar = 2 * np.pi * u, np.pi * v
    p = np.stack([np.sin(polar) * np.cos(turn), np.sin(polar) * np.sin(turn), np.cos(polar)], -1)
    return p, p, 2 * np.pi**2 * np.sin(polar)


BALL = clvol.translate([0.2, 0.4, 1.2]) @ clvol.rotate([1, 1, 0], 40.0) @ clvol.scale(0.5)
CELLS = {  # the bitmap's texels, as cells of a volume round the rectangle
    "type": "gridvolume",
    "data": PIXELS[None],
    "filter_type": "nearest",
    "to_world": DOWN @ clvol.translate([-1, -1, -0.5]) @ clvol.scale([2, 2, 1]),
}
LIGHTS = {
    "volume": ("rectangle", DOWN, {"type": "volume", "volume": CELLS}, bitmap_at, rectangle),
    "rectangle": ("rectangle", DOWN, BITMAP, bitmap_at, rectangle),
    "disk": ("disk", DOWN, BOARD, board_at, disk),
    "sphere": ("sphere", BALL, BOARD, board_at, sphere),
}


def exact(to_world, value, surface, n=600):
    """Irradiance at POINT from above, by the midpoint rule."""
    u, v = midpoints(n)
    p, normal, weight = surface(u, v)
    world = p @ to_world[:3, :3].T + to_world[:3, 3]
    cofactor = np.linalg.inv(to_world[:3, :3]).T * np.linalg.det(to_world[:3, :3])
    area = normal @ cofactor.T * (np.broadcast_to(weight, u.shape) / n**2)[..., None]
    to = POINT - world
    square = (to**2).sum(-1)
    facing = np.maximum((area * to).sum(-1), 0) * np.maximum(-to[..., 2], 0) / square**2
    return (facing[..., None] * value(u, v)).sum((0, 1))


@quick_first("name", LIGHTS)
def test_a_floor_has_the_irradiance_of_the_texture(name):
    kind, to_world, texture, value, surface = LIGHTS[name]
    sensor = {
        "type": "perspective",
        "fov": 0.01,
        "to_world": clvol.look_at([1.1, -0.7, 0.3], POINT, [0, 0, 1]),
        "film": {"type": "hdrfilm", "width": 16, "height": 16, "rfilter": {"type": "box"}},
    }
    white = {"type": "diffuse", "reflectance": 1.0}
    parts = {
        "sensor": sensor,
        "integrator": {"type": "path", "max_depth": 2},
        "lamp": {"type": kind, "to_world": to_world, "emitter": {"type": "area", "radiance": texture}},
        "floor": {"type": "rectangle", "to_world": clvol.scale(9.0), "bsdf": white},
    }
    scene = clvol.load_dict({"type": "scene", **parts})
    result = clvol.render(scene, spp=4096, seed=1)
    mean, error = result.image.mean((0, 1)), np.sqrt(result.variance.sum((0, 1))) / 256
    expected = exact(to_world, value, surface) / np.pi
    assert (error < 2.5e-3 * expected.max()).all()
    assert (np.abs(mean - expected) < 4.5 * error + 5e-4 * expected.max()).all(), (mean, expected, error)


def test_a_camera_sees_the_texture():
    sensor = {
        "type": "orthographic",
        "to_world": clvol.look_at([0, 0, 3], [0, 0, 0], [0, 1, 0]),
        "film": {"type": "hdrfilm", "width": 2, "height": 2, "rfilter": {"type": "box"}},
    }
    texture = BITMAP | {"bitmap": PIXELS[:2]}
    lamp = {"type": "rectangle", "emitter": {"type": "area", "radiance": texture}}
    image = clvol.render(clvol.load_dict({"type": "scene", "s": sensor, "lamp": lamp}), spp=16).image
    assert np.allclose(image, PIXELS[1::-1], atol=1e-6)  # rows of a picture go down, v goes up


def lamp_of(radiance, kind="area"):
    lamp = {"type": "sphere", "emitter": {"type": kind, "radiance": radiance}}
    return clvol.load_dict({"type": "scene", "s": {"type": "perspective"}, "lamp": lamp})


def test_a_directional_area_is_black_which_is_said():
    scene = lamp_of(3.0, "directionalarea")
    assert scene.shapes[0].emission == (0.0,) and "black" in scene.approximated[0]
    assert scene.shapes[0].bsdf.reflectance == (0.0,)


@pytest.mark.parametrize(
    ("radiance", "message"),
    [
        ({"type": "mesh_attribute", "name": "vertex_a"}, "'radiance' of emitter 'area' must be"),
        (BITMAP | {"bitmap": -PIXELS}, r"texels must be in \[0, 1e\+15\]"),
        (BITMAP | {"bitmap": PIXELS * np.inf}, "texels must be in"),
        (BOARD | {"color0": -1.0}, "'color0'"),
        ({"type": "null"}, "takes no bsdf|must be"),
    ],
    ids=lambda value: "",
)
def test_mistakes_are_named(radiance, message):
    with pytest.raises(clvol.SceneError, match=message), np.errstate(invalid="ignore"):
        lamp_of(radiance)


@pytest.mark.parametrize("texture", [BITMAP, BOARD], ids=["bitmap", "checkerboard"])
def test_a_reflectance_beyond_one_is_refused_though_a_light_may_have_it(texture):
    shape = {"type": "sphere", "bsdf": {"type": "diffuse", "reflectance": texture}}
    with pytest.raises(clvol.SceneError, match=r"must be in \[0, 1\]"):
        clvol.load_dict({"type": "scene", "s": {"type": "perspective"}, "a": shape})
