"""`clvol.render(scene, sensor=…)`: one of the scene's sensors, a sensor of one's own, or several at once."""

from __future__ import annotations

import signal

import numpy as np
import pytest
from every_bit import scene as flat_scene
from signals import press_key
from smoke_scenes import BEHIND, VOLUME_BYTES, load

import clvol

OPTIONS = {"spp": 2, "seed": 3, "sampler": "joint", "pool": 256}


@pytest.fixture(scope="module")
def scene():
    return load()


@pytest.fixture(scope="module")
def expected():
    """From behind."""
    return clvol.render(load(to_world=BEHIND), **OPTIONS)


def sensor(**parameters):
    return {"type": "perspective", "fov": 30, "to_world": BEHIND, **parameters}


def test_a_dict_is_a_view(scene, expected):
    for view in ({"to_world": BEHIND}, sensor()):
        assert (clvol.render(scene, sensor=view, **OPTIONS).image == expected.image).all()


def test_a_sensor_may_have_its_own_film_and_sampler(scene):
    film = {"type": "hdrfilm", "width": 5, "height": 3}
    sampler = {"type": "independent", "sample_count": 3, "seed": 9}
    own = clvol.render(scene, sensor=sensor(film=film, sampler=sampler), pool=256)
    assert own.image.shape == (3, 5, 3) and own.samples == (0, 3) and own.metadata["seed"] == 9
    smaller = clvol.render(scene, sensor={"film.size": (5, 3), "x_fov": 20}, **OPTIONS)
    assert smaller.image.shape == (3, 5, 3)


def test_several_views_are_built_once(scene, expected, device):
    before = device.memory.taken
    turned = {"to_world": clvol.rotate((0, 1, 0), 40) @ BEHIND}
    views = [0, {"to_world": BEHIND}, turned]
    results = clvol.render(scene, sensor=views, **OPTIONS)
    assert len(results) == 3 and (results[1].image == expected.image).all()
    assert (results[0].image == clvol.render(load(), **OPTIONS).image).all()
    first, *others = ((r.stats["uploaded_bytes"], r.stats["kernels_built"]) for r in results)
    assert first[0] > VOLUME_BYTES and others == [(0, 0), (0, 0)]
    assert device.memory.taken == before  # and nothing stays
    digests = {result.metadata["digest"] for result in results}
    assert len(digests) == 3


def test_progressive_sees_a_view_too(scene, expected):
    *_, last = clvol.progressive(scene, sensor={"to_world": BEHIND}, **OPTIONS)
    assert (last.image == expected.image).all()


@pytest.mark.usefixtures("ctrl_c")
def test_ctrl_c_ends_the_views():
    def press(record):
        press_key(signal.SIGINT)

    results = clvol.render(flat_scene(), sensor=[0, 0, 0], spp=100_000, pool=256, progress=press)
    assert len(results) == 1 and results[0].stats["interrupted"]


@pytest.mark.parametrize(
    ("view", "message"),
    [
        (1, "there is no sensor 1"),
        ("front", "sensor must be a number or a dict, not 'front'"),
        (1.5, "sensor must be a number or a dict"),
        ([], "there is no view to render"),
        ([0, 7], "there is no sensor 7"),
        ([0, [0]], "sensor must be a number or a dict"),
        ({"to_wrld": BEHIND}, "no parameter 'to_wrld'; did you mean 'to_world'"),
        ({3: BEHIND}, "no parameter 3"),
        ({"to_world": np.eye(3)}, "expected a transform"),
        ({"near_clip": 5e4}, "must be beyond near_clip"),
        ({"type": "sphere"}, "'sphere' is a shape, not a sensor"),
        ({"type": "perspectiv"}, "did you mean 'perspective'"),
        (sensor(fov=200), "fov"),
        (sensor(sampler={"type": "ref", "id": "x"}), "unknown id 'x'"),
    ],
    ids=range(14),
)
def test_what_is_no_view_is_said(scene, view, message):
    with pytest.raises(clvol.Error, match=message):
        clvol.render(scene, sensor=view, **OPTIONS)


def test_lists_are_for_render(scene):
    with pytest.raises(clvol.OptionError, match="sensor must be a number or a dict"):
        clvol.progressive(scene, sensor=[0], **OPTIONS)
    with pytest.raises(clvol.OptionError, match="resume is of one picture"):
        clvol.render(scene, sensor=[0], resume="a.exr", **OPTIONS)
