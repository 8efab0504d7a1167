"""One camera ray and what walks did along it, in numbers."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from clvol.lab.digits import up_to_error

if TYPE_CHECKING:
    from clvol.lab.ray.place import Place
    from clvol.lab.ray.walks import Watched

CHANNEL_NAMES = ("red", "green", "blue")
DARK = 1e-3
"""Transmittance beyond which there is little to see."""


@dataclass(frozen=True, eq=False)
class WatchedRay:
    """One camera ray through its first medium, and what walks did along it.

    Attributes
    ----------
    scene, pixel, medium, seed, device
        What was looked at, and with which random numbers.
    place
        Where the ray enters the medium, and how long it stays, in world lengths.
    channel
        Number of the channel that is shown, of ``len(sigma_t)``.
    sigma_t
        float64 (channels, n), per world length, at the middles of n even steps, a multiple of 3.
    watched
        Each technique and transmittance, in the order asked for.
    notes
        What a viewer has to know, in sentences.
    files
        What the scene was read from, which `save` does not replace.
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
    files: tuple[str, ...] = ()

    @property
    def edges(self) -> np.ndarray:
        """Ends of the steps, float64 (n + 1,), from the medium's entry."""
        return np.linspace(0.0, self.place.length, self.sigma_t.shape[1] + 1)

    @property
    def window(self) -> tuple[float, float]:
        """The part worth a look, from the medium's entry.

        From its first matter to where walks have ended and little light is left.
        """
        matter = np.flatnonzero(self.sigma_t.any(axis=0))
        first, last = self.edges[matter[0]], self.edges[matter[-1] + 1]
        for watched in self.watched:
            rate = watched.rate()
            if watched.cells is not None and rate is not None:
                first = min(first, *watched.cells["t"][rate > 0].tolist())
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
    def depth_error(self) -> np.ndarray:
        """Error of the depth at the end, as the rule with steps three times as long tells, (channels,).

        Every third of the middles is the middle of such a step.  The error falls with the square of a step's
        length; to it comes that of places and densities in float32.
        """
        step = self.place.length / self.sigma_t.shape[1]
        coarse = 3 * step * self.sigma_t[:, 1::3].sum(axis=1)
        error: np.ndarray = np.abs(coarse - self.depth[:, -1]) / 8 + 1e-6 * self.depth[:, -1]
        return error

    @property
    def exact(self) -> str:
        """The transmittance at the end, with the digits that the error of the depth leaves."""
        value, error = self.transmittance[self.channel, -1], self.depth_error[self.channel]
        return up_to_error(value, value * error)

    @property
    def transmittance(self) -> np.ndarray:
        """exp(-depth), float64 (channels, n + 1)."""
        transmittance: np.ndarray = np.exp(-self.depth)
        return transmittance

    @property
    def bound_notes(self) -> list[str]:
        """A sentence where other channels rise above majorants, which are of the channel that is shown."""
        others = np.delete(self.sigma_t, self.channel, axis=0)
        middles, exceeded = (self.edges[1:] + self.edges[:-1]) / 2, []
        for watched in self.watched:
            cells, rate = watched.cells, watched.rate()
            if cells is None or rate is None or watched.name == "residual-ratio" or not len(others):
                continue
            place = np.minimum(np.searchsorted(cells["t_end"], middles), len(cells) - 1)
            inside = (middles >= cells["t"][0]) & (middles <= cells["t_end"][-1])
            if (inside & (others > 1.001 * rate[place])).any():
                exceeded.append(watched.label)
        if not exceeded:
            return []
        shown = CHANNEL_NAMES[self.channel]
        return [f"Majorants of {', '.join(exceeded)} are bounds of the {shown} channel only."]
