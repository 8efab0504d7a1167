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
_PERMUTATION = np.frombuffer(_TABLE * 2, np.uint8).astype(np.intp)
_EDGES = ["xy", "Xy", "xY", "XY", "xz", "Xz", "xZ", "XZ", "yz", "Yz", "yZ", "YZ", "xy", "Xy", "yZ", "YZ"]
_GRADIENTS = np.array([[(a in e) - (a.upper() in e) for e in _EDGES] for a in "xyz"], float)[
    :, np.arange(256) & 15
]
"""Perlin's, by axis and the last four bits: capitals point backwards."""
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
    found = np.ones((len(y), len(x)), np.float32)
    above = y > 0  # it is solid below, whatever the noise
    if above.any():
        found[above] = _wisps(x, y[above], z, density, wispiness, frequency)
    return found


def _wisps(
    x: np.ndarray, y: np.ndarray, z: float, density: float, wispiness: float, frequency: float
) -> np.ndarray:
    at = [np.array(part, float) for part in np.broadcast_arrays(x[None, :], y[:, None], z)]
    at = [frequency * part for part in at]
    if wispiness > 0:
        omega, factor = 0.05 * wispiness, 10.0
        for _ in range(2):
            slopes = _gradient([factor * part for part in at])
            at = [part + omega * slope for part, slope in zip(at, slopes, strict=True)]
            omega, factor = omega / 2, factor * 1.99
    total, omega, factor = np.zeros((len(y), len(x))), 0.5, 1.0
    for _ in range(5):
        total += omega * noise(*(factor * part for part in at))
        omega, factor = omega / 2, factor * 1.99
    altitude = y[:, None]
    wisps = np.clip((1 - altitude) * 4.5 * density * total, 0, 1)
    solid: np.ndarray = np.clip(wisps + 2 * np.maximum(0, 0.5 - altitude), 0, 1)
    return solid


def _gradient(p: list[np.ndarray]) -> list[np.ndarray]:
    """Differences of the noise over a small step along each axis."""
    here = noise(*p)
    moved = ([part + _DELTA * (n == axis) for n, part in enumerate(p)] for axis in range(3))
    return [(noise(*place) - here) / _DELTA for place in moved]


def noise(x: np.ndarray, y: np.ndarray, z: np.ndarray) -> np.ndarray:
    """Perlin's improved noise at points (x, y, z)."""
    cells, ways, weights = [], [], []
    for part in (x, y, z):
        whole = np.floor(part)
        way = part - whole
        cells.append(np.fmod(whole, 256).astype(np.intp) & 255)
        ways.append((way, way - 1))
        weights.append(((6 * way - 15) * way + 10) * way**3)
    first = [_PERMUTATION.take(cells[0] + n) + cells[1] for n in range(2)]
    second = [[_PERMUTATION.take(row + n) + cells[2] for n in range(2)] for row in first]
    along_x = []
    for i in range(2):
        along_y = []
        for j in range(2):
            ends = [
                _slope(_PERMUTATION.take(second[i][j] + k), ways[0][i], ways[1][j], ways[2][k])
                for k in (0, 1)
            ]
            along_y.append(ends[0] + weights[2] * (ends[1] - ends[0]))
        along_x.append(along_y[0] + weights[1] * (along_y[1] - along_y[0]))
    total: np.ndarray = along_x[0] + weights[0] * (along_x[1] - along_x[0])
    return total


def _slope(hashed: np.ndarray, x: np.ndarray, y: np.ndarray, z: np.ndarray) -> np.ndarray:
    """One of twelve gradients, four of them twice, times the way from the corner."""
    slope: np.ndarray = _GRADIENTS[0].take(hashed) * x
    slope += _GRADIENTS[1].take(hashed) * y
    slope += _GRADIENTS[2].take(hashed) * z
    return slope
