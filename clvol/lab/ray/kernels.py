"""The renderer's device functions round one ray: small kernels that read the scene as a render does.

What they run is the headers that the plan's own stages include, with hooks that record the walk
(cl/ray/recorder.h); nothing of a tracker is repeated here.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
import pyopencl as cl

from clvol.lab.ray.walks import CELL, OUTCOME
from clvol.rendering.scene_kernels import SceneKernels
from clvol.rendering.session import seed_words

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from clvol.planning import registry

EVENT_SIZE = 5
"""Floats of an event, as cl/ray/recorder.h writes it."""
MOST_EVENTS = 4096
"""Events of a walk that are recorded; later ones are only counted."""
MOST_CELLS = 1 << 16


class RayKernels(SceneKernels):
    """One scene on the device with one set of choices, and kernels along a ray."""

    purpose = "the walks", "watch fewer of them"

    def places(self, origin: np.ndarray, direction: np.ndarray, most: int) -> tuple[np.ndarray, np.ndarray]:
        """Surfaces on a ray, float32 (n, 3): t, number, entering; and media's spans, float64 (media, 2).

        Single precision would round the length of a thin one away.
        """
        media = len(self.prepared.boundaries.entries)
        hits, spans = np.full((most, 3), np.inf, np.float32), np.empty((media, 3), np.float32)
        if media:
            given = np.concatenate([origin, direction]).astype(np.float32)
            sizes = np.uint32(media), np.uint32(most)
            self._run(1, "places", {}, [given], [hits, spans], sizes)
        return hits[np.isfinite(hits[:, 0])], spans[:, :1].astype(float) + spans[:, 1:]

    def tables(
        self, given: np.ndarray, family: str | None, points: int
    ) -> tuple[np.ndarray, np.ndarray | None]:
        """sigma_t at even steps of a ray, float32 (channels, points), and the majorant's cells, `CELL` (n,).

        There are none, None, where `family` walks none or is None.
        """
        channels = 3 if self.plan.features.chromatic_extinction else 1
        walks = family is not None and self._tracker(family).walks_majorant
        macros = {
            "CLVOL_RAY_MAJORANT": walks,
            "CLVOL_RAY_CONTROLS": family == "technique" and self.plan.needs_controls,
            "CLVOL_RAY_RESIDUALS": family == "transmittance" and self.plan.needs_residuals,
        }
        sigma = np.empty((channels, points), np.float32)
        cells, count = np.full((MOST_CELLS, CELL.itemsize // 4), np.nan, np.float32), np.zeros(1, np.uint32)
        sizes = [np.uint32(n) for n in (points, channels, MOST_CELLS)]
        self._run(points, "tables", macros, [given], [sigma, cells, count], sizes)
        return sigma, cells[: int(count[0])].view(CELL)[:, 0].copy() if walks else None

    def walks(
        self, given: np.ndarray, family: str, seed: int, walks: int, recorded: int
    ) -> tuple[np.ndarray, list[np.ndarray]]:
        """Outcomes of walks, `OUTCOME` (walks,), and events of the first, each (n, EVENT_SIZE)."""
        outcomes = np.empty(walks, OUTCOME)
        log = np.zeros((recorded, MOST_EVENTS, EVENT_SIZE), np.float32)
        macros = {"CLVOL_RAY_COLLISIONS": family == "technique"}
        sizes = [np.uint32(n) for n in (walks, recorded, MOST_EVENTS)]
        seeds = cl.cltypes.make_uint2(*seed_words(seed))  # type: ignore[attr-defined]  # made at import
        self._run(walks, "walks", macros, [given], [outcomes, log], [seeds, *sizes])
        return outcomes, [events[: int(o["events"])] for events, o in zip(log, outcomes, strict=False)]

    def _tracker(self, family: str) -> registry.Choice:
        return self.plan.tracker if family == "technique" else self.plan.estimator

    def _run(
        self,
        count: int,
        name: str,
        macros: Mapping[str, bool],
        inputs: list[np.ndarray],
        outputs: list[np.ndarray],
        scalars: Sequence[Any],
    ) -> None:
        """Run cl/ray/`name`.cl for `count` work-items; `outputs` come back."""
        flags = {macro: int(value) for macro, value in macros.items()}
        text = f'#include "ray/{name}.cl"\n'
        self.run_unit(name, text, count, inputs, outputs, scalars, flags)
