"""Sequences and turntables: nothing jumps, nothing is rendered twice, and nothing stops the rest."""

from __future__ import annotations

import itertools
import shutil
from types import SimpleNamespace
from typing import TYPE_CHECKING

import numpy as np
import OpenImageIO as oiio  # noqa: N813
import pytest
from click.testing import CliRunner, Result

import clvol
from clvol.base.frames import Pattern, parse_frames
from clvol.cli.frames import Reel
from clvol.cli.main import main
from clvol.errors import OptionError, VolumeError
from clvol.picture.video import Film
from clvol.staging.sequence import spread, survey
from clvol.staging.source import Source
from clvol.staging.stage import Staged, stage

if TYPE_CHECKING:
    from pathlib import Path

SIZE = 24, 16
GIVEN = {"light": "sun"}


def run(*arguments: str | Path) -> Result:
    return CliRunner().invoke(main, [str(argument) for argument in arguments])


def ball(place: float, radius: float, n: int = 16) -> np.ndarray:
    """A soft ball at a height from 0 to 1."""
    z, y, x = (np.indices((n, n, n)) + 0.5) / n
    distance = np.sqrt((x - 0.5) ** 2 + (y - 0.5) ** 2 + (z - place) ** 2)
    density: np.ndarray = np.clip(1 - distance / radius, 0, None).astype(np.float32)
    return density


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """smoke.0001.npz, empty, to smoke.0005.npz; the ball rises and grows.  The third is broken."""
    monkeypatch.chdir(tmp_path)
    np.savez("smoke.0001.npz", density=np.zeros((16, 16, 16), np.float32))
    for frame in (2, 4, 5):
        np.savez(f"smoke.{frame:04}.npz", density=ball(0.15 * frame, 0.05 * frame))
    (tmp_path / "smoke.0003.npz").write_bytes(b"no archive")
    return tmp_path


def render(*more: str | Path) -> Result:
    return run("render", "smoke.####.npz", "-o", "out.%04d.exr", "--size", "24x16", "--spp", "1", *more)


def pictures(folder: Path) -> list[str]:
    return sorted(path.name for path in folder.glob("out.*"))


# --- names and lists -------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("name", "third"),
    [
        ("smoke.####.vdb", "smoke.0003.vdb"),
        ("a#b/smoke_%04d.vdb", "a#b/smoke_0003.vdb"),
        ("%d.vdb", "3.vdb"),
        ("/tmp/x/##", "/tmp/x/03"),
    ],
)
def test_a_pattern_has_a_place_for_the_number(name: str, third: str) -> None:
    pattern = Pattern.of(name)
    assert pattern is not None and pattern.at(3) == third


def test_what_is_no_pattern() -> None:
    assert Pattern.of("smoke.vdb") is None and Pattern.of("take#1/smoke.vdb") is None
    with pytest.raises(OptionError, match="more than one place"):
        Pattern.of("a.##.b.##.vdb")


def test_frames_that_there_are_are_found(tmp_path: Path) -> None:
    for name in ("s.0007.vdb", "s.0010.vdb", "s.12345.vdb", "s.02.vdb", "s.0007.vdb.bak", "other.0001.vdb"):
        (tmp_path / name).touch()
    pattern = Pattern.of(f"{tmp_path}/s.####.vdb")
    assert pattern is not None and pattern.found() == [7, 10, 12345]
    (tmp_path / "s.####.vdb").touch()  # a file of that very name is no sequence
    assert Pattern.of(f"{tmp_path}/s.####.vdb") is None
    missing = Pattern.of(f"{tmp_path}/missing/s.####.vdb")
    assert missing is not None
    with pytest.raises(OptionError, match="cannot be read"):
        missing.found()


def test_lists_of_frames() -> None:
    assert parse_frames("1-9:2, 4,4,20-21") == [1, 3, 5, 7, 9, 4, 20, 21]
    for text in ("", "a", "3-1", "1-9:0", "1-", "-3", "1-999999999", "1,,2"):
        with pytest.raises(OptionError, match="frames"):
            parse_frames(text)


# --- what frames share -----------------------------------------------------------------------------


def test_frames_share_framing_and_scale(folder: Path) -> None:
    names = [f"smoke.{frame:04}.npz" for frame in range(1, 6)]
    fixed = survey(names, GIVEN, SIZE)
    staged = [stage(Source.of(names[n]), GIVEN, SIZE, fixed=fixed) for n in (0, 1, 3, 4)]
    places = [one.description["sensor"]["to_world"] for one in staged]
    for place in places[1:]:
        np.testing.assert_array_equal(place, places[0])
    scales = [one.description["volume"]["interior"]["scale"] for one in staged]
    assert len(set(scales)) == 1
    own = [stage(Source.of(names[n]), GIVEN, SIZE).fixed.scales.density for n in (1, 3, 4)]
    assert min(own) <= scales[0] <= max(own)
    for one in (1, 3, 4):  # every frame is in the picture
        found = stage(Source.of(names[one]), GIVEN, SIZE).fixed.points
        assert (found >= fixed.box[0] - 1e-9).all() and (found <= fixed.box[1] + 1e-9).all()


def test_a_sequence_that_burns_somewhere_burns_throughout(tmp_path: Path) -> None:
    dark = {"density": ball(0.3, 0.3), "flame": np.zeros((16, 16, 16)), "temperature": ball(0.3, 0.3)}
    for frame, arrays in enumerate(
        [dark, dark | {"flame": ball(0.3, 0.2), "temperature": 3 * ball(0.3, 0.3)}]
    ):
        np.savez(tmp_path / f"{frame}.npz", **arrays)
    names = [str(tmp_path / f"{frame}.npz") for frame in range(2)]
    fixed = survey(names, {}, SIZE)
    first, second = (stage(Source.of(name), {}, SIZE, fixed=fixed) for name in names)
    assert "emission" not in first.description["volume"]["interior"]
    assert "emission" in second.description["volume"]["interior"]
    albedos = {one.description["volume"]["interior"]["albedo"] for one in (first, second)}
    assert len(albedos) == 1 and "rim" in first.lines[-1] and "rim" in second.lines[-1]


def test_of_a_sequence_that_cannot_be_read_the_reason_is_said(tmp_path: Path) -> None:
    (tmp_path / "a.npz").write_bytes(b"no archive")
    with pytest.raises(VolumeError, match="archive is damaged"):
        survey([str(tmp_path / "a.npz")], {}, SIZE)


def test_names_are_spread_with_both_ends() -> None:
    names = [str(n) for n in range(100)]
    assert spread(names, 5) == ["0", "25", "50", "74", "99"] and spread(names[:3], 5) == names[:3]


# --- the command -----------------------------------------------------------------------------------


def test_a_frame_that_fails_does_not_stop_the_rest(folder: Path) -> None:
    outcome = render()
    assert outcome.exit_code == 1, outcome.output
    assert pictures(folder) == [f"out.{n:04}.exr" for n in (1, 2, 4, 5)]
    told = outcome.stderr.splitlines()
    assert "1 of 5 frames failed" in told[-2] and "smoke.0003.npz" in told[-1]
    empty = oiio.ImageBuf(str(folder / "out.0001.exr")).get_pixels(oiio.FLOAT)[..., :3]
    full = oiio.ImageBuf(str(folder / "out.0005.exr")).get_pixels(oiio.FLOAT)[..., :3]
    assert np.isfinite(empty).all() and empty.std() < full.std()


def test_frames_that_are_there_are_not_rendered_again(folder: Path) -> None:
    (folder / "out.0004.exr").write_bytes(b"earlier")
    outcome = render("--frames", "4-5")
    assert outcome.exit_code == 0, outcome.output
    assert "1 frames were there already" in outcome.stdout
    assert (folder / "out.0004.exr").read_bytes() == b"earlier"
    assert render("--frames", "4", "--overwrite").exit_code == 0
    assert (folder / "out.0004.exr").stat().st_size > 1000
    # A part of a sequence is framed as all of it.
    pixels = [oiio.ImageBuf(str(folder / f"out.{n:04}.exr")).get_pixels(oiio.FLOAT) for n in (4, 5)]
    assert render("--overwrite").exit_code == 1
    for n, before in zip((4, 5), pixels, strict=True):
        again = oiio.ImageBuf(str(folder / f"out.{n:04}.exr")).get_pixels(oiio.FLOAT)
        np.testing.assert_array_equal(again, before)


def test_no_frame_replaces_what_is_rendered(folder: Path) -> None:
    before = {path: path.read_bytes() for path in folder.iterdir()}
    for path in before:
        path.with_suffix(".tif").symlink_to(path)
    outcome = run("render", "smoke.####.npz", "-o", "smoke.####.tif", "--overwrite")
    assert outcome.exit_code == 2
    assert "would replace a frame of the sequence" in outcome.stderr
    (folder / "light.exr").write_bytes(b"an environment")
    outcome = run("render", "smoke.0002.npz", "-o", "light.exr", "--light", "light.exr")
    assert outcome.exit_code == 2 and "would replace the light" in outcome.stderr
    assert {path: path.read_bytes() for path in before} == before


def test_kernels_are_built_once(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    from clvol.device import programs

    built: list[str] = []
    build = programs.build

    def counted(device: object, source: str, *others: object) -> object:
        built.append(source)
        return build(device, source, *others)  # type: ignore[arg-type]

    monkeypatch.setattr(programs, "build", counted)
    assert render("--frames", "4,5").exit_code == 0
    assert len(built) == 2 * len(set(built))


def test_ctrl_c_ends_the_sequence_and_saves_no_half_frame(
    folder: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    rendered = clvol.render
    count = itertools.count(1)

    def interrupted(*arguments: object, **options: object) -> object:
        result = rendered(*arguments, **options)  # type: ignore[arg-type]
        result.stats["interrupted"] = next(count) == 2
        return result

    monkeypatch.setattr(clvol, "render", interrupted)
    outcome = render("--frames", "2,4,5")
    assert outcome.exit_code == 130, outcome.output
    assert "not saved" in outcome.stderr
    assert pictures(folder) == ["out.0002.exr"]


def test_a_turntable_goes_round_at_one_distance(tmp_path: Path) -> None:
    source = Source.of(ball(0.3, 0.2) + ball(0.7, 0.1))

    def turned(turn: float) -> Staged:
        return stage(source, GIVEN, SIZE, turn=turn)

    at = [turned(turn).description["sensor"]["to_world"] for turn in (0, 90, 180, 360)]
    np.testing.assert_allclose(at[3], at[0], atol=1e-12)
    up = np.array([0, 0, 1])
    for matrix in at:
        assert matrix[2, 3] == pytest.approx(at[0][2, 3])
        assert matrix[:3, 2] @ up == pytest.approx(at[0][:3, 2] @ up)
    np.testing.assert_allclose((at[0] + at[2])[:2, 2], 0, atol=1e-12)
    np.save(tmp_path / "smoke.npy", ball(0.5, 0.4))
    output = tmp_path / "turn.##.png"
    outcome = run(
        "render", tmp_path / "smoke.npy", "-o", output, "--turntable", 3, "--size", "24x16", "--spp", 1
    )
    assert outcome.exit_code == 0, outcome.output
    assert sorted(path.name for path in tmp_path.glob("*.png")) == [
        "turn.01.png",
        "turn.02.png",
        "turn.03.png",
    ]


def test_scenes_may_be_a_sequence_too(folder: Path) -> None:
    for frame in (4, 5):
        outcome = run("scene", f"smoke.{frame:04}.npz", "-o", f"scene.{frame}.xml", "--size", "24x16")
        assert outcome.exit_code == 0, outcome.output
    outcome = run("render", "scene.#.xml", "-o", "out.#.exr", "--spp", 1)
    assert outcome.exit_code == 0, outcome.output
    assert pictures(folder) == ["out.4.exr", "out.5.exr"]


@pytest.mark.parametrize(
    ("arguments", "fragment"),
    [
        (["smoke.####.npz", "-o", "out.png"], "no place for a frame's number"),
        (["smoke.####.vdb", "-o", "out.####.png"], "there are no such files"),
        (["smoke.0002.npz", "-o", "out.png", "--frames", "1"], "--frames is for sequences"),
        (["smoke.0002.npz", "-o", "out.mp4"], "a film takes a sequence"),
        (["smoke.####.npz", "-o", "out.####.png", "--turntable", "3"], "turns one volume"),
        (["smoke.0002.npz", "-o", "out.#.png", "--turntable", "3", "--frames", "4"], "frames 1 to 3"),
        (["smoke.####.npz", "-o", "out.####.png", "--frames", "5-1"], "ascends"),
        (["smoke.####.npz", "-o", "out.####.png", "--exposure", "auto"], "differs from frame to frame"),
        (["smoke.####.npz", "-o", "out.####.png", "--profile"], "for one picture"),
        (["smoke.####.npz", "-o", "out.####.gif"], "out.0001.gif"),
        (["smoke.####.npz", "-o", "out.####.png", "--fps", "12"], "--fps is for films"),
        (["smoke.0002.npz", "-o", "out.png", "--overwrite"], "--overwrite is for sequences"),
    ],
)
def test_mistakes_are_one_line(folder: Path, arguments: list[str], fragment: str) -> None:
    outcome = run("render", *arguments)
    assert outcome.exit_code == 2
    assert len(outcome.stderr.splitlines()) == 1, outcome.stderr
    assert fragment in outcome.stderr
    assert not pictures(folder)


def test_films_get_frames_in_order_whatever_order_they_come_in() -> None:
    film: list[int] = []
    reel = Reel([SimpleNamespace(add=lambda pixels: film.append(int(pixels[0])))])  # type: ignore[list-item]
    for place in (1, 3, 0, 4, 2):
        reel.put(place, None if place == 3 else np.array([place]))
    assert film == [0, 1, 2, 4]


# --- films -----------------------------------------------------------------------------------------


def test_a_film_has_every_frame(folder: Path) -> None:
    ffmpeg = pytest.importorskip("imageio_ffmpeg", reason="the extra 'video' is not installed")
    shutil.copy("smoke.0004.npz", "smoke.0003.npz")
    outcome = run(
        "render",
        "smoke.####.npz",
        "-o",
        "smoke.mp4",
        "--size",
        "25x17",
        "--spp",
        "1",
        "--fps",
        "10",
        "--exposure",
        "1",
    )
    assert outcome.exit_code == 0, outcome.output
    frames = ffmpeg.read_frames(str(folder / "smoke.mp4"))
    about = next(frames)
    assert about["size"] == (26, 18) and about["fps"] == 10  # ffmpeg wants even sides
    assert len(list(frames)) == 5


def test_without_its_extra_a_film_is_refused_before_anything_is_rendered(
    folder: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    import sys

    monkeypatch.setitem(sys.modules, "imageio_ffmpeg", None)
    outcome = run("render", "smoke.####.npz", "-o", "smoke.mp4", "-o", "out.####.png", "--size", "25x17")
    assert outcome.exit_code == 2
    assert "pip install 'clvol[video]'" in outcome.stderr
    assert not pictures(folder)


def filmed(path: Path, *sizes: tuple[int, int], ffmpeg: str = "") -> None:
    with Film(path) as film:
        film._ffmpeg = ffmpeg or film._ffmpeg
        for height, width in sizes:
            film.add(np.zeros((height, width, 3), np.uint8))


def test_ffmpeg_s_failure_is_told_and_leaves_no_film(tmp_path: Path) -> None:
    pytest.importorskip("imageio_ffmpeg", reason="the extra 'video' is not installed")
    (tmp_path / "a.mp4").write_bytes(b"earlier")
    with pytest.raises(OptionError, match="does not fit"):
        filmed(tmp_path / "a.mp4", (4, 4), (4, 6))
    assert (tmp_path / "a.mp4").read_bytes() == b"earlier"
    with pytest.raises(OptionError, match="ffmpeg failed"):
        filmed(tmp_path / "b.mp4", (4, 4), ffmpeg="/bin/false")
    assert not (tmp_path / "b.mp4").exists()


def test_ctrl_c_leaves_a_shorter_film(tmp_path: Path) -> None:
    ffmpeg = pytest.importorskip("imageio_ffmpeg", reason="the extra 'video' is not installed")
    path = tmp_path / "a.mp4"

    def pressed() -> None:
        with Film(path) as film:
            film.add(np.zeros((4, 4, 3), np.uint8))
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        pressed()
    assert len(list(ffmpeg.read_frames(str(path)))) == 2  # what it is, and its frame
