"""Side by side with OpenVDB.

What its own module finds in its files and in ours, the reader finds, voxel by voxel.

Runs when asked for: ``pytest --openvdb tests/volumes/test_openvdb.py``, which installs bpy (Blender as a
module, with OpenVDB's in it) in an environment of its own, unless CLVOL_OPENVDB names a Python that has it.
"""

from __future__ import annotations

import json
import os
import subprocess
import sys
from itertools import product
from typing import TYPE_CHECKING

import numpy as np
import openvdb_worker
import pytest
from rich_vdb import STORED_TYPES, rich_grid
from vdb_writer import ACTIVE_MASK, BLOSC, ZIP, write_vdb
from volume_samples import probe

from clvol.scene.describe import describe_volume
from clvol.volumes import list_vdb, read_vdb

if TYPE_CHECKING:
    from pathlib import Path

REQUIREMENT = "bpy==5.0.*"
RENDERED = ("float", "double", "half", "int32", "int64", "vec3s", "vec3d")
REFUSED = {"bool", "vec3i", "points", "frustum"}

OURS = {
    f"{value_type}{' half' if half else ''}, compression {mask | codec}": {
        "value_type": value_type,
        "half": half,
        "compression": mask | codec,
    }
    for (value_type, half), mask, codec in product(STORED_TYPES, (0, ACTIVE_MASK), (0, ZIP, BLOSC))
    if value_type != "half"  # not before OpenVDB 13
}
"""Files by the tests' own writer, which can choose the compression as OpenVDB's module cannot."""
NAME = ("name", "string", b"density")

pytestmark = pytest.mark.openvdb


def openvdb_python(tmp_path_factory) -> str:
    """The Python that CLVOL_OPENVDB names, else that of an environment made for these tests."""
    if given := os.environ.get("CLVOL_OPENVDB"):
        return given
    folder = tmp_path_factory.mktemp("bpy")
    subprocess.run([sys.executable, "-m", "venv", folder], check=True)
    python = str(folder / "bin" / "python")
    subprocess.run([python, "-m", "pip", "install", "--quiet", REQUIREMENT], check=True)
    return python


@pytest.fixture(scope="module")
def folder(tmp_path_factory) -> Path:
    """Where OpenVDB's files and ours are, and what it finds in them."""
    folder = tmp_path_factory.mktemp("openvdb")
    for name, options in OURS.items():
        write_vdb(folder / f"{name}.vdb", [rich_grid(metadata=[NAME], **options)])
    worker = [openvdb_python(tmp_path_factory), openvdb_worker.__file__, folder]
    subprocess.run(worker, check=True, stdout=subprocess.DEVNULL)
    return folder


def display_names(names: list[str]) -> list[str]:
    """The names of a file's grids, in their order: the second "density" is "density[1]"."""
    seen: dict[str, int] = {}
    shown = []
    for name in names:
        number = seen[name] = seen.get(name, -1) + 1
        shown.append(f"{name}[{number}]" if number else name)
    return shown


@pytest.mark.parametrize("variant", [*openvdb_worker.VARIANTS, *OURS])
def test_the_reader_finds_what_openvdb_finds(folder, variant):
    path = folder / f"{variant}.vdb"
    about = json.loads((folder / f"{variant}.json").read_text())
    listed = list_vdb(path)
    names = display_names([known["name"] for known in about])
    assert [info.name for info in listed] == names
    assert [info.value_type for info in listed] == [known["type"] for known in about]
    with np.load(folder / f"{variant}.npz") as stored:
        for number, (name, info, known) in enumerate(zip(names, listed, about, strict=True)):
            if info.unreadable:
                assert name in REFUSED
                continue
            assert (known["type"] in RENDERED, known["linear"]) == (True, True)
            for choice in (number, name):
                read = read_vdb(path, choice)
                assert read.name == name
                assert read.active_voxels == known["active"]
                assert np.array_equal(read.background, np.float32(np.ravel(known["background"])))
                assert np.allclose(read.index_to_world, known["matrix"], rtol=1e-12, atol=1e-12)
                if known["box"]:
                    assert read.active_box.tolist() == known["box"]
                    values, active = probe(read, stored[f"{number}_places"])
                    expected = stored[f"{number}_values"].astype("f4").reshape(values.shape)
                    assert np.array_equal(values, expected, equal_nan=True)
                    assert np.array_equal(active, stored[f"{number}_active"])


@pytest.mark.parametrize("variant", openvdb_worker.VARIANTS)
def test_info_describes_each_grid(folder, variant):
    lines = describe_volume(str(folder / f"{variant}.vdb"))
    about = json.loads((folder / f"{variant}.json").read_text())
    assert sum(line.startswith("  stored") for line in lines) == len(about)
    if not about:
        assert "it has no grids" in lines[0]
