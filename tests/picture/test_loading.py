"""Pictures that were saved come back as the results they were, merge, and are gone on from."""

from __future__ import annotations

import json
from typing import TYPE_CHECKING

import numpy as np
import OpenImageIO as oiio  # noqa: N813
import pytest
from every_bit import SPP, rendered, scene

import clvol
from clvol.picture.encoding import RECORD

if TYPE_CHECKING:
    from pathlib import Path

    from clvol.picture.result import Result

SEED = 7
CUT = 337


def saved(result: Result, folder: Path, name: str = "a.exr", **options: object) -> Result:
    result.save(folder / name, **options)
    return clvol.load_result(folder / name)


OTHERS = [pytest.param(sampler, marks=pytest.mark.contract) for sampler in ("sobol", "independent")]


@pytest.fixture(scope="module", params=["joint", *OTHERS])
def parts(request: pytest.FixtureRequest) -> list[Result]:
    """The first samples, the others, and all of them."""
    ranges = (0, SPP), (0, CUT), (CUT, SPP - CUT)  # the longest first: its kernels serve the others
    options = {"seed": SEED, "sampler": request.param, "aov": ["depth"]}
    whole, *parts = [rendered(scene(), samples=r, **options) for r in ranges]
    return [*parts, whole]


def test_a_saved_result_comes_back(parts: list[Result], tmp_path: Path) -> None:
    for result in parts:
        back = saved(result, tmp_path)
        assert (back.image == result.image).all() and (back.variance == result.variance).all()
        assert set(back.aovs) == set(result.aovs)
        assert all((back.aovs[name] == result.aovs[name]).all() for name in result.aovs)
        assert json.dumps(back.metadata) == json.dumps(result.metadata)
        assert back.stats == result.stats
        assert (back.samples, back.ranges, back.dof) == (result.samples, result.ranges, result.dof)
        assert back.noise == result.noise and repr(back) == repr(result)


def test_files_merge_to_the_picture_of_all_samples(parts: list[Result], tmp_path: Path) -> None:
    first, second = (saved(part, tmp_path) for part in parts[:2])
    whole = parts[2]
    for pair in ([second, first], [parts[0], second]):
        merged = clvol.merge(pair)
        assert merged.ranges == ((0, SPP),) and merged.dof == whole.dof
        np.testing.assert_allclose(merged.image, whole.image, rtol=3e-7)
        np.testing.assert_allclose(merged.variance, whole.variance, rtol=5e-3)
        assert merged.noise == pytest.approx(whole.noise, rel=1e-3)
        np.testing.assert_allclose(merged.aovs["depth"], whole.aovs["depth"], rtol=1e-5)


def test_merged_files_are_files_again(parts: list[Result], tmp_path: Path) -> None:
    outer = [rendered(scene(), samples=r, seed=SEED) for r in ((0, 2), (6, 2))]
    gap = saved(clvol.merge(outer), tmp_path)
    assert gap.ranges == ((0, 2), (6, 2)) and gap.samples == (0, 4)
    single = saved(rendered(scene(), spp=1, seed=SEED), tmp_path)
    assert np.isinf(single.variance).all()
    rest = rendered(scene(), samples=(1, 7), seed=SEED)
    merged, whole = clvol.merge([single, rest]), rendered(scene(), spp=8, seed=SEED)
    np.testing.assert_allclose(merged.image, whole.image, rtol=3e-7)
    np.testing.assert_allclose(merged.variance, whole.variance, rtol=5e-3)


def test_a_render_goes_on_where_a_file_ended(parts: list[Result], tmp_path: Path) -> None:
    options = {"sampler": parts[0].metadata["sampler"], "seed": SEED, "aov": ["depth"]}
    path = tmp_path / "a.exr"
    parts[0].save(path)
    for resume in (path, str(path), parts[0]):
        more = rendered(scene(), resume=resume, spp=SPP, **options)
        assert more.ranges == ((0, SPP),)
        np.testing.assert_allclose(more.image, parts[2].image, rtol=3e-7)
    records = []
    rendered(scene(), resume=path, spp=CUT + 8, progress=records.append, **options)
    assert (records[-1].samples_done, records[-1].samples_total) == (CUT + 8, CUT + 8)
    enough = rendered(scene(), resume=path, spp=CUT - 1, **options)
    assert enough.samples == (0, CUT) and not enough.stats["interrupted"]
    *_, last = clvol.progressive(scene(), resume=path, spp=CUT + 8, **options)
    assert last.samples == (0, CUT + 8)
    timed = rendered(scene(), resume=path, time_limit=0.01, **options)
    assert timed.ranges[0][0] == 0 and timed.samples[1] > CUT


def test_another_render_does_not_go_on_from_a_file(tmp_path: Path) -> None:
    path = tmp_path / "a.exr"
    rendered(scene(), spp=2, seed=SEED).save(path)
    for options, message in (
        ({"seed": 8}, "another seed: 7, not 8; give seed=7, or render anew"),
        ({"technique": "weighted-delta"}, "another technique: 'delta', not 'weighted-delta'"),
        ({"size": (9, 8)}, "8 x 8 pixels with one of 9 x 8"),
        ({"aov": ["depth"]}, "with lookups, with one with lookups, depth"),
        ({"target_error": 0.1}, "target error cannot go on"),
        ({"samples": (2, 2), "spp": None}, "resume and samples exclude each other"),
        ({"technique": "auto:pilot"}, "leave auto:pilot out"),
    ):
        with pytest.raises(clvol.OptionError, match=message):
            rendered(scene(), **{"seed": SEED, "spp": 4, "resume": path} | options)
    other = clvol.traverse(brighter := scene())
    other.update({"emitter.radiance.value": 0.9})
    with pytest.raises(clvol.OptionError, match="another scene: that of a scene from Python"):
        rendered(brighter, spp=4, seed=SEED, resume=path)


def test_pictures_that_cannot_merge_say_so_before_the_render(tmp_path: Path) -> None:
    half = saved(rendered(scene(), spp=2, seed=SEED), tmp_path, component_format="float16")
    with pytest.raises(clvol.OptionError, match="half floats do not merge"):
        rendered(scene(), spp=4, seed=SEED, resume=half)
    with pytest.raises(clvol.OptionError, match="half floats do not merge"):
        clvol.merge([half, rendered(scene(), samples=(2, 2), seed=SEED)])
    target = saved(rendered(scene(), target_error=0.5, seed=SEED), tmp_path)
    assert (target.estimate.counts.reshape(8, 8) == target.aovs["samples"]).all()
    with pytest.raises(clvol.OptionError, match="results of a target error do not merge"):
        rendered(scene(), spp=4, seed=SEED, resume=target)


def edited(path: Path, change) -> None:
    """Write the file anew with another record, or other channels."""
    picture = oiio.ImageBuf(str(path))
    spec = oiio.ImageSpec(picture.spec())
    record = change(spec.get_string_attribute(RECORD))
    if record is None:
        spec.erase_attribute(RECORD)
    else:
        spec.attribute(RECORD, record)
    pixels = picture.get_pixels(oiio.FLOAT)
    output = oiio.ImageOutput.create(str(path))
    assert output.open(str(path), spec) and output.write_image(pixels) and output.close()


def replaced(**changes: object):
    return lambda text: json.dumps({**json.loads(text), **changes})


@pytest.mark.parametrize(
    "change",
    [
        lambda _: None,
        lambda _: "",
        lambda text: text[:-10],
        lambda _: "[1, 2]",
        lambda _: "[" * 100_000,
        replaced(ranges=[]),
        replaced(ranges=[[0, 2], [1, 4]]),
        replaced(ranges="0,2"),
        replaced(sums={"kind": "replicates", "counts": [1] * 5}),
        replaced(sums={"kind": "replicates", "counts": [0, 0, 0, 0]}),
        replaced(sums={"kind": "replicates", "counts": [1e30]}),
        replaced(sums={"kind": "moments", "count": True}),
        replaced(sums={"kind": "other"}),
        replaced(samples=None),
        replaced(metadata=3),
        replaced(stats=[]),
    ],
    ids=range(16),
)
def test_damaged_records_are_one_error(tmp_path: Path, change) -> None:
    path = tmp_path / "a.exr"
    rendered(scene(), spp=2, seed=SEED).save(path)
    edited(path, change)
    with pytest.raises(clvol.OptionError, match="record of its render"):
        clvol.load_result(path)


def test_what_is_no_picture_of_clvol_is_said(tmp_path: Path) -> None:
    result = rendered(scene(), spp=2, seed=SEED)
    result.save(tmp_path / "a.png")
    result.save(tmp_path / "a.exr")
    (tmp_path / "cut.exr").write_bytes((tmp_path / "a.exr").read_bytes()[:-500])
    (tmp_path / "text.exr").write_text("not a picture")
    for name in ("a.png", "cut.exr", "text.exr", "missing.exr", ".", "a\0b"):
        with pytest.raises(clvol.OptionError):
            clvol.load_result(tmp_path / name)
    for what in (3, None, b"a.exr", ["a.exr"], result):
        with pytest.raises(clvol.OptionError, match="takes a file's name"):
            clvol.load_result(what)


def test_a_result_is_an_array_and_a_picture() -> None:
    result = rendered(scene(), spp=2, seed=SEED)
    assert np.asarray(result) is result.image and np.array(result) is not result.image
    assert np.asarray(result, np.float64).dtype == np.float64
    assert np.mean(result) == result.image.mean()
    with pytest.raises(ValueError, match="copy"):
        np.asarray(result, np.float64, copy=False)
    assert result.display.dtype == np.uint8 and result.display.shape == (8, 8, 3)


def test_a_result_is_an_image_of_pillow() -> None:
    pytest.importorskip("PIL", reason="needs Pillow, of the extra report")
    result = rendered(scene(), spp=2, seed=SEED)
    assert (np.asarray(result.to_pil()) == result.display).all()


def test_what_is_displayed_is_what_a_png_holds(tmp_path: Path) -> None:
    result = rendered(scene(), spp=2, seed=SEED)
    result.save(tmp_path / "a.png")
    assert (oiio.ImageBuf(str(tmp_path / "a.png")).get_pixels(oiio.UINT8) == result.display).all()
