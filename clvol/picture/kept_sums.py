"""What a file keeps of the sums of a result, so that results merge that were written and read.

Of independent samples the mean and its variance say it all.  Of low-discrepancy samples the randomisations'
means are wanted one by one: a file has their deviations from the mean, in standard errors of it, as layers
of half floats.  These are numbers of the size of 1 whatever the picture is, their rounding touches the
variance by a thousandth, and the mean not at all.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from clvol.errors import option
from clvol.picture.estimate import Estimate, Moments, Replicates, Uneven
from clvol.picture.image_io import HALVED

if TYPE_CHECKING:
    from collections.abc import Mapping

_HALF = "pictures that are half floats do not merge: their rounding would not average out"
LAYER = HALVED
"""How the names of such layers begin; the number of the randomisation follows."""


def layers_of(estimate: Estimate) -> dict[str, np.ndarray]:
    """The layers of an estimate of shape (height, width, 3), by name; float32."""
    if not isinstance(estimate, Replicates):
        return {}
    mean, variance = estimate.mean_and_variance()
    error = np.sqrt(variance)
    known = np.isfinite(error) & (error > 0)
    layers = {}
    for number, (total, count) in enumerate(zip(estimate.sums, estimate.counts, strict=True)):
        deviation = np.zeros(mean.shape, np.float32)
        if count:
            with np.errstate(invalid="ignore"):
                np.divide(total / count - mean, error, out=deviation, where=known, casting="same_kind")
        layers[f"{LAYER}{number}"] = np.nan_to_num(deviation)
    return layers


def described(estimate: Estimate, half: bool) -> dict[str, Any]:
    """What the layers do not say, in JSON; `half`: the mean is written as half floats."""
    if half:
        return {"kind": "half", "dof": min(estimate.dof, 2**31)}
    match estimate:
        case Moments():
            return {"kind": "moments", "count": estimate.count}
        case Replicates():
            return {"kind": "replicates", "counts": estimate.counts.tolist()}
        case Uneven():
            return {"kind": "uneven", "dof": estimate.dof, "reason": estimate.reason, "hint": estimate.hint}


def rebuilt(
    said: Mapping[str, Any],
    mean: np.ndarray,
    variance: np.ndarray,
    layers: Mapping[str, np.ndarray],
    samples: np.ndarray | None,
) -> Estimate:
    """The estimate that `described` and `layers_of` describe, up to the rounding of floats.

    Parameters
    ----------
    mean, variance : float32 (height, width, 3).
    samples : of each pixel, where it is a picture of a target error.

    Raises ValueError, KeyError or TypeError where what is said makes no sense.
    """
    mean64, variance64 = mean.astype(np.float64), variance.astype(np.float64)
    if said["kind"] == "moments":
        count = _count(said["count"])
        with np.errstate(invalid="ignore"):
            spread = variance64 * (count * (count - 1.0)) if count > 1 else np.zeros(mean.shape)
        return Moments(count * mean64, spread + count * mean64**2, count)
    if said["kind"] == "replicates":
        return _replicates([_count(n, least=0) for n in said["counts"]], mean64, variance64, layers)
    counts = np.zeros(mean.shape[:2]) if samples is None else np.rint(samples)
    whole = mean64, variance64, counts.astype(np.int64).reshape(-1), _count(said["dof"], least=-1)
    if said["kind"] == "half":
        return Uneven(*whole, reason=_HALF, hint=_IN_FULL)
    if said["kind"] != "uneven" or samples is None:
        raise ValueError("unknown kind of sums")
    return Uneven(*whole, str(said["reason"]), str(said["hint"]))


_IN_FULL = f"save as .exr with {option('component_format', 'float32')}"


def _replicates(
    counts: list[int], mean: np.ndarray, variance: np.ndarray, layers: Mapping[str, np.ndarray]
) -> Replicates:
    """Deviations are shifted so that the mean of all samples is `mean` again, to the last bit but one."""
    total = sum(counts)
    if not 1 <= len(counts) <= 64 or total < 1:
        raise ValueError("no samples")
    error = np.sqrt(np.where(np.isfinite(variance), variance, 0.0))
    scaled = np.stack([layers[f"{LAYER}{n}"].astype(np.float64) * error for n in range(len(counts))])
    weights = np.array(counts, np.float64)
    scaled -= np.tensordot(weights / total, scaled, axes=1)
    sums = weights[:, None, None, None] * (mean + scaled)
    return Replicates(sums, np.array(counts, np.int64))


def _count(value: Any, least: int = 1) -> int:
    if isinstance(value, bool) or not isinstance(value, int) or not least <= value < 2**40:
        raise ValueError(f"{value!r} is no number of samples")
    return value
