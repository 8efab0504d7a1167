"""What a file is that cannot be used as what it was given for, by how it begins or by its name."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    import os

PICTURE = "scenes name pictures in an envmap or a bitmap"
MESH = "scenes name meshes in a shape of that type"
VOLUME = "give it the suffix of its format"
_BEGINNINGS = (
    (b"\x76\x2f\x31\x01", "an OpenEXR picture", PICTURE),
    (b"\x89PNG", "a PNG picture", PICTURE),
    (b"\xff\xd8\xff", "a JPEG picture", PICTURE),
    (b"GIF8", "a GIF picture", PICTURE),
    (b"#?R", "a Radiance picture", PICTURE),
    (b"II*\0", "a TIFF picture", PICTURE),
    (b"MM\0*", "a TIFF picture", PICTURE),
    (b"ply", "a PLY mesh", MESH),
    (b"glTF", "a glTF mesh", MESH),
    (b" BDV\0\0\0\0", "an OpenVDB volume", VOLUME),
    (b"NanoVDB", "a NanoVDB volume", VOLUME),
    (b"VOL\x03", "a Mitsuba volume", VOLUME),
    (b"\x93NUMPY", "a NumPy array", VOLUME),
    (b"\x89HDF", "an HDF5 file", VOLUME),
    (b"NRRD", "an NRRD image", VOLUME),
    (b"BLENDER", "a Blender file", "export its volumes as .vdb, or the scene as Mitsuba's .xml"),
    (b"PXR-USDC", "a USD file", "export its volumes as .vdb, or the scene as Mitsuba's .xml"),
    (b"#usda", "a USD file", "export its volumes as .vdb, or the scene as Mitsuba's .xml"),
    (b"%PDF", "a PDF", ""),
    (b"\x1f\x8b", "packed by gzip", "unpack it"),
    (b"PK\x03\x04", "a zip archive", "unpack it"),
)
_SUFFIXES = {
    ".obj": ("an OBJ mesh", MESH),
    ".stl": ("an STL mesh", MESH),
    ".gltf": ("a glTF mesh", MESH),
    ".mp4": ("a film", ""),
    ".md": ("a text", ""),
    ".txt": ("a text", ""),
    ".rst": ("a text", ""),
    ".py": ("a Python script", "run it by python"),
    ".ipynb": ("a notebook", "open it in Jupyter"),
    ".json": ("JSON", "if it is of `clvol compare`, its report.html shows it"),
    ".html": ("a web page", "open it in a browser"),
    ".svg": ("an SVG drawing", ""),
}
_HEAD = 16


def kind_of_file(path: str | os.PathLike[str]) -> tuple[str, str]:
    """What a file is, as "a PNG picture", and what to do with it; "" each where that is not known."""
    try:
        with open(path, "rb") as file:
            head = file.read(_HEAD)
    except (OSError, ValueError):
        return "", ""
    for beginning, what, hint in _BEGINNINGS:
        if head.startswith(beginning):
            return what, hint
    if not head:
        return "empty", ""
    return _SUFFIXES.get(Path(path).suffix.lower(), ("", ""))
