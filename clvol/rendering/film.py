"""The film on the device: what finished samples add up to, pixel by pixel.

A render has one; a survey that decides how many samples each pixel gets has another, so that none of its
samples is in the picture.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt
import pyopencl as cl

from clvol import layout
from clvol.picture.estimate import Estimate, Moments, Replicates, Uneven
from clvol.rendering.sizes import HOST_BYTES, film_sizes
from clvol.tables.sobol import samples_of_each

if TYPE_CHECKING:
    from clvol.device.device import Device
    from clvol.planning.plan import Plan

_READ_PIXELS = 1 << 18


class Film:
    """Sums over the samples of one seed.

    Parameters
    ----------
    seed : low and high word of the seed of its samples.
    pixels : of the picture.
    held : of them on the device at a time, where these are not all (`clvol.rendering.bands`).
    """

    first_pixel = 0
    """Of those on the device."""

    def __init__(
        self, device: Device, plan: Plan, pixels: int, seed: tuple[int, int], held: int | None = None
    ) -> None:
        self.device, self.plan, self.pixels, self.seed = device, plan, pixels, seed
        self.path_counts = layout.path_counts(plan.macros)
        self.firsts = layout.first_hit_fields(plan.macros)
        self.peaks = 1 + layout.shows_weight(plan.macros)
        self.sizes = film_sizes(plan, pixels)
        sizes = film_sizes(plan, held or pixels)
        what, hint = f"a film of {pixels} pixels", "render fewer pixels"
        self.buffers = {name: device.memory.allocate(size, what, hint) for name, size in sizes.items()}
        if device.memory.shared:
            device.memory.require(HOST_BYTES * pixels, f"a picture of {pixels} pixels", hint)
        self.clear(seed)

    def clear(self, seed: tuple[int, int]) -> None:
        """Forget every sample; the next ones are another seed's."""
        self.seed = seed
        zero = np.zeros(1, np.uint32)
        for buffer in self.buffers.values():
            cl.enqueue_fill_buffer(self.device.queue, buffer, zero, 0, buffer.size)
        listed = self.pixels if self.plan.pixel_list else 0
        self.samples = np.zeros(listed, np.int64)  # of each pixel, where they are not the same of all
        self.slot_totals = dict.fromkeys(layout.slot_fields(self.plan.macros), 0.0)

    def contents(self) -> dict[str, np.ndarray]:
        """Every buffer as it is, uint8, by name: with `put_back` no bit is lost."""
        return {name: self._read(name, (buffer.size,), np.uint8) for name, buffer in self.buffers.items()}

    def put_back(self, contents: dict[str, np.ndarray]) -> None:
        """Make the buffers what `contents` found."""
        for name, array in contents.items():
            cl.enqueue_copy(self.device.queue, self.buffers[name], array, is_blocking=True)

    def _read(self, name: str, shape: tuple[int, ...], dtype: npt.DTypeLike) -> np.ndarray:
        array: np.ndarray = np.empty(shape, dtype)
        cl.enqueue_copy(self.device.queue, array, self.buffers[name], is_blocking=True)
        return array

    def _sums(self) -> np.ndarray:
        """Of each randomisation, or of samples and squares; float64 (parts, pixels, channels).

        Read a part of the pixels at a time: the device's pairs of floats take as much as the sums.
        """
        parts, channels = self.plan.randomizations or 2, self.plan.channels
        sums = np.empty((parts, self.pixels, channels))
        for first in range(0, self.pixels, _READ_PIXELS):
            count = min(_READ_PIXELS, self.pixels - first)
            pairs = self._pairs(first, (count, parts, channels, 2))
            np.add(
                pairs[..., 0].swapaxes(0, 1),
                pairs[..., 1].swapaxes(0, 1),
                out=sums[:, first : first + count],
                dtype=np.float64,
            )
        return sums

    def _pairs(self, first: int, shape: tuple[int, ...]) -> np.ndarray:
        """Value and rounding error of the sums of pixels from `first` on, float32."""
        pairs: np.ndarray = np.empty(shape, np.float32)
        at = first * pairs[0].nbytes
        cl.enqueue_copy(self.device.queue, pairs, self.buffers["film"], src_offset=at, is_blocking=True)
        return pairs

    def estimate(self, first: int, count: int) -> Estimate:
        """What the samples `first` to `first + count`, all rendered, add up to; (pixels, channels)."""
        return self._estimate(self._sums(), first, count)

    def _estimate(self, sums: np.ndarray, first: int, count: int) -> Moments | Replicates:
        if self.plan.randomizations:
            return Replicates(sums, samples_of_each(first, count))
        return Moments(sums[0], sums[1], count)

    def uneven_estimate(self) -> Uneven:
        """What the samples, from 0 on as many as each pixel has, add up to; (pixels, channels)."""
        sums = self._sums()
        mean, variance = np.zeros(sums.shape[1:]), np.full(sums.shape[1:], np.inf)
        least = []
        for count in np.unique(self.samples[self.samples > 0]):
            at = self.samples == count
            estimate = self._estimate(sums[:, at], 0, int(count))
            mean[at], variance[at] = estimate.mean_and_variance()
            least.append(estimate.dof)
        return Uneven(mean, variance, self.samples.copy(), min(least, default=0))

    def counts(self) -> dict[str, np.ndarray]:
        """What walks counted so far, by name, uint64 (pixels,)."""
        if not self.path_counts:
            return {}
        counts = self._read("film_counts", (self.pixels, len(self.path_counts)), np.uint64)
        return {name: counts[:, n] for n, name in enumerate(self.path_counts)}

    def first_hits(self) -> dict[str, np.ndarray]:
        """Sums over the paths of what they first met, by field, float64 (pixels,)."""
        if not self.firsts:
            return {}
        film = self._read("film_firsts", (self.pixels, len(self.firsts), 2), np.float32).astype(np.float64)
        return {name: film[:, n, 0] + film[:, n, 1] for n, name in enumerate(self.firsts)}

    def peaks_by_pixel(self) -> dict[str, np.ndarray]:
        """Largest absolute sample of each pixel, and weight where a picture shows it; float32 (pixels,)."""
        peaks = self._read("film_peaks", (self.pixels, self.peaks), np.float32)
        return {
            name: peaks[:, n] for n, name in enumerate(("largest_sample", "largest_weight")[: self.peaks])
        }
