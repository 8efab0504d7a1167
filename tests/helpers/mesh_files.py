"""Small mesh files for tests, as bytes."""

import json
import struct
import zlib

import numpy as np

TETRAHEDRON_OBJ = b"v 0 0 0\nv 2 0 0\nv 0 1 0\nv 0 0 3\nf 1 3 2\nf 1 2 4\nf 1 4 3\nf 2 3 4\n"


def ply_header(vertices, faces, form="ascii", properties=("x", "y", "z")):
    lines = [
        f"ply\nformat {form} 1.0\nelement vertex {vertices}",
        *(f"property float {p}" for p in properties),
    ]
    lines += [f"element face {faces}\nproperty list uchar int vertex_indices\nend_header\n"]
    return "\n".join(lines).encode()


def ascii_ply(vertices, faces, properties=("x", "y", "z")):
    rows = [" ".join(repr(float(v)) for v in row) for row in vertices]
    rows += [" ".join(str(i) for i in (len(face), *face)) for face in faces]
    header = ply_header(len(vertices), len(faces), properties=properties)
    return header + ("\n".join(rows) + "\n").encode()


def binary_ply(vertices, triangles):
    """Little-endian; float32 (n, 3) and int32 (m, 3)."""
    faces = np.zeros(len(triangles), dtype=[("count", "u1"), ("indices", "<i4", 3)])
    faces["count"], faces["indices"] = 3, triangles
    header = ply_header(len(vertices), len(triangles), "binary_little_endian")
    return header + np.asarray(vertices, "<f4").tobytes() + faces.tobytes()


def glb(primitives, nodes, **extra):
    """One mesh for each of `primitives` (dicts of POSITION, NORMAL, TEXCOORD_0, indices, material)."""
    blob, views, accessors, meshes = b"", [], [], []
    for primitive in primitives:
        attributes = {}
        for name, values in primitive.items():
            if name == "material":
                continue
            array = np.ascontiguousarray(values, "<u4" if name == "indices" else "<f4")
            views.append({"buffer": 0, "byteOffset": len(blob), "byteLength": array.nbytes})
            kind = {"indices": "SCALAR", "TEXCOORD_0": "VEC2"}.get(name, "VEC3")
            accessor = {"bufferView": len(views) - 1, "componentType": 5125 if name == "indices" else 5126}
            attributes[name] = len(accessors)
            accessors.append(accessor | {"count": len(array), "type": kind})
            blob += array.tobytes()
        entry = {"indices": attributes.pop("indices"), "attributes": attributes}
        entry |= {"material": primitive["material"]} if "material" in primitive else {}
        meshes.append({"primitives": [entry]})
    tree = {
        "asset": {"version": "2.0"},
        "scene": 0,
        "scenes": [{"nodes": list(range(len(nodes)))}],
        "nodes": nodes,
        "meshes": meshes,
        "accessors": accessors,
        "bufferViews": views,
        "buffers": [{"byteLength": len(blob)}],
    }
    text = json.dumps(tree | extra).encode()
    text += b" " * (-len(text) % 4)
    body = struct.pack("<I4s", len(text), b"JSON") + text + struct.pack("<I4s", len(blob), b"BIN\0") + blob
    return b"glTF" + struct.pack("<II", 2, 12 + len(body)) + body


def serialized_mesh(vertices, faces, normals=None, uvs=None, colors=None, **how):
    """One mesh as it is in a Mitsuba `.serialized`: its header, then the rest deflated.

    how : version = 4, double = False, flags = 0 (more of them), name = "mesh", counts (what it claims).
    """
    version, double = how.get("version", 4), how.get("double", False)
    given = [part for part in (vertices, normals, uvs, colors) if part is not None]
    flags = how.get("flags", 0) | (0x2000 if double else 0x1000)
    flags |= (normals is not None) | 2 * (uvs is not None) | 8 * (colors is not None)
    name = how.get("name", "mesh").encode() + b"\0" if version == 4 else b""
    body = struct.pack("<I", flags) + name
    body += struct.pack("<QQ", *how.get("counts", (len(vertices), len(faces))))
    body += b"".join(np.asarray(part, "<f8" if double else "<f4").tobytes() for part in given)
    body += np.asarray(faces, "<u4").tobytes()
    return struct.pack("<HH", 0x041C, version) + zlib.compress(body)


def serialized(*meshes, version=4):
    """A `.serialized` file of several meshes."""
    offsets = np.cumsum([0, *map(len, meshes)])[:-1].astype("<u8" if version == 4 else "<u4")
    return b"".join(meshes) + offsets.tobytes() + struct.pack("<I", len(meshes))
