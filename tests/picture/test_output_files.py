"""Files are written whole or not at all; a picture that cannot have its name is kept under another."""

from __future__ import annotations

import errno
import os
import re
import resource
import shutil
import signal
import stat
import subprocess
import sys
import tempfile
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
import OpenImageIO as oiio  # noqa: N813
import pytest
from click.testing import CliRunner
from places import ROOT

import clvol
from clvol.base.output_files import check_file, write_file
from clvol.cli.main import main
from clvol.errors import OptionError
from clvol.lab.comparison.report import _replace, check_folder
from clvol.lab.ray.view import check_output
from clvol.picture.estimate import Moments
from clvol.picture.result import Result
from clvol.picture.saving import check_disk

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator

SCENE = """<scene version="3.0.0"><sensor type="perspective"><film type="hdrfilm">
<integer name="width" value="64"/><integer name="height" value="64"/></film></sensor>
<emitter type="constant"/></scene>"""


def noise(size: int = 64) -> Result:
    """A picture that no compression makes small."""
    values = np.random.default_rng(1).random((size, size, 3))
    about = {"technique": "delta", "transmittance": "ratio", "majorant": "grid", "lookup": "exact"}
    stats = {"paths": 96, "lookups": 192, "interrupted": False}
    return Result.from_estimate(
        Moments(2 * values, 3 * values**2, 2), (0, 2), {}, stats, about | {"seconds": 1.0}
    )


def pixels(path: Path) -> np.ndarray:
    """Colours of a picture file, which must be whole."""
    opened = oiio.ImageInput.open(str(path))
    assert opened is not None, oiio.geterror()
    found = opened.read_image(0, 0, 0, 3, oiio.FLOAT)
    assert found is not None, opened.geterror()
    return found


@contextmanager
def no_file_over(size: int) -> Iterator[None]:
    """Writing beyond `size` bytes fails, as on a full disk, without root."""
    soft, hard = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (size, hard))
    try:
        yield
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, (soft, hard))


@pytest.fixture
def full_disk(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A folder in which files open and take data, and fail when it comes to the disk; /tmp is elsewhere."""
    folder, spare = tmp_path / "full", tmp_path / "spare"
    folder.mkdir()
    spare.mkdir()
    fsync = os.fsync

    def sync(descriptor: int) -> None:
        if Path(os.readlink(f"/proc/self/fd/{descriptor}")).is_relative_to(folder):
            raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))
        fsync(descriptor)

    monkeypatch.setattr(os, "fsync", sync)
    monkeypatch.setattr(tempfile, "tempdir", str(spare))
    return folder


@pytest.fixture
def rendered(monkeypatch: pytest.MonkeyPatch) -> Callable[[Callable[[], object]], None]:
    """Have `clvol render` return `noise()`, once it did what is given."""

    def fake(meanwhile: Callable[[], object]) -> None:
        monkeypatch.setattr(clvol, "render", lambda *_, **__: (meanwhile(), noise())[1])

    return fake


@pytest.fixture
def scene(tmp_path: Path) -> Path:
    (tmp_path / "scene.xml").write_text(SCENE)
    return tmp_path / "scene.xml"


def only(folder: Path, pattern: str) -> Path:
    """The one file in a folder."""
    (found,) = folder.iterdir()
    assert found.match(pattern)
    return found


# --- a full disk -----------------------------------------------------------------------------------


@pytest.mark.parametrize("name", ["a.png", "a.exr"])
@pytest.mark.parametrize("limit", [1, 4096, 8192])
def test_no_picture_is_cut_short(tmp_path: Path, name: str, limit: int) -> None:
    write_file(tmp_path / name, b"earlier")
    with no_file_over(limit), pytest.raises(OptionError, match="no other place to keep"):
        noise().save(tmp_path / name)
    assert only(tmp_path, name).read_bytes() == b"earlier"


@pytest.mark.parametrize("suffix", [".png", ".exr"])
def test_wherever_memory_ends_no_file_is_taken_for_whole(suffix: str) -> None:
    whole = len(noise(16).encode(suffix))
    for limit in [*range(1, whole - 40, 997), *range(whole - 40, whole)]:
        with no_file_over(limit), pytest.raises(OptionError, match="cannot make the"):
            noise(16).encode(suffix)
    with no_file_over(whole):
        assert len(noise(16).encode(suffix)) == whole


@pytest.mark.parametrize("name", ["a.png", "a.exr"])
def test_a_full_disk_keeps_the_earlier_file_and_the_picture_elsewhere(full_disk: Path, name: str) -> None:
    (full_disk / name).write_bytes(b"earlier")
    with pytest.raises(OptionError, match="No space left on device; the picture is kept as ") as failed:
        noise().save(full_disk / name)
    assert only(full_disk, name).read_bytes() == b"earlier"
    kept = only(full_disk.parent / "spare", "clvol-*.exr")
    assert str(kept) in str(failed.value)
    np.testing.assert_array_equal(pixels(kept), noise().image)


def test_of_two_names_the_one_that_could_be_written_is_told(
    full_disk: Path, scene: Path, rendered: Callable
) -> None:
    rendered(lambda: None)
    good = full_disk.parent / "good.exr"
    outcome = CliRunner().invoke(
        main, ["render", str(scene), "-o", str(full_disk / "a.png"), "-o", str(good)]
    )
    assert outcome.exit_code == 2
    assert f"the picture is kept as {good}" in outcome.stderr and "a.png" not in outcome.stdout
    assert not list(full_disk.iterdir()) and not list((full_disk.parent / "spare").iterdir())


def test_a_report_is_replaced_whole_or_not_at_all(tmp_path: Path) -> None:
    target = tmp_path / "report"
    _replace(target, {"a": b"1"})
    target.chmod(0o700)
    with no_file_over(100), pytest.raises(OSError, match="too large"):
        _replace(target, {"a": b"2", "b": bytes(1000)})
    assert [path.name for path in tmp_path.iterdir()] == ["report"]
    assert only(target, "a").read_bytes() == b"1"
    _replace(target, {"b": b"3"})
    assert only(target, "b").read_bytes() == b"3" and stat.S_IMODE(target.stat().st_mode) == 0o700


KILLED = """
import os, signal, sys
from clvol.base import output_files
setattr(output_files.os, sys.argv[1], lambda *_: os.kill(os.getpid(), signal.SIGKILL))
output_files.write_file(sys.argv[2], b"later" * 9999)
"""


@pytest.mark.parametrize("moment", ["fsync", "replace"])
def test_a_process_that_is_killed_while_it_saves_leaves_the_earlier_file(tmp_path: Path, moment: str) -> None:
    (tmp_path / "a").write_bytes(b"earlier")
    done = subprocess.run([sys.executable, "-c", KILLED, moment, str(tmp_path / "a")], check=False)
    assert done.returncode == -signal.SIGKILL
    assert (tmp_path / "a").read_bytes() == b"earlier"


def test_every_file_is_written_whole() -> None:
    """By output_files; but for notes of PoCL's cache, of which a part does no harm, and a film under way."""
    writes = re.compile(
        r"\bopen\([^()]*,\s*[\"'][wax]b?\+?[\"']|\.open\(\s*[\"'][wax]|(?<!formatter)\.write_(text|bytes)\(|\.tofile\("
        r"|np\.save\w*\((?!file)|savefig\((?!stream|buffer)"
    )
    found = {
        f"{path.parent.name}/{path.name}"
        for path in (ROOT / "clvol").rglob("*.py")
        if writes.search(path.read_text(encoding="utf-8"))
    }
    assert found == {"base/output_files.py", "device/kernel_cache.py", "device/side_builds.py"}


# --- whatever fails after the last sample ----------------------------------------------------------


@pytest.mark.parametrize("meanwhile", [shutil.rmtree, lambda folder: (folder / "a.exr").mkdir()])
def test_a_picture_outlives_what_happens_to_its_folder(
    tmp_path: Path,
    scene: Path,
    monkeypatch: pytest.MonkeyPatch,
    rendered: Callable,
    meanwhile: Callable[[Path], object],
) -> None:
    folder, spare = tmp_path / "folder", tmp_path / "spare"
    folder.mkdir()
    spare.mkdir()
    monkeypatch.setattr(tempfile, "tempdir", str(spare))
    rendered(lambda: meanwhile(folder))
    outcome = CliRunner().invoke(main, ["render", str(scene), "-o", str(folder / "a.exr"), "--quiet"])
    assert outcome.exit_code == 2 and outcome.stderr.count("\n") == 1
    kept = Path(outcome.stderr.strip().rpartition("the picture is kept as ")[2])
    np.testing.assert_array_equal(pixels(kept), noise().image)


def test_names_that_are_not_utf_8_are_written(tmp_path: Path) -> None:
    result = noise()
    result.metadata["scene"] = os.fsdecode(b"sc\xffne.xml")
    for name in (b"p\xff.exr", b"p\xff.png"):
        result.save(tmp_path / os.fsdecode(name))
    saved = oiio.ImageInput.open(str(shutil.copy(tmp_path / os.fsdecode(b"p\xff.exr"), tmp_path / "b.exr")))
    assert saved.spec().getattribute("scene") == r"sc\udcffne.xml"


def test_the_longest_name_is_written_and_a_longer_one_refused(tmp_path: Path) -> None:
    noise().save(tmp_path / ("a" * 251 + ".exr"))
    with pytest.raises(OptionError, match="File name too long"):
        check_file(tmp_path / ("a" * 252 + ".exr"))


def test_the_suffix_is_that_of_the_name_given(tmp_path: Path) -> None:
    (tmp_path / "a.exr").symlink_to("plain")
    noise().save(tmp_path / "a.exr")
    assert (tmp_path / "a.exr").is_symlink() and not (tmp_path / "plain").is_symlink()
    np.testing.assert_array_equal(pixels(tmp_path / "a.exr"), noise().image)


# --- what is refused before the first sample -------------------------------------------------------


@pytest.mark.parametrize("check", [check_file, check_output, noise().save])
@pytest.mark.parametrize(
    ("name", "message"),
    [
        ("pipe.png", "is a named pipe"),
        ("null.png", "is a device"),
        ("loop.png", "loop"),
        ("file/a.png", "Not a directory"),
        ("a\0.png", "null"),
        ("folder.png", "is a folder"),
        ("missing/a.png", "no such folder"),
    ],
)
def test_a_name_that_no_file_can_take_is_refused(
    tmp_path: Path, check: Callable[[Path], None], name: str, message: str
) -> None:
    os.mkfifo(tmp_path / "pipe.png")
    (tmp_path / "null.png").symlink_to("/dev/null")
    (tmp_path / "loop.png").symlink_to("loop.png")
    (tmp_path / "file").touch()
    (tmp_path / "folder.png").mkdir()
    with pytest.raises(OptionError, match=message):
        check(tmp_path / name)


@pytest.mark.parametrize("stops", ["2000", "-101", "nan", "inf"])
def test_an_impossible_exposure_is_refused_before_rendering(
    tmp_path: Path, scene: Path, rendered: Callable, stops: str
) -> None:
    rendered(lambda: pytest.fail("rendered"))
    outcome = CliRunner().invoke(
        main, ["render", str(scene), "-o", str(tmp_path / "a.png"), f"--exposure={stops}"]
    )
    assert outcome.exit_code == 2 and "exposure" in outcome.stderr
    with pytest.raises(OptionError, match="exposure"):
        noise().save(tmp_path / "a.png", exposure=float(stops))


def test_a_disk_without_room_is_refused_before_rendering(
    tmp_path: Path, scene: Path, rendered: Callable, caplog: pytest.LogCaptureFixture
) -> None:
    rendered(lambda: pytest.fail("rendered"))
    raw = 64 * 64 * 8 * 4  # colours, variances, look-ups and samples as float32
    with no_file_over(raw // 40):
        outcome = CliRunner().invoke(main, ["render", str(scene), "-o", str(tmp_path / "a.exr")])
    assert outcome.exit_code == 2 and "cannot write 4 KiB" in outcome.stderr
    with no_file_over(raw // 2):
        check_disk(tmp_path / "a.exr", 64 * 64, 0)
        with pytest.raises(OptionError, match="cannot write 256 KiB"):
            check_folder(tmp_path / "report")
    assert "no room for the 128 KiB it may take" in caplog.text
    assert not list(tmp_path.glob("*.exr"))


# --- modes -----------------------------------------------------------------------------------------


def test_a_file_keeps_its_mode_and_a_new_one_has_that_of_any_other(tmp_path: Path) -> None:
    earlier = os.umask(0o027)
    try:
        write_file(tmp_path / "new", b"1")
        write_file(tmp_path / "old", b"1")
        (tmp_path / "old").chmod(0o604)
        write_file(tmp_path / "old", b"2")
    finally:
        os.umask(earlier)
    modes = {path.name: stat.S_IMODE(path.stat().st_mode) for path in tmp_path.iterdir()}
    assert modes == {"new": 0o640, "old": 0o604}


# --- what is printed -------------------------------------------------------------------------------


def test_names_are_printed_without_commanding_the_terminal(scene: Path, rendered: Callable) -> None:
    rendered(lambda: None)
    output = scene.with_name(os.fsdecode(b"a\xff\x1b[31m.png"))
    outcome = CliRunner().invoke(main, ["render", str(scene), "-o", str(output)])
    assert outcome.exit_code == 0 and r"a\udcff\x1b[31m.png" in outcome.stdout
    outcome = CliRunner().invoke(main, ["render", "\x1b[31m.xml", "-o", str(output)], color=True)
    assert outcome.exit_code == 2 and r"\x1b[31m.xml" in outcome.stderr and "\x1b" not in outcome.stderr


def test_a_narrow_encoding_of_the_terminal_is_no_failure(scene: Path, rendered: Callable) -> None:
    rendered(lambda: None)
    output = scene.with_name("\N{EM DASH}.png")
    outcome = CliRunner(charset="latin-1").invoke(main, ["render", str(scene), "-o", str(output)])
    assert outcome.exit_code == 0 and r"\u2014.png: 64 x 64 pixels" in outcome.stdout
