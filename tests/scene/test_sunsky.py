"""The sky and the sun of `sunsky` against numbers that Mitsuba 3.9.1 gave, and what scenes say of them."""

from datetime import date

import numpy as np
import pytest

import clvol
from clvol.scene.records import ConstantEmitter, EnvmapEmitter, SunEmitter
from clvol.scene.sky_model import Sky, sun_irradiance
from clvol.scene.sun_position import Place, sun_direction
from clvol.scene.sunsky import FROM_MAP, HEIGHT, WIDTH, map_directions

LOOKS = np.array([(0, 0, 1), (0.6, 0, 0.8), (-0.3, 0.4, np.sqrt(0.75)), (0, -np.sqrt(1 - 0.05**2), 0.05)])
SKIES = {  # turbidity, albedo, elevation of a sun over x: radiance in those directions
    (1, 0.0, 10): (
        "0.0068997 0.014927 0.027124, 0.013951 0.026194 0.042084, 0.0095365 0.018724 0.032976, "
        "0.074699 0.0896 0.067441"
    ),
    (3, 0.3, 40): (
        "0.021172 0.03803 0.077088, 0.096283 0.11926 0.15905, 0.020532 0.039507 0.081485, "
        "0.12465 0.17262 0.20886"
    ),
    (4.5, (0.1, 0.5, 0.9), 70): (
        "0.10348 0.14056 0.20668, 0.17144 0.23028 0.29258, 0.037983 0.074432 0.16183, 0.11619 0.23938 0.40646"
    ),
    (10, 1.0, 5): (
        "0.013387 0.016574 0.020057, 0.039877 0.035629 0.031018, 0.018956 0.021995 0.024204, "
        "0.019892 0.017577 0.015203"
    ),
}
SUNS = {  # turbidity, elevation: irradiance normal to the sun
    (1, 3.5): "0.666929 0.263237 0.0220885",
    (3, 5): "0.642984 0.286747 0.0387253",
    (3, 30): "1.39251 1.09547 0.729283",
    (3, 80): "1.52131 1.28701 1.01543",
    (7.2, 45): "1.24664 1.00657 0.748152",
    (2.5, 0.3): "0.323385 0.0890782 -0.0049732",
    (5, 89.9): "1.44503 1.217 0.965549",
}
PLACES = [  # date, hour, place: direction to the sun
    (date(2010, 7, 10), 15.0, Place(), (0.05139, 0.69175, 0.72031)),
    (date(2010, 7, 10), 6.5 + 20 / 60 + 30 / 3600, Place(), (-0.15907, -0.88959, 0.42818)),
    (date(2025, 3, 20), 12.0, Place(), (0.58477, 0.04901, 0.80972)),
    (date(2010, 7, 10), 10.0, Place(-33.9, 18.4, 2.0), (-0.69215, -0.63047, 0.35135)),
    (date(1999, 12, 31), 13.0, Place(64.1, -21.9, 0.0), (0.99154, -0.12171, 0.04513)),
]
LOW = {"sun_direction": [1, 0, 0.02]}


def loaded(**parameters):
    scene = {"type": "scene", "camera": {"type": "perspective"}, "light": {"type": "sunsky", **parameters}}
    return clvol.load_dict(scene)


def numbers(text):
    return np.array([[float(word) for word in part.split()] for part in text.split(",")])


def over_x(elevation):
    return np.array([np.cos(elevation), 0.0, np.sin(elevation)])


@pytest.mark.parametrize("case", SKIES, ids=str)
def test_the_sky_is_mitsubas(case):
    turbidity, albedo, elevation = case
    sun = over_x(np.radians(elevation))
    sky = Sky(turbidity, np.broadcast_to(albedo, 3), np.radians(elevation))
    assert np.allclose(sky.radiance(LOOKS[:, 2], LOOKS @ sun), numbers(SKIES[case]), rtol=5e-5)


@pytest.mark.parametrize("case", SUNS, ids=str)
def test_the_sun_is_mitsubas(case):
    assert np.allclose(sun_irradiance(case[0], np.radians(case[1])), numbers(SUNS[case])[0], rtol=1e-5)


@pytest.mark.parametrize(("day", "hour", "place", "expected"), PLACES, ids=lambda value: str(value)[:10])
def test_the_sun_stands_where_mitsubas_does(day, hour, place, expected):
    """Mitsuba counts the days in single precision: up to 11 minutes of arc."""
    assert np.abs(sun_direction(day, np.array(hour), place) - expected).max() < 1e-3


def test_the_map_is_the_sky_between_its_texels_too():
    """In radiance, but for the row at the horizon, and in irradiance, which that row is part of."""
    scene = loaded(turbidity=2.0, sun_direction=over_x(0.7))
    [sky, _] = scene.emitters
    assert sky.radiance.shape == (HEIGHT, WIDTH, 3) and not sky.radiance[HEIGHT // 2 :].any()
    model = Sky(2.0, np.full(3, 0.3), 0.7)
    rows, columns = np.arange(0, HEIGHT // 2 - 1, 3), np.arange(0, WIDTH - 1, 5)
    middle = map_directions(rows + 0.5, WIDTH, HEIGHT)[:, columns] @ _turn(np.pi / WIDTH).T
    between = sum(sky.radiance[rows + a][:, columns + b] for a in (0, 1) for b in (0, 1)) / 4
    exact = model.radiance(middle[..., 2], middle @ over_x(0.7))
    assert np.abs(between / exact - 1).max() < 0.01
    fine = map_directions(np.arange(0.0, (HEIGHT - 1) / 2, 0.25) + 0.125, 64, HEIGHT)
    up = fine[..., 2:]
    weight = up * np.sqrt(1 - up**2)
    exact = (
        (weight * model.radiance(fine[..., 2], fine @ over_x(0.7))).sum((0, 1))
        * np.pi**2
        / 64
        / (HEIGHT - 1)
        / 2
    )
    at = map_directions(np.arange(HEIGHT), WIDTH, HEIGHT)[:, :1, 2]
    found = (sky.radiance.mean(1) * at * np.sqrt(1 - at**2)).sum(0) * 2 * np.pi**2 / (HEIGHT - 1)
    assert np.abs(found / exact - 1).max() < 1e-4


def _turn(angle):
    """About z, as columns of the map go."""
    first, second = map_directions(np.array([HEIGHT / 2]), WIDTH, HEIGHT)[0, :2]
    sign = np.sign(np.cross(first, second)[2])
    c, s = np.cos(angle), sign * np.sin(angle)
    return np.array([[c, -s, 0], [s, c, 0], [0, 0, 1]])


def test_the_sun_keeps_its_energy_whatever_its_aperture():
    for aperture in (0.01, 0.5358, 40.0):
        [_, sun] = loaded(sun_direction=over_x(np.radians(50)), sun_aperture=aperture, sun_scale=2.0).emitters
        assert np.allclose(sun.irradiance, 2 * sun_irradiance(3.0, np.radians(50)))
        assert np.isclose(sun.solid_angle, 2 * np.pi * (1 - np.cos(np.radians(aperture / 2))), rtol=1e-6)
        assert sun.up is None


def test_a_turned_sky_has_its_sun_where_the_map_is_reddest():
    turn = clvol.rotate([1, 2, 3], 70.0) @ clvol.scale(3.0)
    direction = turn[:3, :3] @ over_x(1.0)
    [sky, sun] = loaded(sun_direction=direction, to_world=turn).emitters
    red = sky.radiance[: HEIGHT // 4, :, 0]  # without the horizon
    row, column = np.unravel_index(red.argmax(), red.shape)
    seen = (
        sky.to_world[:3, :3] @ FROM_MAP[:3, :3].T @ map_directions(np.array([row]), WIDTH, HEIGHT)[0, column]
    )
    assert np.degrees(np.arccos(seen @ sun.sun_direction / np.linalg.norm(seen))) < 0.5
    assert np.allclose(sun.sun_direction, direction / 3)


def test_what_is_scaled_to_nothing_is_not_there():
    [sky, sun] = loaded(sky_scale=0.0).emitters
    assert isinstance(sky, ConstantEmitter) and sky.radiance == (0.0,) and isinstance(sun, SunEmitter)
    [sky] = loaded(sun_scale=0.0).emitters
    assert isinstance(sky, EnvmapEmitter)


def test_a_sun_below_the_horizon_leaves_the_night_which_is_said():
    night = loaded(hour=23.0)
    assert [type(emitter) for emitter in night.emitters] == [ConstantEmitter]
    assert "below the horizon" in night.approximated[0]


def test_a_low_sun_is_cut_by_the_horizon_and_has_no_blue():
    scene = loaded(**LOW, sun_aperture=5.0)
    [_, sun] = scene.emitters
    assert np.allclose(sun.up, (0, 0, 1)) and sun.irradiance[2] == 0 < sun.irradiance[1]
    assert any("blue" in said for said in scene.approximated)


def test_the_same_disk_without_the_darkening_of_its_limb_is_said():
    assert "complex_sun" in loaded(complex_sun=True).approximated[0]


@pytest.mark.parametrize(
    ("parameters", "message"),
    [
        ({"turbidity": 0.9}, r"'turbidity' .* in \[1, 10\], got 0.9"),
        ({"turbidity": 10.1}, r"'turbidity' .* in \[1, 10\]"),
        ({"albedo": 1.5}, r"'albedo' .* in \[0, 1\]"),
        ({"albedo": {"type": "checkerboard"}}, "'albedo' .* must be a number, an rgb or a spectrum"),
        ({"sun_scale": -1.0}, "'sun_scale' .* >= 0"),
        ({"sky_scale": float("nan")}, "'sky_scale'"),
        ({"sun_aperture": 0.0}, "'sun_aperture'"),
        ({"sun_aperture": 180.0}, "'sun_aperture'"),
        ({"sun_direction": [0, 0, 0]}, "sun_direction is zero"),
        ({"sun_direction": [0, 0, 1], "hour": 3.0}, "either sun_direction or hour"),
        ({"month": 13}, "'month'"),
        ({"month": 2, "day": 30}, "there is no 2010-2-30"),
        ({"hour": 1e30}, "too far"),
        ({"latitude": 91.0}, "'latitude'"),
        ({"sun_scale": 1e15}, "must not exceed"),
        ({"to_world": clvol.scale([1, 2, 1])}, "stretch or shear"),
        ({"scale": 2.0}, "unknown parameter 'scale'"),
    ],
    ids=lambda value: "-".join(value) if isinstance(value, dict) else "",
)
def test_mistakes_are_named(parameters, message):
    with pytest.raises(clvol.SceneError, match=message):
        loaded(**parameters)


def test_directions_of_any_length_are_taken():
    for length in (1e-300, 1e300):
        [_, sun] = loaded(sun_direction=[0, 0, length]).emitters
        assert sun.sun_direction == (0, 0, 1)


def test_a_scene_has_one_sky():
    scene = {"type": "scene", "camera": {"type": "perspective"}, "a": {"type": "sunsky"}}
    with pytest.raises(clvol.SceneError, match="one environment emitter"):
        clvol.load_dict(scene | {"b": {"type": "constant"}})
