"""Write the procedural files of the scenes, the same on every run.

    python tools/make_scenes.py [FOLDER]

`plume.vol` is the smoke of room.xml: it rises in a swaying column, and spreads where the ceiling stops it.
`knot.ply` is the solid of jade.xml: a trefoil knot whose tube is thickest at the outer bends.
"""

from __future__ import annotations

from pathlib import Path

import click
import numpy as np
from folders import SCENES
from make_cloud import fractal

from clvol.volumes import write_vol

PLUME_SHAPE = (36, 52, 36)  # z, y, x; y is up
PLUME_SEED = 3
KNOT_SIZE = (280, 18)  # rings along the knot, corners of a ring


def plume_density(points: np.ndarray) -> np.ndarray:
    """Density 0..1 at points (n, 3) of the unit cube, float32 (n,): y is up, the source is at (½, 0, ½)."""
    warp = np.stack([fractal(points, 2.5, 3, PLUME_SEED + 10 * axis, False) for axis in range(3)], axis=1)
    x, y, z = (points + np.float32(0.3) * warp * np.minimum(1, 2 * points[:, 1:2])).T
    away = np.hypot(x - 0.5 - 0.10 * np.sin(6 * y) * y, z - 0.5 + 0.06 * np.sin(5 * y) * y)
    radius = 0.07 + 0.13 * y + 0.5 * np.clip((y - 0.6) / 0.4, 0, 1) ** 2
    billows = fractal(points, 4.0, 3, PLUME_SEED + 40, True)
    depth = (radius - away) / radius + 1.5 * (billows - 0.2)
    ceiling = np.clip((1 - points[:, 1]) / 0.08, 0, 1)
    return (np.clip(2 * depth, 0, 1) * ceiling * np.clip(1.8 - 2 * points[:, 1], 0.05, 1)).astype(np.float32)


def make_plume() -> np.ndarray:
    """The smoke, float32 in z, y, x order: multiples of 1/255, the outermost layer 0."""
    axes = [(np.arange(n, dtype=np.float32) + np.float32(0.5)) / np.float32(n) for n in PLUME_SHAPE]
    z, y, x = np.meshgrid(*axes, indexing="ij")
    density = plume_density(np.stack([x.ravel(), y.ravel(), z.ravel()], axis=1)).reshape(PLUME_SHAPE)
    values = np.zeros(PLUME_SHAPE, np.float32)
    inner = (slice(1, -1),) * 3
    values[inner] = np.rint(density[inner] * np.float32(255)) / np.float32(255)
    return values


def make_knot() -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """A closed tube: vertices and unit normals, float32 (n, 3), and faces, int32 (m, 3), turned outwards."""
    rings, corners = KNOT_SIZE
    t = 2 * np.pi * np.arange(rings)[:, None] / rings
    curve = np.hstack([np.sin(t) + 2 * np.sin(2 * t), np.cos(t) - 2 * np.cos(2 * t), -1.1 * np.sin(3 * t)])
    tangent = np.roll(curve, -1, axis=0) - np.roll(curve, 1, axis=0)
    side = np.cross(tangent, [0.0, 0.0, 1.0])  # the tangent is never along z
    side /= np.linalg.norm(side, axis=1, keepdims=True)
    up = np.cross(side, tangent)
    up /= np.linalg.norm(up, axis=1, keepdims=True)
    angle = 2 * np.pi * np.arange(corners) / corners
    radial = np.cos(angle)[None, :, None] * side[:, None] + np.sin(angle)[None, :, None] * up[:, None]
    radius = 0.52 + 0.13 * (np.hypot(curve[:, 0], curve[:, 1]) - 1) / 2
    points = curve[:, None] + radius[:, None, None] * radial
    ring, corner = np.meshgrid(np.arange(rings), np.arange(corners), indexing="ij")
    a, b = ring * corners + corner, ring * corners + (corner + 1) % corners
    c, d = (ring + 1) % rings * corners + (corner + 1) % corners, (ring + 1) % rings * corners + corner
    quads = np.stack([a, b, c, d], axis=-1).reshape(-1, 4)
    faces = np.concatenate([quads[:, [0, 1, 2]], quads[:, [0, 2, 3]]]).astype(np.int32)
    corner_points = points.reshape(-1, 3)[faces]
    outward = np.cross(corner_points[:, 1] - corner_points[:, 0], corner_points[:, 2] - corner_points[:, 0])
    if (outward * radial.reshape(-1, 3)[faces[:, 0]]).sum() < 0:
        faces = faces[:, ::-1]
    return points.reshape(-1, 3).astype(np.float32), radial.reshape(-1, 3).astype(np.float32), faces


def write_ply(path: Path, vertices: np.ndarray, normals: np.ndarray, faces: np.ndarray) -> None:
    """A binary PLY with normals."""
    header = ["ply", "format binary_little_endian 1.0", f"element vertex {len(vertices)}"]
    header += [f"property float {name}" for name in ("x", "y", "z", "nx", "ny", "nz")]
    header += [f"element face {len(faces)}", "property list uchar int vertex_indices", "end_header\n"]
    rows = np.empty(len(faces), np.dtype([("count", "u1"), ("corners", "<i4", 3)]))
    rows["count"], rows["corners"] = 3, faces
    body = np.hstack([vertices, normals]).astype("<f4").tobytes() + rows.tobytes()
    path.write_bytes("\n".join(header).encode() + body)


@click.command()
@click.argument("folder", default=SCENES, type=click.Path(path_type=Path), metavar="[FOLDER]")
def main(folder: Path) -> None:
    """Write the files to FOLDER, or to scenes/."""
    write_vol(folder / "plume.vol", make_plume(), np.array([[0, 0, 0], [1, 1, 1]]))
    write_ply(folder / "knot.ply", *make_knot())


if __name__ == "__main__":
    main()
