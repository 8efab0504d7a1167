"""What lights the volume, as emitters of a scene description."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from clvol.scene.transforms import rotate
from clvol.staging.looks import LOOKS, Dome

if TYPE_CHECKING:
    from clvol.staging.framing import Axes

ROWS = 128
"""Of the picture of a dome."""


def look_emitters(
    name: str, axes: Axes, azimuth: float, sun: np.ndarray | None, dimmed: float = 1.0
) -> dict[str, Any]:
    """The emitters of a look by name, for a camera at this azimuth.

    sun : where the first lamp stands instead, a direction in the world; None to leave it.
    dimmed : multiplies all light.
    """
    look = LOOKS[name]
    lights = {"environment": _environment(look.dome, axes, dimmed)}
    for number, lamp in enumerate(look.lamps):
        there = axes.towards(azimuth + lamp.azimuth, lamp.elevation)
        if number == 0 and sun is not None:
            there = sun / np.linalg.norm(sun)
        lights[f"lamp_{number}"] = {
            "type": "directional",
            "direction": (-there).tolist(),
            "irradiance": {"type": "rgb", "value": [dimmed * one for one in lamp.irradiance]},
        }
    return lights


def _environment(dome: Dome, axes: Axes, dimmed: float) -> dict[str, Any]:
    """A lat-long picture, whose local y is up."""
    degrees = 90 - 180 * np.arange(ROWS) / (ROWS - 1)
    rows = np.stack(
        [np.interp(degrees, dome.degrees, channel) for channel in zip(*dome.radiances, strict=True)], axis=-1
    )
    bitmap = dimmed * np.repeat(rows[:, None], 2, axis=1).astype(np.float32)
    return {"type": "envmap", "bitmap": bitmap, "to_world": upright(axes)}


def environment_file(path: str, axes: Axes, azimuth: float) -> dict[str, Any]:
    """A lat-long picture, whose middle is what the camera looks at."""
    return {"type": "envmap", "filename": path, "to_world": rotate(axes.up, azimuth) @ upright(axes)}


def upright(axes: Axes) -> np.ndarray:
    """Turns local y, which is up in lat-long pictures, to the world's up, local z to the front; (4, 4)."""
    matrix = np.eye(4)
    matrix[:3, :3] = np.stack([axes.right, axes.up, axes.front], axis=1)
    return matrix
