"""What a render does, counted: no machine changes these numbers, so that a regression shows.

Each row is one of the benchmark's scenes, in small, with the choices that users get.  A change that moves a
counter, for better or worse, writes the new one into this table, and its commit says why: a failing test
prints the row as it would be now.
"""

from dataclasses import dataclass, fields

import pytest
from benched import benched

import clvol
from clvol.planning import auto

SPP = 32
SAMPLER = auto.DEFAULT_SAMPLER
"""That of users, which a fixture replaces for other tests."""
PER_SAMPLE = ("lookups", "cells", "collisions", "shadow_rays", "handled")
CLOSE = 0.05
"""Relative: other random numbers, or another device's rounding, move counts per sample by less."""


@dataclass(frozen=True)
class Counters:
    """Counts per sample, then sizes.

    lookups : of the density.  cells : of majorants crossed.  collisions : real ones.  shadow_rays : traced.
    handled : paths that a stage took from its queue, over all stages.
    launches : of each wave.
    path_bytes : of a path's state.
    """

    lookups: float
    cells: float
    collisions: float
    shadow_rays: float
    handled: float
    launches: int
    path_bytes: int


PINNED = {
    "cloud": Counters(6.717, 8.884, 1.473, 0, 8.306, 4, 104),
    "cloud_dense": Counters(41.56, 20.66, 8.16, 1.042, 29.55, 5, 140),
    "chroma": Counters(14.35, 26.04, 3.381, 0, 22, 4, 108),
    "box_smoke": Counters(6.932, 13.71, 0.7318, 1.892, 15.49, 5, 200),
    "thin_sparse": Counters(3.74, 16.85, 0.2025, 0.1777, 4.785, 5, 144),
    "emissive": Counters(30.35, 9.57, 0.6843, 0, 5.755, 4, 120),
}


def counted(result):
    stats, samples = result.stats, SPP * result.image[..., 0].size
    return Counters(
        lookups=stats["lookups"] / samples,
        cells=stats["cells_crossed"] / samples,
        collisions=stats["real_collisions"] / samples,
        shadow_rays=stats["shadow_rays"] / samples,
        handled=sum(stats["items"].values()) / samples,
        launches=len(stats["items"]),
        path_bytes=stats["bytes_per_slot"],
    )


@pytest.mark.parametrize("name", PINNED)
def test_a_render_does_no_more_and_no_less_than_it_did(name, tmp_path):
    now = counted(clvol.render(benched(name, tmp_path), spp=SPP, seed=1, sampler=SAMPLER))
    values = ", ".join(f"{getattr(now, f.name):.4g}" for f in fields(now))
    for field in fields(now):
        pinned, value = getattr(PINNED[name], field.name), getattr(now, field.name)
        slack = CLOSE if field.name in PER_SAMPLE else 0.0
        assert value == pytest.approx(pinned, rel=slack), f'now: "{name}": Counters({values}),'
