"""What is wrong with a picture, by its statistics, and what its samples may not show: said in the log."""

from __future__ import annotations

import logging
import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

from clvol.errors import Told, option
from clvol.tables.apart import peak_extinction

if TYPE_CHECKING:
    from clvol.picture.result import Result
    from clvol.rendering.session import Session

log = logging.getLogger("clvol")
LARGE_WEIGHT = 100.0
"""Paths that weigh so much more than others are rare: few samples do not show them."""
_FORESIGHT = 1.05
"""Of a target error, up to which it counts as reached: surveys foresee no better."""


@dataclass(frozen=True)
class Expected:
    """What pictures of a session are judged by; small, for it travels from machine to machine.

    Parameters
    ----------
    density : its paths look a density up, if they meet a medium; not of one that is empty on purpose and
        glows.
    dense : some medium has an extinction somewhere.
    light : there are lights, or media that glow.
    needs_bound : look-ups above their majorant bias it.
    """

    density: bool
    dense: bool
    light: bool
    needs_bound: bool

    @classmethod
    def of(cls, session: Session) -> Expected:
        """Of a session's plan and tables."""
        features, prepared = session.plan.features, session.prepared
        media = enumerate(prepared.matter.media)
        dense = any(bool(peak_extinction(medium, prepared.density(n)).any()) for n, medium in media)
        return cls(
            bool(features.heterogeneous and not features.homogeneous and (dense or not features.glow)),
            dense,
            bool(features.emitters or features.emission or features.glow),
            session.plan.needs_bound,
        )


def say_doubts(result: Result, expected: Expected) -> None:
    """Log what leaves the picture wrong, or noisier than it looks."""
    stats = result.stats
    if expected.density and not stats["lookups"] and not stats["real_collisions"]:  # controls need no look-up
        why = "are the transforms right?" if expected.dense else "it is 0 everywhere (a transfer function?)"
        log.warning("no path met any density: %s", why)
    for name in ("non_finite", "walks_exhausted"):
        if stats[name]:
            log.warning("%s: %d", name.replace("_", " "), stats[name])
    if stats["majorant_violations"]:
        log.warning(
            "%d of %d look-ups were above their majorant: %s",
            stats["majorant_violations"],
            stats["lookups"],
            "the picture is biased"
            if expected.needs_bound
            else "these techniques stay unbiased, at more noise",
        )
    if stats["largest_weight"] > LARGE_WEIGHT:
        log.warning(
            Told(
                "weights grew to %.2g: the picture is noisier than its variance says; raise "
                f"{option('majorant_scale')}, use {option('probability', 'history')}, or a technique without "
                "weights"
            ),
            stats["largest_weight"],
        )
    if stats["largest_sample"] == 0 and expected.light:
        log.warning("no sample met any light: the picture may be black by chance, its noise is unknown")
    elif expected.dense and result.met_nothing and not result.variance.any():
        log.warning(
            "no path met anything in the media, and all samples are the same: what is rare there has not "
            "been seen, and the noise is only a bound"
        )


def say_missed_target(noise: float, target: float) -> None:
    """Log where the noise, nan while it is unknown, is above what a render was to reach."""
    if not noise <= _FORESIGHT * target:
        known = "unknown" if math.isnan(noise) else f"{noise:.3g}"
        log.warning("the noise is %s, the target was %.3g", known, target)


def say_seconds(result: Result) -> None:
    """Log where the time went."""
    seconds = dict(result.stats["seconds"])
    setup, kernels = seconds.pop("setup"), seconds.pop("kernels")
    log.info("set-up (volumes, majorants, kernels)  %8.3f seconds, %.3f of them for kernels", setup, kernels)
    del seconds["render"]
    for stage, spent in seconds.items():
        log.info("stage %-20s %8.3f seconds", stage, spent)
