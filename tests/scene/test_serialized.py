"""Mitsuba's `.serialized` meshes are read as Mitsuba reads them, and broken ones are errors.

Numbers called Mitsuba's were printed by version 3.9.1 (scalar_rgb), of the same bytes.
"""

import struct
import tracemalloc
import zlib

import numpy as np
import pytest
from mesh_files import serialized, serialized_mesh

from clvol.errors import SceneError
from clvol.scene import load_dict

VERTICES = np.array([(0, 0, 0), (2, 0, 0), (0, 1, 0), (0, 0, 3)], float)
FACES = [(0, 2, 1), (0, 1, 3), (0, 3, 2), (1, 2, 3)]
NORMALS = [(0, 0, 2), (0, 1, 0), (1, 0, 0), (1, 1, 1)]
UVS = np.array([(0, 0.2), (1, 0), (0, 1), (0.5, 0.5)])
MITSUBAS_NORMALS = [
    (-0.577, -0.577, -0.577),
    (0.927, -0.167, -0.336),
    (-0.411, 0.792, -0.452),
    (-0.198, -0.11, 0.974),
]


@pytest.fixture
def mesh(tmp_path):
    """Writes a file and loads its mesh."""

    def read(data, **parameters):
        path = tmp_path / "mesh.serialized"
        path.write_bytes(data)
        shape = {"type": "serialized", "filename": str(path)} | parameters
        return load_dict({"type": "scene", "camera": {"type": "perspective"}, "thing": shape}).shapes[0].mesh

    return read


@pytest.mark.parametrize("version", [3, 4])
@pytest.mark.parametrize("double", [False, True])
def test_every_mesh_of_a_file_arrives(mesh, version, double):
    how = {"version": version, "double": double}
    plain = serialized_mesh(VERTICES, FACES, **how, name="a name")
    full = serialized_mesh(2 * VERTICES, FACES, NORMALS, UVS, np.ones((4, 3)), **how, name="")
    file = serialized(plain, full, serialized_mesh(VERTICES, FACES[:2], uvs=UVS, **how), version=version)
    first = mesh(file)
    assert np.array_equal(first.vertices, VERTICES)
    assert first.uvs is None
    assert np.allclose(first.normals, MITSUBAS_NORMALS, atol=6e-4)
    second = mesh(file, shape_index=1)
    assert np.array_equal(second.vertices, 2 * VERTICES)
    assert np.array_equal(second.faces, FACES)
    assert np.allclose(second.normals, NORMALS / np.linalg.norm(NORMALS, axis=1)[:, None])
    assert np.allclose(second.uvs, UVS)  # not flipped
    third = mesh(file, shape_index=2)
    assert np.array_equal(third.faces, FACES[:2])
    assert np.allclose(third.uvs, UVS)
    assert mesh(file, shape_index=1, face_normals=True).normals is None


def test_a_file_that_asks_for_faces_normals_is_smooth_as_in_mitsuba_with_a_warning(mesh, caplog):
    read = mesh(serialized_mesh(VERTICES, FACES, flags=0x10))
    assert np.allclose(read.normals, MITSUBAS_NORMALS, atol=6e-4)
    assert "set face_normals" in caplog.text


def test_a_single_mesh_needs_no_table(mesh):
    assert len(mesh(serialized_mesh(VERTICES, FACES)).faces) == 4


WHOLE = serialized_mesh(VERTICES, FACES, NORMALS, UVS)
HEADER, BODY = WHOLE[:4], zlib.decompress(WHOLE[4:])


def of_body(body):
    return HEADER + zlib.compress(body)


BROKEN = {
    "empty": (b"", 0, "it holds none"),
    "another": (bytes(range(256)), 0, "it holds none"),
    "version": (struct.pack("<HH", 0x041C, 5) + WHOLE[4:], 0, "version 5; 3 and 4 can be read"),
    "header only": (HEADER, 0, "ends within its header"),
    "not deflated": (HEADER + bytes(64), 0, "deflated data is damaged"),
    "check sum": (WHOLE[:-1] + b"\0", 0, "deflated data is damaged"),
    "cut code": (WHOLE[:60], 0, "ends within its"),
    "cut triangles": (of_body(BODY[:-1]), 0, "ends within its triangles"),
    "cut normals": (of_body(BODY[: 4 + 5 + 16 + 48 + 5]), 0, "ends within its normals"),
    "no end of the name": (of_body(BODY[:4] + b"a" * 9000), 0, "its name has more than 4096 bytes"),
    "vertices": (serialized_mesh(VERTICES, FACES, counts=(2**60, 4)), 0, "cannot hold"),
    "triangles": (serialized_mesh(VERTICES, FACES, counts=(4, 2**64 - 1)), 0, "cannot hold"),
    "no triangles": (serialized_mesh(VERTICES, np.zeros((0, 3))), 0, "no triangles"),
    "index": (serialized_mesh(VERTICES, [(0, 1, 4)]), 0, "names vertex 4 of 4"),
    "large index": (serialized_mesh(VERTICES, [(0, 1, 2**32 - 1)]), 0, "names vertex 4294967295 of 4"),
    "not finite": (serialized_mesh(VERTICES + np.inf, FACES), 0, "is not finite"),
    "no such mesh": (serialized(WHOLE, WHOLE), 2, "no shape_index 2: it holds 2"),
    "no table": (WHOLE, 1, "table of meshes is damaged"),
    "many": (serialized(WHOLE)[:-4] + b"\xff" * 4, 1, "table of meshes is damaged"),
    "offset": (WHOLE + struct.pack("<QQI", 0, 2**63, 2), 1, "table of meshes is damaged"),
    "elsewhere": (WHOLE + struct.pack("<QQI", 0, 7, 2), 1, "no mesh begins at byte 7"),
    "tiny": (HEADER[:3], 0, "ends within its header"),
}


@pytest.mark.parametrize("name", BROKEN)
def test_broken_files_are_errors(mesh, name):
    data, index, message = BROKEN[name]
    with pytest.raises(SceneError) as caught:
        mesh(data, shape_index=index)
    assert message in str(caught.value)
    assert "scene.thing.filename: mesh '" in str(caught.value)


def test_a_bomb_takes_no_memory(mesh):
    """A hundred megabytes of zeros in 100 kB, of which the counts admit to few, or to four times as many."""
    zeros, header = bytes(100 << 20), struct.pack("<I", 0x1000) + b"\0"
    few = of_body(
        header
        + struct.pack("<QQ", 3, 1)
        + np.float32([0, 0, 0, 1, 0, 0, 0, 1, 0]).tobytes()
        + np.uint32([0, 1, 2]).tobytes()
        + zeros
    )
    many = of_body(header + struct.pack("<QQ", 40 << 20, 4) + zeros)
    tracemalloc.start()
    try:
        assert len(mesh(few).faces) == 1
        with pytest.raises(SceneError, match="cannot hold"):
            mesh(many)
        peak = tracemalloc.get_traced_memory()[1]
    finally:
        tracemalloc.stop()
    assert peak < 4 << 20
