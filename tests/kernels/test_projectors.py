"""Projectors: what arrives at points, against numbers of Mitsuba 3.9.1 and its formula in float64."""

import numpy as np
import pytest
from probe import Probe, medium_of, scene_of

import clvol
from clvol.scene.materials import Bitmap, Checkerboard
from clvol.scene.records import ProjectorEmitter
from clvol.tables.lights import light_table

RNG = np.random.default_rng(0)
PIXELS = RNG.random((3, 5, 3)).astype(np.float32)
TO_UV = np.array([[2.0, 0.3, 0.1], [0.2, 1.5, -0.2], [0.0, 0.0, 1.0]])
PICTURES = {
    "colour": (1.0, 2.0, 3.0),
    "bitmap": Bitmap(PIXELS, TO_UV, "nearest", "repeat"),
    "checkerboard": Checkerboard((0.9, 0.4, 0.1), (0.2,), TO_UV),
}
PLACE = clvol.look_at([0.4, 0.6, 2.0], [0.5, 0.4, 0.5], [0.2, 1.0, 0.3])
BODY = """
    const LightSample light = sample_light(scene, vload3(i, in0), 0.5f, 0.5f, 0.5f);
    vstore3(light.value, i, out0);
"""


def arriving(device, emitter, points):
    """What `sample_light` says at points of the world, float32 (n, 3)."""
    probe = Probe(device, scene_of(medium_of(1.0, albedo=0.5), [emitter]))
    given = (points - probe.prepared.centre).astype(np.float32)
    [found] = probe.run(
        ["emitter/emitter.h"], BODY, [np.zeros((len(points), 3), np.float32)], [given], stage="shade"
    )
    return found


def shown(picture, uv):
    """The picture at (u, v) after its own to_uv, and whether that is far from a border."""
    if isinstance(picture, tuple):
        return np.broadcast_to(picture, (uv.shape[1], 3)), np.full(uv.shape[1], True)
    u, v = TO_UV[:2, :2] @ uv + TO_UV[:2, 2:]
    rows, columns = picture.pixels.shape[:2] if isinstance(picture, Bitmap) else (2, 2)
    x, y = u * columns, v * rows
    clear = np.minimum(np.abs(x - np.round(x)), np.abs(y - np.round(y))) > 1e-3
    if isinstance(picture, Bitmap):
        return PIXELS[np.floor(y).astype(int) % rows, np.floor(x).astype(int) % columns], clear
    same = (u % 1 > 0.5) == (v % 1 > 0.5)
    return np.where(same[:, None], picture.color0, np.broadcast_to(picture.color1, 3)), clear


@pytest.mark.parametrize("mirrored", [False, True])
@pytest.mark.parametrize("name", PICTURES)
def test_a_projector_throws_its_picture(device, name, mirrored):
    """Mitsuba: pi · scale / (z² cos), with the local z, and a cosine with the axis as long as it is."""
    to_world = PLACE @ clvol.scale([-3.0, 3.0, 3.0]) if mirrored else PLACE
    projector = ProjectorEmitter(PICTURES[name], 2.5, to_world, 40.0)
    points = np.random.default_rng(2).uniform(-1, 2, (4096, 3)).astype(np.float32)
    found = arriving(device, projector, points)
    local = (np.linalg.inv(to_world) @ np.c_[points, np.ones(len(points))].T)[:3]
    half = np.tan(np.radians(20)) * np.array([1.0, 3 / 5 if name == "bitmap" else 1.0])
    uv = 0.5 - 0.5 * local[:2] / local[2] / half[:, None]
    edge = np.abs(np.abs(uv - 0.5) - 0.5).min(axis=0)
    inside = (np.abs(uv - 0.5) < 0.5).all(axis=0) & (local[2] > 0)
    color, clear = shown(PICTURES[name], np.where(inside, uv, 0.3))
    clear &= edge > 1e-4
    away = points - to_world[:3, 3]
    cosine = np.abs(away @ to_world[:3, 2]) / np.linalg.norm(away, axis=1)
    expected = 2.5 * np.pi * color * (inside / (local[2] ** 2 * cosine))[:, None]
    assert 200 < inside[clear].sum() < 3000
    assert np.allclose(found[clear], expected[clear], rtol=1e-4)


MITSUBAS = {  # what its sample_direction gave at (0.1, 0.05, 1), over pi
    "colour": (ProjectorEmitter((1.0, 2.0, 3.0), 2.0, np.eye(4), 40.0), (2.0124612, 4.0249224, 6.037383)),
    "bitmap": (
        ProjectorEmitter(Bitmap(PIXELS, np.eye(3), "nearest", "repeat"), 1.0, np.eye(4), 40.0),
        (0.30157927, 0.4253208, 0.02849612),
    ),
    "scaled": (
        ProjectorEmitter(Bitmap(PIXELS, np.eye(3), "nearest", "repeat"), 1.0, clvol.scale(3), 40.0),
        (0.9047378, 1.2759624, 0.08548835),
    ),
    "mirrored": (
        ProjectorEmitter(Bitmap(PIXELS, np.eye(3), "nearest", "repeat"), 1.0, clvol.scale([-1, 1, 1]), 40.0),
        (0.6192193, 0.38606808, 1.0034231),
    ),
    "beside": (ProjectorEmitter((1.0,), 1.0, np.eye(4), 10.0), (0.0, 0.0, 0.0)),
    "behind": (ProjectorEmitter((1.0,), 1.0, clvol.rotate([0, 1, 0], 180), 90.0), (0.0, 0.0, 0.0)),
}


@pytest.mark.parametrize("name", MITSUBAS)
def test_as_mitsubas_does(device, name):
    projector, expected = MITSUBAS[name]
    found = arriving(device, projector, np.array([[0.1, 0.05, 1.0]]))[0] / np.pi
    np.testing.assert_allclose(found, expected, rtol=2e-6, atol=1e-7)


def test_its_power_is_that_of_the_picture_at_a_distance_of_one():
    """The choice among lights goes by it: pi · scale · mean, over the picture's area there."""
    emitters = [
        ProjectorEmitter(Bitmap(PIXELS, np.eye(3), "nearest", "repeat"), 2.0, PLACE, 40.0),
        ProjectorEmitter((0.5,), 1.0, PLACE, 60.0),
    ]
    table = light_table(scene_of(medium_of(1.0), emitters), np.zeros(3), 2.0).emitters
    luminance = PIXELS.mean((0, 1)) @ (0.212671, 0.715160, 0.072169)
    powers = [
        2 * luminance * 4 * np.tan(np.radians(20)) ** 2 * 3 / 5,
        0.5 * 4 * np.tan(np.radians(30)) ** 2,
    ]
    strongest = max(powers) / sum(powers)
    assert table["select_pdf"][0] == pytest.approx(strongest, rel=1e-4)


@pytest.mark.parametrize(
    ("given", "x_fov"),
    [
        ({}, 34.0221),
        ({"focal_length": "50mm", "irradiance": "wide"}, 40.7105),
        ({"fov": 40.0}, 40.0),
        ({"fov": 40.0, "irradiance": "wide", "fov_axis": "y"}, 62.4834),
        ({"fov": 40.0, "irradiance": "wide", "fov_axis": "smaller"}, 62.4834),
        ({"fov": 40.0, "irradiance": "wide", "fov_axis": "larger"}, 40.0),
        ({"fov": 40.0, "irradiance": "wide", "fov_axis": "diagonal"}, 34.6665),
    ],
)
def test_the_picture_is_as_wide_as_a_cameras(given, x_fov):
    """As ``str`` of Mitsuba's emitter says, and uv in its samples."""
    if "irradiance" in given:
        given = given | {"irradiance": {"type": "bitmap", "bitmap": PIXELS}}
    scene = clvol.load_dict(
        {"type": "scene", "s": {"type": "perspective"}, "p": {"type": "projector"} | given}
    )
    assert scene.emitters[0].x_fov == pytest.approx(x_fov, rel=2e-6)


@pytest.mark.parametrize(
    ("given", "message"),
    [
        ({"irradiance": {"type": "mesh_attribute", "name": "vertex_a"}}, "'mesh_attribute'"),
        ({"scale": -1.0}, "'scale' of emitter 'projector'"),
        ({"fov": 40.0, "focal_length": "50mm"}, "either fov or focal_length"),
        ({"fov": 180.0}, r"in \(0, 180\)"),
        ({"fov_axis": "x"}, "fov_axis goes with fov"),
        ({"to_world": clvol.scale([1, 2, 1])}, "must not stretch or shear"),
        ({"irradance": 1.0}, "did you mean 'irradiance'"),
    ],
    ids=lambda value: "",
)
def test_mistakes_are_named(given, message):
    with pytest.raises(clvol.SceneError, match=message):
        clvol.load_dict({"type": "scene", "s": {"type": "perspective"}, "p": {"type": "projector", **given}})
