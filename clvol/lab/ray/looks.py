"""How techniques, channels and collisions look in a ray's figure."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from clvol.lab.colours import BLACK, BLUE, GREEN, ORANGE, PURPLE, SKY, VERMILION

if TYPE_CHECKING:
    from clvol.lab.ray.walks import Watched
    from clvol.lab.ray.watched import WatchedRay

SERIES = (BLUE, VERMILION, GREEN, PURPLE, ORANGE, SKY)
STYLES = ("-", (0, (5, 1.5)), (0, (1.5, 1)), (0, (5, 1.5, 1.5, 1.5)))
CHANNEL_COLOURS = (VERMILION, GREEN, BLUE)
MAJORANT: dict[str, Any] = {"color": BLACK, "lw": 1.2}
CONTROL: dict[str, Any] = {"color": BLUE, "lw": 1.4, "ls": (0, (3, 1))}
SIGNS: dict[str, dict[str, Any]] = {
    "null": {"marker": "o", "ls": "", "mfc": "white", "mec": BLACK, "ms": 4.5, "mew": 0.9},
    "real": {"marker": "o", "ls": "", "mfc": VERMILION, "mec": BLACK, "ms": 6.5, "mew": 0.8},
    "control": {"marker": "D", "ls": "", "mfc": SKY, "mec": BLACK, "ms": 6, "mew": 0.8},
}
DISTANCE = "distance from the camera (scene lengths)"


def colour(view: WatchedRay, watched: Watched) -> str:
    """Colours count anew in each family: techniques and transmittances never share a panel."""
    family = [other for other in view.watched if other.family == watched.family]
    return SERIES[family.index(watched) % len(SERIES)]


def style(view: WatchedRay, watched: Watched) -> Any:
    """Dashes, which count so too."""
    family = [other for other in view.watched if other.family == watched.family]
    return STYLES[family.index(watched) % len(STYLES)]
