"""Denoised pictures are a layer to be looked at; nothing that is measured sees them."""

from __future__ import annotations

import sys
from typing import TYPE_CHECKING

import numpy as np
import OpenImageIO as oiio  # noqa: N813
import pytest
from click.testing import CliRunner
from pictures import picture

import clvol
from clvol.cli.main import main
from clvol.errors import OptionError
from clvol.picture import denoising
from clvol.picture.estimate import Moments
from clvol.picture.result import Result
from clvol.scene.materials import Diffuse
from clvol.scene.records import ConstantEmitter, Shape

if TYPE_CHECKING:
    from pathlib import Path

SLAB = "scenes/slab.xml"


def noisy(alpha: bool = False, count: int = 4) -> tuple[Result, np.ndarray]:
    """A picture with noise, and without."""
    y, x = np.mgrid[0:48, 0:64] / 64
    clean = np.stack([0.2 + 0.5 * x, 0.1 + y * y, np.full_like(x, 0.4)], axis=-1)
    samples = clean * np.random.default_rng(2).exponential(size=(count, *clean.shape))
    aovs = {"lookups": np.ones(x.shape, np.float32)}
    if alpha:
        aovs["alpha"] = np.float32(np.clip(x + 0.3 * np.random.default_rng(3).normal(size=x.shape), 0, 1))
    moments = Moments(samples.sum(axis=0), (samples**2).sum(axis=0), count)
    return Result.from_estimate(moments, (0, count), aovs, {"paths": 1}, {"spp": count}), clean


def error(image: np.ndarray, clean: np.ndarray) -> float:
    return float(np.sqrt(((image - clean) ** 2).mean()))


def planes(path: Path) -> dict[str, np.ndarray]:
    buffer = oiio.ImageBuf(str(path))
    pixels = buffer.get_pixels(oiio.FLOAT)
    return {name: pixels[..., n] for n, name in enumerate(buffer.spec().channelnames)}


def test_a_missing_extra_is_one_line_before_anything_is_rendered(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setitem(sys.modules, "pyoidn", None)
    with pytest.raises(OptionError, match=r"denoising needs pyoidn.*clvol\[denoise\]"):
        noisy()[0].denoise()
    outcome = CliRunner().invoke(main, ["render", SLAB, "-o", str(tmp_path / "a.exr"), "--denoise"])
    assert outcome.exit_code == 2 and "pip install 'clvol[denoise]'" in outcome.stderr
    assert not list(tmp_path.iterdir())


@pytest.fixture(scope="module")
def oidn() -> object:
    return pytest.importorskip("pyoidn", reason="the extra `denoise` is not installed")


@pytest.mark.usefixtures("oidn")
class TestWithOpenImageDenoise:
    """What the extra brings."""

    def test_noise_goes_and_the_picture_stays_as_it_is(self) -> None:
        result, clean = noisy()
        before = result.image.copy(), result.variance.copy(), result.noise
        assert result.denoise() is result
        assert result.denoised.shape == result.image.shape and result.denoised.dtype == np.float32
        assert error(result.denoised, clean) < 0.15 * error(result.image, clean)
        assert (result.image == before[0]).all() and (result.variance == before[1]).all()
        assert result.noise == before[2]
        assert result.metadata["denoised"].startswith("Open Image Denoise 2.")

    @pytest.mark.parametrize("alpha", [False, True])
    def test_files_have_it_beside_the_picture_and_show_it(self, tmp_path: Path, alpha: bool) -> None:
        result, _ = noisy(alpha)
        result.denoise()
        result.save(tmp_path / "a.exr")
        found = planes(tmp_path / "a.exr")
        for n, channel in enumerate("RGBA" if alpha else "RGB"):
            np.testing.assert_array_equal(found[f"denoised.{channel}"], result.denoised[..., n])
        np.testing.assert_array_equal(found["G"], result.image[..., 1])
        loaded = clvol.load_result(tmp_path / "a.exr")
        np.testing.assert_array_equal(loaded.denoised, result.denoised)
        assert loaded.aovs.keys() == result.aovs.keys()
        assert loaded.encode(".png") == result.encode(".png")
        about = oiio.ImageBuf(str(tmp_path / "a.exr")).spec()
        assert about.getattribute("denoised") == result.metadata["denoised"]
        shown = Result.from_estimate(result.estimate, result.samples, {}, {}, dict(result.metadata))
        shown.image = result.denoised[..., :3]
        if alpha:
            shown.aovs["alpha"] = result.denoised[..., 3]
        assert result.encode(".png") == shown.encode(".png")

    def test_albedo_and_normal_guide_it_and_are_filtered_first(self) -> None:
        result, clean = noisy()
        y, x = np.mgrid[0:48, 0:64]
        stripes = np.where((x // 8 + y // 8) % 2 == 0, 0.9, 0.2)[..., None] * np.ones(3)
        result.image = np.float32(result.image * stripes)
        rng = np.random.default_rng(5)
        result.aovs["albedo"] = np.float32(stripes + 0.1 * rng.normal(size=stripes.shape))
        alone = denoising.denoise(result.image)
        result.denoise()
        assert error(result.denoised, clean * stripes) < 0.8 * error(alone, clean * stripes)
        assert result.metadata["denoised"].endswith("with albedo")

    def test_broken_pixels_stay_broken_and_spoil_no_others(self) -> None:
        result, _ = noisy()
        result.image[3, 4, 1], result.image[9, 9] = np.nan, np.inf
        result.aovs["albedo"] = np.full(result.image.shape, np.nan, np.float32)
        denoised = result.denoise().denoised
        assert np.isnan(denoised[3, 4, 1]) and np.isinf(denoised[9, 9]).all()
        assert np.isfinite(denoised).sum() == denoised.size - 4

    def test_the_smallest_pictures_are_denoised(self) -> None:
        for size in ((1, 1), (1, 9), (9, 1)):
            assert denoising.denoise(np.ones((*size, 3), np.float32)).shape == (*size, 3)

    def test_merging_leaves_it_out(self) -> None:
        scene = clvol.load_file(SLAB, res=8)
        parts = [clvol.render(scene, samples=(n, 2), seed=1, denoise=n == 0) for n in (0, 2)]
        merged = clvol.merge(parts)
        assert merged.denoised is None and "denoised" not in merged.metadata

    def test_renders_have_the_same_bits_and_guides_where_these_help(self) -> None:
        scene = clvol.load_file(SLAB, res=8)
        plain, denoised = (clvol.render(scene, spp=4, seed=1, denoise=on) for on in (False, True))
        assert (plain.image == denoised.image).all() and (plain.variance == denoised.variance).all()
        assert plain.denoised is None and denoised.denoised is not None
        assert "albedo" not in denoised.aovs  # a medium alone, of one albedo
        assert clvol.plan(clvol.load_file("scenes/room.xml")).guides_denoiser
        ball = picture(
            [Shape("sphere", np.eye(4), bsdf=Diffuse())], [ConstantEmitter()], (0, 0, 4), (0, 0, 0)
        )
        found = clvol.render(ball, spp=1, denoise=True)
        assert {"albedo", "normal"} <= found.aovs.keys()
        assert found.metadata["denoised"].endswith("with albedo and normal")

    def test_the_command_denoises(self, tmp_path: Path) -> None:
        outputs = ["-o", str(tmp_path / "a.exr"), "-o", str(tmp_path / "a.png")]
        words = ["render", SLAB, "-D", "res=8", "--spp", "2", "--background", "transparent", "--denoise"]
        outcome = CliRunner().invoke(main, [*words, *outputs])
        assert outcome.exit_code == 0, outcome.output
        assert {"R", "A", "denoised.R", "denoised.A"} <= planes(tmp_path / "a.exr").keys()
        assert "A" in planes(tmp_path / "a.png")
