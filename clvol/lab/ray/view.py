"""What `clvol.trace_ray` returns: one camera ray, and what walks did along it."""

from __future__ import annotations

import json
from dataclasses import asdict, dataclass
from os import PathLike
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from clvol.base.extras import need_matplotlib
from clvol.base.output_files import check_file, output_suffix, write_file
from clvol.lab.ray.place import Place
from clvol.lab.ray.walks import Watched, format_estimate
from clvol.version import __version__

if TYPE_CHECKING:
    from matplotlib.figure import Figure

SUFFIXES = (".png", ".svg", ".pdf", ".json")
CHANNEL_NAMES = ("red", "green", "blue")
DARK = 1e-3
"""Transmittance beyond which there is little to see."""


@dataclass(frozen=True, eq=False)
class RayView:
    """One camera ray through its first medium.

    scene, pixel, medium, seed, device : what was looked at, and with which numbers.
    place : where the ray enters the medium, and how long it stays; world lengths.
    channel : number of the channel that is shown, of ``len(sigma_t)``.
    sigma_t : float64 (channels, n), at the middles of n even steps.
    watched : each technique and transmittance, in the order asked for.
    notes : what a viewer has to know.
    """

    scene: str
    pixel: tuple[int, int]
    medium: str
    seed: int
    device: str
    place: Place
    channel: int
    sigma_t: np.ndarray
    watched: tuple[Watched, ...]
    notes: tuple[str, ...]

    @property
    def edges(self) -> np.ndarray:
        """Ends of the steps, float64 (n + 1,), from the medium's entry."""
        return np.linspace(0.0, self.place.length, self.sigma_t.shape[1] + 1)

    @property
    def window(self) -> tuple[float, float]:
        """The part worth a look, from the medium's entry: from its first matter to where walks have
        ended and little light is left."""
        matter = np.flatnonzero(self.sigma_t.any(axis=0))
        first, last = self.edges[matter[0]], self.edges[matter[-1] + 1]
        for watched in self.watched:
            if watched.rate() is not None:
                first = min(first, *watched.cells[watched.rate() > 0, 0].tolist())
        dark = np.flatnonzero(self.transmittance[self.channel] < DARK)
        if len(dark):
            ends = [walk.reach(self.channel) for watched in self.watched for walk in watched.walks]
            last = max(self.edges[dark[0]], *[self.place.length if end is None else end for end in ends])
        margin = 0.03 * (last - first)
        return max(first - margin, 0.0), min(last + margin, self.place.length)

    @property
    def depth(self) -> np.ndarray:
        """Optical depth from the entry to each of `edges`, float64 (channels, n + 1): the midpoint rule."""
        step = self.place.length / self.sigma_t.shape[1]
        return np.pad(np.cumsum(self.sigma_t, axis=1) * step, [(0, 0), (1, 0)])

    @property
    def transmittance(self) -> np.ndarray:
        """exp(-depth), float64 (channels, n + 1)."""
        return np.exp(-self.depth)

    @property
    def bound_notes(self) -> list[str]:
        """A sentence where other channels rise above majorants, which are of the channel that is shown."""
        others = np.delete(self.sigma_t, self.channel, axis=0)
        middles, exceeded = (self.edges[1:] + self.edges[:-1]) / 2, []
        for watched in self.watched:
            if watched.rate() is None or watched.name == "residual-ratio" or not len(others):
                continue
            cells = watched.cells
            place = np.minimum(np.searchsorted(cells[:, 1], middles), len(cells) - 1)
            inside = (middles >= cells[0, 0]) & (middles <= cells[-1, 1])
            if (inside & (others > 1.001 * watched.rate()[place])).any():
                exceeded.append(watched.label)
        if not exceeded:
            return []
        shown = CHANNEL_NAMES[self.channel]
        return [f"Majorants of {', '.join(exceeded)} are bounds of the {shown} channel only."]

    def figure(self) -> Figure:
        """The view as a matplotlib figure; OptionError where matplotlib is not installed."""
        need_matplotlib("the figure of a ray")
        from clvol.lab.ray.plot import draw

        return draw(self)

    def summary(self) -> list[str]:
        """A line on the ray and one on each technique and transmittance."""
        exact = self.transmittance[self.channel, -1]
        lines = [
            f"{self.medium}: {self.place.length:.4g} long, {self.place.distance:.4g} from the camera; "
            f"optical depth {self.depth[self.channel, -1]:.4g}, transmittance {exact:.4g}"
        ]
        for watched in self.watched:
            mean, error = watched.transmitted(self.channel)
            lines.append(
                f"  {watched.label}: transmittance {format_estimate(mean, error)}, {watched.mean(6):.4g} "
                f"look-ups and {watched.mean(4):.4g} tentative collisions per walk"
            )
        return lines + [f"  {note}" for note in self.notes]

    def to_dict(self) -> dict[str, Any]:
        """Everything that is shown, as numbers, lists and text."""
        return {
            "scene": self.scene,
            "pixel": list(self.pixel),
            "medium": self.medium,
            "seed": self.seed,
            "device": self.device,
            "version": __version__,
            "notes": list(self.notes),
            "distance": self.place.distance,
            "length": self.place.length,
            "channel": self.channel,
            "sigma_t": self.sigma_t.tolist(),
            "transmittance": self.transmittance[:, -1].tolist(),
            "watched": [self._watched_dict(watched) for watched in self.watched],
        }

    def _watched_dict(self, watched: Watched) -> dict[str, Any]:
        cells = watched.cells
        names = ("t", "t_end", "majorant")
        known = {} if cells is None else {name: cells[:, n].tolist() for n, name in enumerate(names)}
        for name, values in (("rate", watched.rate()), ("control", watched.control(self.channel))):
            if values is not None:
                known[name] = values.tolist()
        mean, error = watched.transmitted(self.channel)
        return {
            "family": watched.family,
            "name": watched.name,
            "biased": watched.biased,
            "majorant": watched.majorant,
            "cells": known,
            "walks": len(watched.outcomes),
            "transmittance": mean,
            "standard_error": error,
            "lookups": watched.mean(6),
            "tentative": watched.mean(4),
            "shown": [asdict(walk) for walk in watched.walks],
        }

    def save(self, path: str | PathLike[str]) -> None:
        """Write the view as .png, .svg, .pdf (the figure) or .json (the numbers), by the path's suffix.

        Raises OptionError for another suffix, or a file that cannot be written; an earlier file is replaced
        only once the new one is complete.
        """
        check_output(path)
        write_file(path, self._encoded(Path(path).suffix.lower()[1:], 150))

    def _encoded(self, kind: str, dpi: int) -> bytes:
        """The numbers as JSON, or the figure in a format of matplotlib's."""
        import io

        if kind == "json":
            return (json.dumps(_finite(self.to_dict()), indent=1) + "\n").encode()
        buffer = io.BytesIO()
        self.figure().savefig(buffer, format=kind, dpi=dpi)
        return buffer.getvalue()

    def _repr_png_(self) -> bytes:
        """The figure, for notebooks."""
        return self._encoded("png", 100)


def check_output(path: str | PathLike[str]) -> None:
    """Raise OptionError now for a path that `RayView.save` could not write later."""
    if output_suffix(path, SUFFIXES) != ".json":
        need_matplotlib("the figure of a ray (all but .json)")
    check_file(path)


def _finite(value: Any) -> Any:
    """The same with None for numbers that JSON cannot say."""
    if isinstance(value, dict):
        return {name: _finite(entry) for name, entry in value.items()}
    if isinstance(value, list | tuple):
        return [_finite(entry) for entry in value]
    if isinstance(value, float) and not np.isfinite(value):
        return None
    return value
