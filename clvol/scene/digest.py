"""Which scenes, and parts of them, are the same: by short fingerprints, and to the last bit.

Fingerprints keep results of different scenes from being taken for one another.
"""

from __future__ import annotations

import hashlib
from dataclasses import fields, is_dataclass

import numpy as np

_BLOCKS, _BLOCK_VALUES = 256, 4096
"""Of a larger array this many blocks of so many values, evenly spread, are looked at: a large volume would
take seconds."""


_APART = (
    *("source", "files", "name", "names", "spp", "seed", "choices", "sensors", "component_format", "kept"),
    *("approximated", "left_out", "aovs", "made_from"),  # the records tell
    *("sanitize", "repairs"),  # the samples tell
    "meter",  # the sensor tells
)
"""Fields that do not tell scenes apart."""


def scene_digest(scene: object) -> str:
    """16 hexadecimal digits that depend on every record of the scene.

    All but where it was read from, its sample count, its seed, the sensors that it is not seen by, and what
    numbers in files are.
    """
    state = hashlib.blake2b(digest_size=8)
    _feed(state, scene)
    return state.hexdigest()


def outline(record: object) -> str:
    """As `scene_digest`, of a few values of each array: alike records have the same, others may."""
    state = hashlib.blake2b(digest_size=8)
    _feed(state, record, blocks=1, block_values=64)
    return state.hexdigest()


def alike(one: object, other: object) -> bool:
    """Whether two records mean the same: all that `scene_digest` tells by is the same to the last bit."""
    if one is other:
        return True
    if type(one) is not type(other):
        return False
    if isinstance(one, np.ndarray) and isinstance(other, np.ndarray):
        same = (one.shape, one.dtype) == (other.shape, other.dtype)
        return same and bool(np.array_equal(_bits(one), _bits(other)))
    if isinstance(one, tuple | list) and isinstance(other, tuple | list):
        return len(one) == len(other) and all(alike(a, b) for a, b in zip(one, other, strict=True))
    if is_dataclass(one):
        told = (field.name for field in fields(one) if field.name not in _APART)
        return all(alike(getattr(one, name), getattr(other, name)) for name in told)
    return repr(one) == repr(other)


def _bits(array: np.ndarray) -> np.ndarray:
    """The values' bits, by which 0 and -0 differ, and NaN does not from itself."""
    whole = np.ascontiguousarray(array).reshape(-1)
    return whole.view(f"u{whole.itemsize}" if whole.itemsize <= 8 else np.uint8)


def _feed(
    state: hashlib.blake2b, value: object, blocks: int = _BLOCKS, block_values: int = _BLOCK_VALUES
) -> None:
    if isinstance(value, np.ndarray):
        flat = value.reshape(-1)
        state.update(repr((value.shape, value.dtype.str)).encode())
        if flat.size <= blocks * block_values:
            state.update(np.ascontiguousarray(flat).tobytes())
        else:
            for start in np.linspace(0, flat.size - block_values, blocks).astype(int):
                state.update(np.ascontiguousarray(flat[start : start + block_values]).tobytes())
    elif is_dataclass(value):
        state.update(type(value).__name__.encode())
        for field in fields(value):
            if field.name not in _APART:
                state.update(field.name.encode())
                _feed(state, getattr(value, field.name), blocks, block_values)
    elif isinstance(value, tuple | list):
        state.update(f"[{len(value)}]".encode())
        for item in value:
            _feed(state, item, blocks, block_values)
    else:
        state.update(repr(value).encode())
