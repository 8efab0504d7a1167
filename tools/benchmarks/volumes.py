"""The volumes of the benchmark's scenes: seeded, of any size, and 0 in their outermost voxels.

So clamped edges, zero outside and active voxels only, which are what programs differ in, all mean the same.
Arrays are float32 [z, y, x] over the unit cube, values at the centres of voxels.
"""

from __future__ import annotations

import os
import tempfile
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from benchmarks.big_grids import cloud_slabs

if TYPE_CHECKING:
    from collections.abc import Callable

SPIKES = 64 / 256**3
"""Share of the voxels that are spikes of thin volumes."""
KEPT = 128
"""Volumes of so many voxels along an axis, or more, are made once."""


def fractal(size: int, seed: int, exponent: float = -11 / 6) -> np.ndarray:
    """Periodic noise of standard deviation 1 whose spectrum falls by a power of the frequency."""
    frequency = np.fft.fftfreq(size) * size
    z, y, x = np.meshgrid(frequency, frequency, frequency, indexing="ij")
    wave = np.sqrt(z**2 + y**2 + x**2)
    wave[0, 0, 0] = 1
    amplitude = wave**exponent
    amplitude[0, 0, 0] = 0
    white = np.random.default_rng(seed).standard_normal((size, size, size))
    noise: np.ndarray = np.fft.ifftn(np.fft.fftn(white) * amplitude).real
    return noise / noise.std()


def radius(size: int) -> np.ndarray:
    """Distance from the middle; 1 at the middle of a face."""
    along = np.linspace(-1, 1, size, dtype=np.float32)
    z, y, x = np.meshgrid(along, along, along, indexing="ij")
    distance: np.ndarray = np.sqrt(x * x + y * y + z * z)
    return distance


def bordered(values: np.ndarray) -> np.ndarray:
    """As float32, with 0 in the outermost voxels."""
    inner = np.zeros(values.shape, np.float32)
    inner[1:-1, 1:-1, 1:-1] = values[1:-1, 1:-1, 1:-1]
    return inner


def cloud(size: int = 128, seed: int = 1) -> np.ndarray:
    """A ball with a fractal border, at most 1."""
    density = np.clip((0.75 - radius(size)) * 3 + 0.6 * fractal(size, seed), 0, None)
    return bordered(density / density.max())


def thin(size: int = 256, seed: int = 5, occupied: float = 0.05) -> np.ndarray:
    """Wisps of density up to about 0.05, and in them single voxels of 1, a bad case for a global bound."""
    noise = fractal(size, seed, -1.6)
    above = noise - np.quantile(noise, 1 - occupied)
    dense = np.quantile(above[above > 0], 0.9)
    density = bordered(0.05 * np.clip(above / dense, 0, 1))
    places = np.flatnonzero(density > 0.025)
    spikes = max(1, round(SPIKES * density.size))
    density.reshape(-1)[np.random.default_rng(seed + 1).choice(places, spikes, replace=False)] = 1.0
    return density


def flame(size: int = 128, seed: int = 2) -> np.ndarray:
    """Smoke round a flame: another cloud."""
    return cloud(size, seed)


def glow(size: int = 128, seed: int = 2) -> np.ndarray:
    """The flame in it: brightest in the middle, at most 1."""
    fall = np.clip(1 - (radius(size) / 0.7) ** 2, 0, 1)
    light = fall * np.clip(0.6 + 0.4 * fractal(size, seed + 10), 0, None)
    return bordered(light / light.max())


def rough(size: int, seed: int = 1) -> np.ndarray:
    """A rough cloud of any size, made slab by slab."""
    return bordered(np.concatenate(list(cloud_slabs(size, seed))))


VOLUMES: dict[str, Callable[[int], np.ndarray]] = {
    "cloud": cloud,
    "thin": thin,
    "flame": flame,
    "glow": glow,
    "rough": rough,
}


def volume(name: str, size: int) -> np.ndarray:
    """The volume of this name and size; large ones, which take long, are kept in the temporary folder."""
    if size < KEPT:
        return VOLUMES[name](size)
    folder = Path(tempfile.gettempdir()) / "clvol-bench"
    path = folder / f"{name}-{size}.npy"
    if not path.exists():
        folder.mkdir(exist_ok=True)
        unfinished = folder / f"{name}-{size}-{os.getpid()}.npy"
        np.save(unfinished, VOLUMES[name](size))
        os.replace(unfinished, path)
    found: np.ndarray = np.load(path)
    return found
