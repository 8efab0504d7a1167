"""Small whole files of every format that clvol reads, and how each is read: what fuzzing begins with."""

from __future__ import annotations

import io
import json
import struct
import zipfile
import zlib
from dataclasses import dataclass
from types import SimpleNamespace
from typing import TYPE_CHECKING

import numpy as np
import OpenImageIO as oiio  # noqa: N813
from mesh_files import TETRAHEDRON_OBJ, ascii_ply, binary_ply, glb, ply_header, serialized, serialized_mesh
from nvdb_writer import write_nvdb
from places import CASES, SCENES
from rich_vdb import rich_grid
from vdb_writer import ACTIVE_MASK, BLOSC, ZIP, GridSpec, write_vdb

import clvol
from clvol.lab.comparison.reference import read_reference
from clvol.picture.estimate import Moments
from clvol.picture.result import Result
from clvol.rendering.checkpoint import FORMAT, read_checkpoint
from clvol.volumes.bricks import build_bricks
from clvol.volumes.check import check_finite
from clvol.volumes.listing import list_grids
from clvol.volumes.read import read_volume

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator
    from pathlib import Path

CORNERS = [(0, 0, 0), (2, 0, 0), (0, 1, 0), (0, 0, 3)]
FACES = [(0, 2, 1), (0, 1, 3), (0, 3, 2), (1, 2, 3)]
NORMALS = [(0, 0, 2), (0, 1, 0), (1, 0, 0), (1, 1, 1)]
UVS = [(0, 0.2), (1, 0), (0, 1), (0.5, 0.5)]
ONE_LEAF = {(0, 0, 0): (np.ones((8, 8, 8)), np.ones((8, 8, 8), bool))}


@dataclass(frozen=True)
class Kind:
    """A format: whole files of it, made in a folder, and what reads one."""

    seeds: Callable[[Path], list[bytes]]
    read: Callable[[Path], object]


def _scene(**contents: object) -> clvol.Scene:
    film = {"type": "hdrfilm", "width": 4, "height": 4}
    return clvol.load_dict({"type": "scene", "sensor": {"type": "perspective", "film": film}, **contents})


# -- volumes ---------------------------------------------------------------------------------------------


def _read_grids(path: Path) -> None:
    for listed in list_grids(path):
        grid = read_volume(path, listed.name)
        if max(grid.shape if hasattr(grid, "shape") else (0,), default=0) < 512:
            check_finite(grid, "values")
            build_bricks(grid)


def _read_dense(path: Path) -> None:
    grid = read_volume(path)
    check_finite(grid, "values")
    build_bricks(grid)


def _vdbs(folder: Path) -> list[bytes]:
    rich = [
        write_vdb(folder / "a", [rich_grid(compression=codec)])
        for codec in (0, ZIP | ACTIVE_MASK, BLOSC | ACTIVE_MASK)
    ]
    small = [write_vdb(folder / "a", [GridSpec(leaves=ONE_LEAF, half=half)]) for half in (False, True)]
    return rich + small


def _nvdbs(folder: Path) -> list[bytes]:
    packed = [(CASES / "nvdb" / f"{name}.nvdb").read_bytes() for name in ("zip", "blosc")]
    small = [write_nvdb(folder / "a", [GridSpec(leaves=ONE_LEAF)], codec=codec) for codec in (0, 1, 2)]
    return [*packed, *small, write_nvdb(folder / "a", [rich_grid()])]


def _vols(_folder: Path) -> list[bytes]:
    values = np.random.default_rng(1).random((3, 4, 5), np.float32)

    def vol(kind: int, channels: int, data: bytes) -> bytes:
        return b"VOL\3" + struct.pack("<5i6f", kind, 5, 4, 3, channels, 0, 0, 0, 1, 1, 1) + data

    three = np.repeat(values[..., None], 3, -1)
    return [vol(1, 1, values.tobytes()), vol(1, 3, three.tobytes())]


def _npys(_folder: Path) -> list[bytes]:
    values = np.random.default_rng(1).random((3, 4, 5))
    return [_bytes(np.save, array) for array in (values, values.astype("f2"), (values * 99).astype(">u2"))]


def _npzs(_folder: Path) -> list[bytes]:
    arrays = {"density": np.random.default_rng(1).random((3, 4, 5)), "other": np.ones((2, 2, 2), np.uint8)}
    return [_bytes(np.savez, **arrays), _bytes(np.savez_compressed, **arrays)]


def _bytes(save: Callable[..., object], *arrays: object, **named: object) -> bytes:
    stream = io.BytesIO()
    save(stream, *arrays, **named)
    return stream.getvalue()


# -- meshes ----------------------------------------------------------------------------------------------


def _mesh(kind: str) -> Callable[[Path], object]:
    return lambda path: _scene(thing={"type": kind, "filename": str(path)})


def _plys(_folder: Path) -> list[bytes]:
    full = [(*p, *n, *t) for p, n, t in zip(CORNERS, NORMALS, UVS, strict=True)]
    names = ("x", "y", "z", "nx", "ny", "nz", "u", "v")
    return [binary_ply(CORNERS, FACES), ascii_ply(CORNERS, FACES), ascii_ply(full, FACES, names)]


def _objs(_folder: Path) -> list[bytes]:
    full = b"vt 0 0\nvt 1 0\nvn 0 0 1\nf 1/1/1 2/2/1 3/1/1\nf -1 -2 -3 -4\ng a\nusemtl b\n"
    return [TETRAHEDRON_OBJ, TETRAHEDRON_OBJ + full]


def _stls(_folder: Path) -> list[bytes]:
    corners = np.array(CORNERS, "<f4")
    facets = b"".join(bytes(12) + corners[list(face)].tobytes() + bytes(2) for face in FACES)
    lines = [
        "facet normal 0 0 1\nouter loop\n"
        + "".join("vertex {} {} {}\n".format(*CORNERS[corner]) for corner in face)
        + "endloop\nendfacet\n"
        for face in FACES
    ]
    return [
        bytes(80) + struct.pack("<I", len(FACES)) + facets,
        f"solid a\n{''.join(lines)}endsolid a\n".encode(),
    ]


def _glbs(_folder: Path) -> list[bytes]:
    part = {"POSITION": CORNERS, "NORMAL": NORMALS, "TEXCOORD_0": UVS, "indices": np.ravel(FACES)}
    nodes = [{"mesh": 0, "children": [1], "scale": [1, 2, 1]}, {"mesh": 1, "translation": [1, 0, 0]}]
    return [glb([part, part], nodes, scenes=[{"nodes": [0]}]), glb([part], [{"mesh": 0}])]


def _serialized(_folder: Path) -> list[bytes]:
    one = serialized_mesh(CORNERS, FACES, NORMALS, UVS)
    return [one, serialized(one, serialized_mesh(CORNERS, FACES, double=True))]


# -- pictures --------------------------------------------------------------------------------------------


def _pictures(suffix: str, kind: str, *channels_of: int) -> Callable[[Path], list[bytes]]:
    def made(folder: Path) -> list[bytes]:
        found = []
        for channels in channels_of:
            path = folder / f"a{suffix}"
            output = oiio.ImageOutput.create(str(path))
            assert output.open(str(path), oiio.ImageSpec(9, 7, channels, kind))
            output.write_image(np.random.default_rng(0).random((7, 9, channels)).astype(np.float32))
            output.close()
            found.append(path.read_bytes())
        return found

    return made


def _read_picture(path: Path) -> None:
    texture = {"type": "bitmap", "filename": str(path)}
    _scene(
        quad={"type": "rectangle", "bsdf": {"type": "diffuse", "reflectance": texture}},
        sky={"type": "envmap", "filename": str(path)},
    )


FILM = SimpleNamespace(film=SimpleNamespace(window=(0, 0, 4, 3)))


def _results(_folder: Path) -> list[bytes]:
    values = np.random.default_rng(1).random((3, 4, 3))
    result = Result.from_estimate(Moments(2 * values, 3 * values**2, 2), (0, 2), {}, {}, {"seed": 1})
    return [result.encode(".exr")]


# -- checkpoints -----------------------------------------------------------------------------------------


def _checkpoints(_folder: Path) -> list[bytes]:
    spent = {"seconds": 1.0, "launches": 1, "waves": 1, "non_finite": 0}
    spent |= {"stages": {}, "items": {}, "slots": {}}
    about = {"format": FORMAT, "first": 0, "done": 4, "pictures": ["lookups"], "metadata": {}, "spent": spent}
    text = np.frombuffer(json.dumps(about).encode(), np.uint8)
    return [_bytes(np.savez, about=text, film=np.zeros(96, np.uint8), film_peaks=np.zeros(16, np.uint8))]


# -- bombs -----------------------------------------------------------------------------------------------


def _npz_bombs(size: int) -> Iterator[bytes]:
    target = io.BytesIO()
    how = zipfile.ZIP_DEFLATED, True, 1
    with zipfile.ZipFile(target, "w", *how) as parts, parts.open("about.npy", "w") as member:
        member.write(_npy_head((size // 4 + 99, 1, 1)))
        for _ in range(size // _PIECE + 1):
            member.write(bytes(_PIECE))
    yield target.getvalue()


def _npy_head(shape: tuple[int, ...]) -> bytes:
    header = f"{{'descr': '<f4', 'fortran_order': False, 'shape': {shape}, }}\n".encode()
    return b"\x93NUMPY\x01\x00" + struct.pack("<H", len(header)) + header


def _serialized_bombs(size: int) -> Iterator[bytes]:
    whole, squeezer = serialized_mesh(CORNERS, FACES, counts=(size // 12, 4)), zlib.compressobj(1)
    body = zlib.decompressobj().decompress(whole[4:])
    packed = squeezer.compress(body)
    for _ in range(size // _PIECE + 1):
        packed += squeezer.compress(bytes(_PIECE))
    yield whole[:4] + packed + squeezer.flush()


def _ply_bombs(_size: int) -> Iterator[bytes]:
    for vertices, faces in ((4 * 10**9, 2), (0, 4 * 10**9), (10**18, 10**18), (4, 10**9)):
        yield ply_header(vertices, faces, "binary_little_endian") + bytes(100)
        yield ply_header(vertices, faces) + b"0 0 0\n" * 20


def _stl_bombs(_size: int) -> Iterator[bytes]:
    yield bytes(80) + struct.pack("<I", 2**32 - 1) + bytes(100)


def _vol_bombs(_size: int) -> Iterator[bytes]:
    for sides in ((2**31 - 1,) * 3, (1024, 1024, 1024), (1, 1, 2**31 - 1), (-1, -1, 4)):
        yield b"VOL\3" + struct.pack("<5i6f", 1, *sides, 1, 0, 0, 0, 1, 1, 1) + bytes(4000)


def _npy_bombs(_size: int) -> Iterator[bytes]:
    for shape in ((2**40, 1, 1), (2**20, 2**20, 2**20), (2**62, 4, 4), (0, 2**62, 2**62)):
        yield _npy_head(shape) + bytes(64)


def _png_bombs(size: int) -> Iterator[bytes]:
    """Of as many pixels as any is allowed, and many more; of black, which packs a thousand to one."""
    for side in (2**13, 2**16, 2**31 - 1):
        squeezer = zlib.compressobj(1)
        rows = b"".join(squeezer.compress(bytes(_PIECE)) for _ in range(size // _PIECE)) + squeezer.flush()
        parts = ((b"IHDR", struct.pack(">2I5B", side, side, 8, 2, 0, 0, 0)), (b"IDAT", rows), (b"IEND", b""))
        yield b"\x89PNG\r\n\x1a\n" + b"".join(
            struct.pack(">I", len(body)) + kind + body + struct.pack(">I", zlib.crc32(kind + body))
            for kind, body in parts
        )


_PIECE = 1 << 20
BOMBS: dict[str, Callable[[int], Iterator[bytes]]] = {
    ".npz": _npz_bombs,
    "checkpoint.npz": _npz_bombs,
    ".serialized": _serialized_bombs,
    ".ply": _ply_bombs,
    ".stl": _stl_bombs,
    ".vol": _vol_bombs,
    ".npy": _npy_bombs,
    ".png": _png_bombs,
}
"""Files of some kilobytes that say they are, or unpack to, more than so many bytes; none can be read.

Those of .vdb and .nvdb are in tests/volumes, where each lie has its message."""


# -- scenes ----------------------------------------------------------------------------------------------


def _read_scene(path: Path) -> None:
    clvol.load_file(path)


PBRT = """LookAt 0 0 -3 0 0 0 0 1 0 Camera "perspective" "float fov" [40]
Film "rgb" "integer xresolution" [4] "integer yresolution" [4] WorldBegin
AttributeBegin MakeNamedMedium "m" "string type" "uniformgrid" "integer nx" [2] "float density" [1 2]
MediumInterface "m" "" Material "interface" Rotate 20 0 1 0 Shape "sphere" AttributeEnd # a
Texture "t" "spectrum" "scale" "rgb tex" [0.5 0.5 0.1] "float scale" [2]
ObjectBegin "o" Material "dielectric" "float eta" 1.3 Shape "trianglemesh"
"integer indices" [0 1 2] "point3 P" [0 0 0 1 0 0 0 1 0] ObjectEnd
Material "diffuse" "texture reflectance" "t"
ObjectInstance "o" LightSource "infinite" "rgb L" [1 1 1] AreaLightSource "diffuse" "rgb L" [2 1 1]
Shape "disk" "float radius" [2]
"""


XML = """<scene version="3.0.0"><default name="w" value="4"/><integrator type="volpath"/>
<sensor type="thinlens"><float name="fov" value="45"/><float name="aperture_radius" value="0.1"/>
<transform name="to_world"><lookat origin="0, 0, -3" target="0, 0, 0" up="0, 1, 0"/></transform>
<film type="hdrfilm"><integer name="width" value="$w"/><integer name="height" value="4"/></film></sensor>
<bsdf type="twosided" id="b"><bsdf type="roughplastic"><rgb name="diffuse_reflectance" value="0.1, 0.2, 0.3"/>
<float name="alpha" value="0.2"/></bsdf></bsdf>
<shape type="cube"><transform name="to_world"><rotate y="1" angle="30"/><scale value="0.5"/></transform>
<medium name="interior" type="homogeneous"><spectrum name="sigma_t" value="400:1, 500:2, 700:1"/>
<phase type="hg"><float name="g" value="0.3"/></phase></medium><ref id="b"/></shape>
<shape type="sphere"><point name="center" x="1" y="0" z="2"/>
<emitter type="area"><rgb name="radiance" value="1 0.5 0"/></emitter></shape>
<emitter type="directional"><vector name="direction" value="0, -1, 0"/></emitter></scene>"""


def _xmls(_folder: Path) -> list[bytes]:
    return [(SCENES / "slab.xml").read_bytes(), XML.encode()]


FORMATS = {
    ".vdb": Kind(_vdbs, _read_grids),
    ".nvdb": Kind(_nvdbs, _read_grids),
    ".vol": Kind(_vols, _read_dense),
    ".npy": Kind(_npys, _read_dense),
    ".npz": Kind(_npzs, _read_grids),
    ".ply": Kind(_plys, _mesh("ply")),
    ".obj": Kind(_objs, _mesh("obj")),
    ".stl": Kind(_stls, _mesh("stl")),
    ".glb": Kind(_glbs, _mesh("glb")),
    ".serialized": Kind(_serialized, _mesh("serialized")),
    ".exr": Kind(_pictures(".exr", "float", 1, 3), _read_picture),
    ".png": Kind(_pictures(".png", "uint8", 1, 3), _read_picture),
    ".jpg": Kind(_pictures(".jpg", "uint8", 1, 3), _read_picture),
    ".hdr": Kind(_pictures(".hdr", "float", 3), _read_picture),
    "result.exr": Kind(_results, clvol.load_result),
    "reference.exr": Kind(_results, lambda path: read_reference(path, FILM)),
    "checkpoint.npz": Kind(_checkpoints, read_checkpoint),
    ".pbrt": Kind(lambda _: [PBRT.encode()], _read_scene),
    ".xml": Kind(_xmls, _read_scene),
}
"""By the suffix or, where two things have one, the name."""
