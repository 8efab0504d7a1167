"""What a render does, counted: no machine changes these numbers, so that a regression shows.

Each row is one of the benchmark's scenes, in small, with the choices that users get.  One work-group renders
it, since which paths are in lanes together depends on which group was free for them.  A change that moves a
counter, for better or worse, writes the new one into this table, and its commit says why: a failing test
prints the row as it would be now.
"""

from dataclasses import dataclass, fields

import pytest
from benched import benched
from tiers import quick_where

import clvol
from clvol.planning import auto

SPP = 32
SAMPLER = auto.DEFAULT_SAMPLER
"""That of users, which a fixture replaces for other tests."""
PER_SAMPLE = ("lookups", "cells", "collisions", "shadow_rays", "handled", "lanes_busy")
CLOSE = 0.05
"""Relative: other random numbers, or another device's rounding, move counts per sample by less."""


@dataclass(frozen=True)
class Counters:
    """Counts per sample, then sizes.

    lookups : of the density.  cells : of majorants crossed.  collisions : real ones.  shadow_rays : traced.
    handled : paths that a stage took from its queue, over all stages.
    lanes_busy : share of the lanes' steps.
    launches : of each wave.
    path_bytes : of a path's state.
    """

    lookups: float
    cells: float
    collisions: float
    shadow_rays: float
    handled: float
    lanes_busy: float
    launches: int
    path_bytes: int


PINNED = {
    "cloud": Counters(13.24, 13.5, 2.067, 0, 10.35, 0.5721, 4, 112),
    "cloud_dense": Counters(79.01, 29.22, 9.5, 1.353, 35.07, 0.5051, 5, 148),
    "chroma": Counters(27.58, 37.24, 4.712, 0, 26.53, 0.5411, 4, 116),
    "box_smoke": Counters(7.542, 12.57, 0.7115, 2.201, 11.87, 0.4859, 5, 208),
    "thin_sparse": Counters(5.099, 17.75, 0.335, 0.3342, 5.346, 0.4732, 5, 148),
    "emissive": Counters(30.51, 9.611, 0.6844, 0, 5.683, 0, 4, 120),
}


def counted(result):
    stats, samples = result.stats, SPP * result.image[..., 0].size
    return Counters(
        lookups=stats["lookups"] / samples,
        cells=stats["cells_crossed"] / samples,
        collisions=stats["real_collisions"] / samples,
        shadow_rays=stats["shadow_rays"] / samples,
        handled=sum(stats["items"].values()) / samples,
        lanes_busy=stats["busy_lane_steps"] / max(stats["lane_steps"], 1),
        launches=len(stats["items"]),
        path_bytes=stats["bytes_per_slot"],
    )


@quick_where("name", PINNED, {"cloud_dense", "box_smoke", "emissive"}.__contains__)
def test_a_render_does_no_more_and_no_less_than_it_did(name, tmp_path):
    now = counted(clvol.render(benched(name, tmp_path), spp=SPP, seed=1, sampler=SAMPLER, pool=256))
    values = ", ".join(f"{getattr(now, f.name):.4g}" for f in fields(now))
    for field in fields(now):
        pinned, value = getattr(PINNED[name], field.name), getattr(now, field.name)
        slack = CLOSE if field.name in PER_SAMPLE else 0.0
        assert value == pytest.approx(pinned, rel=slack), f'now: "{name}": Counters({values}),'
