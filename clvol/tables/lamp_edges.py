"""Lamps that the camera sees (cl/stages/lamp_edges.h): which count, where they are, what their edges pass.

Pure NumPy.  Nothing here changes the mean of a picture.
"""

from __future__ import annotations

from itertools import product
from typing import TYPE_CHECKING

import numpy as np

from clvol import layout
from clvol.scene.extents import shape_bounds
from clvol.scene.records import IrradianceMeter, Meter
from clvol.tables.camera import camera_rays, reach_of

if TYPE_CHECKING:
    from clvol.tables.prepare import PreparedScene

OUTSHINES = 4.0
"""Times that a lamp must outshine a white surface under the sky, and may be fainter than the brightest."""
Window = tuple[int, int, int, int]


def outshining(emitters: np.ndarray, sky: float = 0.0) -> np.ndarray:
    """Which EMITTER records are lamps far brighter than what is likely to be seen beside them, bool (n,).

    sky : radiance that little of a map of the environment exceeds (`bright_sky`).

    Beside others an edge's own noise is small, and what refining takes it for would be the greater: with
    radiance c times the lamp's beside it, the noise goes from (1 - c)² to c² of the lamp's.
    """
    kinds = {name: emitters["kind"] == layout.enum("EMITTER", name) for name in layout.ENUMS["EMITTER"]}
    bright = emitters["value"].max(axis=1).astype(np.float64)
    distant = bright[kinds["CONSTANT"]].sum() + sky
    distant += (bright[kinds["DIRECTIONAL"]].sum() + (bright * emitters["area"])[kinds["SUN"]].sum()) / np.pi
    brightest = bright[kinds["AREA"]].max(initial=0.0)
    least = max(OUTSHINES * distant, brightest / OUTSHINES)
    found: np.ndarray = kinds["AREA"] & (bright > 0) & (bright >= least)
    return found


def bright_sky(radiance: np.ndarray) -> float:
    """Of a map (rows, columns, channels), what a hundredth of it exceeds in its brightest channel."""
    return float(np.quantile(radiance.max(axis=-1), 0.99))


def lamp_window(prepared: PreparedScene) -> Window:
    """Left, top, right and bottom of the part of the film where lamps may be seen, in pixels of its window.

    That is the whole window where one reaches behind the camera; an empty part where none is before it, or
    where the sensor is none that makes a picture.
    """
    film = prepared.scene.film
    if isinstance(prepared.scene.camera, Meter | IrradianceMeter):
        return 0, 0, 0, 0
    _, _, width, height = film.window
    everywhere = any(entry.everywhere for entry in prepared.boundaries.entries)
    reach = reach_of(prepared.scene.camera, prepared.radius, everywhere)
    rays = camera_rays(prepared.scene.camera, film, prepared.centre, reach)
    places = []
    for shape in prepared.surfaces.shapes if prepared.surfaces else ():
        if shape.emission is None:
            continue
        box = np.array(shape_bounds(shape))
        corners = np.array([[box[k, axis] for axis, k in enumerate(ks)] for ks in product((0, 1), repeat=3)])
        x, y, depth = rays.place(corners - prepared.centre)
        if (depth <= 0).all():
            continue
        if not (depth > 0).all() or not np.isfinite([x, y]).all():
            return 0, 0, width, height
        places.append((x.min(), y.min(), x.max(), y.max()))
    if not places:
        return 0, 0, 0, 0
    around = film.rfilter.radius + 1.0  # pixels whose filter reaches a lamp
    lower = np.min(places, axis=0)[:2] - around
    upper = np.max(places, axis=0)[2:] + around
    left, top = np.clip(np.floor(lower), 0, (width, height)).astype(int)
    right, bottom = np.clip(np.ceil(upper), 0, (width, height)).astype(int)
    return int(left), int(top), int(max(left, right)), int(max(top, bottom))


def edge_pixels(seen: np.ndarray, radius: float) -> np.ndarray:
    """Pixels within whose filter's reach lamps begin or end, bool (rows, columns).

    Parameters
    ----------
    seen : uint8 (LAMP_GRID rows, LAMP_GRID columns), what the kernel found.
    radius : of the pixel filter, in pixels.
    """
    grid = layout.LAMP_GRID
    side = int(np.ceil(grid * (radius - 0.5))) + 1
    least, most = seen, seen
    for axis in (0, 1):
        padding = [(side, side) if axis == k else (0, 0) for k in (0, 1)]
        steps = tuple(slice(None, None, grid if axis == k else 1) for k in (0, 1))
        views = [
            np.lib.stride_tricks.sliding_window_view(
                np.pad(array, padding, mode="edge"), grid + 2 * side, axis
            )[steps]
            for array in (least, most)
        ]
        least, most = views[0].min(axis=-1), views[1].max(axis=-1)
    edges: np.ndarray = (most > least) & (most != layout.LAMP_UNSURE)
    return edges
