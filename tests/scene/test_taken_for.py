"""What is taken as something else: said once in the log, and in the metadata of pictures."""

import logging

import pytest
from click.testing import CliRunner

import clvol
from clvol.cli.main import main
from clvol.scene.integrator import OTHERS, WRAPPERS
from clvol.scene.records import Integrator
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


def integrator_of(**integrator):
    return clvol.load_dict(scene_with() | {"it": integrator}).integrator


@pytest.mark.parametrize("name", sorted(OTHERS))
def test_other_integrators_are_path_tracers_of_the_same_limits(name):
    """Mitsuba's with derivatives end after six interactions unless they are told otherwise."""
    default = {
        "prb": 6,
        "prb_basic": 6,
        "prb_projective": 6,
        "prbvolpath": 6,
        "direct": 2,
        "direct_projective": 2,
    }
    assert integrator_of(type=name).max_depth == default.get(name, -1)
    if not OTHERS[name].fixed:
        assert integrator_of(type=name, max_depth=9, rr_depth=3) == Integrator(9, 3)


def test_wrappers_are_what_is_inside():
    inside = {"type": "volpath", "max_depth": 7}
    for name in WRAPPERS:
        assert integrator_of(type=name, it=inside) == Integrator(7)
    with pytest.raises(clvol.SceneError, match="this one is empty"):
        integrator_of(type="adaptive")


def test_aovs_of_a_scene_are_layers_of_its_pictures():
    given = scene_with() | {"it": {"type": "aov", "aovs": "d:depth, n:sh_normal", "a": {"type": "path"}}}
    scene = clvol.load_dict(given)
    assert scene.integrator.aovs == ("depth", "normal")
    assert {"depth", "normal", "cells"} < clvol.render(scene, spp=1, aov=["cells"]).aovs.keys()
    with pytest.raises(
        clvol.SceneError, match="aov 'u:uv' is not supported; write name:type, with types albedo"
    ):
        integrator_of(type="aov", aovs="d:depth,u:uv")


def test_integrators_that_see_no_media_are_refused_where_there_are_some():
    medium = {"type": "cube", "bsdf": {"type": "null"}, "interior": {"type": "homogeneous"}}
    for name in ("path", "prb", "direct"):
        with pytest.raises(clvol.SceneError, match=f"'{name}' sees no media"):
            clvol.load_dict(scene_with() | {"it": {"type": name}, "fog": medium})
    clvol.load_dict(scene_with() | {"it": {"type": "prbvolpath"}, "fog": medium})


def test_what_is_said_is_in_the_words_of_python_or_of_the_command_line(caplog, tmp_path):
    """Texts of both forms hold characters of no alphabet between them, which nobody is to see."""
    with caplog.at_level(logging.WARNING, "clvol"):
        scene = clvol.load_dict(scene_with() | {"it": {"type": "volpath", "timeout": 5.0}})
    said = "no limit: time=60 ends a render after a time"
    assert said in caplog.text
    assert said in clvol.render(scene, spp=1).metadata["approximated"]
    (tmp_path / "scene.xml").write_text(
        '<scene version="3.0.0"><integrator type="volpath"><float name="timeout" value="5"/></integrator>'
        '<sensor type="perspective"/><emitter type="constant"/></scene>'
    )
    told = CliRunner().invoke(main, ["info", str(tmp_path / "scene.xml")]).output
    assert "no limit: --time 60 ends" in " ".join(told.split())
    assert not any(0xE000 <= ord(letter) < 0xF900 for letter in told + caplog.text)
