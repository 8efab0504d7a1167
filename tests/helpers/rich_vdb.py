"""Grids that hold everything the format allows."""

import numpy as np
from vdb_writer import GridSpec


def leaf(inactive, seed: int, letter: str = "f", active_share: float = 0.4):
    """A leaf whose inactive values are drawn from `inactive`, whole numbers elsewhere."""
    rng = np.random.default_rng(seed)
    active = rng.random((8, 8, 8)) < active_share
    values = np.where(active, rng.integers(4, 100, active.shape), rng.choice(inactive, active.shape))
    return values.astype(letter), active


INACTIVE = {0: [2], 1: [-2], 2: [1], 3: [2, -2], 4: [2, 1], 5: [1, 3], 6: [1, 2, 3]}


def rich_grid(**options) -> GridSpec:
    """Leaves with each code of inactive values, a full and an empty one, tiles 8³ and 128³; background 2."""
    spec = GridSpec(background=2, **options)
    for code, inactive in INACTIVE.items():
        spec.leaves[(-16 + 8 * code, 0, -4104)] = leaf(inactive, code, spec.letter)
    spec.leaves[(4096, 8, 16)] = leaf([2], 7, spec.letter, 1.0)
    spec.leaves[(4096, 8, 24)] = leaf([-2], 8, spec.letter, 0.0)
    spec.tiles = [
        ((64, 0, -4104), 8, 5, True),
        ((72, 0, -4104), 8, 6, False),
        ((256, 128, 0), 128, 7, True),
        ((384, 128, 0), 128, 1, False),
    ]
    return as_vectors(spec) if spec.value_type in VECTOR_TYPES else spec


def as_vectors(spec: GridSpec) -> GridSpec:
    """The same grid with three channels, of which the others are multiples of the first."""
    spec.background = times_colour(spec.background)
    spec.leaves = {o: (times_colour(values), active) for o, (values, active) in spec.leaves.items()}
    spec.tiles = [(o, edge, times_colour(value), active) for o, edge, value, active in spec.tiles]
    return spec


def times_colour(values):
    """Numbers as vectors: a tuple of one number, an array with another axis of arrays."""
    vectors = np.multiply.outer(values, [1.0, 2.0, 0.5])
    return vectors if np.ndim(values) else tuple(vectors.tolist())


VECTOR_TYPES = ("vec3s", "vec3d")
# OpenVDB stores no integers in half.
STORED_TYPES = [
    *((t, False) for t in ("float", "double", "half", "int32", "int64", *VECTOR_TYPES)),
    *((t, True) for t in ("float", "double", *VECTOR_TYPES)),
]
