"""Results: variance, merging, and pictures on disk."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np
import OpenImageIO as oiio  # noqa: N813
import pytest

from clvol.errors import OptionError
from clvol.picture import image_io
from clvol.picture.dither import codes
from clvol.picture.estimate import Moments
from clvol.picture.merging import merge
from clvol.picture.result import Result, relative_noise
from clvol.picture.view_transform import View

if TYPE_CHECKING:
    from pathlib import Path

HEIGHT, WIDTH = 5, 7


def make_result(first: int, count: int, **changes: object) -> Result:
    """A result of samples drawn per sample index, so that any split of a range gives the same samples."""
    samples = np.stack(
        [np.random.default_rng(index).random((HEIGHT, WIDTH, 3)) for index in range(first, first + count)]
    )
    metadata = {
        "scene": "cloud.xml",
        "technique": "delta",
        "transmittance": "ratio",
        "majorant": "kdtree",
        "lookup": "exact",
        "seed": 3,
        "spp": count,
        "device": "pocl",
        "version": "0.1.0",
        "seconds": 0.5 * count,
    }
    return Result.from_estimate(
        Moments(samples.sum(axis=0), (samples**2).sum(axis=0), count),
        samples=(first, count),
        aovs={"lookups": (10 * samples[..., 0].mean(axis=0)).astype(np.float32)},
        stats={"paths": count * HEIGHT * WIDTH, "seconds": {"shade": 0.25}, "largest weight": float(first)},
        metadata=metadata | changes,
    )


def read(path: Path) -> tuple[dict[str, np.ndarray], dict[str, object]]:
    """Channels by name, and attributes by name, of a picture on disk."""
    image = oiio.ImageInput.open(str(path))
    spec = image.spec()
    pixels = image.read_image(0, 0, 0, spec.nchannels, spec.format)
    image.close()
    channels = {name: pixels[..., index] for index, name in enumerate(spec.channelnames)}
    return channels, {attribute.name: attribute.value for attribute in spec.extra_attribs}


# --- mean, variance, noise -------------------------------------------------------------------------


def test_variance_is_that_of_the_mean() -> None:
    samples = np.random.default_rng(1).random((16, HEIGHT, WIDTH, 3))
    mean, variance = Moments(samples.sum(axis=0), (samples**2).sum(axis=0), 16).mean_and_variance()
    np.testing.assert_allclose(mean, samples.mean(axis=0), rtol=1e-12)
    np.testing.assert_allclose(variance, samples.var(axis=0, ddof=1) / 16, rtol=1e-9)


def test_variance_of_a_single_sample_is_unknown() -> None:
    result = make_result(0, 1)
    assert np.isinf(result.variance).all()
    assert math.isnan(result.noise)


def test_variance_of_equal_samples_is_zero_and_never_negative() -> None:
    value = np.full((1, 1, 3), 0.1)
    _, variance = Moments(value * 10, value**2 * 10 * (1 - 1e-15), 10).mean_and_variance()
    assert (variance >= 0).all() and (variance < 1e-16).all()


def test_image_and_variance_are_float32_and_sums_float64() -> None:
    result = make_result(0, 4)
    assert result.image.dtype == result.variance.dtype == np.float32
    assert result.estimate.sum_.dtype == result.estimate.sum_of_squares.dtype == np.float64


def test_result_without_samples_is_refused() -> None:
    empty = np.zeros((1, 1, 3))
    with pytest.raises(OptionError, match="at least one sample"):
        Result.from_estimate(Moments(empty, empty, 0), (0, 0), {}, {}, {})


def test_noise_is_standard_error_over_mean_and_passes_over_broken_pixels() -> None:
    image = np.full((4, 4, 3), 2.0, np.float32)
    variance = np.full((4, 4, 3), 0.04, np.float32)
    image[0, 0] = np.nan
    assert relative_noise(image, variance) == pytest.approx(0.1)


# --- merging ---------------------------------------------------------------------------------------


@pytest.mark.parametrize("split", [1, 3, 7])
def test_two_parts_merged_equal_the_whole(split: int) -> None:
    whole = make_result(0, 8)
    merged = merge([make_result(split, 8 - split), make_result(0, split)])
    np.testing.assert_allclose(merged.image, whole.image, rtol=1e-6)
    np.testing.assert_allclose(merged.variance, whole.variance, rtol=1e-6)
    np.testing.assert_allclose(merged.aovs["lookups"], whole.aovs["lookups"], rtol=1e-6)
    assert merged.samples == (0, 8)
    assert merged.stats["paths"] == whole.stats["paths"]


def test_statistics_add_but_for_maxima_and_metadata_counts_all_samples() -> None:
    merged = merge([make_result(0, 2), make_result(2, 2, device="gpu")])
    assert merged.stats == {"paths": 4 * HEIGHT * WIDTH, "seconds": {"shade": 0.5}, "largest weight": 2.0}
    assert merged.metadata["spp"] == 4
    assert merged.metadata["seconds"] == 2.0
    assert merged.metadata["device"] == "pocl; gpu"


def test_ranges_with_a_gap_merge_and_the_gap_can_be_filled() -> None:
    outer = merge([make_result(0, 2), make_result(6, 2)])
    assert outer.samples == (0, 4)
    assert outer.ranges == ((0, 2), (6, 2))
    whole = merge([outer, make_result(2, 4)])
    assert whole.ranges == ((0, 8),)
    np.testing.assert_allclose(whole.image, make_result(0, 8).image, rtol=1e-6)


def test_metadata_says_which_samples_where_their_number_does_not() -> None:
    second = make_result(2, 2, samples=(2, 2))
    assert "samples" not in merge([make_result(0, 2), second]).metadata
    assert merge([second, make_result(4, 2, samples=(4, 2))]).metadata["samples"] == (2, 4)
    gap = merge([make_result(0, 2), make_result(6, 2, samples=(6, 2))])
    assert gap.metadata["samples"] == ((0, 2), (6, 2))
    assert "samples" not in merge([gap, make_result(2, 4, samples=(2, 4))]).metadata
    assert "2 spp from sample 2 on" in repr(second)


def test_overlapping_samples_are_refused() -> None:
    with pytest.raises(OptionError, match="overlapping samples: 3 to 3"):
        merge([make_result(0, 4), make_result(3, 4)])
    with pytest.raises(OptionError, match="overlapping"):
        merge([merge([make_result(0, 2), make_result(6, 2)]), make_result(1, 2)])


@pytest.mark.parametrize(
    ("key", "value"), [("seed", 4), ("scene", "fire.xml"), ("technique", "spectral"), ("majorant", "global")]
)
def test_results_of_another_render_are_refused_by_name(key: str, value: object) -> None:
    with pytest.raises(OptionError, match=f"different {key}: .*{value}"):
        merge([make_result(0, 2), make_result(2, 2, **{key: value})])


def test_another_scene_is_named_first_and_without_its_digest() -> None:
    first, other = make_result(0, 2), {"background": "expected", "digest": "0f"}
    with pytest.raises(OptionError, match="cannot merge results of different scenes: ") as refused:
        merge([first, make_result(2, 2, **other)])
    assert "0f" not in str(refused.value) and "background" not in str(refused.value)
    with pytest.raises(OptionError, match=r"different scene: .*fire\.xml"):
        merge([first, make_result(2, 2, **other, scene="fire.xml")])


def test_results_of_another_size_are_refused() -> None:
    zeros = np.zeros((2, 2, 3))
    other = Result.from_estimate(Moments(zeros, zeros, 2), (2, 2), {}, {}, make_result(2, 2).metadata)
    with pytest.raises(OptionError, match=r"different size: \(7, 5\) and \(2, 2\)"):
        merge([make_result(0, 2), other])


@pytest.mark.parametrize(
    ("parts", "message"),
    [
        ([], "nothing to merge"),
        (
            ["a.exr", make_result(0, 2)],
            "merge takes what clvol.render returns, not 'a.exr'; clvol.load_result reads",
        ),
        ("a.exr", "merge takes what clvol.render returns"),
        (make_result(0, 2), "a list of results"),
        (None, "a list of results"),
    ],
)
def test_what_cannot_be_merged_is_said(parts: object, message: str) -> None:
    with pytest.raises(OptionError, match=message):
        merge(parts)


# --- EXR -------------------------------------------------------------------------------------------


def test_exr_holds_picture_variance_and_aovs_exactly(tmp_path: Path) -> None:
    result = make_result(0, 4)
    result.aovs["motion"] = np.random.default_rng(0).random((HEIGHT, WIDTH, 3)).astype(np.float32)
    result.save(tmp_path / "a.exr")
    channels, _ = read(tmp_path / "a.exr")
    for index, label in enumerate("RGB"):
        np.testing.assert_array_equal(channels[label], result.image[..., index])
        np.testing.assert_array_equal(channels[f"variance.{label}"], result.variance[..., index])
        np.testing.assert_array_equal(channels[f"motion.{label}"], result.aovs["motion"][..., index])
    np.testing.assert_array_equal(channels["lookups"], result.aovs["lookups"])


def test_exr_keeps_nan_and_infinity(tmp_path: Path) -> None:
    result = make_result(0, 1)
    result.image[2, 3, 0] = np.nan
    result.save(tmp_path / "a.exr")
    channels, _ = read(tmp_path / "a.exr")
    assert np.isnan(channels["R"][2, 3]) and np.isinf(channels["variance.G"]).all()


def test_exr_says_how_it_was_made(tmp_path: Path) -> None:
    make_result(0, 4, seed=2**40, crop=(1, 2)).save(tmp_path / "a.exr")
    _, attributes = read(tmp_path / "a.exr")
    expected = {
        "scene": "cloud.xml",
        "technique": "delta",
        "transmittance": "ratio",
        "majorant": "kdtree",
        "lookup": "exact",
        "spp": 4,
        "seed": str(2**40),
        "crop": "[1, 2]",
        "device": "pocl",
        "seconds": 2.0,
        "clvol:version": "0.1.0",
        "Software": "clvol 0.1.0",
    }
    assert {name: attributes.get(name) for name in expected} == expected


# --- PNG -------------------------------------------------------------------------------------------


def test_png_shows_the_picture_with_metadata_as_text(tmp_path: Path) -> None:
    result = make_result(0, 4)
    result.save(tmp_path / "a.PNG")
    channels, attributes = read(tmp_path / "a.PNG")
    expected = codes(image_io.shown_pixels(result.image, None, View().resolved()))
    np.testing.assert_array_equal(channels["G"], expected[..., 1])
    assert attributes["technique"] == "delta" and attributes["spp"] == "4"
    assert attributes["Software"] == "clvol 0.1.0" and attributes["exposure"] == "0"
    assert attributes["view_transform"].startswith("ACES 2.0")


def test_png_paints_broken_pixels_magenta_and_counts_them(
    tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    result = make_result(0, 4)
    result.image[0, 0, 1], result.image[2, 1, 2] = np.nan, np.inf
    result.save(tmp_path / "a.png")
    channels, _ = read(tmp_path / "a.png")
    broken = [tuple(int(channels[label][at]) for label in "RGB") for at in ((0, 0), (2, 1))]
    assert broken == [image_io.MAGENTA] * 2
    assert "2 pixels are NaN or infinite" in caplog.text


# --- failures --------------------------------------------------------------------------------------


@pytest.mark.parametrize("name", ["a.gif", "a", "a.exr.gz"])
def test_unknown_suffix_is_refused(tmp_path: Path, name: str) -> None:
    with pytest.raises(OptionError, match=r"name the file \.exr, \.png"):
        make_result(0, 2).save(tmp_path / name)


def test_missing_folder_is_refused(tmp_path: Path) -> None:
    with pytest.raises(OptionError, match="no such folder"):
        make_result(0, 2).save(tmp_path / "missing" / "a.exr")


@pytest.mark.parametrize("name", ["a.exr", "a.png"])
def test_failed_write_keeps_the_earlier_picture_and_leaves_nothing_behind(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, name: str
) -> None:
    make_result(0, 2).save(tmp_path / name)
    earlier = (tmp_path / name).read_bytes()

    def full_disk(source: object, target: object) -> None:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr("os.replace", full_disk)
    with pytest.raises(OptionError, match="No space left"):
        make_result(0, 4).save(tmp_path / name)
    assert (tmp_path / name).read_bytes() == earlier
    assert [path.name for path in tmp_path.iterdir()] == [name]


def test_picture_is_replaced_once_it_is_complete(tmp_path: Path) -> None:
    make_result(0, 2).save(tmp_path / "a.exr")
    make_result(0, 4).save(tmp_path / "a.exr")
    _, attributes = read(tmp_path / "a.exr")
    assert attributes["spp"] == 4
    assert [path.name for path in tmp_path.iterdir()] == ["a.exr"]
