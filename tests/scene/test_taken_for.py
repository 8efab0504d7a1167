"""What is taken as something else: said once in the log, and in the metadata of pictures."""

import logging

import pytest

import clvol
from clvol.scene.sensor import OTHER_SAMPLERS


def scene_with(**camera):
    sensor = {"type": "perspective", "film": {"type": "hdrfilm", "width": 2, "height": 2}} | camera
    return {"type": "scene", "camera": sensor, "sky": {"type": "constant"}}


@pytest.mark.parametrize("name", OTHER_SAMPLERS)
def test_other_samplers_count_samples_as_they_say(name, caplog):
    scene = clvol.load_dict(scene_with(sampler={"type": name, "sample_count": 24, "seed": 3}))
    assert (scene.spp, scene.seed) == (24, 3)
    assert [name in record.getMessage() for record in caplog.records] == [True]


def test_what_is_taken_for_something_else_is_said_once_and_in_the_metadata(caplog):
    sampler = {"type": "stratified", "jitter": True}
    given = scene_with(sampler=sampler) | {"other": {"type": "perspective", "sampler": sampler}}
    with caplog.at_level(logging.WARNING, "clvol"):
        scene = clvol.load_dict(given)
    said = "sampler 'stratified' is taken as clvol's own sampler, of the same sample count"
    assert [record.getMessage() for record in caplog.records] == [f"scene.camera.sampler: {said}"]
    assert scene.approximated == (said,)
    assert clvol.render(scene, spp=1).metadata["approximated"] == said
