"""Scenes far from the origin, of any unit of length, sheared and mirrored."""

from __future__ import annotations

import numpy as np

from clvol.lab.hard import scenes
from clvol.lab.hard.block import Block
from clvol.lab.hard.case import Case
from clvol.lab.hard.rays import NARROW
from clvol.scene.transforms import scale, translate

GROUP = "transforms"
EYE, AHEAD = np.array([0.31, 0.42, -1.7]), np.array([0.1, 0.05, 1.0])
LUMPS = np.random.default_rng(2).random((6, 5, 7)) + 0.1


def _moved(name: str, place: np.ndarray, size: float = 1.0, note: str = "") -> tuple[Case, Case]:
    """The camera looks into the moved volume as into the one that is not."""
    eye = place[:3, :3] @ EYE + place[:3, 3]
    ahead = place[:3, :3] @ AHEAD
    length = float(np.linalg.norm(ahead) / np.linalg.norm(AHEAD))
    block = Block(LUMPS, (3.0 / length,), place)
    return (
        Case(
            f"before a sky: {name}",
            GROUP,
            lambda: scenes.through([block], eye, ahead, size=size, fov=NARROW),
            lambda: scenes.transmitted([block], eye, ahead),
            "float64 quadrature of the optical depth",
            note=note,
        ),
        Case(
            f"in the sun: {name}",
            GROUP,
            lambda: scenes.sunlit([block], eye, ahead, size=size, fov=NARROW),
            lambda: scenes.scattered([block], eye, ahead),
            "float64 quadrature of single scattering",
        ),
    )


def _sheared() -> np.ndarray:
    matrix = np.eye(4)
    matrix[0, 1], matrix[0, 2], matrix[1, 2] = 2.0, -0.7, 1.3
    return matrix


PLACES = (
    *((f"offset {d:g}", translate([d, -2 * d, 0.5 * d]), 1.0) for d in (1e3, 1e5, 1e7)),
    *((f"unit of length {s:g}", scale(s), s) for s in (1e-6, 1e-3, 1e6)),
    ("a millionth of the size, 1e3 away", translate([1e3, 1e3, -1e3]) @ scale(1e-6), 1e-6),
    ("1 : 1e3 flat", np.diag([1.0, 1.0, 1e-3, 1.0]), 1.0),
    ("1 : 1e3 long", np.diag([1.0, 1.0, 1e3, 1.0]), 1e3),
    ("sheared", _sheared(), 1.0),
    ("mirrored", np.diag([-1.0, 1.0, 1.0, 1.0]), 1.0),
    (
        "sheared, mirrored, 1e5 away",
        translate([1e5, 0, 1e5]) @ np.diag([-1.0, 1.0, 1.0, 1.0]) @ _sheared(),
        1.0,
    ),
)
CASES = tuple(case for name, place, size in PLACES for case in _moved(name, place, size))
