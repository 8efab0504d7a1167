"""`clvol render` on workers of its own."""

import os
import signal
import subprocess
import sys
import time
from contextlib import suppress
from pathlib import Path

import numpy as np
import pytest

import clvol

pytest.importorskip("distributed", reason="needs the extra cluster: pip install 'clvol[cluster]'")
pytestmark = pytest.mark.contract
COMMAND = [sys.executable, "-m", "clvol", "render"]


@pytest.fixture
def volumes(tmp_path):
    for n in (1, 2):
        np.save(tmp_path / f"v.{n:04}.npy", np.random.default_rng(n).random((9, 9, 9), np.float32))
    return tmp_path


def test_frames_go_to_workers_and_have_the_bits_that_they_have_without(volumes):
    options = ["--size", "16x16", "--quality", "final", "--sampler", "independent", "--spp", "40"]
    for name, where in (("a", ["--workers", "2"]), ("b", [])):
        command = [*COMMAND, "v.####.npy", "-o", f"{name}.####.exr", *options, *where]
        done = subprocess.run(command, cwd=volumes, capture_output=True, text=True, check=False)
        assert done.returncode == 0, done.stderr
    for n in (1, 2):
        one, other = (clvol.load_result(volumes / f"{name}.{n:04}.exr") for name in "ab")
        assert one.image.tobytes() == other.image.tobytes() and one.samples == other.samples


@pytest.mark.parametrize("delay", [0.0, 0.1, 0.3, 0.6])
def test_ctrl_c_while_workers_start_ends_without_a_traceback(volumes, delay):
    """A worker that starts has not yet said what it does with the signal."""
    command = [
        *COMMAND,
        "v.0001.npy",
        "-o",
        "never.exr",
        "--size",
        "16x16",
        "--spp",
        "2000000",
        "--workers",
        "2",
    ]
    begun = subprocess.Popen(
        command,
        cwd=volumes,
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
        start_new_session=True,
        preexec_fn=lambda: signal.signal(signal.SIGINT, signal.default_int_handler),
    )
    while b"spawn_main" not in b"".join(_command_lines(begun.pid)):
        assert begun.poll() is None
        time.sleep(0.01)
    time.sleep(delay)
    os.killpg(begun.pid, signal.SIGINT)
    said, _ = begun.communicate(timeout=60)
    assert (begun.returncode, "Traceback" in said) == (130, False), said


def _command_lines(session: int) -> list[bytes]:
    """Of all processes of a session."""
    found = []
    for folder in Path("/proc").glob("[0-9]*"):
        with suppress(OSError):
            if int((folder / "stat").read_text().rpartition(")")[2].split()[3]) == session:
                found.append((folder / "cmdline").read_bytes())
    return found


def test_ctrl_c_in_a_terminal_reaches_all_processes_and_the_picture_is_kept(volumes):
    options = ["--size", "16x16", "--spp", "2000000", "--workers", "2", "-v"]
    command = [*COMMAND, "v.0001.npy", "-o", "a.exr", *options]
    begun = subprocess.Popen(
        command,
        cwd=volumes,
        stderr=subprocess.PIPE,
        text=True,
        start_new_session=True,
        preexec_fn=lambda: signal.signal(signal.SIGINT, signal.default_int_handler),
    )
    for line in begun.stderr:
        if "device:" in line:
            break
    time.sleep(1.0)
    os.killpg(begun.pid, signal.SIGINT)
    _, said = begun.communicate()
    assert begun.returncode == 130, said
    result = clvol.load_result(volumes / "a.exr")
    assert 0 < result.samples[1] < 2_000_000
