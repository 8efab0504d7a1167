"""Results of disjoint sample ranges of one render become the result of all samples."""

from __future__ import annotations

from functools import reduce
from typing import TYPE_CHECKING, Any

import numpy as np

from clvol.base.arguments import listed
from clvol.errors import OptionError, either, shown
from clvol.picture.estimate import Uneven
from clvol.picture.result import Result, said_ranges

if TYPE_CHECKING:
    from collections.abc import Iterable, Mapping, Sequence

    from clvol.picture.estimate import Estimate, Ranges

_PER_RUN = frozenset(
    {
        "denoised",
        "spp",
        "samples",
        "seconds",
        "device",
        "time_limit",
        "interrupted",
        "pilot",
        "pilot_reason",
        "repeat",
    }
)
"""Metadata that may differ between results that merge; everything else must agree."""

_LARGEST = ("largest", "peak", "bytes", "slots", "pool")
"""Statistics whose names begin so are maxima or sizes: merged by the maximum, not added."""


def merge(results: Iterable[Result]) -> Result:
    """Combine results of disjoint sample ranges of one render into the result of all samples.

    Sums and counts add up; AOVs are means weighted by the samples; statistics add, but for maxima and
    sizes (names that begin with "largest", "peak", "bytes", "slots", "pool"), of which the largest stays, and
    for means per path ("energy…"), which are weighted by the paths.

    Parameters
    ----------
    results
        At least one, as `clvol.render` and `clvol.load_result` returned them, in any order.

    Returns
    -------
    Result
        The picture of all samples, as if it had been rendered at once.

    Raises
    ------
    OptionError
        No results, or something else; overlapping sample ranges; or another size, scene, seed or choice:
        which, it says.
    """
    given = None if isinstance(results, Result) else listed(results)
    if given is None:
        raise OptionError("merge takes a list of results", hint="merge([a, b])")
    results = given
    if not results:
        raise OptionError("nothing to merge", hint="give at least one result")
    for one in results:
        if not isinstance(one, Result):
            raise OptionError(
                f"merge takes what clvol.render returns, not {shown(one)}",
                hint="clvol.load_result reads what was saved",
            )
    results.sort(key=lambda result: result.ranges)
    for other in results[1:]:
        _check_same_render(results[0], other)
    parts: list[Any] = [result.estimate for result in results]  # of one kind, as the samplers are
    estimate: Estimate = reduce(lambda one, other: one.plus(other), parts)
    ranges = _joined([span for result in results for span in result.ranges])
    counts = [result.samples[1] for result in results]
    merged = Result.from_estimate(
        estimate,
        samples=(ranges[0][0], sum(counts)),
        aovs={name: _merged_aov(name, results, counts) for name in results[0].aovs},
        stats=_merged_stats([result.stats for result in results]),
        metadata=_merged_metadata([result.metadata for result in results], sum(counts)),
    )
    merged.ranges, merged.component_format = ranges, results[0].component_format
    merged.scenery = results[0].scenery
    merged.files = tuple(dict.fromkeys(file for result in results for file in result.files))
    merged.metadata |= said_ranges(ranges)
    return merged


def _check_same_render(one: Result, other: Result) -> None:
    """Raise OptionError where the two are not samples of the same picture."""
    size = {"size": (one.image.shape[1::-1], other.image.shape[1::-1])}
    aovs = {"aovs": (sorted(one.aovs), sorted(other.aovs))}
    for key, (ours, theirs) in (size | differences(one.metadata, other.metadata) | aovs).items():
        if ours != theirs:
            raise OptionError(
                f"cannot merge results of a different {key}: {ours!r} and {theirs!r}",
                hint="only sample ranges of the same render can be merged",
            )
    for result in (one, other):
        if isinstance(result.estimate, Uneven):
            result.estimate.plus(result.estimate)  # says why not


def differences(one: Mapping[str, Any], other: Mapping[str, Any]) -> dict[str, tuple[Any, Any]]:
    """Metadata that must be the same in results that merge and are not: those of both.

    A scene is known by its digest, wherever its file was.
    """
    digest = one.get("digest")
    known = {"scene"} if digest and digest == other.get("digest") else set()
    keys = sorted((one.keys() | other.keys()) - _PER_RUN - known)
    pairs = {key: (one.get(key), other.get(key)) for key in keys}
    return {key: (ours, theirs) for key, (ours, theirs) in pairs.items() if ours != theirs}


def _joined(spans: Sequence[tuple[int, int]]) -> Ranges:
    """Sort sample ranges and join those that touch; OptionError where two overlap."""
    joined: list[tuple[int, int]] = []
    for first, count in sorted(spans):
        if joined and first < sum(joined[-1]):
            ranges = either("samples=(first, count)", "--samples FIRST,COUNT")
            raise OptionError(
                f"cannot merge overlapping samples: {first} to {min(sum(joined[-1]), first + count) - 1} "
                "occur twice",
                hint=f"render disjoint ranges with {ranges}",
            )
        if joined and first == sum(joined[-1]):
            joined[-1] = (joined[-1][0], joined[-1][1] + count)
        else:
            joined.append((first, count))
    return tuple(joined)


def _merged_aov(name: str, results: Sequence[Result], counts: Sequence[int]) -> np.ndarray:
    """Mean of one AOV weighted by the number of samples, or its maximum where the name says so; float32."""
    if name.startswith(_LARGEST):
        largest: np.ndarray = np.max([result.aovs[name] for result in results], axis=0)
        return largest
    total = sum(
        result.aovs[name].astype(np.float64) * count for result, count in zip(results, counts, strict=True)
    )
    return np.asarray(total / sum(counts), np.float32)


def _merged_stats(parts: Sequence[dict[str, Any]]) -> dict[str, Any]:
    """Merge dictionaries of statistics, nested ones too; a name only some of them have is kept."""
    names = dict.fromkeys(name for part in parts for name in part)
    merged = {name: _merged_stat(name, [part[name] for part in parts if name in part]) for name in names}
    for name in names:
        if name.startswith("energy") and merged.get("paths"):
            merged[name] = sum(part.get(name, 0.0) * part["paths"] for part in parts) / merged["paths"]
    return merged


def _merged_stat(name: str, values: Sequence[Any]) -> Any:
    """Merge one statistic: dictionaries by entry, flags by "or", numbers by sum or maximum, others listed."""
    if all(isinstance(value, dict) for value in values):
        return _merged_stats(values)
    if all(isinstance(value, bool | np.bool_) for value in values):
        return any(values)
    if all(isinstance(value, int | float | np.number) for value in values):
        return max(values) if name.lower().startswith(_LARGEST) else sum(values)
    return values[0] if all(value == values[0] for value in values[1:]) else list(values)


def _merged_metadata(parts: Sequence[dict[str, Any]], spp: int) -> dict[str, Any]:
    """Metadata of the whole: the shared entries, the total of samples and seconds, every device used."""
    merged = {key: value for key, value in parts[0].items() if all(part.get(key) == value for part in parts)}
    merged["spp"] = spp
    for name in ("samples", "denoised"):
        merged.pop(name, None)
    seconds = [part["seconds"] for part in parts if "seconds" in part]
    if seconds:
        merged["seconds"] = sum(seconds)
    devices = dict.fromkeys(str(part["device"]) for part in parts if "device" in part)
    if devices:
        merged["device"] = "; ".join(devices)
    return merged
