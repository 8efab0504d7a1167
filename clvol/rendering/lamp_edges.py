"""Finds on the device which pixels the edges of lamps pass, once per view (cl/kernels/lamp_edges.cl)."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import pyopencl as cl

from clvol.device.launch import GROUP, run_kernel, scene_arguments, whole
from clvol.device.programs import BUILD_OPTIONS, arguments_of, build, lamp_edges_source
from clvol.device.side_builds import Launch, Unit
from clvol.errors import option
from clvol.layout import LAMP_GRID
from clvol.tables.lamp_edges import edge_pixels, lamp_window

if TYPE_CHECKING:
    from collections.abc import Mapping

    from clvol.device.device import Device
    from clvol.tables.prepare import PreparedScene

_PURPOSE = "the edges of lamps", f"choose {option('lamp_edges', 'sampled')}"
_POINTS = 1 << 20
"""That are looked at in one launch, about."""


def lamp_edges_unit(prepared: PreparedScene) -> Unit:
    """What is built for it."""
    left, top, right, bottom = lamp_window(prepared)
    rows, columns = LAMP_GRID * (bottom - top), LAMP_GRID * (right - left)
    points = min(rows, _rows_at_once(columns)) * columns
    launches = (Launch("lamp_edges", whole(max(points, 1)), GROUP),)
    return Unit(lamp_edges_source(prepared.plan), BUILD_OPTIONS, launches)


def lamp_edge_buffer(device: Device, prepared: PreparedScene, buffers: Mapping[str, cl.Buffer]) -> cl.Buffer:
    """A byte for each pixel of the film's window, 1 where an edge passes; `buffers`: what the scene has."""
    film = prepared.scene.film
    _, _, width, height = film.window
    edges = np.zeros((height, width), np.uint8)
    left, top, right, bottom = lamp_window(prepared)
    lit = prepared.scene.integrator.max_depth != 0
    if lit and right > left and bottom > top:
        seen = _seen(device, prepared, buffers, (left, top, right, bottom))
        edges[top:bottom, left:right] = edge_pixels(seen, film.rfilter.radius)
    return device.memory.upload(edges, *_PURPOSE)


def _seen(
    device: Device,
    prepared: PreparedScene,
    buffers: Mapping[str, cl.Buffer],
    window: tuple[int, int, int, int],
) -> np.ndarray:
    """What camera rays meet at the points of a part of the film, uint8 (rows, columns)."""
    left, top, right, bottom = (LAMP_GRID * edge for edge in window)
    source = lamp_edges_source(prepared.plan)
    kernel = cl.Kernel(build(device, source, "lamp_edges"), "lamp_edges")
    unused = device.memory.allocate(4, *_PURPOSE)
    arguments = scene_arguments(arguments_of(source), buffers, slot_stride=1, unused=unused)
    columns = right - left
    seen = np.zeros((bottom - top, columns), np.uint8)
    for first in range(0, bottom - top, _rows_at_once(columns)):
        part = seen[first : first + _rows_at_once(columns)]
        scalars = [np.uint32(n) for n in (left, columns, top + first, part.size)]
        run_kernel(device, kernel, part.size, arguments, [], [part], scalars, purpose=_PURPOSE)
    return seen


def _rows_at_once(columns: int) -> int:
    return max(1, _POINTS // max(columns, 1))
