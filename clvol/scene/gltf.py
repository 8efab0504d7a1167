"""glTF files made plain before trimesh reads them.

trimesh drops the texture coordinates of what has no material, and takes time that grows with the square of
a chain of nodes.  Here everything gets a material, and the nodes of the scene become a flat list.
"""

from __future__ import annotations

import json
import struct
from typing import Any

import numpy as np

_GLB, _JSON = b"glTF", b"JSON"
_PLACE = ("matrix", "translation", "rotation", "scale")


def plain_gltf(data: bytes, kind: str) -> bytes:
    """A "gltf" or "glb" file of the same triangles: each with a material, under nodes without children.

    Raises
    ------
    ValueError
        Nodes that are no tree.  What else is wrong is left as it is, for trimesh to say.
    """
    if kind == "gltf":
        return json.dumps(_plain(json.loads(data))).encode()
    if len(data) < 20 or data[:4] != _GLB or data[16:20] != _JSON:
        return data
    (length,) = struct.unpack_from("<I", data, 12)
    text = json.dumps(_plain(json.loads(data[20 : 20 + length]))).encode()
    text += b" " * (-len(text) % 4)
    rest = data[20 + length :]
    return b"".join([data[:8], struct.pack("<II", 20 + len(text) + len(rest), len(text)), _JSON, text, rest])


def _plain(tree: dict[str, Any]) -> dict[str, Any]:
    materials = tree.setdefault("materials", [])
    for mesh in tree.get("meshes", []):
        for primitive in mesh.get("primitives", []):
            if "material" not in primitive:
                primitive["material"] = len(materials)
    materials.append({})
    scenes = tree.get("scenes")
    if scenes:
        scene = scenes[tree.get("scene", 0)]
        tree["nodes"] = _flat(tree.get("nodes", []), scene.get("nodes", []))
        scene["nodes"] = list(range(len(tree["nodes"])))
    return tree


def _flat(nodes: list[dict[str, Any]], roots: list[int]) -> list[dict[str, Any]]:
    """The nodes of meshes below `roots`, each with its matrix to the world."""
    found, seen = [], set()
    waiting: list[tuple[int, np.ndarray | None]] = [(root, None) for root in reversed(roots)]
    while waiting:
        number, parent = waiting.pop()
        if number in seen:
            raise ValueError(f"node {number} is below more than one other, or below itself")
        seen.add(number)
        node = nodes[number]
        local = _matrix(node) if any(key in node for key in _PLACE) else None
        matrix = local if parent is None else parent if local is None else parent @ local
        waiting += [(child, matrix) for child in reversed(node.get("children", []))]
        if "mesh" in node:
            flat = {key: value for key, value in node.items() if key not in (*_PLACE, "children", "camera")}
            found.append(flat if matrix is None else flat | {"matrix": matrix.T.reshape(-1).tolist()})
    return found


def _matrix(node: dict[str, Any]) -> np.ndarray:
    """From a node to its parent: its matrix, or translation · rotation · scale."""
    from trimesh.transformations import quaternion_matrix, translation_matrix

    matrix = np.array(node.get("matrix", np.eye(4)), np.float64).reshape(4, 4).T
    if "translation" in node:
        matrix = matrix @ translation_matrix(node["translation"])
    if "rotation" in node:
        x, y, z, w = node["rotation"]
        matrix = matrix @ quaternion_matrix([w, x, y, z])
    if "scale" in node:
        matrix = matrix @ np.diag([*node["scale"], 1.0])
    return matrix
