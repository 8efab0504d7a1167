"""The density of pbrt's `cloud` medium on a grid: noise summed and warped as pbrt's source says.

Perlin's improved noise (2002), in a cloud model after Ebert: noise that fades with altitude over a lower half
that is solid.
"""

from __future__ import annotations

import numpy as np

SAMPLES = 128
"""Along the longest side of the box."""
_TABLE = bytes.fromhex(
    "97a0895b5a0f830dc95f6035c2e907e18c24671e458e086325f0150a17be0694f778ea4b001ac53e5efcdbcb75230b2039b1"
    "2158ed953857ae147d88aba844af4aa547868b301ba64d929ee7536fe57a3cd385e6dc695c29372ef528f4668f3641193fa1"
    "01d85049d14c84bbd05912a9c8c4878274bc9f56a4646dc6adba034034d9e2fa7c7b05ca2693767eff5255d4cfce3be32f10"
    "3a11b6bd1c2adfb7aad577f898022c9aa346dd99659ba72bac09811627fd13626c6e4f71e0e8b2b97068daf661e4fb22f2c1"
    "eed2900cbfb3a2f1513391ebf90eef6b31c0d61fb5c76a9db854ccb07379322d7f0496fe8aeccd5dde72431d1848f38d80c3"
    "4e42d73d9cb4"
)
"""The permutation of 0..255 in Perlin's reference implementation."""
_PERMUTATION = np.frombuffer(_TABLE * 2, np.uint8).astype(np.int32)
_DELTA = 0.01


def cloud_density(
    lower: np.ndarray, upper: np.ndarray, density: float, wispiness: float, frequency: float
) -> np.ndarray:
    """The density at the centres of equal cells of a box in the medium's own space.

    Parameters
    ----------
    lower, upper : float64 (3,), the box.
    density, wispiness, frequency : as pbrt's parameters.

    Returns
    -------
    numpy.ndarray
        float32 (nz, ny, nx), in [0, 1].
    """
    size = upper - lower
    counts = np.maximum(np.ceil(SAMPLES * size / size.max()), 2).astype(int)
    x, y, z = (
        low + (np.arange(n) + 0.5) / n * side for low, side, n in zip(lower, size, counts, strict=True)
    )
    slices = [_slice(x, y, one, density, wispiness, frequency) for one in z]
    return np.stack(slices).astype(np.float32)


def _slice(
    x: np.ndarray, y: np.ndarray, z: float, density: float, wispiness: float, frequency: float
) -> np.ndarray:
    """The density in a plane, (ny, nx)."""
    p = np.stack(np.broadcast_arrays(x[None, :], y[:, None], z), axis=-1)
    at = frequency * p
    if wispiness > 0:
        omega, scale = 0.05 * wispiness, 10.0
        for _ in range(2):
            at = at + omega * _gradient(scale * at)
            omega, scale = omega / 2, scale * 1.99
    total, omega, scale = np.zeros(p.shape[:-1]), 0.5, 1.0
    for _ in range(5):
        total += omega * noise(scale * at)
        omega, scale = omega / 2, scale * 1.99
    altitude = p[..., 1]
    wisps = np.clip((1 - altitude) * 4.5 * density * total, 0, 1)
    solid: np.ndarray = np.clip(wisps + 2 * np.maximum(0, 0.5 - altitude), 0, 1)
    return solid


def _gradient(p: np.ndarray) -> np.ndarray:
    """Differences of the noise over a small step along each axis."""
    here = noise(p)
    steps = _DELTA * np.eye(3)
    return np.stack([(noise(p + step) - here) / _DELTA for step in steps], axis=-1)


def noise(p: np.ndarray) -> np.ndarray:
    """Perlin's improved noise at points (..., 3)."""
    p = np.fmod(p, 2.0**30)
    cell = np.floor(p)
    d = p - cell
    cell = cell.astype(np.int64) & 255
    weight = ((6 * d - 15) * d + 10) * d**3
    total = np.zeros(p.shape[:-1])
    for corner in np.ndindex(2, 2, 2):
        hashed = np.zeros(p.shape[:-1], np.int64)
        share = np.ones(p.shape[:-1])
        for axis, step in enumerate(corner):
            hashed = (
                _PERMUTATION[hashed + cell[..., axis] + step] if axis else _PERMUTATION[cell[..., 0] + step]
            )
            share = share * (weight[..., axis] if step else 1 - weight[..., axis])
        total += share * _slope(hashed & 15, d - np.array(corner))
    return total


def _slope(h: np.ndarray, d: np.ndarray) -> np.ndarray:
    """One of twelve gradients, times the way from the corner."""
    x, y, z = d[..., 0], d[..., 1], d[..., 2]
    twelve = (h == 12) | (h == 13)
    u = np.where((h < 8) | twelve, x, y)
    v = np.where((h < 4) | twelve, y, z)
    slope: np.ndarray = np.where(h & 1, -u, u) + np.where(h & 2, -v, v)
    return slope
