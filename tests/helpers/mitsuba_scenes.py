"""The scenes of tests/mitsuba, and the pictures, meshes and volumes they read.

Together they have every plugin that clvol and Mitsuba share.  Their defaults `depth`, `hide`
and `integrator` may be set.
"""

import shutil
from pathlib import Path

import numpy as np
import OpenImageIO as oiio  # noqa: N813
import trimesh
from mesh_files import ascii_ply, serialized, serialized_mesh

from clvol.volumes import write_vol
from clvol.volumes.vol import FLOAT32, HEADER, VERSION

SCENES = sorted((Path(__file__).parents[1] / "mitsuba").glob("*.xml"))


STRANDS = """-2.2 -0.5 0 0.1
-1.2 0.3 0 0.25
0 0.9 0.5 0.2
1.2 0.3 0 0.15
2 -0.4 0 0.1
2.5 0.5 0 0.1

-1 -0.5 0.5 0.1
0.6 -0.5 0.5 0.1
1 0.1 0.5 0.1
-1 -0.4 0.5 0.2
"""


def write_files(folder):
    """Writes everything that the scenes read, and the scenes."""
    rng = np.random.default_rng(1)
    write_image(folder / "picture.png", rng.integers(30, 255, (6, 8, 3)).astype(np.uint8))
    write_image(folder / "leaf.png", rng.integers(0, 255, (5, 7, 3)).astype(np.uint8))
    sky = rng.uniform(0.1, 0.6, (16, 32, 3)).astype(np.float32)
    sky[2:4, 5:8] = (12, 10, 7)
    write_image(folder / "sky.exr", sky)
    bends = rng.normal(size=(6, 9, 3)) * (0.5, 0.5, 0) + (0, 0, 1)
    bends /= np.linalg.norm(bends, axis=-1, keepdims=True)
    write_image(folder / "normals.exr", (0.5 + 0.5 * bends).astype(np.float32))
    unit = np.array([[0, 0, 0], [1, 1, 1]])
    write_vol(folder / "smoke.vol", rng.uniform(0, 1, (6, 5, 7)).astype(np.float32) ** 2, unit)
    write_vol(folder / "albedo.vol", rng.uniform(0.4, 1, (4, 4, 4, 3)).astype(np.float32), unit)
    write_vol(folder / "colours.vol", rng.uniform(0, 1, (3, 4, 5, 3)).astype(np.float32), unit)
    tilts = np.random.default_rng(3).normal(size=(4, 3, 4, 3)) * (0.3, 0.3, 0) + (0, 0, 1)
    tilts /= np.linalg.norm(tilts, axis=-1, keepdims=True)
    write_vol(folder / "tilts.vol", (0.5 + 0.5 * tilts).astype(np.float32), unit)
    _write_flakes(folder / "flakes.vol", (0.3, 0.9, 0.2, 0.1, -0.05, 0.15))
    _write_flakes(folder / "even.vol", (0.6, 0.6, 0.6, 0, 0, 0))
    _write_flakes(folder / "fibres.vol", (0.9, 0.9, 0.02, 0, 0, 0))
    roots = np.random.default_rng(6).normal(size=(3, 3, 4, 3, 3)) * 0.5
    matrices = np.einsum("...ij,...kj->...ik", roots, roots) + 0.04 * np.eye(3)
    _write_flakes(folder / "woven.vol", matrices[..., [0, 1, 2, 0, 0, 1], [0, 1, 2, 1, 2, 2]])
    (folder / "smooth.ply").write_bytes(_smooth_ply())
    (folder / "strands.txt").write_text(STRANDS)
    (folder / "painted.ply").write_bytes(_painted_ply())
    (folder / "cup.obj").write_text(_cup_obj())
    (folder / "pair.serialized").write_bytes(_pair())
    for scene in SCENES:
        shutil.copy(scene, folder)


def write_image(path, pixels):
    """A picture, in its own type."""
    out = oiio.ImageOutput.create(str(path))
    height, width, channels = pixels.shape
    out.open(str(path), oiio.ImageSpec(width, height, channels, str(pixels.dtype)))
    out.write_image(pixels)
    out.close()


def _write_flakes(path, flakes):
    """A volume of one sample with six channels, or of several, for an sggx."""
    samples = np.array(flakes, "<f4")
    size = samples.shape[2::-1] if samples.ndim > 1 else (1, 1, 1)
    header = HEADER.pack(b"VOL", VERSION, FLOAT32, *size, 6, 0, 0, 0, 1, 1, 1)
    path.write_bytes(header + samples.tobytes())


def _pair():
    """A tetrahedron, and one with texture coordinates and normals that are not its faces'."""
    corners = np.array([(1, 1, 1), (-1, -1, 1), (-1, 1, -1), (1, -1, -1)], float)
    faces = [(0, 1, 3), (0, 2, 1), (0, 3, 2), (1, 2, 3)]
    normals, uvs = corners + np.array([0.2, 0.5, 0.1]), (corners[:, :2] + 1.1) / 2
    rich = serialized_mesh(corners, faces, normals, uvs, corners, double=True)
    return serialized(serialized_mesh(corners, faces), rich)


def _smooth_ply(rings=6, sectors=9):
    """A coarse ball with the normals of a fine one."""
    theta, phi = np.meshgrid(
        np.pi * np.arange(rings + 1) / rings, 2 * np.pi * np.arange(sectors + 1) / sectors, indexing="ij"
    )
    normals = np.stack([np.sin(theta) * np.cos(phi), np.cos(theta), np.sin(theta) * np.sin(phi)], axis=-1)
    normals = np.round(normals, 6) + 0.0  # so that the seam and the poles meet, and no zero is negative
    uvs = np.stack([phi / (2 * np.pi), theta / np.pi], axis=-1)
    first = np.arange(rings * (sectors + 1)).reshape(rings, -1)[:, :-1]
    below = first + sectors + 1
    upper = np.stack([first, first + 1, below], axis=-1)[1:]  # the others have no area
    lower = np.stack([first + 1, below + 1, below], axis=-1)[:-1]
    faces = np.concatenate([upper.reshape(-1, 3), lower.reshape(-1, 3)])
    rows = np.concatenate([normals, normals, uvs], axis=-1).reshape(-1, 8)
    return ascii_ply(rows, faces, ("x", "y", "z", "nx", "ny", "nz", "u", "v"))


def _painted_ply():
    """A ball of few faces, whose vertices have colours, and a number as an attribute."""
    ball, rng = trimesh.creation.icosphere(1), np.random.default_rng(2)
    rows = np.concatenate([ball.vertices, rng.uniform(0.05, 0.5, (len(ball.vertices), 4))], axis=1)
    return ascii_ply(rows, ball.faces, ("x", "y", "z", "red", "green", "blue", "rough_0"))


def _cup_obj(sectors=7):
    """An open cone of quadrilaterals with texture coordinates and no normals."""
    lines = []
    for i in range(sectors + 1):
        turn = 2 * np.pi * i / sectors
        for radius, height, v in ((0.4, -0.8, 0.0), (0.8, 0.7, 1.0)):
            lines.append(f"v {radius * np.cos(turn):.6f} {height} {radius * np.sin(turn):.6f}")
            lines.append(f"vt {1.5 * i / sectors:.6f} {v}")
    for i in range(sectors):
        a = 2 * i + 1
        lines.append("f " + " ".join(f"{n}/{n}" for n in (a, a + 1, a + 3, a + 2)))
    return "\n".join(lines) + "\n"
