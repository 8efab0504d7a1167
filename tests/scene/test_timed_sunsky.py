"""The mean sky of many days against the mean of the skies, and the shutter through which it is seen."""

from datetime import date

import numpy as np
import pytest

import clvol
from clvol.scene.records import ConstantEmitter, EnvmapEmitter, SunEmitter
from clvol.scene.sky_model import Sky, sun_irradiance
from clvol.scene.sun_position import Place, sun_direction
from clvol.scene.sunsky import HEIGHT, WIDTH, Air, map_directions
from clvol.scene.timed_sunsky import Days, _solid_angles, mean_sky, mean_sun

AIR = Air(3.0, np.full(3, 0.3), 1.5, 2.0, 0.5358, np.eye(4))
MARCH = Days(date(2025, 3, 20), 2, 7.0, 15.0, Place())
ONE_DAY = {"start_month": 3, "start_day": 20, "end_year": 2025, "end_month": 3, "end_day": 21}


def loaded(shutter_close=1.0, shutter_open=0.0, **parameters):
    sensor = {"type": "perspective", "shutter_open": shutter_open, "shutter_close": shutter_close}
    light = {"type": "timed_sunsky", **parameters}
    return clvol.load_dict({"type": "scene", "sensor": sensor, "light": light})


@pytest.fixture(scope="module")
def suns():
    return MARCH.suns((np.arange(200) + 0.5) / 200)


@pytest.fixture(scope="module")
def sky(suns):
    return mean_sky(AIR, suns)


def test_days_go_from_window_to_window():
    at = MARCH.suns(np.array([0.0, 0.25, 0.5, 1.0]))
    hours = [(20, 7.0), (20, 11.0), (21, 7.0), (21, 15.0)]
    expected = [sun_direction(date(2025, 3, day), np.array(hour), Place()) for day, hour in hours]
    assert np.abs(at - expected).max() < 1e-9


def test_the_mean_sky_is_the_mean_of_the_skies(suns, sky):
    """Within 0.1 %: between tabulated elevations skies are interpolated."""
    looks = map_directions(np.array([0, 60, 200, 254]), WIDTH, HEIGHT)[:, ::100].reshape(-1, 3)
    skies = [Sky(3.0, AIR.albedo, np.arcsin(sun[2])) for sun in suns]
    exact = 1.5 * np.mean(
        [one.radiance(looks[:, 2], looks @ sun) for one, sun in zip(skies, suns, strict=True)], 0
    )
    assert np.abs(sky[[0, 60, 200, 254]][:, ::100].reshape(-1, 3) / exact - 1).max() < 1e-3
    assert not sky[HEIGHT // 2 :].any()


MITSUBAS = "0.034208 0.059807 0.11946, 0.098065 0.13371 0.19954, 0.033095 0.062246 0.12639"


def test_the_mean_sky_is_mitsubas(sky):
    """The mean of what its emitter gives at 4,000 times, in three directions."""
    looks = np.array([(0, 0, 1), (0.6, 0, 0.8), (-0.3, 0.4, np.sqrt(0.75))])
    towards = map_directions(np.arange(HEIGHT // 2), WIDTH, HEIGHT)
    for look, text in zip(looks, MITSUBAS.split(","), strict=True):
        row, column = np.unravel_index((towards @ look).argmax(), towards.shape[:2])
        expected = [float(word) for word in text.split()]
        assert np.abs(sky[row, column] / expected - 1).max() < 5e-3  # half a texel away


def test_the_mean_sun_has_the_energy_and_the_middle_of_the_suns(suns):
    """But for what of a disk is below the horizon."""
    found = mean_sun(AIR, suns)
    flux = (found.sum(1) * _solid_angles()[:, None]).sum(0)
    each = 2 * sun_irradiance(3.0, np.arcsin(suns[:, 2]))
    assert np.abs(flux / each.mean(0) - 1).max() < 1e-3
    towards = map_directions(np.arange(HEIGHT), WIDTH, HEIGHT)
    middle = np.einsum("yxc,yxd,y->cd", found, towards, _solid_angles())
    assert np.abs(middle / (each[:, :, None] * suns[:, None]).mean(0) - 1).max() < 2e-3
    assert found.sum() > 0 and not found[HEIGHT // 2 :].any()


def test_a_sun_in_the_zenith_keeps_its_energy():
    found = mean_sun(AIR, np.array([[0.0, 0.0, 1.0]]))
    flux = (found.sum(1) * _solid_angles()[:, None]).sum(0)
    assert np.allclose(flux, 2 * sun_irradiance(3.0, np.pi / 2), rtol=1e-6)


def test_an_open_shutter_sees_the_mean_and_a_closed_one_a_moment(caplog):
    hour = ONE_DAY | {"window_start_time": 8.0, "window_end_time": 9.0, "sky_scale": 0.0}
    scene = loaded(**hour)
    [sky] = scene.emitters
    assert isinstance(sky, EnvmapEmitter) and sky.source == "timed_sunsky" and not caplog.text
    still = loaded(shutter_open=0.5, shutter_close=0.5, **hour)
    [_, sun] = still.emitters
    assert isinstance(sun, SunEmitter) and "open for no time" in caplog.text
    assert np.allclose(sun.sun_direction, sun_direction(date(2025, 3, 20), np.array(8.5), Place()))
    [night] = loaded(window_start_time=0.0, window_end_time=3.0, **ONE_DAY).emitters
    assert isinstance(night, ConstantEmitter)


def test_by_default_a_year_is_seen():
    [emitter] = loaded(shutter_close=0.0).emitters[1:]
    assert np.allclose(emitter.sun_direction, sun_direction(date(2025, 1, 1), np.array(7.0), Place()))
    later = loaded(shutter_open=1.0, shutter_close=1.0, start_year=2024, start_month=2, start_day=29)
    last = sun_direction(date(2025, 2, 28), np.array(19.0), Place())
    assert last[2] < 0 and "below the horizon" in later.approximated[0]


@pytest.mark.parametrize(
    ("parameters", "message"),
    [
        ({"window_start_time": 20.0}, "window_end_time must not be before"),
        ({"window_end_time": 25.0}, r"'window_end_time' .* in \[0, 24\]"),
        ({"end_year": 2024}, "the end, 2024-01-01, is before the start, 2025-01-01"),
        ({"start_month": 2, "start_day": 29}, "there is no 2025-2-29"),
        ({"shutter_close": 0.5}, "beyond the shutter_open and shutter_close"),
        ({"sun_direction": [0, 0, 1]}, "unknown parameter 'sun_direction'"),
    ],
    ids=lambda value: "-".join(value) if isinstance(value, dict) else "",
)
def test_mistakes_are_named(parameters, message):
    sensor = {"type": "perspective", "shutter_close": 1.0 if "shutter_close" in parameters else 0.0}
    with pytest.raises(clvol.SceneError, match=message):
        clvol.load_dict({"type": "scene", "a": sensor, "light": {"type": "timed_sunsky", **parameters}})


def test_sensors_of_different_times_see_different_skies():
    sensors = {f"s{n}": {"type": "perspective", "shutter_close": float(n)} for n in range(2)}
    with pytest.raises(clvol.SceneError, match="of one shutter_open and shutter_close"):
        clvol.load_dict({"type": "scene", **sensors, "light": {"type": "timed_sunsky"}})
