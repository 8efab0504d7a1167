"""Scenes of walks that are long, or that nothing would end."""

import numpy as np

import clvol


def cube(lower, upper, values, scale, albedo):
    """A grid between two corners."""
    middle, half = np.add(upper, lower) / 2, np.subtract(upper, lower) / 2
    place = clvol.translate(middle) @ clvol.scale(half)
    corner = clvol.translate(lower) @ clvol.scale(2 * half)
    return {
        "type": "cube",
        "to_world": place,
        "bsdf": {"type": "null"},
        "interior": {
            "type": "heterogeneous",
            "scale": scale,
            "albedo": albedo,
            "sigma_t": {"type": "gridvolume", "grid": values, "to_world": corner},
        },
    }


def seen(width=8, **what):
    """A scene before a camera that looks along +z at the unit cube."""
    return clvol.load_dict(
        {
            "type": "scene",
            "integrator": {"type": "volpath", "max_depth": -1, "rr_depth": 5},
            "sensor": {
                "type": "perspective",
                "fov": 35.0,
                "to_world": clvol.look_at(origin=(0.4, 0.6, -1.5), target=(0.5, 0.5, 0.5), up=(0, 1, 0)),
                "film": {"type": "hdrfilm", "width": width, "height": width, "rfilter": {"type": "box"}},
            },
            "sky": {"type": "constant", "radiance": 0.5},
            "sun": {"type": "directional", "direction": (0.3, -1.0, 0.4), "irradiance": 2.0},
            **what,
        }
    )


def scene_of(kind):
    """Media of many tentative collisions: one alone; two that overlap, in colour; these between sheets."""
    values = np.random.default_rng(5).uniform(0, 1, (6, 7, 5)).astype(np.float32) ** 3
    if kind == "lumps":
        return seen(cloud=cube((0, 0, 0), (1, 1, 1), values, 12.0, 0.7))
    tint = np.stack([values, 0.5 * values, 0.8 * values], axis=-1)
    media = {
        "a": cube((0, 0, 0), (1, 1, 1), tint, 8.0, 0.7),
        "b": cube((0.3, 0.2, 0.4), (1.2, 0.9, 1.1), values[::-1].copy(), 6.0, 0.4),
    }
    if kind == "sheets":
        for n, z in enumerate((0.2, 0.6)):
            media[f"sheet{n}"] = {
                "type": "rectangle",
                "to_world": clvol.translate((0.5, 0.5, z)) @ clvol.rotate((1, 0, 0), 40.0),
                "bsdf": {"type": "mask", "opacity": 0.4, "nested": {"type": "diffuse"}},
            }
    return seen(**media)


def endless(kind):
    """One voxel of 1e7; a density of 1, for a loose majorant; one that scatters for ever.

    The last scatters 20,000 times across and never absorbs.
    """
    values = np.ones((4, 4, 4), np.float32)
    scale, albedo = 1.0, 0.5
    if kind == "voxel":
        values[:] = 0.0
        values[1, 1, 1] = 1e7
    if kind == "albedo":
        scale, albedo = 20000.0, 1.0
    return seen(4, cloud=cube((0, 0, 0), (1, 1, 1), values, scale, albedo))
