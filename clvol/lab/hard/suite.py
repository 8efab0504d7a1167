"""All hard cases, and which part of their product with the choices is rendered."""

from __future__ import annotations

import itertools
import zlib
from collections.abc import Callable, Iterable, Mapping
from typing import TYPE_CHECKING

from clvol.lab.hard import boundaries, bounds, chromatic, phases, places, rays, sparse, thickness, white
from clvol.lab.hard.case import CROSSED, SAMPLER, Case, Seen, check, loaded, ways
from clvol.planning.choices import Choices

if TYPE_CHECKING:
    from collections.abc import Iterator

    from clvol.device.device import Device
    from clvol.scene.records import Scene

GROUPS = {
    module.GROUP: module.CASES
    for module in (thickness, white, sparse, chromatic, phases, places, rays, boundaries, bounds)
}
"""Cases by group, in the order of the page."""
CASES: tuple[Case, ...] = tuple(itertools.chain.from_iterable(GROUPS.values()))
ALPHA = 1e-4
"""Probability that any case of a sound renderer is called wrong, in one part of the suite."""
TURNS = (("regular", "residual-ratio", "kdtree"), ("weighted-decomposition", "ratio", "grid"))
"""What groups take by turns where each case is rendered in one way: few, since kernels take long to build,
and none that needs bounds that hold."""
Chosen = Callable[[Case, "Scene"], Iterable[Choices]]
"""In which ways a case is rendered."""


def turn(case: Case, number: int) -> Choices:
    """A case by one of `TURNS`."""
    names = dict(zip(CROSSED, TURNS[number % len(TURNS)], strict=True))
    return Choices(majorant_scale=case.majorant_scale).but(sampler=SAMPLER[names["majorant"]], **names)


def in_turn(case: Case, _scene: Scene) -> Iterable[Choices]:
    """Every case in one way, groups by turns: cases of a group share kernels."""
    return (turn(case, list(GROUPS).index(case.group)),)


def every_way(case: Case, scene: Scene) -> Iterable[Choices]:
    """Every case in every way: the product of techniques, transmittances and majorants."""
    return ways(scene, case.majorant_scale)


def quick_part() -> tuple[Case, ...]:
    """A few cases of each group."""
    short = ([case for case in cases if not case.long] for cases in GROUPS.values())
    return tuple(case for cases in short for case in cases[:: max(1, len(cases) // 3)])


def run(device: Device, cases: Iterable[Case], chosen: Chosen = in_turn, seed: int = 0) -> Iterator[Seen]:
    """Render cases, and hold each picture to what is expected."""
    for case in cases:
        scene = loaded(case)
        for choices in chosen(case, scene):
            yield check(device, case, scene, choices, seed_of(case, choices.names, seed))


def seed_of(case: Case, names: Mapping[str, str], seed: int) -> int:
    """A seed of its own for each render."""
    return zlib.crc32(repr((case.name, sorted(names.items()), seed)).encode())
