"""A scene is what it was when it was loaded, whatever becomes of its files and arrays.

What changes while it is read, and what is no file, is one clear error.
"""

from __future__ import annotations

import os
import socket
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from places import SCENES

import clvol
from clvol.errors import Error, VolumeError
from clvol.volumes import files, list_vdb, read_numpy, read_vdb, read_vol, read_volume, write_vol
from clvol.volumes.vdb_stream import WINDOW, open_vdb

FIRE = SCENES / "fire.vdb"
BOX = np.array([[0.0, 0, 0], [1, 1, 1]])
SIZE = 32
NOISE = np.random.default_rng(0).random((SIZE,) * 3, np.float32)


def cloud(**samples) -> clvol.Scene:
    """A unit cube of smoke under a white sky, filling most of a small picture."""
    volume = {"type": "gridvolume"} | samples
    medium = {"type": "heterogeneous", "albedo": 0.5, "scale": 4.0, "sigma_t": volume}
    camera = clvol.look_at([0.5, 0.5, -1.2], [0.5, 0.5, 0.5], [0, 1, 0])
    film = {"type": "hdrfilm", "width": 8, "height": 8}
    return clvol.load_dict(
        {
            "type": "scene",
            "camera": {"type": "perspective", "fov": 40, "to_world": camera, "film": film},
            "sky": {"type": "constant"},
            "box": {
                "type": "cube",
                "to_world": clvol.translate([0.5] * 3) @ clvol.scale(0.5),
                "bsdf": {"type": "null"},
                "interior": medium,
            },
        }
    )


def write(path: Path, values: np.ndarray) -> None:
    """In place, as np.save does: the file keeps its place on the disk, and maps of it their hold."""
    if path.suffix == ".npy":
        np.save(path, values)
    elif path.suffix == ".npz":
        np.savez(path, values)
    else:
        write_vol(path, values, BOX)


REWRITTEN = {
    "shorter": np.ones((8, 8, 8), np.float32),
    "same size, values that would be refused": np.full_like(NOISE, np.nan),
    "longer": np.ones((40, SIZE, SIZE), np.float32),
}


@pytest.mark.parametrize("suffix", [".npy", ".vol", ".npz"])
def test_a_file_written_again_changes_neither_the_picture_nor_its_digest(tmp_path, suffix):
    path = tmp_path / f"smoke{suffix}"
    write(path, NOISE)
    scene = cloud(filename=str(path))
    first = clvol.render(scene, spp=2, seed=3)
    for values in REWRITTEN.values():
        write(path, values)
        again = clvol.render(scene, spp=2, seed=3)
        assert np.array_equal(again.image, first.image)
        assert again.metadata["digest"] == first.metadata["digest"]
        assert again.stats["non_finite"] == 0
    path.unlink()
    assert np.array_equal(clvol.render(scene, spp=2, seed=3).image, first.image)


@pytest.mark.parametrize("kind", ["array", "view", "map"])
def test_an_array_that_is_changed_later_does_not_reach_the_scene(tmp_path, kind):
    values = NOISE.copy()
    if kind == "map":
        np.save(tmp_path / "a.npy", values)
        values = np.load(tmp_path / "a.npy", mmap_mode="r+")
    given = values[:] if kind == "view" else values
    scene = cloud(data=given)
    first = clvol.render(scene, spp=2, seed=3)
    values[:] = np.nan
    assert np.array_equal(clvol.render(scene, spp=2, seed=3).image, first.image)


def test_a_pictures_array_that_is_changed_later_does_not_reach_the_scene():
    sky, texels = np.ones((3, 4, 3), np.float32), np.full((2, 2, 3), 0.5, np.float32)
    bsdf = {"type": "diffuse", "reflectance": {"type": "bitmap", "bitmap": texels, "raw": True}}
    scene = clvol.load_dict(
        {
            "type": "scene",
            "camera": {"type": "perspective"},
            "sky": {"type": "envmap", "bitmap": sky},
            "wall": {"type": "rectangle", "bsdf": bsdf},
        }
    )
    sky[:], texels[:] = np.nan, np.nan
    assert (scene.emitters[0].radiance == 1).all()
    assert (scene.shapes[0].bsdf.reflectance.pixels == 0.5).all()


@pytest.mark.parametrize("suffix", [".npy", ".vol"])
def test_a_file_cut_while_it_is_read_is_an_error(tmp_path, monkeypatch, suffix):
    path = tmp_path / f"a{suffix}"
    write(path, NOISE)
    fill = files.fill

    def cut_and_fill(array, file, where):
        os.truncate(path, SIZE**3)
        fill(array, file, where)

    for module in ("numpy_files", "vol"):
        monkeypatch.setattr(f"clvol.volumes.{module}.fill", cut_and_fill)
    with pytest.raises(VolumeError, match="its data ends after"):
        read_volume(path)


@pytest.mark.parametrize("suffix", [".npy", ".vol", ".npz"])
def test_a_file_written_to_while_it_is_read_is_an_error(tmp_path, monkeypatch, suffix):
    path = tmp_path / f"a{suffix}"
    write(path, NOISE)
    fill = files.fill

    def fill_and_touch(array, file, where):
        fill(array, file, where)
        os.utime(path, ns=(1, 1))

    for module in ("numpy_files", "vol"):
        monkeypatch.setattr(f"clvol.volumes.{module}.fill", fill_and_touch)
    with pytest.raises(VolumeError, match="changed while it was read; load it again once it is written"):
        read_volume(path)


def test_a_vdb_cut_while_it_is_read_is_an_error(tmp_path):
    path = tmp_path / "a.vdb"
    path.write_bytes(FIRE.read_bytes())
    gone = "are gone since it was opened"
    with pytest.raises(VolumeError, match=gone), open_vdb(path) as stream:  # noqa: PT012 (it closes the file too)
        stream.take(100)
        os.truncate(path, 1000)
        stream.skip(2 * WINDOW)
        stream.take(100)


# What is no file


READERS = (read_numpy, read_vol, read_vdb, list_vdb)


@pytest.mark.parametrize("reader", READERS, ids=lambda r: r.__name__)
def test_pipes_sockets_devices_and_folders_are_refused_at_once(tmp_path, reader):
    os.mkfifo(tmp_path / "pipe")
    with socket.socket(socket.AF_UNIX) as server:
        server.bind(str(tmp_path / "socket"))
        for path, kind in (
            (tmp_path / "pipe", "a named pipe"),
            (tmp_path / "socket", "a socket"),
            (Path("/dev/zero"), "a device"),
            (tmp_path, "a folder"),
        ):
            with pytest.raises(VolumeError, match=f"is {kind}, not a volume file"):
                reader(path)


@pytest.mark.parametrize("suffix", [".vdb", ".vol", ".npy", ".npz", ".xml", ""])
def test_info_does_not_wait_for_a_pipe(tmp_path, suffix):
    pipe = tmp_path / f"pipe{suffix}"
    os.mkfifo(pipe)
    arguments = [sys.executable, "-c", "from clvol.cli.main import main; main()", "info", str(pipe)]
    run = subprocess.run(arguments, capture_output=True, text=True, timeout=60, check=False)
    assert run.returncode == 2
    assert "is a named pipe, not a" in run.stderr


def test_a_scene_that_names_pipes_is_refused(tmp_path):
    for name in ("a.vol", "a.obj", "a.ply", "a.exr"):
        os.mkfifo(tmp_path / name)
    for item in (
        {"type": "obj", "filename": str(tmp_path / "a.obj")},
        {"type": "ply", "filename": str(tmp_path / "a.ply")},
        {"type": "envmap", "filename": str(tmp_path / "a.exr")},
        {
            "type": "cube",
            "interior": {
                "type": "heterogeneous",
                "sigma_t": {"type": "gridvolume", "filename": str(tmp_path / "a.vol")},
            },
        },
    ):
        with pytest.raises(Error, match="is a named pipe, not a file"):
            clvol.load_dict({"type": "scene", "camera": {"type": "perspective"}, "item": item})


GLTF = """{"asset": {"version": "2.0"}, "buffers": [{"uri": "points.bin", "byteLength": 36}],
"bufferViews": [{"buffer": 0, "byteLength": 36}],
"accessors": [{"bufferView": 0, "componentType": 5126, "count": 3, "type": "VEC3"}],
"meshes": [{"primitives": [{"attributes": {"POSITION": 0}}]}],
"nodes": [{"mesh": 0}], "scenes": [{"nodes": [0]}], "scene": 0}"""


def test_a_gltf_that_names_a_pipe_is_refused_and_one_that_names_a_file_read(tmp_path):
    path, points = tmp_path / "a.gltf", tmp_path / "points.bin"
    path.write_text(GLTF)
    scene = {"type": "scene", "camera": {"type": "perspective"}, "m": {"type": "gltf", "filename": str(path)}}
    points.write_bytes(np.eye(3, dtype=np.float32).tobytes())
    assert len(clvol.load_dict(scene).shapes[0].mesh.faces) == 1
    points.unlink()
    os.mkfifo(points)
    with pytest.raises(Error, match=r"'points\.bin', which it names, is a named pipe, not a file"):
        clvol.load_dict(scene)
