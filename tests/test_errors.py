"""What `render` refuses: one line that says what is wrong and what to do, before anything is rendered."""

import numpy as np
import pytest
from pictures import box, homogeneous, picture

import clvol
from clvol.errors import DeviceError, Error, OptionError
from clvol.scene.records import ConstantEmitter, DirectionalEmitter, PointEmitter


def scene(*lights, **integrator):
    shapes = [box((0, 0, 0), (1, 1, 1), homogeneous(1.0, 0.5))]
    lights = lights or (ConstantEmitter(),)
    return picture(shapes, lights, (0.5, 0.5, -2), (0.5, 0.5, 0), **integrator)


LAMP = PointEmitter((1.0,), (0, 3, 0))
SUN = DirectionalEmitter((1.0,), (0, -1, 0))


@pytest.mark.parametrize("family", ["technique", "transmittance", "majorant", "lookup", "absorption"])
def test_an_unknown_choice_names_itself_and_the_legal_ones(family):
    with pytest.raises(OptionError) as caught:
        clvol.render(scene(), **{family: "wodcock"})
    message = str(caught.value)
    assert f"unknown {family} 'wodcock'" in message
    assert "choose one of auto, " in message
    assert "\n" not in message


def test_a_near_miss_is_guessed():
    with pytest.raises(OptionError, match="did you mean 'kdtree'"):
        clvol.render(scene(), majorant="kd-tree")


def test_an_unknown_choice_of_the_scene_is_refused_too():
    with pytest.raises(OptionError, match="unknown technique 'wodcock'"):
        clvol.render(scene(choices={"technique": "wodcock"}))


@pytest.mark.parametrize(
    "options, message",
    [
        ({"spp": 0}, "cannot render 0 samples per pixel"),
        ({"spp": -3}, "cannot render -3 samples per pixel"),
        ({"spp": 2**32}, "at most 4294967295"),
        ({"samples": (0, 0)}, "cannot render 0 samples per pixel"),
        ({"samples": (-1, 4)}, "from sample -1"),
        ({"samples": (2**32 - 2, 2)}, "at most 4294967295"),
        ({"spp": 4, "samples": (0, 4)}, "spp and samples exclude each other"),
        ({"seed": -1}, "seed -1 is not a 64-bit number"),
        ({"seed": 2**64}, "is not a 64-bit number"),
        ({"time_limit": 0}, "time limit 0 is not a positive number"),
        ({"time_limit": -2.5}, "time limit -2.5 is not a positive number"),
        ({"time_limit": float("nan")}, "time limit nan is not a positive number"),
    ],
)
def test_numbers_out_of_range_are_refused(options, message):
    with pytest.raises(OptionError) as caught:
        clvol.render(scene(), **options)
    assert message in str(caught.value)
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize("light", [LAMP, SUN], ids=["point", "directional"])
def test_lights_that_nothing_hits_by_chance_need_light_sampling(light):
    with pytest.raises(
        OptionError, match=r"'none' cannot render point, spot and directional lights; .*use ratio"
    ):
        clvol.render(scene(light), transmittance="none")


def test_an_unknown_device_lists_the_known_ones():
    with pytest.raises(DeviceError) as caught:
        clvol.render(scene(), device="abacus")
    message = str(caught.value)
    assert "no OpenCL device matches 'abacus'" in message
    assert "there are: 0: " in message
    assert "\n" not in message


def test_an_unknown_keyword_is_a_type_error():
    with pytest.raises(TypeError, match="samples_per_pixel"):
        clvol.render(scene(), samples_per_pixel=4)


def test_options_are_refused_before_a_device_is_opened(monkeypatch):
    def no_device(pattern):
        raise AssertionError("opened")

    monkeypatch.setattr("clvol.renderer.open_device", no_device)
    for options in ({"majorant": "oct"}, {"spp": 0}, {"seed": -1}, {"time_limit": 0}):
        with pytest.raises(OptionError):
            clvol.render(scene(), **options)


def test_every_error_of_a_user_is_a_clvol_error():
    assert issubclass(OptionError, Error) and issubclass(DeviceError, Error)
    assert clvol.Error is Error


def test_legal_extremes_are_rendered():
    """The neighbours of what is refused above."""
    for options in ({"spp": 1}, {"samples": (2**32 - 2, 1)}, {"seed": 2**64 - 1, "spp": 1}):
        assert np.isfinite(clvol.render(scene(), **options).image).all()
