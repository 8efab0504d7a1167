"""The small scenes of the recipes: a unit cube of given density under a white sky, and one ray through it."""

from __future__ import annotations

from typing import Any

import numpy as np

import clvol


def noise(cells: int, octaves: int = 3, seed: int = 1) -> np.ndarray:
    """Smooth noise from 0 to 1, float32 (cells, cells, cells)."""
    random, total = np.random.default_rng(seed), np.zeros((cells,) * 3)
    axes = np.meshgrid(*[np.linspace(0, 2 * np.pi, cells)] * 3, indexing="ij")
    for octave in range(octaves):
        for _ in range(6):
            wave = random.integers(-(2**octave) - 1, 2**octave + 2, 3)
            phase = random.uniform(0, 2 * np.pi)
            total += np.sin(sum(k * x for k, x in zip(wave, axes, strict=True)) + phase) / 2**octave
    return ((total - total.min()) / np.ptp(total)).astype(np.float32)


def cube(
    density: np.ndarray, scale: float, albedo: float = 0.9, size: int = 48, light: str = "constant"
) -> Any:
    """A unit cube that fills the picture; density (z, y, x) or (z, y, x, 3) times `scale` is its extinction.

    Under a white sky, or a sun where next-event estimation has something to estimate.
    """
    eye, target = [0.5, 0.5, -1.4], [0.5, 0.5, 0.5]
    lights: dict[str, Any] = {
        "constant": {"type": "constant"},
        "sun": {"type": "directional", "direction": [0.4, -1.0, 0.6], "irradiance": 3.0},
    }
    film = {"type": "hdrfilm", "width": size, "height": size, "rfilter": {"type": "box"}}
    return clvol.load_dict(
        {
            "type": "scene",
            "sensor": {
                "type": "perspective",
                "fov": 35,
                "to_world": clvol.look_at(eye, target, [0, 1, 0]),
                "film": film,
                "sampler": {"type": "independent"},
            },
            "light": lights[light],
            "cube": {
                "type": "cube",
                "to_world": clvol.translate([0.5, 0.5, 0.5]) @ clvol.scale(0.5),
                "bsdf": {"type": "null"},
                "interior": {
                    "type": "heterogeneous",
                    "albedo": albedo,
                    "scale": scale,
                    "sigma_t": {"type": "gridvolume", "data": density},
                },
            },
        }
    )
