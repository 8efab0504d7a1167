"""A film that has no room on its device: the host keeps it, and the device has a band of it at a time."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt
import pyopencl as cl

from clvol.rendering.film import Film

if TYPE_CHECKING:
    from collections.abc import Iterator

    from clvol.device.device import Device
    from clvol.planning.plan import Plan


class BandedFilm(Film):
    """Sums over the samples of one seed, of all pixels, as the device's pairs of floats.

    What a band gathers on the device becomes part of them once all bands have it (`keep`): they are of the
    same samples in every pixel.

    Parameters
    ----------
    held : pixels of a band, but of the last, which may have fewer.
    """

    def __init__(self, device: Device, plan: Plan, pixels: int, seed: tuple[int, int], held: int) -> None:
        self.held = held
        self._kept: dict[str, np.ndarray] = {}
        self._fresh: dict[int, dict[str, np.ndarray]] = {}
        super().__init__(device, plan, pixels, seed, held)

    def clear(self, seed: tuple[int, int]) -> None:
        """Forget every sample; the next ones are another seed's."""
        super().clear(seed)
        self._kept.clear()  # before the new ones are there
        self._kept.update({name: np.zeros(size, np.uint8) for name, size in self.sizes.items()})
        self.forget()

    def bring(self, first: int, count: int) -> Iterator[tuple[cl.Event, int]]:
        """Put so many pixels from `first` on onto the device, as they are kept: copies, and their bytes."""
        self.first_pixel = first
        for name, buffer in self.buffers.items():
            band = self._band(name, first, count)
            yield cl.enqueue_copy(self.device.queue, buffer, band, is_blocking=True), band.nbytes

    def fetch(self, count: int) -> Iterator[tuple[cl.Event, int]]:
        """Take so many pixels off the device again, to be kept with all others; yields what `bring` does."""
        fresh = {name: np.empty_like(self._band(name, self.first_pixel, count)) for name in self.buffers}
        for name, band in fresh.items():
            yield cl.enqueue_copy(self.device.queue, band, self.buffers[name], is_blocking=True), band.nbytes
        self._fresh[self.first_pixel] = fresh

    def keep(self) -> None:
        """Let what was fetched be what the film has."""
        while self._fresh:
            first, fresh = self._fresh.popitem()
            for name, array in fresh.items():
                at = first * (self.sizes[name] // self.pixels)
                self._kept[name][at : at + array.nbytes] = array

    def forget(self) -> None:
        """Let the film be what it was before anything was fetched."""
        self._fresh.clear()
        self.first_pixel = 0

    def _band(self, name: str, first: int, count: int) -> np.ndarray:
        per_pixel = self.sizes[name] // self.pixels
        return self._kept[name][first * per_pixel : (first + count) * per_pixel]

    def contents(self) -> dict[str, np.ndarray]:
        """What the buffers would hold on a device that had room for them."""
        return dict(self._kept)

    def put_back(self, contents: dict[str, np.ndarray]) -> None:
        """Make the film what `contents` found."""
        for name, array in contents.items():
            self._kept[name][:] = array

    def _read(self, name: str, shape: tuple[int, ...], dtype: npt.DTypeLike) -> np.ndarray:
        return self._kept[name].view(dtype).reshape(shape).copy()

    def _pairs(self, first: int, shape: tuple[int, ...]) -> np.ndarray:
        return self._band("film", first, shape[0]).view(np.float32).reshape(shape)
