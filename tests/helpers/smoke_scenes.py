"""Smoke in a box over a floor, under a sky and a sun, from a few values."""

import numpy as np

import clvol

VALUES = np.random.default_rng(1).uniform(0.5, 1, (20, 24, 28)).astype(np.float32)
VOLUME_BYTES = VALUES.nbytes
BEHIND = clvol.look_at((0.3, 0.5, 5), (0, 0, 0), (0, 1, 0))


def load(scale=4.0, values=VALUES, radiance=0.5, to_world=None, reflectance=0.5, g=0.4):
    to_world = clvol.look_at((0, 0, -5), (0, 0, 0), (0, 1, 0)) if to_world is None else to_world
    film = {"type": "hdrfilm", "width": 8, "height": 8}
    medium = {
        "type": "heterogeneous",
        "scale": scale,
        "albedo": 0.8,
        "sigma_t": {"type": "gridvolume", "grid": values, "to_world": clvol.scale(2) @ clvol.translate(-0.5)},
        "phase": {"type": "hg", "g": g},
    }
    floor = clvol.translate((0, -1.5, 0)) @ clvol.rotate((1, 0, 0), -90) @ clvol.scale(4)
    look = {"type": "twosided", "look": {"type": "diffuse", "reflectance": reflectance}}
    return clvol.load_dict(
        {
            "type": "scene",
            "integrator": {"type": "volpath"},
            "sensor": {"type": "perspective", "fov": 30, "to_world": to_world, "film": film},
            "smoke": {"type": "cube", "bsdf": {"type": "null"}, "interior": medium},
            "floor": {"type": "rectangle", "to_world": floor, "bsdf": look},
            "sky": {"type": "constant", "radiance": radiance},
            "sun": {"type": "directional", "direction": [0.3, -1, 0.2], "irradiance": 2.0},
        }
    )
