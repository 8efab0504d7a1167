"""What a medium is made of and bounded by, as far as it decides which code a scene needs; pure functions."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, TypeVar

import numpy as np

from clvol.scene import records
from clvol.scene.boundaries import is_clipped

if TYPE_CHECKING:
    from collections.abc import Iterable, Sequence

_T = TypeVar("_T")
LOOKED_UP = {
    "sigma_t": "",
    "albedo": "",
    "emission": "emits",
    "temperature": "emits",
    "phase_weight": "",
    "flakes": "",
    "emission_density": "glows",
}
"""What of a medium may be a grid volume, and the property of the medium without which it does not count."""


def volume_roles(medium: records.Medium) -> dict[str, records.GridVolume]:
    """Grid volumes of a medium, by what of it they are."""
    names = [name for name, of in LOOKED_UP.items() if not of or getattr(medium, of)]
    found = {name: getattr(medium, name) for name in names}
    return {name: volume for name, volume in found.items() if isinstance(volume, records.GridVolume)}


def medium_volumes(medium: records.Medium) -> list[records.GridVolume]:
    """Grid volumes of a medium: sigma_t, albedo and, where it emits or glows, what says how much."""
    return list(volume_roles(medium).values())


@dataclass(frozen=True, eq=False)
class Matter:
    """A scene's media and volumes, each once, by number.

    Parameters
    ----------
    media : in the order of the entries that name them first.  of_entry : number of each entry's medium.
    volumes : in the order in which the media name them first; then those that surfaces alone show.
    roles : for each medium, the number of its volume by what of it that is.
    """

    media: tuple[records.Medium, ...]
    of_entry: tuple[int, ...]
    volumes: tuple[records.GridVolume, ...]
    roles: tuple[dict[str, int], ...]


def number_matter(media: Sequence[records.Medium], others: Sequence[records.GridVolume] = ()) -> Matter:
    """Number the media of a scene's entries, one for each, and their volumes: objects, not values.

    others : volumes that surfaces show.
    """
    distinct, of_entry = _numbered(media)
    volumes, numbers = _numbered([v for medium in distinct for v in medium_volumes(medium)] + [*others])
    left = iter(numbers)
    roles = tuple({name: next(left) for name in volume_roles(medium)} for medium in distinct)
    return Matter(tuple(distinct), tuple(of_entry), tuple(volumes), roles)


def _numbered(objects: Iterable[_T]) -> tuple[list[_T], list[int]]:
    """The distinct objects in order, and the number of each."""
    distinct: list[_T] = []
    place: dict[int, int] = {}
    numbers = []
    for one in objects:
        if id(one) not in place:
            place[id(one)] = len(distinct)
            distinct.append(one)
        numbers.append(place[id(one)])
    return distinct, numbers


def channels_of(volume: records.Volume) -> int:
    """Channels of a volume: 1 or 3; 6 of the matrices of an sggx."""
    if isinstance(volume, records.ConstVolume):
        return len(volume.value)
    return volume.grid.channels


def is_grey(volume: records.Volume) -> bool:
    """Whether a coefficient is the same in all channels, everywhere."""
    if isinstance(volume, records.ConstVolume):
        return len(set(volume.value)) == 1
    return channels_of(volume) == 1


def is_grey_of(medium: records.Medium, role: str) -> bool:
    """Whether a medium's "sigma_t", "albedo" or "emission" is grey everywhere, classified or not."""
    transfer = medium.transfer(role)
    return is_grey(getattr(medium, role)) if transfer is None else transfer.is_grey


def classifies(medium: records.Medium) -> bool:
    """Whether anything is made of its density's values where the density is interpolated."""
    sigma_t = medium.sigma_t
    return medium.transfers is not None and getattr(sigma_t, "filter_type", "") == "trilinear"


def is_homogeneous(medium: records.Medium) -> bool:
    """Whether sigma_t is the same everywhere inside (the albedo may still vary)."""
    return isinstance(medium.sigma_t, records.ConstVolume)


def scatters(medium: records.Medium) -> bool:
    """Whether it scatters anything anywhere."""
    albedo = medium.albedo.value if isinstance(medium.albedo, records.ConstVolume) else (1.0,)
    return bool((np.array(albedo) * np.array(medium.scale) > 0).any())


def is_dark_emitter(medium: records.Medium) -> bool:
    """Emits, and absorbs at least as much as it scatters, everywhere."""
    dark = isinstance(medium.albedo, records.ConstVolume) and max(medium.albedo.value) <= 0.5
    return medium.emits and dark


def bounding_kind(shape: records.Shape) -> str:
    """What bounds the medium in a shape's span of a ray: "cube", "sphere" or "none".

    It is none where the volume's box, which clips the medium anyway, lies within the shape.
    """
    medium = shape.interior
    if medium is None or not is_clipped(medium):
        return shape.kind
    volume = medium.sigma_t
    if isinstance(volume, records.GridVolume):
        lower, upper, box_to_world = volume.lower, volume.upper, volume.index_to_world
    else:
        lower, upper, box_to_world = np.zeros(3), np.ones(3), volume.to_world
    corners = np.array([(*np.where(bits, upper, lower), 1.0) for bits in np.ndindex(2, 2, 2)]).T
    local = (np.linalg.inv(shape.to_world) @ box_to_world @ corners)[:3]
    reach = np.linalg.norm(local, axis=0) if shape.kind == "sphere" else np.abs(local)
    return "none" if reach.max() <= 1 + 1e-6 else shape.kind
