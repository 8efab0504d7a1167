"""Spots that project a texture: what arrives at points, against Mitsuba's formula in float64."""

import numpy as np
import pytest
from probe import Probe, medium_of, scene_of

import clvol
from clvol.scene.materials import Bitmap, Checkerboard
from clvol.scene.records import SpotEmitter

PIXELS = np.random.default_rng(1).random((5, 7, 3)).astype(np.float32)
TO_UV = np.array([[2.0, 0.3, 0.1], [0.2, 1.5, -0.2], [0.0, 0.0, 1.0]])
SLIDES = {
    "bitmap": Bitmap(PIXELS, TO_UV, "nearest", "repeat"),
    "checkerboard": Checkerboard((0.9, 0.4, 0.1), (0.2,), TO_UV),
}
PLACE = clvol.look_at([0.4, 0.6, 2.0], [0.5, 0.4, 0.5], [0.2, 1.0, 0.3])
BODY = """
    const LightSample light = sample_light(scene, vload3(i, in0), 0.5f, 0.5f, 0.5f);
    vstore3(light.value, i, out0);
"""


def shown(slide, uv):
    """The texture at (u, v) after its own to_uv, and whether that is far from a border."""
    u, v = TO_UV[:2, :2] @ uv + TO_UV[:2, 2:]
    if isinstance(slide, Bitmap):
        x, y = u * 7, v * 5
        near = np.minimum(np.abs(x - np.round(x)), np.abs(y - np.round(y))) < 1e-3
        return PIXELS[np.floor(y).astype(int) % 5, np.floor(x).astype(int) % 7], ~near
    near = np.minimum(np.abs(2 * u - np.round(2 * u)), np.abs(2 * v - np.round(2 * v))) < 1e-3
    same = (u % 1 > 0.5) == (v % 1 > 0.5)
    return np.where(same[:, None], slide.color0, np.broadcast_to(slide.color1, 3)), ~near


@pytest.mark.parametrize("mirrored", [False, True])
@pytest.mark.parametrize("name", SLIDES)
def test_a_spot_projects_its_texture(device, name, mirrored):
    to_world = PLACE @ clvol.scale([-3.0, 3.0, 3.0]) if mirrored else PLACE
    spot = SpotEmitter((9.0, 5.0, 7.0), to_world, 35.0, 25.0, SLIDES[name])
    scene = scene_of(medium_of(1.0, albedo=0.5), [spot])
    points = np.random.default_rng(2).uniform(-1, 2, (4096, 3)).astype(np.float32)
    probe = Probe(device, scene)
    given = (points - probe.prepared.centre).astype(np.float32)
    [found] = probe.run(
        ["emitter/emitter.h"], BODY, [np.zeros((len(points), 3), np.float32)], [given], stage="shade"
    )
    local = (np.linalg.inv(to_world) @ np.c_[points, np.ones(len(points))].T)[:3]
    local /= np.linalg.norm(local, axis=0)
    angle = np.degrees(np.arccos(local[2]))
    falloff = np.clip((35 - angle) / 10, 0, 1)
    uv = 0.5 + 0.5 * local[:2] / (local[2] * np.tan(np.radians(35)))
    color, clear = shown(SLIDES[name], np.where(falloff > 0, uv, 0.3))
    square = ((points - to_world[:3, 3]) ** 2).sum(1)
    expected = np.array(spot.intensity) * color * (falloff / square)[:, None]
    assert 300 < (falloff[clear] > 0).sum() < 4000
    assert np.abs(found - expected)[clear].max() < 2e-5 * expected.max()


@pytest.mark.parametrize(
    ("given", "message"),
    [
        ({"texture": 0.5}, "must be a bitmap or a checkerboard"),
        ({"texture": {"type": "mesh_attribute", "name": "vertex_a"}}, "must be a bitmap or a checkerboard"),
        ({"texture": {"type": "checkerboard"}, "cutoff_angle": 90.0}, "below 90"),
    ],
    ids=["number", "attribute", "wide"],
)
def test_mistakes_are_named(given, message):
    spot = {"type": "spot", **given}
    with pytest.raises(clvol.SceneError, match=message):
        clvol.load_dict({"type": "scene", "s": {"type": "perspective"}, "spot": spot})
