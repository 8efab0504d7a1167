"""Volumes that repeat or mirror beyond their box: samples of all that their medium can ask them for.

The device clamps look-ups of a medium's volumes to their samples.  A volume's period is a whole number of
samples, so that the samples of a larger box are the same ones again, and interpolate to the same field.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import product
from typing import TYPE_CHECKING

import numpy as np

from clvol.errors import SceneError
from clvol.scene import records
from clvol.scene.boundaries import Boundaries, entry_bounds, is_clipped
from clvol.scene.medium_facts import volume_roles

if TYPE_CHECKING:
    from collections.abc import Collection

MAX_SAMPLES = 1 << 24
"""Most samples that a volume may become."""


@dataclass(frozen=True)
class Reach:
    """Samples `first` … `last`, both included, in the index space of a volume, x y z."""

    first: tuple[int, int, int]
    last: tuple[int, int, int]

    @property
    def samples(self) -> int:
        """How many they are."""
        return int(np.prod([last - first + 1 for first, last in zip(self.first, self.last, strict=True)]))

    def of(self, values: np.ndarray, mode: str) -> np.ndarray:
        """These samples of a field (nz, ny, nx, channels) that repeats or mirrors."""
        picked = [
            _wrapped(np.arange(first, last + 1), size, mode)
            for first, last, size in zip(self.first, self.last, values.shape[2::-1], strict=True)
        ]
        return np.ascontiguousarray(values[np.ix_(*picked[::-1])])


def _wrapped(index: np.ndarray, size: int, mode: str) -> np.ndarray:
    """Where in `size` samples those of these indices are; a mirrored field has its edges twice, as there."""
    if mode == "repeat":
        return index % size
    place = index % (2 * size)
    folded: np.ndarray = np.where(place < size, place, 2 * size - 1 - place)
    return folded


def reaches(
    scene: records.Scene, found: Boundaries, shown: Collection[records.GridVolume] = ()
) -> dict[int, Reach]:
    """By id(), the volumes of which a medium needs samples beyond their box; `shown`: those on surfaces.

    Volumes of a medium are looked up wherever sigma_t is.

    Raises
    ------
    SceneError
        Such a volume's medium is everywhere, is so large that the samples would be too many, or the volume
        is a texture as well.
    """
    needed: dict[int, Reach] = {}
    for entry, box in zip(found.entries, entry_bounds(scene, found), strict=True):
        sigma_t = entry.medium.sigma_t
        clip = sigma_t if isinstance(sigma_t, records.GridVolume) and is_clipped(entry.medium) else None
        for name, volume in volume_roles(entry.medium).items():
            if volume is sigma_t or volume.wrap_mode == "clamp" or _same_box(clip, volume):
                continue
            corners = _corners(box) if clip is None else _world_corners(clip)
            what = f"wrap_mode {volume.wrap_mode!r} of the {name} volume"
            where = volume.source or entry.medium.name
            if not np.isfinite(corners).all():
                hint = "bound the medium by a shape, or use wrap_mode clamp"
                raise SceneError(f"{what}, whose medium is everywhere", where, hint)
            if any(volume is other for other in shown):
                raise SceneError(f"{what}, which is a surface's texture too", where, "give it twice")
            reach = _joined(needed.get(id(volume)), _reach(volume, corners))
            if reach.samples > MAX_SAMPLES:
                many = f"{what} makes {reach.samples} samples of it in its medium, more than {MAX_SAMPLES}"
                raise SceneError(many, where, "give it the box of sigma_t or a coarser grid, or use clamp")
            needed[id(volume)] = reach
    return needed


def _same_box(one: records.GridVolume | None, other: records.GridVolume) -> bool:
    return one is not None and np.allclose(_world_corners(one), _world_corners(other))


def _corners(box: tuple[np.ndarray, np.ndarray]) -> np.ndarray:
    """The eight corners of a box, (8, 3)."""
    return np.array(
        [[box[side][axis] for axis, side in enumerate(sides)] for sides in product((0, 1), repeat=3)]
    )


def _world_corners(volume: records.GridVolume) -> np.ndarray:
    """World positions of the corners of a volume's box, (8, 3)."""
    matrix = volume.index_to_world
    placed: np.ndarray = _corners((volume.lower, volume.upper)) @ matrix[:3, :3].T + matrix[:3, 3]
    return placed


def _reach(volume: records.GridVolume, corners: np.ndarray) -> Reach:
    """The samples between which all of a world box lies, and one more on each side for rounding."""
    matrix = np.linalg.inv(volume.index_to_world)
    index = corners @ matrix[:3, :3].T + matrix[:3, 3]
    first, last = np.floor(index.min(axis=0)) - 1, np.floor(index.max(axis=0)) + 2
    return Reach((int(first[0]), int(first[1]), int(first[2])), (int(last[0]), int(last[1]), int(last[2])))


def _joined(one: Reach | None, other: Reach) -> Reach:
    if one is None:
        return other
    first, last = np.minimum(one.first, other.first), np.maximum(one.last, other.last)
    return Reach((int(first[0]), int(first[1]), int(first[2])), (int(last[0]), int(last[1]), int(last[2])))
