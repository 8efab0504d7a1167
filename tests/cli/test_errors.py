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
    ("options", "message"),
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
    with pytest.raises(OptionError, match=r"point, spot and directional lights, nor projectors; .*use ratio"):
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

    monkeypatch.setattr("clvol.api.order.open_device", no_device)
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


class Mute:
    """An object whose repr raises, as some libraries' do once they are closed."""

    def __repr__(self):
        raise RuntimeError("closed")

    __str__ = __repr__


NUMBERS = ("seed", "spp", "time_limit", "majorant_scale", "step", "target_error", "samples")
NAMES = ("technique", "transmittance", "majorant", "lookup", "sampler", "aov")


@pytest.mark.parametrize("value", ["one", Mute(), "x" * 10_000, [Mute()]], ids=lambda v: type(v).__name__)
def test_values_of_other_types_are_errors_in_one_short_line(value):
    """Every option of `render`, and every kind of parameter of a scene."""
    camera = {"type": "perspective", "fov": 40}
    calls = [lambda option=option: clvol.render(scene(), **{option: value}) for option in (*NUMBERS, *NAMES)]
    calls += [
        lambda key=key: clvol.load_dict({"type": "scene", "camera": camera | {key: value}})
        for key in ("fov", "near_clip", "to_world", "film", "fov_axis", "id")
        if key != "id" or not isinstance(value, str)
    ]
    calls += [lambda: clvol.rotate(value, 30), lambda: clvol.rotate([0, 0, 1], [value])]
    for call in calls:
        with pytest.raises(Error) as caught:
            call()
        assert len(str(caught.value)) < 1500


@pytest.mark.parametrize("seed", [1.5, "1", -1, 2**64, None])
def test_only_whole_numbers_are_seeds(seed):
    if seed is not None:
        with pytest.raises(OptionError, match="is not a 64-bit number"):
            clvol.render(scene(), seed=seed)
        with pytest.raises(OptionError, match="is not a 64-bit number"):
            clvol.trace_ray(scene(), 1, 1, seed=seed)
        with pytest.raises(OptionError, match="is not a 64-bit number"):
            clvol.compare(scene(), techniques=["delta", "regular"], seed=seed)
    with pytest.raises(OptionError, match="is not a 64-bit number"):
        clvol.selftest(scene(), seed=seed)


def test_every_error_is_exported():
    for name in ("SceneError", "VolumeError", "OptionError", "DeviceError"):
        assert issubclass(getattr(clvol, name), Error)
        assert name in clvol.__all__


def test_pythons_list_of_techniques_has_the_pilot():
    with pytest.raises(OptionError, match="choose one of auto, auto:pilot, delta"):
        clvol.render(scene(), technique="woodcock tracking")


@pytest.mark.parametrize("pattern", ["²", "٢٢", "x" * 10_000])
def test_odd_device_names_are_errors(pattern):
    with pytest.raises(DeviceError, match="no OpenCL device matches") as caught:
        clvol.render(scene(), device=pattern)
    assert len(str(caught.value)) < 2000


def test_records_show_themselves_in_short():
    grid = np.random.default_rng(1).random((20, 20, 20))
    fog = {"type": "heterogeneous", "sigma_t": {"type": "gridvolume", "data": grid}}
    sky = {"type": "envmap", "bitmap": np.ones((60, 90, 3))}
    camera = {"type": "perspective", "fov": 40}
    cube = {"type": "cube", "bsdf": {"type": "null"}, "interior": fog}
    loaded = clvol.load_dict({"type": "scene", "camera": camera, "fog": cube, "sky": sky})
    assert "20 x 20 x 20" in repr(loaded.shapes[0]) and len(repr(loaded.shapes[0])) < 2500
    assert "90 x 60" in repr(loaded.emitters[0]) and len(repr(loaded.emitters[0])) < 200
