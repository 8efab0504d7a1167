"""Density fields whose free-flight distribution is known by float64 quadrature, and rays through them."""

import numpy as np


def constant():
    return np.full((9, 8, 10), 0.7, np.float32)


def ramp():
    """Linear in x: along any ray a linear density, away from the clamped borders."""
    return np.broadcast_to(np.linspace(0.0, 1.0, 33, dtype=np.float32), (5, 6, 33)).copy()


def sparse(shape=(24, 25, 40)):
    """95 % empty; among the rest a few voxels 20 times as dense as the others."""
    rng = np.random.default_rng(7)
    values = np.zeros(shape, np.float32)
    filled = rng.random(shape) < 0.05
    values[filled] = 0.05
    values[filled & (rng.random(shape) < 0.15)] = 1.0
    return values


def vacuum():
    return np.zeros((9, 9, 9), np.float32)


FIELDS = {"constant": constant, "ramp": ramp, "sparse": sparse, "vacuum": vacuum}


def tinted():
    """Lumps over a base, the same in every channel: colour comes from the medium's scale alone."""
    rng = np.random.default_rng(11)
    return (0.3 + 0.7 * rng.random((11, 12, 13)) ** 4).astype(np.float32)


def coloured():
    """Channels of different shape: dense lumps; half as dense, mirrored; a ramp a thousand times thinner."""
    lumps = sparse((16, 17, 18)) + np.float32(0.02)
    ramp = np.broadcast_to(np.linspace(0.2, 1.0, 18, dtype=np.float32), lumps.shape)
    return np.stack([lumps, 0.5 * lumps[::-1, :, ::-1], 1e-3 * ramp], axis=-1)


CHROMATIC = {"tinted": (tinted, (6.0, 3.0, 1.0)), "coloured": (coloured, (40.0,))}
"""Fields of three channels and their medium's scale: 60:30:10 by scale, and 1000:1 by the grid itself."""


def trilinear(values, points):
    """Cell-centred trilinear interpolation in the unit cube, clamped; points (n, 3) as x, y, z, float64."""
    size = np.array(values.shape[::-1])
    p = np.clip(points * size - 0.5, 0, size - 1)
    base = np.clip(p.astype(int), 0, np.maximum(size - 2, 0))
    f = p - base
    result = np.zeros(len(points))
    for corner in range(8):
        bits = np.array([(corner >> a) & 1 for a in range(3)])
        x, y, z = np.minimum(base + bits, size - 1).T
        result += values[z, y, x].astype(float) * np.prod(np.where(bits, f, 1 - f), axis=1)
    return result


def optical_depth(values, origin, direction, length, scale, steps=40_000):
    """Optical depth from 0 to each of steps + 1 even points of the ray: midpoint rule in float64."""
    t = (np.arange(steps) + 0.5) * (length / steps)
    sigma = scale * trilinear(values, origin + t[:, None] * direction)
    return np.concatenate([[0.0], np.cumsum(sigma) * (length / steps)])


def exit_distance(origin, direction):
    """Where a ray from inside the unit cube leaves it."""
    with np.errstate(divide="ignore"):
        far = np.where(direction > 0, (1 - origin) / direction, -origin / direction)
    return float(np.where(direction == 0, np.inf, far).min())


def _unit(*v):
    return np.array(v) / np.linalg.norm(v)


RAYS = {
    "oblique": (np.array([0.02, 0.11, 0.07]), _unit(1.0, 0.71, 0.53)),
    "backwards": (np.array([0.97, 0.9, 0.85]), _unit(-0.9, -0.77, -0.31)),
    "along an axis": (np.array([0.003, 0.52, 0.48]), np.array([1.0, 0.0, 0.0])),
    "on a cell's face": (np.array([0.001, 0.5, 0.5]), _unit(1.0, 0.0, 0.3)),
}
