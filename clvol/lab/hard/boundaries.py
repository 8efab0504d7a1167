"""Media in media, side by side, in the same place, behind meshes that are no good."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np

from clvol.lab.hard import scenes
from clvol.lab.hard.block import CUBE, Block
from clvol.lab.hard.case import Case
from clvol.lab.hard.places import AHEAD, EYE, LUMPS
from clvol.scene.loader import load_dict
from clvol.scene.records import Mesh, Scene, Shape
from clvol.scene.transforms import scale, translate

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

GROUP = "boundaries"
DEEP = 200
"""Media in one another."""
DENSE = np.array(1.0)


def centred(size: float) -> np.ndarray:
    """The unit cube to a cube of that size in its middle."""
    place: np.ndarray = translate([0.5] * 3) @ scale(size) @ translate([-0.5] * 3)
    return place


def _added(count: int, values: np.ndarray) -> list[Block]:
    """Cubes in one another, whose media add where they overlap."""
    return [Block(values, (3.0 / count,), centred(1 - 0.9 * n / count)) for n in range(count)]


def _replaced() -> tuple[dict[str, Any], list[Block]]:
    """Cubes each of which names the one around it as its exterior; and blocks whose sum is the same."""
    sigma = 1.0 + np.arange(DEEP) % 7
    places = [centred(1 - 0.9 * n / DEEP) for n in range(DEEP)]
    scene = scenes.view(EYE, AHEAD, {"sky": {"type": "constant"}})
    for n, (value, place) in enumerate(zip(sigma, places, strict=True)):
        scene[f"medium{n}"] = {**Block(DENSE, (value,), place).medium(albedo=0.0), "id": f"medium{n}"}
        around = {"exterior": {"type": "ref", "id": f"medium{n - 1}"}} if n else {}
        inside = {"interior": {"type": "ref", "id": f"medium{n}"}}
        scene[f"cube{n}"] = {
            "type": "cube",
            "to_world": place @ CUBE,
            "bsdf": {"type": "null"},
            **inside,
            **around,
        }
    steps = np.diff(sigma, prepend=0.0)
    return scene, [Block(DENSE, (step,), place) for step, place in zip(steps, places, strict=True)]


def _spoilt(scene: dict[str, Any]) -> Scene:
    """With its cube as a mesh of which triangles are there twice, turned round, or without area."""
    made = load_dict(scene)
    cube = made.shapes[0]
    corners = np.array([[x, y, z] for z in (-1, 1) for y in (-1, 1) for x in (-1, 1)], np.float32)
    squares = [(0, 2, 3, 1), (4, 5, 7, 6), (0, 1, 5, 4), (2, 6, 7, 3), (0, 4, 6, 2), (1, 3, 7, 5)]
    faces = [face for a, b, c, d in squares for face in ((a, b, c), (a, c, d))]
    faces += [*faces[:5], faces[7][::-1], (0, 0, 3), (1, 1, 1), (0, 3, 3)]
    mesh = Mesh(corners, np.array(faces, np.int32))
    shape = Shape("mesh", cube.to_world, cube.interior, mesh=mesh, name="the spoilt cube")
    return replace(made, shapes=(shape,))


def _sky(
    name: str, blocks: Callable[[], Sequence[Block]], eye: Any = EYE, note: str = "", spp: int = 1024
) -> Case:
    return Case(
        f"before a sky: {name}",
        GROUP,
        lambda: scenes.through(blocks(), eye, AHEAD),
        lambda: scenes.transmitted(blocks(), eye, AHEAD),
        "float64 quadrature of the optical depth",
        spp,
        note=note,
    )


def _sun(name: str, blocks: Callable[[], Sequence[Block]], eye: Any = EYE) -> Case:
    return Case(
        f"in the sun: {name}",
        GROUP,
        lambda: scenes.sunlit(blocks(), eye, AHEAD),
        lambda: scenes.scattered(blocks(), eye, AHEAD),
        "float64 quadrature of single scattering",
    )


LUMPY = Block(LUMPS, (3.0,), np.eye(4))
BESIDE = Block(LUMPS[::-1].copy(), (2.0,), translate([0.0, 0.0, 1.0]))
ACROSS = Block(LUMPS[:, ::-1].copy(), (2.0,), translate([0.3, 0.2, 0.5]))
PAIRS = {
    "touching": [LUMPY, BESIDE],
    "in the same place": [LUMPY, LUMPY],
    "overlapping": [LUMPY, ACROSS],
}
ONE_MEDIUM = "Mitsuba keeps one medium where several overlap"
CASES = (
    *(_sky(f"volumes {name}", lambda b=blocks: b, note=ONE_MEDIUM) for name, blocks in PAIRS.items()),  # type: ignore[misc]
    *(_sun(f"volumes {name}", lambda b=blocks: b) for name, blocks in PAIRS.items()),  # type: ignore[misc]
    _sky(f"{DEEP} media in one another", lambda: _added(DEEP, DENSE), spp=512),
    _sky("64 volumes in one another", lambda: _added(64, np.ones((3, 3, 3))), spp=64),
    Case(
        f"before a sky: {DEEP} media, each the exterior of the next",
        GROUP,
        lambda: _replaced()[0],
        lambda: scenes.transmitted(_replaced()[1], EYE, AHEAD),
        "closed form: the lengths in each medium",
        2048,
    ),
    Case(
        "before a sky: a mesh with triangles there twice, turned and without area",
        GROUP,
        lambda: _spoilt(scenes.through([LUMPY], EYE, AHEAD)),
        lambda: scenes.transmitted([LUMPY], EYE, AHEAD),
        "float64 quadrature of the optical depth",
    ),
    Case(
        "in the sun: a mesh with triangles there twice, turned and without area",
        GROUP,
        lambda: _spoilt(scenes.sunlit([LUMPY], EYE, AHEAD)),
        lambda: scenes.scattered([LUMPY], EYE, AHEAD),
        "float64 quadrature of single scattering",
    ),
    _sky("the camera on a boundary inside another medium", lambda: [LUMPY, ACROSS], (0.31, 0.42, 0.5)),
)
