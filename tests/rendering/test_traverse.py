"""A scene whose parameters are traversed: what changed is uploaded, and new features are built, and no more.

Pictures have the bits of those of a scene that was loaded with the same values.
"""

from __future__ import annotations

import gc

import pytest
from smoke_scenes import BEHIND, VALUES, VOLUME_BYTES, load

import clvol

OPTIONS = {"spp": 2, "seed": 3, "sampler": "joint", "pool": 256}


@pytest.fixture(scope="module")
def traversed():
    """A scene that has been rendered, and its parameters."""
    scene = load()
    parameters = clvol.traverse(scene)
    first = clvol.render(scene, **OPTIONS)
    assert first.stats["uploaded_bytes"] > VOLUME_BYTES
    return scene, parameters


def cost(result):
    return result.stats["uploaded_bytes"], result.stats["kernels_built"]


def assert_same(result, expected):
    assert (result.image == expected.image).all() and (result.variance == expected.variance).all()
    assert result.metadata["digest"] == expected.metadata["digest"]


def test_a_render_of_the_same_scene_uploads_and_builds_nothing(traversed):
    scene, _ = traversed
    assert cost(clvol.render(scene, **OPTIONS | {"seed": 4})) == (0, 0)


SMALL = {
    "sensor.to_world": ("to_world", BEHIND, 0),
    "sky.radiance.value": ("radiance", 0.9, 4096),
    "smoke.interior.phase.g": ("g", -0.2, 4096),
    "floor.bsdf.brdf_0.reflectance": ("reflectance", 0.2, 4096),
    "smoke.interior.scale": ("scale", 7.0, VOLUME_BYTES / 2),  # majorants among them
}


@pytest.mark.parametrize("name", SMALL)
def test_what_changed_is_uploaded_and_no_more(traversed, name):
    scene, parameters = traversed
    keyword, value, most = SMALL[name]
    before = parameters[name]
    parameters[name] = value
    parameters.update()
    changed = clvol.render(scene, **OPTIONS)
    assert_same(changed, clvol.render(load(**{keyword: value}), **OPTIONS))
    assert changed.stats["uploaded_bytes"] <= most and changed.stats["kernels_built"] == 0
    parameters.update({name: before})
    assert_same(clvol.render(scene, **OPTIONS), clvol.render(load(), **OPTIONS))


def test_other_samples_are_uploaded_and_nothing_is_built(traversed):
    scene, parameters = traversed
    other = VALUES[:, ::-1] ** 2
    parameters.update({"smoke.interior.sigma_t.data": other})
    changed = clvol.render(scene, **OPTIONS)
    assert_same(changed, clvol.render(load(values=other), **OPTIONS))
    assert changed.stats["uploaded_bytes"] > VOLUME_BYTES and changed.stats["kernels_built"] == 0
    parameters.update({"smoke.interior.sigma_t.data": VALUES})
    assert_same(clvol.render(scene, **OPTIONS), clvol.render(load(), **OPTIONS))


def test_new_features_are_built(traversed):
    """Colour makes three channels of one."""
    scene, parameters = traversed
    parameters.update({"sky.radiance.value": (0.5, 0.6, 0.7)})
    changed = clvol.render(scene, **OPTIONS)
    sky = {"type": "rgb", "value": [0.5, 0.6, 0.7]}
    assert_same(changed, clvol.render(load(radiance=sky), **OPTIONS))
    assert changed.stats["kernels_built"] > 0 and changed.stats["uploaded_bytes"] < VOLUME_BYTES
    parameters.update({"sky.radiance.value": 0.5})
    assert clvol.render(scene, **OPTIONS).stats["kernels_built"] == 0


def test_frames_under_way_keep_the_scene_that_they_began_with(traversed):
    scene, parameters = traversed
    spp = 64
    frames = clvol.progressive(scene, interval=0, **OPTIONS | {"spp": spp})
    next(frames)
    parameters.update({"smoke.interior.scale": 1.0, "smoke.interior.sigma_t.data": VALUES / 2})
    clvol.render(scene, **OPTIONS)
    *_, last = frames
    assert (last.image == clvol.render(load(), **OPTIONS | {"spp": spp}).image).all()
    parameters.update({"smoke.interior.scale": 4.0, "smoke.interior.sigma_t.data": VALUES})


def test_a_camera_that_orbits_builds_once_over_frames(traversed):
    scene, parameters = traversed
    clvol.render(scene, **OPTIONS)
    for angle in (10, 20):
        parameters["sensor.to_world"] = clvol.rotate((0, 1, 0), angle) @ BEHIND
        parameters.update()
        frame = next(clvol.progressive(scene, **OPTIONS))
        assert cost(frame) == (0, 0)
    parameters.update({"sensor.to_world": clvol.look_at((0, 0, -5), (0, 0, 0), (0, 1, 0))})


def test_buffers_go_with_the_scene(device):
    gc.collect()
    before = device.memory.taken
    scene = load()
    clvol.render(scene, **OPTIONS)
    gc.collect()
    assert device.memory.taken == before  # nothing stays of a scene that is not traversed
    clvol.traverse(scene)
    clvol.render(scene, **OPTIONS)
    gc.collect()
    assert device.memory.taken > before + VOLUME_BYTES
    del scene
    gc.collect()
    assert device.memory.taken == before
