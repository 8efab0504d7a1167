"""Pictures of the same samples, side by side as one."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np

from clvol.picture.estimate import Moments, Replicates
from clvol.picture.parts import merged_stats

if TYPE_CHECKING:
    from collections.abc import Sequence

    from clvol.picture.estimate import Estimate
    from clvol.picture.parts import Part

_COLUMNS = -2
"""The axis of an estimate's sums, (..., height, width, channels)."""


def beside(parts: Sequence[Part], about: dict[str, Any]) -> Part:
    """One picture of several of a height, from the left, which have the same samples, pictures and sampler.

    Statistics are those of all.  What their metadata do not share is said one after the other.

    about : metadata of the whole.
    """
    first = parts[0]
    keys = dict.fromkeys(key for part in parts for key in part.metadata)
    said = {key: _said([part.metadata[key] for part in parts if key in part.metadata]) for key in keys}
    return replace(
        first,
        estimate=_joined([part.estimate for part in parts]),
        aovs={name: np.concatenate([part.aovs[name] for part in parts], axis=1) for name in first.aovs},
        stats=merged_stats([part.stats for part in parts]),
        metadata=said | {"seconds": sum(part.metadata["seconds"] for part in parts)} | about,
        size=(sum(part.size[0] for part in parts), first.size[1]),
        scenery=None,  # labels are of one view
    )


def _said(values: Sequence[Any]) -> Any:
    """The value, or where they differ all of them."""
    if all(value == values[0] for value in values):
        return values[0]
    return " | ".join(dict.fromkeys(map(str, values)))


def _joined(estimates: Sequence[Estimate]) -> Estimate:
    one = estimates[0]
    if isinstance(one, Replicates):
        sums = np.concatenate([e.sums for e in estimates if isinstance(e, Replicates)], axis=_COLUMNS)
        return Replicates(sums, one.counts)
    moments = [e for e in estimates if isinstance(e, Moments)]  # pixels of a range have as many samples
    squares = np.concatenate([e.sum_of_squares for e in moments], axis=_COLUMNS)
    sums = np.concatenate([e.sum_ for e in moments], axis=_COLUMNS)
    return Moments(sums, squares, moments[0].count)
