"""Scenes with several sensors, and films of other sizes."""

from __future__ import annotations

import numpy as np
import pytest

import clvol
from clvol.errors import OptionError
from clvol.scene.digest import scene_digest
from clvol.scene.views import in_size, seen_by

FILM = {"type": "hdrfilm", "width": 6, "height": 4, "rfilter": {"type": "box"}}
SCENE = {
    "type": "scene",
    "front": {
        "type": "perspective",
        "film": FILM,
        "to_world": clvol.look_at([0, 0, -4], [0, 0, 0], [0, 1, 0]),
    },
    "aside": {
        "type": "perspective",
        "fov": 20,
        "film": FILM | {"width": 5},
        "sampler": {"type": "independent", "sample_count": 2, "seed": 7},
        "to_world": clvol.look_at([4, 0, 0], [0, 0, 0], [0, 1, 0]),
    },
    "lamp": {"type": "directional", "direction": [1, 0, 0]},
    "box": {"type": "cube", "bsdf": {"type": "diffuse"}},
}


@pytest.fixture(scope="module")
def scene() -> clvol.Scene:
    return clvol.load_dict(SCENE)


def alone(name: str) -> clvol.Scene:
    return clvol.load_dict(
        {key: value for key, value in SCENE.items() if key in (name, "type", "lamp", "box")}
    )


def test_each_sensor_sees_what_it_sees_alone(scene: clvol.Scene) -> None:
    for number, name in enumerate(("front", "aside")):
        picture, expected = clvol.render(scene, sensor=number), clvol.render(alone(name))
        np.testing.assert_array_equal(picture.image, expected.image)
        assert picture.metadata["digest"] == expected.metadata["digest"]
        assert picture.metadata["seed"] == expected.metadata["seed"] == 7 * number
        assert picture.samples == expected.samples
    assert scene_digest(scene) == scene_digest(alone("front"))
    assert scene_digest(seen_by(seen_by(scene, 1), 0)) == scene_digest(scene)


def test_a_size_is_that_of_the_film(scene: clvol.Scene) -> None:
    sized = clvol.load_dict(SCENE | {"front": SCENE["front"] | {"film": FILM | {"width": 8, "height": 8}}})
    np.testing.assert_array_equal(clvol.render(scene, size=(8, 8)).image, clvol.render(sized).image)
    assert clvol.render(scene, sensor=1, size=(3, 2)).image.shape == (2, 3, 3)


@pytest.mark.parametrize("number", [2, -1, 1.5, "1"])
def test_a_sensor_that_is_not_there_is_refused(scene: clvol.Scene, number: object) -> None:
    with pytest.raises(OptionError, match="sensor"):
        seen_by(scene, number)  # type: ignore[arg-type]


@pytest.mark.parametrize("size", [(0, 4), (70000, 1), (60000, 60000), (4,), (4, 4.5), "4x4", None])
def test_an_impossible_size_is_refused(scene: clvol.Scene, size: object) -> None:
    with pytest.raises(OptionError, match=r"size|film"):
        in_size(scene, size)  # type: ignore[arg-type]


def test_a_crop_window_goes_with_its_own_size() -> None:
    film = FILM | {"crop_width": 3, "crop_height": 2}
    cropped = clvol.load_dict(SCENE | {"front": SCENE["front"] | {"film": film}})
    with pytest.raises(OptionError, match="crop window"):
        in_size(cropped, (8, 8))
