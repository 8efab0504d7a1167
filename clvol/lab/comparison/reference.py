"""What combinations are compared with: a picture whose own error is known."""

from __future__ import annotations

import logging
import math
import os
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from clvol.base.files import other_kind
from clvol.base.image_reading import UnreadableError, read_stored
from clvol.errors import OptionError, either, shown
from clvol.scene.digest import scene_digest

if TYPE_CHECKING:
    from clvol.scene.records import Scene

log = logging.getLogger("clvol")
_MANY = 15
"""Degrees of freedom of a given variance that does not say how many it has, and the most that count."""


@dataclass(frozen=True, eq=False)
class Reference:
    """A picture near the truth.

    Parameters
    ----------
    image, variance : float64 (height, width, 3)
        Mean radiance and the variance of that mean.
    rounds : float32 (rounds, height, width, 3)
        Independent pictures whose mean it is.
    spp : samples per pixel in all; None where that is not known.
    source : how it was made, in words.
    variance_known : whether the variance was measured; if not it is 0, and errors look larger than they are.
    seeds : first and last that it was rendered with, None where that is not known.
    """

    image: np.ndarray
    variance: np.ndarray
    rounds: np.ndarray
    spp: int | None
    source: str
    variance_known: bool = True
    seeds: tuple[int, int] | None = None

    @classmethod
    def of_rounds(
        cls, rounds: np.ndarray, spp: int, source: str, seeds: tuple[int, int] | None = None
    ) -> Reference:
        """The mean of independent rounds of `spp` samples each; its variance is the one between them."""
        mean = rounds.mean(axis=0, dtype=np.float64)
        variance = rounds.var(axis=0, ddof=1, dtype=np.float64) / len(rounds)
        return cls(mean, variance, rounds, spp * len(rounds), source, seeds=seeds)

    @property
    def round_spp(self) -> float | None:
        """Samples per pixel of each of `rounds`; None where that is not known."""
        return self.spp / len(self.rounds) if self.spp else None

    @property
    def product_error(self) -> float:
        """Standard error that its own error leaves in mean squared errors, after subtracting the variance."""
        count = len(self.rounds)
        squares = ((self.rounds - self.image) ** 2).mean(axis=(1, 2, 3), dtype=np.float64)
        pixels = np.sqrt(2 * (self.variance**2).sum()) / self.variance.size
        if squares.sum() == 0:
            return 0.0
        spread = float(squares.std(ddof=1) / squares.mean()) * float(self.variance.mean())
        return max(spread, float(pixels)) * math.sqrt(1 + 1 / count)


def read_reference(path: str | os.PathLike[str], scene: Scene) -> Reference:
    """A picture that `Result.save` wrote, or any .exr of the film's size with channels R, G, B.

    Without channels variance.R, variance.G, variance.B its error is taken to be 0, with a warning; warnings
    too where its metadata name another scene or a biased choice.

    Raises
    ------
    OptionError : a file that cannot be read, of another size, without colours, or with values not finite.
    """
    if not isinstance(path, str | os.PathLike):
        raise OptionError(f"a reference is a file's name or a number of samples, not {shown(path)}")
    where = str(path)
    planes, metadata = _read_planes(where)
    missing = [name for name in "RGB" if name not in planes]
    if missing:
        raise OptionError(f"has no channel {', '.join(missing)}", where=where, hint="give a linear RGB .exr")
    image = np.stack([planes[name] for name in "RGB"], axis=-1).astype(np.float64)
    size = tuple(scene.film.window[2:])
    if image.shape[1::-1] != size:
        given = either("defaults", "-D")
        raise OptionError(
            f"is {image.shape[1]} x {image.shape[0]} pixels, the scene's film {size[0]} x {size[1]}",
            where=where,
            hint=f"render it with the same {given}, or give those that match it",
        )
    known = all(f"variance.{name}" in planes for name in "RGB")
    variance = np.zeros_like(image)
    if known:
        variance = np.stack([planes[f"variance.{name}"] for name in "RGB"], axis=-1).astype(np.float64)
    if not (np.isfinite(image).all() and np.isfinite(variance).all() and (variance >= 0).all()):
        raise OptionError(
            "has pixels or variances that are not finite", where=where, hint="render it with 2 spp or more"
        )
    _warn_of_doubts(where, metadata, known, scene)
    return Reference(
        image,
        variance,
        _stand_ins(image, variance, _freedom(metadata)),
        _count(metadata.get("spp")),
        f"given: {os.path.basename(where)}",
        known,
        _seeds(metadata),
    )


def _read_planes(where: str) -> tuple[dict[str, np.ndarray], dict[str, object]]:
    """Channels (height, width) by name, and the metadata."""
    if not where.lower().endswith(".exr"):
        raise OptionError("a reference is an .exr", where=where, hint="clvol render SCENE -o reference.exr")
    if kind := other_kind(where):
        raise OptionError(f"is {kind}, not a picture", where=where)
    if not os.path.isfile(where):
        raise OptionError("no such file", where=where)
    try:
        stored = read_stored(where)
    except UnreadableError as error:
        raise OptionError("cannot be read as a picture", where, str(error)) from None
    return {name: stored.pixels[..., n] for n, name in enumerate(stored.channels)}, stored.metadata


def _count(value: Any) -> int | None:
    """A number of at least 1 out of a file's metadata, which anybody may have written; None for all else."""
    try:
        return count if (count := int(value)) >= 1 else None
    except (TypeError, ValueError, OverflowError):
        return None


def _freedom(metadata: dict[str, object]) -> int:
    """Degrees of freedom of the variance: few where sampler sobol or joint rendered it."""
    return min(_count(metadata.get("dof")) or _MANY, _MANY)


def _seeds(metadata: dict[str, object]) -> tuple[int, int] | None:
    """First and last seed: "seed" of a render, "seeds" of an earlier comparison's reference."""
    words = str(metadata.get("seeds", metadata.get("seed", ""))).split()
    return (int(words[0]), int(words[-1])) if words and all(w.isdecimal() for w in words) else None


def _warn_of_doubts(where: str, metadata: dict[str, object], known: bool, scene: Scene) -> None:
    if not known:
        log.warning(
            "%s has no variance channels: its own error cannot be subtracted, and counts as everyone's", where
        )
    if "digest" in metadata and metadata["digest"] != scene_digest(scene):
        log.warning("%s was made of another scene, or with other values of its defaults", where)
    if metadata.get("biased"):
        log.warning("%s is biased itself (%s)", where, metadata["biased"])


def _stand_ins(image: np.ndarray, variance: np.ndarray, dof: int) -> np.ndarray:
    """Rounds that have exactly this mean and this variance of the mean, with as many degrees of freedom.

    A test between stacks takes them when the rounds themselves are gone.  Channels share their noise, as they
    do where paths carry them together: no certainty comes of taking their mean.
    """
    count = dof + 1
    noise = np.random.default_rng(1).standard_normal((count, *image.shape[:2], 1))
    noise -= noise.mean(axis=0)
    noise = noise / noise.std(axis=0, ddof=1) * np.sqrt(variance * count)
    rounds: np.ndarray = image + noise
    return rounds.astype(np.float32)
