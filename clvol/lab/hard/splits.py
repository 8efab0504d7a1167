"""Where kd-trees of majorants split, asked of the nodes that go to the device, for rays in these planes."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from clvol.lab.hard import scenes
from clvol.lab.hard.block import Block
from clvol.planning.choices import Choices
from clvol.planning.plan import Plan
from clvol.scene.loader import load_dict
from clvol.tables.prepare import prepare

LEAF = 3
"""In the low bits of a leaf's first word, where an inner node has its axis (cl/majorant/kdtree.h)."""


class Split(NamedTuple):
    """A plane across `axis` at `at`, in the unit cube of a block."""

    axis: int
    at: float


def splits(block: Block, technique: str = "delta") -> list[Split]:
    """The inner nodes of a block's tree, breadth first, the root before all."""
    scene = load_dict(scenes.through([block], (0.5, 0.5, -1.0), (0.0, 0.0, 1.0)))
    plan = Plan.of(scene, Choices(technique=technique, majorant="kdtree"))
    (majorant,) = prepare(scene, plan).majorants
    if majorant is None or majorant.nodes is None:
        raise ValueError(f"{technique} walks no tree here")
    cell = majorant.cell_size / np.array(block.values.shape[2::-1])
    words = majorant.nodes[:, 0]
    return [
        Split(int(word & LEAF), float((word >> 2) * cell[word & LEAF]))
        for word in words[words & LEAF != LEAF]
    ]


def lumps(side: int) -> Block:
    """Steep lumps of half a brick each, between which every technique's tree splits."""
    values = np.random.default_rng(8).random((side // 4,) * 3) ** 8
    return Block(np.kron(values, np.ones((4, 4, 4))), (40.0,), np.eye(4))


def in_split(block: Block) -> tuple[np.ndarray, np.ndarray]:
    """A ray from outside in the plane where the tree splits first: origin and direction."""
    first = splits(block)[0]
    o, d = np.roll((0.0, 0.3, -1.0), first.axis), np.roll((0.0, 0.2, 1.0), first.axis)
    o[first.axis] = first.at
    return o, d


def in_two_splits(block: Block) -> tuple[np.ndarray, np.ndarray]:
    """One along the line where that plane meets the first across another axis."""
    first, *more = splits(block)
    other = next(split for split in more if split.axis != first.axis)
    o, d = np.full(3, -1.0), np.ones(3)
    for axis, at in (first, other):
        o[axis], d[axis] = at, 0.0
    return o, d
