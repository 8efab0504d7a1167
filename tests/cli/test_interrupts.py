"""Signals end a render early, and nothing that is done is lost, whenever they come."""

from __future__ import annotations

import importlib
import os
import signal
import subprocess
import sys
import time
from typing import TYPE_CHECKING

import numpy as np
import OpenImageIO as oiio  # noqa: N813
import pytest
from click.testing import CliRunner, Result
from places import ROOT
from signals import press_key

import clvol
from clvol.api import order
from clvol.base import interrupts, output_files
from clvol.base.progress import Progress, RichProgress
from clvol.cli.main import main

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator
    from pathlib import Path

SIGNALS = (signal.SIGINT, signal.SIGTERM, signal.SIGHUP)
SCENE = """<scene version="3.0.0"><sensor type="perspective"><film type="hdrfilm">
<integer name="width" value="8"/><integer name="height" value="6"/><rfilter type="box"/></film></sensor>
<emitter type="constant"/></scene>"""
CLOUD = """<shape type="cube"><bsdf type="null"/><medium name="interior" type="heterogeneous">
<volume name="sigma_t" type="gridvolume"><string name="filename" value="density.npy"/></volume></medium>
</shape></scene>"""


@pytest.fixture(autouse=True)
def handlers() -> Iterator[None]:
    """Those of an ordinary process, and again after each test those that were before."""
    previous = {number: signal.getsignal(number) for number in SIGNALS}
    signal.signal(signal.SIGINT, signal.default_int_handler)
    signal.signal(signal.SIGTERM, signal.SIG_DFL)
    signal.signal(signal.SIGHUP, signal.SIG_DFL)
    yield
    after = {number: signal.getsignal(number) for number in SIGNALS}
    for number, handler in previous.items():
        signal.signal(number, handler)
    assert list(after.values()) == [signal.default_int_handler, signal.SIG_DFL, signal.SIG_DFL]


def test_ctrl_c_waits_for_an_import(monkeypatch: pytest.MonkeyPatch) -> None:
    """Cut short, pyopencl's ends the process with SIGABRT."""

    def import_module(name: str) -> object:
        signal.raise_signal(signal.SIGINT)
        time.sleep(0.01)
        loaded.append(name)
        return interrupts

    loaded: list[str] = []
    monkeypatch.setattr(importlib, "import_module", import_module)
    monkeypatch.setitem(clvol._EXPORTS, "Interrupt", "clvol.base.interrupts")
    with pytest.raises(KeyboardInterrupt):
        _ = clvol.Interrupt
    assert loaded == ["clvol.base.interrupts"]
    assert signal.getsignal(signal.SIGINT) is signal.default_int_handler


def render(tmp_path: Path, *options: str) -> Result:
    """`clvol render` of a small scene into a.exr."""
    (tmp_path / "scene.xml").write_text(SCENE)
    arguments = ["render", str(tmp_path / "scene.xml"), "-o", str(tmp_path / "a.exr"), *options]
    return CliRunner().invoke(main, arguments)


def samples_of(path: Path) -> int:
    """Samples per pixel of a whole picture file."""
    opened = oiio.ImageInput.open(str(path))
    assert opened.read_image() is not None
    return opened.spec().get_int_attribute("spp")


@pytest.mark.parametrize("number", SIGNALS)
def test_a_signal_ends_the_render_and_keeps_the_picture(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, number: signal.Signals
) -> None:
    pressed = []

    def press_once(_bar: RichProgress, _record: Progress) -> None:
        if not pressed:
            pressed.append(press_key(number))

    monkeypatch.setattr(RichProgress, "__call__", press_once)
    outcome = render(tmp_path, "--time", "120")
    assert outcome.exit_code == 128 + number, outcome.output
    assert "clvol: interrupted after " in outcome.stderr and "saved what there is" in outcome.stderr
    assert samples_of(tmp_path / "a.exr") >= 1


@pytest.mark.parametrize("number", SIGNALS)
@pytest.mark.parametrize("moment", ["after the last sample", "while it is written"])
def test_signals_after_the_last_sample_lose_nothing(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, moment: str, number: signal.Signals
) -> None:
    """However many they are."""

    def pressed_before(function: Callable) -> Callable:
        def pressed(*arguments: object) -> object:
            for _ in range(5):
                press_key(number)
            return function(*arguments)

        return pressed

    if moment == "after the last sample":
        monkeypatch.setattr(order, "make_result", pressed_before(order.make_result))
    else:
        monkeypatch.setattr(output_files.os, "replace", pressed_before(os.replace))
    outcome = render(tmp_path, "--spp", "3")
    assert outcome.exit_code == 128 + number, outcome.output
    assert samples_of(tmp_path / "a.exr") == 3 and "written" not in outcome.stderr


def test_before_the_first_sample_there_is_nothing_to_keep(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(clvol, "load_file", lambda *_, **__: signal.raise_signal(signal.SIGINT))
    (tmp_path / "a.exr").write_bytes(b"earlier")
    outcome = render(tmp_path)
    assert (outcome.exit_code, outcome.stderr.strip()) == (130, "clvol: interrupted")
    assert (tmp_path / "a.exr").read_bytes() == b"earlier"


IGNORED = """
import os, signal
signal.signal(signal.SIGINT, signal.SIG_IGN)
from clvol.base.progress import RichProgress
from clvol.cli.main import main
def pressed(bar, record):
    os.kill(os.getpid(), signal.SIGINT)
    os.kill(os.getpid(), signal.SIGTERM)
RichProgress.__call__ = pressed
main(["render", "s.xml", "-o", "a.exr", "--spp", "1000000"])
"""


LOADING = """
import os, signal, sys
module = sys.argv[-1]
class Pressed:
    def find_spec(self, name, path=None, target=None):
        if name == module:
            os.kill(os.getpid(), signal.SIGINT)
sys.meta_path.insert(0, Pressed())
from clvol.__main__ import main
sys.argv[1:] = ["--version"]
main()
"""
EXITING = """
import atexit, os, signal, sys
from clvol.__main__ import main
atexit.register(os.kill, os.getpid(), signal.SIGINT)
sys.argv[1:] = ["--version"]
main()
"""


def test_ctrl_c_says_nothing_while_the_command_is_loaded_or_has_ended() -> None:
    """Python would print what it was importing, or doing at its exit."""

    def run(*command: str) -> tuple[int, str]:
        done = subprocess.run([sys.executable, "-c", *command], capture_output=True, text=True, check=False)
        return done.returncode, done.stderr

    for module in ("clvol.cli.main", "numpy", "clvol.cli.render"):
        assert run(LOADING, module) == (-signal.SIGINT, "")
    assert run(EXITING) == (0, "")


def test_an_ignored_ctrl_c_takes_no_other_signal_with_it(tmp_path: Path) -> None:
    """As a shell's background jobs ignore it; the compiler of kernels has caught it by the first sample."""
    (tmp_path / "s.xml").write_text(SCENE)
    command = [sys.executable, "-c", IGNORED]
    done = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True, check=False)
    assert done.returncode == 128 + signal.SIGTERM, done.stderr
    assert "saved what there is" in done.stderr and samples_of(tmp_path / "a.exr") > 0


def test_renders_in_python_leave_other_signals_to_the_program() -> None:
    seen = []

    def look(_record: Progress) -> None:
        seen.append([signal.getsignal(number) for number in SIGNALS])

    scene = {"type": "scene", "sensor": {"type": "perspective", "film": {"type": "hdrfilm", "width": 4}}}
    clvol.render(clvol.load_dict(scene | {"sky": {"type": "constant"}}), spp=1, progress=look)
    assert seen[0][0] not in (signal.default_int_handler, signal.SIG_DFL)
    assert seen[0][1:] == [signal.SIG_DFL, signal.SIG_DFL]


def test_signals_count_once_they_are_heeded_and_interrupt_after_so_many() -> None:
    with interrupts.interruptible() as outer:
        with interrupts.interruptible((signal.SIGTERM,)) as inner:
            assert inner is outer
        with pytest.raises(KeyboardInterrupt):
            signal.raise_signal(signal.SIGINT)
        outer.heed(patience=1)
        press_key(signal.SIGINT)
        assert outer.asked() and outer.status == 130
        with pytest.raises(KeyboardInterrupt):
            press_key(signal.SIGINT)
        outer.keep()
        for _ in range(9):
            press_key(signal.SIGINT)
    assert interrupts._held is None


def test_a_comparison_keeps_its_rounds_at_sigterm(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    from clvol.lab.comparison import measure

    np.save(tmp_path / "density.npy", np.float32([[[1, 2], [2, 1]], [[2, 1], [1, 3]]]))
    (tmp_path / "scene.xml").write_text(SCENE.replace("</scene>", CLOUD))
    rounds = measure.rounds

    def pressed(*arguments: object) -> Iterator[object]:
        for number, results in enumerate(rounds(*arguments)):
            if number == 5:
                press_key(signal.SIGTERM)
            yield results

    monkeypatch.setattr(measure, "rounds", pressed)
    monkeypatch.setattr("clvol.lab.comparison.report.plots", lambda _: press_key(signal.SIGTERM) or {})
    arguments = ["--techniques", "delta,regular", "--spp", "1", "-o", str(tmp_path / "report")]
    outcome = CliRunner().invoke(main, ["compare", str(tmp_path / "scene.xml"), *arguments])
    assert outcome.exit_code == 143, outcome.output
    assert "interrupted after 5 rounds, saved what there is" in outcome.stderr
    assert (tmp_path / "report" / "report.html").exists()


@pytest.mark.parametrize("stream", ["1", "2"])
def test_nobody_has_to_read_what_a_render_says(tmp_path: Path, stream: str) -> None:
    """A terminal that is gone, or a full disk, under standard output or standard error."""
    (tmp_path / "scene.xml").write_text(SCENE)
    command = f"exec {sys.executable} -m clvol render scene.xml -o a.exr --majorant grid -v"
    done = subprocess.run(
        ["sh", "-c", f"{command} {stream}>/dev/full"],
        cwd=tmp_path,
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 0 and "Traceback" not in done.stderr and "Exception" not in done.stderr
    assert samples_of(tmp_path / "a.exr") >= 1


def test_an_interrupt_amid_the_making_of_a_class_leaves_the_status(tmp_path: Path) -> None:
    """`python -m` would end by the signal, where modules that were loading make their classes by `exec`."""
    (tmp_path / "interrupted.py").write_text(
        """import sys
import clvol.__main__, clvol.cli.main

def command(prog_name):
    try:
        exec("raise KeyboardInterrupt")
    except KeyboardInterrupt:
        sys.exit(130)

clvol.cli.main.main = command
clvol.__main__.main()
"""
    )
    done = subprocess.run([sys.executable, "-m", "interrupted"], cwd=tmp_path, check=False)
    assert done.returncode == 130


def test_until_ctrl_c_is_quiet_nothing_is_imported() -> None:
    """An interrupt of an import is told with a traceback, and no import can be told to be silent."""
    code = "import sys; sys.path.insert(0, {!r}); known = set(sys.modules); import clvol.__main__; "
    code += "print(*sorted(set(sys.modules) - known))"
    command = [sys.executable, "-I", "-S", "-c", code.format(str(ROOT))]
    done = subprocess.run(command, capture_output=True, text=True, check=True)
    assert done.stdout.split() == ["clvol", "clvol.__main__", "clvol.version"]
