"""Meshes from files: STL and glTF through trimesh, the rest by `obj`, `ply` and `serialized`."""

from __future__ import annotations

import io
import logging
import os
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from clvol.base.files import note_file, other_kind
from clvol.scene.gltf import plain_gltf
from clvol.scene.mesh import RawMesh, build_mesh
from clvol.scene.obj import read_obj
from clvol.scene.ply import read_ply
from clvol.scene.serialized import read_serialized

if TYPE_CHECKING:
    from trimesh import Trimesh
    from trimesh.resolvers import FilePathResolver

    from clvol.scene.records import Mesh

log = logging.getLogger("clvol")

FORMATS = ("obj", "ply", "serialized", "stl", "glb", "gltf")
_HINTS = {  # what trimesh says, and what it may mean
    "No module named": "it is damaged, or needs that package",
    "No such file": "a gltf needs the files that it names beside it: try glb",
}


def read_mesh(
    path: Path, kind: str, flip_tex_coords: bool = False, face_normals: bool = False, shape_index: int = 0
) -> tuple[Mesh, np.ndarray]:
    """The triangles of a file of one of `FORMATS`, and the point (float64 (3,)) they are relative to.

    Parts of a glTF scene are put together under their transforms.  An STL always has face normals: it does
    not say which triangles meet.  `flip_tex_coords`: v becomes 1 − v.  `shape_index`: which of the meshes
    of a serialized file, from 0.

    Raises
    ------
    ValueError
        Not a mesh of this format, or one that cannot be rendered; what is wrong and perhaps what to do.
    """
    try:
        raw = _read(path, kind, shape_index)
    except Exception as error:  # trimesh raises whatever its parsers stumble over
        reason = " ".join(str(error).split())[:160] or type(error).__name__
        hint = next((f" ({meaning})" for said, meaning in _HINTS.items() if said in reason), "")
        raise ValueError(f"it cannot be read as {kind}: {reason}{hint}") from None
    if flip_tex_coords and raw.uvs is not None:
        raw.uvs[:, 1] = 1 - raw.uvs[:, 1]
    if raw.uvs is not None and raw.without_uvs is not None:
        raw.uvs[raw.without_uvs] = 0
        bare = int(raw.without_uvs[raw.faces].any(axis=1).sum())
        log.warning(
            "%s: %d of %d triangles have no texture coordinates: they get (0, 0)", path, bare, len(raw.faces)
        )
    return build_mesh(raw, str(path), smooth=not face_normals and kind != "stl")


def _read(path: Path, kind: str, shape_index: int) -> RawMesh:
    if kind == "obj":
        return read_obj(path.read_bytes())
    if kind == "ply":
        return read_ply(path.read_bytes())
    if kind == "serialized":
        return read_serialized(path, shape_index)
    return _read_with_trimesh(path, kind)


def _read_with_trimesh(path: Path, kind: str) -> RawMesh:
    import trimesh  # takes half a second, which scenes without meshes are spared

    with np.errstate(all="ignore"):
        data = path.read_bytes()
        file = io.BytesIO(data if kind == "stl" else plain_gltf(data, kind))
        finder = _regular_files(path)
        loaded = trimesh.load(file, file_type=kind, resolver=finder, process=False, maintain_order=True)
    if isinstance(loaded, trimesh.Trimesh):
        return _raw(loaded, np.eye(4))
    parts = []
    if isinstance(loaded, trimesh.Scene):
        for node in loaded.graph.nodes_geometry:
            to_world, name = loaded.graph[node]
            if isinstance(loaded.geometry[name], trimesh.Trimesh):
                parts.append(_raw(loaded.geometry[name], np.asarray(to_world, np.float64)))
    return _joined(parts)


def _regular_files(path: Path) -> FilePathResolver:
    """Finds the files that a mesh names, in its folder as trimesh does, and waits for no pipe among them."""
    from trimesh.resolvers import FilePathResolver

    class RegularFiles(FilePathResolver):
        def get(self, name: str) -> bytes:
            if not Path(os.path.abspath(Path(self.parent, name.strip()))).is_relative_to(self.parent):
                raise ValueError(f"'{name}', which it names, lies outside its folder: move it there")
            for part in (name.strip(), name.strip().lstrip("/"), Path(name).name):
                if kind := other_kind(Path(self.parent, part)):
                    raise ValueError(f"'{part}', which it names, is {kind}, not a file")
                if os.path.isfile(found := Path(self.parent, part)):
                    note_file(found)
            data: bytes = super().get(name)
            return data

    return RegularFiles(str(path))


def _raw(mesh: Trimesh, to_world: np.ndarray) -> RawMesh:
    """A trimesh under a transform; only the normals that its file holds."""
    vertices, faces = np.asarray(mesh.vertices), np.asarray(mesh.faces)
    normals = np.asarray(mesh.vertex_normals) if "vertex_normals" in mesh._cache else None
    uvs = getattr(mesh.visual, "uv", None)
    uvs = None if uvs is None else np.array(uvs, np.float64)
    if not np.array_equal(to_world, np.eye(4)):
        vertices = vertices @ to_world[:3, :3].T + to_world[:3, 3]
        if normals is not None:
            normals = normals @ np.linalg.inv(to_world[:3, :3])
        if np.linalg.det(to_world[:3, :3]) < 0:  # mirrored: outside stays outside
            faces = faces[:, ::-1]
    return RawMesh(vertices, faces, normals, uvs)


def _joined(parts: list[RawMesh]) -> RawMesh:
    """Several meshes as one.  Normals that a part lacks are 0, so worked out later."""
    if not parts:
        raise ValueError("it has no triangles")
    if len(parts) == 1:
        return parts[0]
    first = np.cumsum([0, *(len(part.vertices) for part in parts)])
    has_normals = any(part.normals is not None for part in parts)
    bare = [part.uvs is None for part in parts]
    has_uvs = not all(bare)
    return RawMesh(
        np.concatenate([part.vertices for part in parts]),
        np.concatenate([part.faces + at for part, at in zip(parts, first, strict=False)]),
        np.concatenate([_or_zeros(p.normals, p, 3) for p in parts]) if has_normals else None,
        np.concatenate([_or_zeros(p.uvs, p, 2) for p in parts]) if has_uvs else None,
        np.repeat(bare, [len(p.vertices) for p in parts]) if has_uvs and any(bare) else None,
    )


def _or_zeros(values: np.ndarray | None, part: RawMesh, width: int) -> np.ndarray:
    return np.zeros((len(part.vertices), width)) if values is None else values
