"""Write scenes/cloud.vol: a procedural cumulus in the unit cube, the same bits on every run.

    python tools/make_cloud.py [OUT.vol]

A sphere's surface is pushed outwards by billowy noise (the rounded heads of a cumulus, with creases between
them) at points that are warped by smoother noise, and finer noise erodes what is thin: an opaque core with
translucent wisps.  Densities are multiples of 1/255, so that the file packs well; the outermost voxels are
0, so that the border rules of different renderers do not matter.
"""

from __future__ import annotations

from pathlib import Path

import click
import numpy as np
from folders import SCENES

from clvol.volumes import write_vol

SIZE = 128
SEED = 7
DEFAULT_PATH = SCENES / "cloud.vol"

RADIUS = 0.33  # of the undisturbed sphere, in units of the cube's edge
EDGE = 0.05  # depth over which density rises from 0 to 1
EDGE_DIRECTIONS = """
    1 1 0   -1 1 0   1 -1 0   -1 -1 0    1 0 1   -1 0 1   1 0 -1   -1 0 -1
    0 1 1   0 -1 1   0 1 -1   0 -1 -1    1 1 0   -1 1 0   0 -1 1   0 -1 -1
"""
GRADIENTS = np.array(EDGE_DIRECTIONS.split(), np.float32).reshape(16, 3)
"""Perlin's twelve edge directions of a cube, four of them twice."""


def lattice_hash(x: np.ndarray, y: np.ndarray, z: np.ndarray, seed: int) -> np.ndarray:
    """Hash integer lattice points (int64 arrays, wrapped to 32 bits) to uint32; the same on every machine."""
    bits = (x * 0x8DA6B343 + y * 0xD8163841 + z * 0xCB1AB31F + seed * 0x9E3779B1).astype(np.uint32)
    for shift, factor in ((16, 0x7FEB352D), (15, 0x846CA68B)):
        bits = (bits ^ (bits >> np.uint32(shift))) * np.uint32(factor)
    return bits ^ (bits >> np.uint32(16))


def gradient_noise(points: np.ndarray, seed: int) -> np.ndarray:
    """Perlin's gradient noise at points (n, 3), float32 (n,), about -1..1, with quintic interpolation."""
    cell = np.floor(points)
    inside = points - cell
    weight = inside * inside * inside * (inside * (inside * 6 - 15) + 10)
    x, y, z = cell.astype(np.int64).T
    total = np.zeros(len(points), np.float32)
    for corner in np.ndindex(2, 2, 2):
        dx, dy, dz = corner
        gradient = GRADIENTS[lattice_hash(x + dx, y + dy, z + dz, seed) & 15]
        offset = inside - np.array(corner, np.float32)
        share = np.where(np.array(corner, bool), weight, 1 - weight)
        along = gradient[:, 0] * offset[:, 0] + gradient[:, 1] * offset[:, 1] + gradient[:, 2] * offset[:, 2]
        total += along * share[:, 0] * share[:, 1] * share[:, 2]
    return total


def fractal(points: np.ndarray, frequency: float, octaves: int, seed: int, billowy: bool) -> np.ndarray:
    """Sum of octaves of halving amplitude, divided by their sum; the absolute value of each if `billowy`."""
    total = np.zeros(len(points), np.float32)
    for octave in range(octaves):
        noise = gradient_noise(points * np.float32(frequency * 2**octave), seed + octave)
        total += (np.abs(noise) if billowy else noise) * np.float32(0.5**octave)
    return total / np.float32(2 - 0.5 ** (octaves - 1))


def cloud_density(points: np.ndarray) -> np.ndarray:
    """Density 0..1 at points (n, 3) of the cube -½..½, float32 (n,)."""
    warp = np.stack([fractal(points, 3.0, 2, SEED + 10 * axis, False) for axis in range(3)], axis=1)
    warped = points + np.float32(0.07) * warp
    heads = fractal(warped, 5.0, 4, SEED + 40, True)
    wisps = fractal(warped, 12.0, 3, SEED + 50, False)
    x, y, z = warped.T
    distance = np.sqrt(x * x + y * y + z * z)
    depth = np.float32(RADIUS) + np.float32(0.5) * (heads - np.float32(0.2)) - distance
    rise = np.clip(depth / np.float32(EDGE), 0, 1)
    eroded = rise - (1 - rise) * np.maximum(wisps + np.float32(0.2), 0)
    return np.clip(eroded * (np.float32(0.8) + np.float32(0.5) * wisps), 0, 1)


def make_cloud(size: int = SIZE) -> np.ndarray:
    """The cloud, float32 (size, size, size) in z, y, x order: multiples of 1/255, outermost layer 0."""
    centres = (np.arange(size, dtype=np.float32) + np.float32(0.5)) / np.float32(size) - np.float32(0.5)
    z, y, x = np.meshgrid(centres, centres, centres, indexing="ij", sparse=True)
    inside = x * x + y * y + z * z < np.float32((0.5 - 1.0 / size) ** 2)
    indices = np.argwhere(inside)
    points = centres[indices[:, ::-1]]
    density = np.concatenate([cloud_density(part) for part in np.array_split(points, 64)])
    values = np.zeros((size, size, size), np.float32)
    values[inside] = np.rint(density * np.float32(255)) / np.float32(255)
    return values


@click.command()
@click.argument("path", default=DEFAULT_PATH, type=click.Path(path_type=Path), metavar="[PATH]")
def main(path: Path) -> None:
    """Write the cloud to PATH, or to scenes/cloud.vol."""
    write_vol(path, make_cloud(), np.array([[0, 0, 0], [1, 1, 1]]))


if __name__ == "__main__":
    main()
