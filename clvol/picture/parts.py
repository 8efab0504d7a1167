"""What results of disjoint samples are to be added by: every sum as it is, nothing divided yet.

Sums of float64 depend on the order that they are added in.  So it is fixed: parts stand in the order of their
samples, `FAN_IN` neighbours at a time become one, and so again until one is left (`added`).  Whoever adds in
this order, here or on many machines, gets the same bits.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import reduce
from typing import TYPE_CHECKING, Any

import numpy as np

from clvol.errors import OptionError, either
from clvol.picture.estimate import Uneven
from clvol.picture.result import Result, said_ranges

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from clvol.picture.estimate import Estimate, Ranges
    from clvol.picture.scenery import Scenery

FAN_IN = 8
"""So many parts are added at a time."""

_PER_RUN = frozenset(
    {
        "denoised",
        "bands",
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

_DIFFERENT = {
    "aovs": "results with different aovs",
    "digest": "results of different scenes: files, values of defaults or the sensor changed",
}
"""What is said of differences instead of their names."""

_LARGEST = ("largest", "peak", "bytes", "slots", "pool")
"""Statistics whose names begin so are maxima or sizes: merged by the maximum, not added."""


@dataclass(frozen=True, eq=False)
class Part:
    """The sums of a result, to be added to those of others.

    Parameters
    ----------
    estimate, stats, metadata, ranges : as in `Result`; `samples` of each pixel.
    aovs : by name, float64 sums over the samples, or maxima.
    """

    estimate: Estimate
    samples: int
    ranges: Ranges
    aovs: dict[str, np.ndarray]
    stats: dict[str, Any]
    metadata: dict[str, Any]
    size: tuple[int, int]
    component_format: str | None
    scenery: Scenery | None
    files: tuple[str, ...]

    @classmethod
    def of(cls, result: Result) -> Part:
        """Of a result, which it shares its sums with."""
        count = result.samples[1]
        height, width = result.image.shape[:2]
        about = {key: value for key, value in result.metadata.items() if key not in ("samples", "denoised")}
        return cls(
            result.estimate,
            count,
            result.ranges,
            {
                n: a if n.startswith(_LARGEST) else a.astype(np.float64) * count
                for n, a in result.aovs.items()
            },
            result.stats,
            about | {"spp": count},
            (width, height),
            result.component_format,
            result.scenery,
            result.files,
        )

    def result(self) -> Result:
        """The picture of these samples."""
        merged = Result.from_estimate(
            self.estimate,
            samples=(self.ranges[0][0], self.samples),
            aovs={name: self._mean(name) for name in self.aovs},
            stats=dict(self.stats),
            metadata=self.metadata | said_ranges(self.ranges),
        )
        merged.ranges, merged.component_format = self.ranges, self.component_format
        merged.scenery, merged.files = self.scenery, self.files
        return merged

    def _mean(self, name: str) -> np.ndarray:
        """One AOV's mean per sample, or its maximum where the name says so; float32."""
        total = self.aovs[name]
        return total if name.startswith(_LARGEST) else np.asarray(total / self.samples, np.float32)


def added(parts: Sequence[Part]) -> Part:
    """All parts, in the order of their samples, as one; OptionError where they do not fit together."""
    parts = sorted(parts, key=lambda part: part.ranges)
    while len(parts) > 1:
        parts = [sum_of(parts[at : at + FAN_IN]) for at in range(0, len(parts), FAN_IN)]
    return parts[0]


def sum_of(parts: Sequence[Part]) -> Part:
    """Parts, from the first to the last, as one; OptionError where they do not fit together."""
    if len(parts) == 1:
        return parts[0]
    for other in parts[1:]:
        _check_same_render(parts[0], other)
    estimates: list[Any] = [part.estimate for part in parts]  # of one kind, as the samplers are
    samples = sum(part.samples for part in parts)
    return replace(
        parts[0],
        estimate=reduce(lambda one, other: one.plus(other), estimates),
        samples=samples,
        ranges=_joined([span for part in parts for span in part.ranges]),
        aovs={name: _summed_aov(name, parts) for name in parts[0].aovs},
        stats=merged_stats([part.stats for part in parts]),
        metadata=_merged_metadata([part.metadata for part in parts], samples),
        files=tuple(dict.fromkeys(file for part in parts for file in part.files)),
    )


def _summed_aov(name: str, parts: Sequence[Part]) -> np.ndarray:
    arrays = [part.aovs[name] for part in parts]
    if name.startswith(_LARGEST):
        largest: np.ndarray = np.max(arrays, axis=0)
        return largest
    return reduce(np.add, arrays)


def _check_same_render(one: Part, other: Part) -> None:
    """Raise OptionError where the two are not samples of the same picture."""
    size = {"size": (one.size, other.size)}
    aovs = {"aovs": (sorted(one.aovs), sorted(other.aovs))}
    found = differences(one.metadata, other.metadata)
    scenes = {key: found.pop(key) for key in ("scene", "digest") if key in found}  # others follow from these
    for key, (ours, theirs) in (size | scenes | found | aovs).items():
        if ours != theirs:
            what = _DIFFERENT.get(key, f"results of a different {key}")
            said = "" if key == "digest" else f": {ours!r} and {theirs!r}"
            raise OptionError(
                f"cannot merge {what}{said}",
                hint="only sample ranges of the same render can be merged",
            )
    for part in (one, other):
        if isinstance(part.estimate, Uneven):
            part.estimate.plus(part.estimate)  # says why not


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


def merged_stats(parts: Sequence[dict[str, Any]]) -> dict[str, Any]:
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
        return merged_stats(values)
    if all(isinstance(value, bool | np.bool_) for value in values):
        return any(values)
    if all(isinstance(value, int | float | np.number) for value in values):
        return max(values) if name.lower().startswith(_LARGEST) else sum(values)
    return values[0] if all(value == values[0] for value in values[1:]) else list(values)


def _merged_metadata(parts: Sequence[dict[str, Any]], spp: int) -> dict[str, Any]:
    """Metadata of the whole: the shared entries, the total of samples and seconds, every device used."""
    merged = {key: value for key, value in parts[0].items() if all(part.get(key) == value for part in parts)}
    merged["spp"] = spp
    seconds = [part["seconds"] for part in parts if "seconds" in part]
    if seconds:
        merged["seconds"] = sum(seconds)
    named = [str(part["device"]).split(_ALSO) for part in parts if "device" in part]
    if named:
        merged["device"] = _ALSO.join(dict.fromkeys(device for devices in named for device in devices))
    return merged


_ALSO = "; "
"""Between devices."""
