"""What only reports need is an extra: clvol renders without it, and says in one line what to install."""

from __future__ import annotations

import os
import subprocess
import sys
from typing import TYPE_CHECKING

import pytest
from places import SCENES

if TYPE_CHECKING:
    from pathlib import Path

WITHOUT = """
import sys
sys.modules["matplotlib"] = None  # as where it is not installed: any import of it is an ImportError
from clvol.cli.main import main
main()
"""


def clvol_without_matplotlib(folder: Path, *arguments: str) -> subprocess.CompletedProcess[str]:
    command = [sys.executable, "-c", WITHOUT, *arguments]
    return subprocess.run(command, cwd=folder, capture_output=True, text=True, env=os.environ)


def test_renders_need_no_matplotlib(tmp_path: Path) -> None:
    scene = str(SCENES / "slab.xml")
    done = clvol_without_matplotlib(
        tmp_path, "render", scene, "-D", "res=8", "--spp", "1", "-o", "a.exr", "-o", "a.png"
    )
    assert done.returncode == 0, done.stderr
    assert (tmp_path / "a.exr").is_file() and (tmp_path / "a.png").is_file()


@pytest.mark.parametrize(
    "arguments",
    [
        ("compare", "{scene}", "--techniques", "delta,regular", "-o", "report"),
        ("ray", "{scene}", "4", "4", "-o", "ray.svg"),
        ("ray", "{scene}", "4", "4"),
    ],
    ids=["compare", "ray", "ray's default"],
)
def test_reports_say_what_to_install_before_anything_is_rendered(
    tmp_path: Path, arguments: tuple[str, ...]
) -> None:
    scene = str(SCENES / "slab.xml")
    done = clvol_without_matplotlib(tmp_path, *(word.format(scene=scene) for word in arguments))
    assert done.returncode == 2
    assert done.stderr.count("\n") == 1, done.stderr
    assert "needs matplotlib" in done.stderr and "pip install 'clvol[report]'" in done.stderr
    assert not list(tmp_path.iterdir())


def test_the_numbers_along_a_ray_need_no_matplotlib(tmp_path: Path) -> None:
    scene = str(SCENES / "slab.xml")
    done = clvol_without_matplotlib(
        tmp_path, "ray", scene, "4", "4", "-D", "res=8", "--techniques", "delta", "-o", "ray.json"
    )
    assert done.returncode == 0, done.stderr
    assert (tmp_path / "ray.json").stat().st_size > 0
