"""Which stages walk their paths side by side, in the lanes of vectors, and what is against it elsewhere.

A walk in lanes draws other random numbers than one by itself, the same at every width.  Stages that do not
walk draw the numbers that their paths decide by in lanes: the same ones.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from clvol import layout
from clvol.planning import registry

if TYPE_CHECKING:
    from clvol.planning.decisions import Decisions

SAMPLING, SHADOWS = "medium_sample", "shadow_transmittance"


def _against_any(plan: Decisions) -> str:
    """What is against lanes in any stage; "" for nothing."""
    features, majorant, settled = plan.features, plan.chosen["majorant"], plan.settled
    hurdles = {
        "there are several media": features.media > 1,
        f"a majorant {majorant} is walked one path at a time": majorant in registry.MAJORANTS
        and not registry.MAJORANTS[majorant].in_lanes,
        "a transfer function classifies the density": features.transfers,
        "microflakes differ from place to place": features.varied_areas,
        "the volume is a tree": settled is not None and (settled.top_trees or settled.tree_grid),
        "one path follows several channels": plan.extinction == 3,
    }
    return next((reason for reason, holds in hurdles.items() if holds), "")


def against(plan: Decisions) -> dict[str, str]:
    """What is against lanes in each stage that walks through heterogeneous media; "" for nothing."""
    if not plan.features.heterogeneous:
        return {}
    technique, transmittance = plan.chosen["technique"], plan.chosen["transmittance"]
    common = _against_any(plan)
    found = {SAMPLING: common}
    if not plan.tracker.in_lanes:
        found[SAMPLING] = common or f"technique {technique} walks one path at a time"
    elif plan.features.emission:
        found[SAMPLING] = common or "walks gather emission"
    if plan.nee:
        found[SHADOWS] = common
        if not plan.estimator.in_lanes:
            found[SHADOWS] = common or f"transmittance {transmittance} walks one path at a time"
        elif plan.features.passable:
            found[SHADOWS] = common or "surfaces let light through"
    return found


def _width(plan: Decisions) -> int:
    return int(plan.chosen["lanes"]) if plan.chosen["lanes"].isdecimal() else 0


def lanes(plan: Decisions) -> dict[str, int]:
    """Stages that walk their paths in lanes, and in how many."""
    width = _width(plan)
    return {stage: width for stage, hurdle in against(plan).items() if width and not hurdle}


def widths(plan: Decisions) -> dict[str, int]:
    """Lanes of every stage that has any: those that walk in them, and those that draw numbers in them."""
    width = _width(plan)
    return {stage.name: width for stage in layout.STAGES if stage.begins and width} | lanes(plan)


def said(plan: Decisions) -> str:
    """Which stages walk or draw in lanes, and why others don't."""
    words = {"": f"{_width(plan)} paths at a time"}
    walks = [
        f"{stage} {words.get(hurdle, f'one path at a time: {hurdle}')}"
        for stage, hurdle in against(plan).items()
    ]
    drawing = " and ".join(stage for stage in widths(plan) if stage not in against(plan))
    return "; ".join([*walks, f"{drawing} draw for {_width(plan)} at a time"])
