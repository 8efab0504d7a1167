"""Efficiency beside Mitsuba's in a room with surfaces, glass and smoke, and where our time goes."""

from __future__ import annotations

from folders import SCENES
from scene_options import open_scene

from benchmarks.cloud import Z_LIMIT, agrees, measure_cloud, show_cloud
from benchmarks.tables import Figures, Row, at_least, ranged, show

ROOM = str(SCENES / "room.xml")
EFFICIENCY_TARGET = 5.0


def stage_seconds(scene: str, res: int, choices: dict[str, str], device: str | None) -> Figures:
    """Device seconds of each stage in one render, kernels built and loaded before."""
    opened = open_scene(scene, {"res": res}, choices, device)
    opened.render(1, 0)
    seconds = opened.render(16, 1).result.stats["seconds"]
    return {stage: seconds[stage] for stage in opened.plan.stages}


def measure_room(
    scene: str,
    res: int,
    rounds: int,
    seconds: float,
    python: str,
    choices: dict[str, str],
    device: str | None,
) -> Figures:
    """Render by turns; efficiency, means and their difference, and the share of each stage."""
    figures = measure_cloud(scene, res, rounds, seconds, python, choices, device)
    return figures | {"stages": stage_seconds(scene, res, choices, device)}


def show_room(figures: Figures) -> None:
    """Both sides, the ratio, and the stages."""
    show_cloud(figures, "room")
    total = sum(figures["stages"].values())
    rows = [(stage, f"{100 * seconds / total:.0f} %") for stage, seconds in figures["stages"].items()]
    show("room: device time by stage", ["", "share"], rows)


def room_rows(figures: Figures) -> list[Row]:
    """The ratio, and how far the means are apart."""
    ratio, res = figures["ratio"], figures["res"]
    return [
        at_least(
            f"the same on `{figures['scene']}`, {res} × {res}: smoke, glass, an area light",
            f"{ranged(ratio)} times, with {figures['clvol']['spp']} samples",
            EFFICIENCY_TARGET,
            ratio["median"],
        ),
        Row(
            "difference of both means there",
            f"{abs(figures['z']):.1f} standard errors",
            f"within {Z_LIMIT:g} standard errors",
            agrees(figures),
        ),
    ]
