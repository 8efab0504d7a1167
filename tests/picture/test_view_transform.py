"""What a display shows of radiance: the views of a colour configuration, and exposure."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import pytest

from clvol.errors import OptionError
from clvol.picture.exposure import AUTO, GREY, HIGHLIGHTS, MOST_STOPS, auto_exposure
from clvol.picture.image_io import MAGENTA, shown_pixels
from clvol.picture.view_transform import View, through_view

if TYPE_CHECKING:
    from pathlib import Path

# A configuration whose one view is a square root, and which has Rec.709 under one of its usual names.
ROOTS = """ocio_profile_version: 2
roles: {{default: raw, scene_linear: {linear}}}
file_rules:
  - !<Rule> {{name: Default, colorspace: default}}
displays:
  screen:
    - !<View> {{name: roots, colorspace: root}}
colorspaces:
  - !<ColorSpace> {{name: raw, isdata: true}}
  - !<ColorSpace> {{name: {linear}}}
  - !<ColorSpace>
    name: root
    from_scene_reference: !<ExponentTransform> {{value: 2.0, direction: inverse}}
"""


def show(colours: object, exposure: float = 0.0, **names: str) -> np.ndarray:
    """A colour, or several, through a view."""
    image = np.asarray(colours, np.float32)
    shown = shown_pixels(image.reshape(1, -1, 3), None, View(exposure, **names).resolved())
    return shown.reshape(image.shape)


def hue(colour: np.ndarray) -> float:
    """Angle in the plane of opponent colours of CIELAB-like values (OKLab), degrees; of display colours."""
    linear = np.where(colour <= 0.04045, colour / 12.92, ((colour + 0.055) / 1.055) ** 2.4)
    to_lms = np.array(
        [
            [0.4122215, 0.5363325, 0.0514460],
            [0.2119035, 0.6806995, 0.1073970],
            [0.0883025, 0.2817188, 0.6299787],
        ]
    )
    to_lab = np.array(
        [
            [0.2104543, 0.7936178, -0.0040720],
            [1.9779985, -2.4285922, 0.4505937],
            [0.0259040, 0.7827718, -0.8086758],
        ]
    )
    _, a, b = to_lab @ np.cbrt(to_lms @ linear)
    return float(np.degrees(np.arctan2(b, a)))


@pytest.fixture(autouse=True)
def built_in(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delenv("OCIO", raising=False)


def configured(folder: Path, monkeypatch: pytest.MonkeyPatch, text: str) -> None:
    (folder / "config.ocio").write_text(text)
    monkeypatch.setenv("OCIO", str(folder / "config.ocio"))


def test_the_default_view_is_aces_2_on_an_srgb_display() -> None:
    view = View().resolved()
    assert "sRGB" in str(view.display) and "ACES 2.0" in str(view.transform)


def test_a_flame_keeps_its_hue_as_it_gets_brighter() -> None:
    flame = np.array([1.0, 0.35, 0.05])
    flames = flame * 2.0 ** np.arange(-3, 4)[:, None]
    assert np.ptp([hue(colour) for colour in show(flames)]) < 12
    clipped = show(flames, transform="un-tone")  # what each channel does alone: to yellow
    assert np.ptp([hue(colour) for colour in clipped]) > 30


def test_a_brighter_pixel_is_shown_brighter_up_to_white() -> None:
    greys = show(np.geomspace(1e-3, 30, 30)[:, None] * np.ones(3))
    assert (np.diff(greys, axis=0) > 0).all()
    np.testing.assert_allclose(show([np.finfo(np.float32).max] * 3), 1, atol=1e-6)
    np.testing.assert_allclose(show([-1.0, 0.0, -np.finfo(np.float32).max]), 0, atol=1e-6)
    np.testing.assert_allclose(show([1.0] * 3, MOST_STOPS), 1, atol=1e-6)
    np.testing.assert_allclose(show([1.0] * 3, -MOST_STOPS), 0, atol=1e-6)


def test_exposure_is_in_stops() -> None:
    np.testing.assert_allclose(show([0.1, 0.2, 0.3], 2.0), show([0.4, 0.8, 1.2]), atol=1e-6)


def test_un_tone_mapped_is_srgb() -> None:
    shown = show([0.002, 0.18, 0.5], transform="Un-tone-mapped")
    np.testing.assert_allclose(shown, [12.92 * 0.002, 0.4613561, 0.7353569], atol=2e-4)


def test_names_are_found_by_their_parts_and_in_any_case() -> None:
    assert View(display="display P3 - d", transform="RAW").resolved() == View(
        0, "Display P3 - Display", "Raw"
    )
    with pytest.raises(OptionError, match=r"'p3' may be more than one display.*Display P3 - Display"):
        View(display="p3").resolved()
    with pytest.raises(OptionError, match=r"unknown view of display .*'filmic'.*Un-tone-mapped"):
        View(transform="filmic").resolved()
    for wrong in ("", 3):
        with pytest.raises(OptionError, match="unknown display"):
            View(display=wrong).resolved()


def test_the_environment_variable_ocio_names_another_configuration(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    configured(tmp_path, monkeypatch, ROOTS.format(linear="lin_rec709"))
    assert View().resolved() == View(0, "screen", "roots")
    np.testing.assert_allclose(show([0.25, 0.36, 4.0]), [0.5, 0.6, 1.0], atol=1e-5)
    assert not caplog.records
    configured(tmp_path, monkeypatch, ROOTS.format(linear="ours"))
    np.testing.assert_allclose(show([0.25, 0.36, 4.0]), [0.5, 0.6, 1.0], atol=1e-5)
    assert "taken for its scene_linear, 'ours'" in caplog.text


@pytest.mark.parametrize("text", ["hello", "", None])
def test_a_broken_configuration_is_said(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, text: str | None
) -> None:
    if text is not None:
        (tmp_path / "config.ocio").write_text(text)
    monkeypatch.setenv("OCIO", str(tmp_path / "config.ocio"))
    with pytest.raises(OptionError, match=r"OCIO=.*config\.ocio.*unset OCIO"):
        View().resolved()


def test_auto_exposure_makes_the_mean_grey_within_its_highlights() -> None:
    values = np.exp(np.random.default_rng(3).normal(-3, 1.0, (40, 40, 1))) * np.ones(3)
    stops = auto_exposure(values)
    assert np.exp(np.log(values * 2**stops).mean()) == pytest.approx(GREY, rel=1e-6)
    snow = np.full((40, 40, 3), 0.8)
    assert 0.8 * 2 ** auto_exposure(snow) == pytest.approx(HIGHLIGHTS[0])
    candle = np.full((40, 40, 3), 1e-2)
    candle[:2] = 5.0
    assert 5 * 2 ** auto_exposure(candle) == pytest.approx(HIGHLIGHTS[1])


def test_auto_exposure_looks_past_black_and_broken_pixels() -> None:
    values = np.exp(np.random.default_rng(3).normal(-3, 1.0, (40, 40, 1))) * np.ones(3)
    around = np.zeros((80, 80, 3))
    around[:40, :40] = values
    around[60], around[70] = np.nan, np.inf
    around[75] = -1.0
    assert auto_exposure(around) == pytest.approx(auto_exposure(values))
    assert auto_exposure(np.zeros((4, 4, 3))) == auto_exposure(np.full((4, 4, 3), np.nan)) == 0
    for scale in (1e-30, 1e25):
        assert abs(auto_exposure(values * scale)) <= MOST_STOPS


@pytest.mark.parametrize("wrong", ["bright", "Auto", "", None, 101, np.nan, [1]])
def test_an_impossible_exposure_is_refused(wrong: object) -> None:
    with pytest.raises(OptionError, match="not a number from -100 to 100 stops"):
        View(wrong).resolved()  # type: ignore[arg-type]
    assert View(AUTO).resolved().exposure == AUTO


def test_alpha_divides_colours_and_broken_pixels_are_opaque() -> None:
    image = np.float32([[[0.1, 0.2, 0.05], [0.0, 0.0, 0.0], [np.nan, 0.0, 0.0]]])
    alpha = np.float32([[0.5, 0.0, 0.2]])
    shown = shown_pixels(image, alpha, View().resolved())
    np.testing.assert_allclose(shown[0, 0], [*show([0.2, 0.4, 0.1]), 0.5], atol=1e-6)
    np.testing.assert_array_equal(shown[0, 1], 0)
    np.testing.assert_allclose(shown[0, 2] * 255, [*MAGENTA, 255])


def test_a_whole_picture_goes_through_as_its_pixels_do() -> None:
    image = np.random.default_rng(1).random((5, 7, 3), np.float32)
    view = View().resolved()
    whole = through_view(image, view)
    np.testing.assert_array_equal(whole[3, 2], through_view(image[3:4, 2:3], view)[0, 0])
