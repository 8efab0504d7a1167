"""What a render returns: the picture, how sure of it we are, what it cost, and how it was made.

A result keeps the float64 sums it is made from (`clvol.picture.estimate`), so that results of disjoint
samples merge without loss.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from functools import reduce
from typing import TYPE_CHECKING, Any

import numpy as np

from clvol.errors import OptionError, shown
from clvol.picture.estimate import Estimate, error_bias

if TYPE_CHECKING:
    from os import PathLike

Ranges = tuple[tuple[int, int], ...]
"""Sample ranges as (first, count), ascending, disjoint, not touching."""

_PER_RUN = frozenset(
    {"spp", "samples", "seconds", "device", "time_limit", "interrupted", "pilot", "pilot_reason", "repeat"}
)
"""Metadata that may differ between results that merge; everything else must agree."""

_LARGEST = ("largest", "peak", "bytes", "slots", "pool")
"""Statistics whose names begin so are maxima or sizes: merged by the maximum, not added."""


def relative_noise(image: np.ndarray, variance: np.ndarray, dof: float = math.inf) -> float:
    """Mean standard error of the pixels over their mean radiance; nan where that is unknown.

    Standard errors from few degrees of freedom are too small on the mean, which is corrected.

    Both means run over the pixels and channels whose value and variance are finite, so that a dark
    background neither counts as infinitely noisy nor hides one bad pixel's nan.
    """
    known = np.isfinite(image) & np.isfinite(variance)
    level = float(np.abs(image[known]).sum(dtype=np.float64))
    if level == 0.0:
        return math.nan
    return float(np.sqrt(variance[known]).sum(dtype=np.float64)) / level / error_bias(dof)


def unseen_noise(paths: int, samples: int) -> float:
    """Bound of `relative_noise` where all samples are the same although media might have changed them.

    What none of `paths` paths met has a probability of 3 / paths at most (rule of three, 95 %); if it changes
    a sample by its own size, the means of `samples` samples have an error of √(3 / (paths · samples)).
    """
    return math.sqrt(3 / (max(paths, 1) * max(samples, 1)))


@dataclass(eq=False)
class Result:
    """A rendered picture.

    Parameters
    ----------
    image : float32 (height, width, 3)
        Mean linear radiance.
    variance : float32 (height, width, 3)
        Variance of that mean, per pixel; inf after a single sample.  It has `dof` degrees of freedom: with
        sampler sobol that of a single pixel is rough, sums over tiles and the image are good.
    stats : dict
        What it cost and what went wrong on the way: seconds by stage, paths, look-ups, violations, …
    aovs : dict of str to array (height, width) or (height, width, channels)
        Further pictures, means per path, e.g. "lookups".
    metadata : dict
        How the picture was made: scene, choices, spp, seed, device, version, seconds; and "samples" where
        they are not the first.
    samples : (int, int)
        First sample and number of samples of each pixel.
    estimate : `clvol.picture.estimate.Moments` or `Replicates` of shape (height, width, 3)
        Sums over the samples, by which results merge.
    ranges : tuple of (int, int)
        The same as `samples`, but exact where merged ranges leave gaps.
    """

    image: np.ndarray
    variance: np.ndarray
    stats: dict[str, Any]
    aovs: dict[str, np.ndarray]
    metadata: dict[str, Any]
    samples: tuple[int, int]
    estimate: Estimate
    ranges: Ranges = ()

    def __post_init__(self) -> None:
        self.ranges = self.ranges or (self.samples,)

    @classmethod
    def from_estimate(
        cls,
        estimate: Estimate,
        samples: tuple[int, int],
        aovs: dict[str, np.ndarray],
        stats: dict[str, Any],
        metadata: dict[str, Any],
    ) -> Result:
        """Make a result of the sums over ``samples = (first, count)``; count must be at least 1."""
        first, count = (int(number) for number in samples)
        if count < 1:
            raise OptionError("a result needs at least one sample per pixel")
        mean, variance = estimate.mean_and_variance()
        return cls(
            image=mean.astype(np.float32),
            variance=variance.astype(np.float32),
            stats=stats,
            aovs=aovs,
            metadata=metadata,
            samples=(first, count),
            estimate=estimate,
        )

    def __repr__(self) -> str:
        height, width = self.image.shape[:2]
        keys = ("technique", "transmittance", "majorant")
        how = [str(self.metadata[key]) for key in keys if key in self.metadata]
        (first, _), spp = self.ranges[0], self.samples[1]
        extent = f"{spp} spp from sample {first} on" if first else f"{spp} spp"
        about = f"{width} x {height}, {extent}, noise {self.noise:.2%}"
        return f"<Result {', '.join([about, *how])}>"

    @property
    def dof(self) -> int:
        """Degrees of freedom of each pixel's variance."""
        return self.estimate.dof

    @property
    def noise(self) -> float:
        """Mean relative standard error of the image (`relative_noise`).

        It is nan, that is unknown, where no sample met any light.

        Where all samples of each pixel are the same it is 0, unless paths crossed media and met nothing in
        them: then it is the bound `unseen_noise`.
        """
        noise = relative_noise(self.image, self.variance, self.dof)
        if noise == 0.0 and self.met_nothing:
            return unseen_noise(self.stats.get("paths", 0), self.samples[1])
        return noise

    @property
    def met_nothing(self) -> bool:
        """Paths crossed media, as far as is known, and no collision was real.

        What these media do to the picture has not been seen.
        """
        analytic = self.metadata.get("technique") == "analytic"
        crossed = analytic or self.stats.get("cells_crossed", 0) or self.stats.get("lookups", 0)
        return bool(crossed) and not self.stats.get("real_collisions", 0)

    def _repr_png_(self) -> bytes:
        """The picture as a PNG, tone-mapped: how a notebook shows a result."""
        from clvol.picture.saving import encode

        return encode(self, ".png")

    def save(self, path: str | PathLike[str], exposure: float = 0.0) -> None:
        """Write the picture as .exr (everything, linear) or .png (tone-mapped), by the path's suffix.

        An EXR holds R, G, B, variance.R/G/B and every AOV as float32 channels of one part.  A PNG is
        raised by `exposure` stops and goes through `clvol.picture.image_io.tone_map`.  Both carry the
        metadata.  An earlier file of that name is replaced only once the new one is complete.

        Raises
        ------
        OptionError
            Unknown suffix, impossible exposure, or a folder that is missing or cannot be written to; or a
            file that failed, as on a full disk: the picture is then kept where the message says.
        """
        from clvol.picture.saving import check_picture, save_all

        check_picture(path, exposure)
        for failure in save_all(self, [path], exposure).values():
            raise failure


def said_ranges(ranges: Ranges) -> dict[str, Any]:
    """Metadata "samples" where their number does not tell: a range as `clvol.render` takes it, or several."""
    if ranges == ((0, ranges[0][1]),):
        return {}
    return {"samples": ranges[0] if len(ranges) == 1 else ranges}


def merge(results: Iterable[Result]) -> Result:
    """Combine results of disjoint sample ranges of one render into the result of all samples.

    Sums and counts add up; AOVs are means weighted by the samples; statistics add, but for maxima and
    sizes (names that begin with "largest", "peak", "bytes", "slots", "pool"), of which the largest stays, and
    for means per path ("energy…"), which are weighted by the paths.

    Raises
    ------
    OptionError
        No results, or something else; overlapping sample ranges; or another size, scene, seed or choice:
        which, it says.
    """
    if isinstance(results, Result) or not isinstance(results, Iterable):
        raise OptionError("merge takes a list of results", hint="merge([a, b])")
    results = list(results)
    if not results:
        raise OptionError("nothing to merge", hint="give at least one result")
    for one in results:
        if not isinstance(one, Result):
            raise OptionError(
                f"merge takes what clvol.render returns, not {shown(one)}",
                hint="files do not hold the sums that it needs",
            )
    results.sort(key=lambda result: result.ranges)
    for other in results[1:]:
        _check_same_render(results[0], other)
    estimate = reduce(lambda one, other: one.plus(other), [result.estimate for result in results])
    ranges = _joined([span for result in results for span in result.ranges])
    counts = [result.samples[1] for result in results]
    merged = Result.from_estimate(
        estimate,
        samples=(ranges[0][0], sum(counts)),
        aovs={name: _merged_aov(name, results, counts) for name in results[0].aovs},
        stats=_merged_stats([result.stats for result in results]),
        metadata=_merged_metadata([result.metadata for result in results], sum(counts)),
    )
    merged.ranges = ranges
    merged.metadata |= said_ranges(ranges)
    return merged


def _check_same_render(one: Result, other: Result) -> None:
    """Raise OptionError where the two are not samples of the same picture."""
    pairs: dict[str, tuple[Any, Any]] = {
        "size": (one.image.shape[1::-1], other.image.shape[1::-1]),
        "target_error": (one.metadata.get("target_error"), other.metadata.get("target_error")),
        "aovs": (sorted(one.aovs), sorted(other.aovs)),
    }
    for key in sorted((one.metadata.keys() | other.metadata.keys()) - _PER_RUN):
        pairs[key] = (one.metadata.get(key), other.metadata.get(key))
    for key, (ours, theirs) in pairs.items():
        if ours != theirs:
            raise OptionError(
                f"cannot merge results of a different {key}: {ours!r} and {theirs!r}",
                hint="only sample ranges of the same render can be merged",
            )


def _joined(spans: Sequence[tuple[int, int]]) -> Ranges:
    """Sort sample ranges and join those that touch; OptionError where two overlap."""
    joined: list[tuple[int, int]] = []
    for first, count in sorted(spans):
        if joined and first < sum(joined[-1]):
            raise OptionError(
                f"cannot merge overlapping samples: {first} to {min(sum(joined[-1]), first + count) - 1} "
                "occur twice",
                hint="render disjoint ranges with samples=(first, count)",
            )
        if joined and first == sum(joined[-1]):
            joined[-1] = (joined[-1][0], joined[-1][1] + count)
        else:
            joined.append((first, count))
    return tuple(joined)


def _merged_aov(name: str, results: Sequence[Result], counts: Sequence[int]) -> np.ndarray:
    """Mean of one AOV weighted by the number of samples, or its maximum where the name says so; float32."""
    if name.startswith(_LARGEST):
        return np.max([result.aovs[name] for result in results], axis=0)
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
    merged.pop("samples", None)
    seconds = [part["seconds"] for part in parts if "seconds" in part]
    if seconds:
        merged["seconds"] = sum(seconds)
    devices = dict.fromkeys(str(part["device"]) for part in parts if "device" in part)
    if devices:
        merged["device"] = "; ".join(devices)
    return merged
