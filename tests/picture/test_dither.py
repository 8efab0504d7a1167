"""Eight bits without bands: codes change from pixel to pixel, and their mean is the picture's."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import OpenImageIO as oiio  # noqa: N813
import pytest

from clvol.picture.dither import codes, thresholds
from clvol.picture.image_io import encode_display
from clvol.picture.view_transform import View

if TYPE_CHECKING:
    from pathlib import Path


def smooth(value: float = 0.3, slope: float = 0.5) -> np.ndarray:
    """A sky of eight codes from top to bottom, (128, 64, 3)."""
    rows = value + slope * np.linspace(0, 16 / 255, 128)
    return np.repeat(np.repeat(rows[:, None, None], 64, 1), 3, 2).astype(np.float32)


def test_the_mean_of_a_patch_is_that_of_the_picture() -> None:
    """Rounding alone is off by up to half a code all over a band."""
    picture = smooth()
    patches = (codes(picture) - 255.0 * picture).reshape(16, 8, 8, 8, 3).mean(axis=(1, 3))
    rounded = (np.rint(255 * picture) - 255.0 * picture).reshape(16, 8, 8, 8, 3).mean(axis=(1, 3))
    assert np.abs(patches).max() < 0.1 < 0.25 < np.abs(rounded).max()
    assert np.abs(codes(picture) - 255.0 * picture).max() < 1


def test_what_is_a_code_stays_one_and_grey_stays_grey() -> None:
    exact = np.repeat(np.arange(256, dtype=np.float32).reshape(16, 16, 1) / np.float32(255), 3, axis=2)
    np.testing.assert_array_equal(codes(exact)[..., 0].reshape(-1), np.arange(256))
    for value in (0.0, 1.0):
        assert (codes(np.full((9, 9, 3), value, np.float32)) == 255 * value).all()
    grey = codes(smooth())
    assert (grey == grey[..., :1]).all()


def test_thresholds_are_even_and_the_same_however_rows_are_cut() -> None:
    whole = thresholds(slice(0, 64), 64)
    np.testing.assert_array_equal(whole[20:30], thresholds(slice(20, 30), 64))
    counts = np.histogram(whole, bins=16, range=(0, 1))[0]
    assert counts == pytest.approx(np.full(16, 256), abs=4)


def test_alpha_is_rounded() -> None:
    picture = np.dstack([smooth(), np.full((128, 64), 0.5019, np.float32)])
    assert (codes(picture)[..., 3] == 128).all()


@pytest.mark.parametrize(("suffix", "component"), [(".png", "uint8"), (".tif", "uint8"), (".png", "uint16")])
def test_files_of_eight_bits_are_dithered(suffix: str, component: str, tmp_path: Path) -> None:
    path = tmp_path / f"a{suffix}"
    view = View().resolved().with_stops(smooth())
    path.write_bytes(encode_display(suffix, smooth(0.1, 0.1), None, {}, view, component))
    row = oiio.ImageBuf(str(path)).get_pixels(oiio.FLOAT)[64, :, 0]
    assert len(set(row.tolist())) == (2 if component == "uint8" else 1)
