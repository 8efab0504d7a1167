"""Which grid of a file is what: density, temperature, flame and colour by their usual names."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

from clvol.errors import VolumeError, either
from clvol.volumes.grid import STAGGERED

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from clvol.volumes import Listed

NAMES = {
    "density": ("density", "smoke", "sigma_t", "extinction", "fog", "cloud", "soot", "rho"),
    "temperature": ("temperature", "heat", "temp"),
    "flame": ("flame", "flames", "fire", "burn", "emission", "fuel"),
    "colour": ("cd", "color", "colour", "albedo"),
}
"""What a grid is for, and its names in any case, the most usual first."""
MOTION = ("v", "vel", "velocity", "vel.x", "vel.y", "vel.z", "pressure", "divergence", "rest", "shadow")
"""Grids of simulations that show nothing by themselves."""
IN_UNITS = ("sigma_t", "extinction")
"""Names that say that a density is an extinction already, per unit of the world."""
NONE = "none"
"""What a user says instead of a name where a grid is not to be used."""


@dataclass(frozen=True)
class Found:
    """Names of the grids, "" where a format has none; None where there is no such grid, or it is not used."""

    density: str
    temperature: str | None = None
    flame: str | None = None
    colour: str | None = None


def find_grids(listed: Sequence[Listed], asked: Mapping[str, str | None], where: str) -> Found:
    """Choose the grid of each kind.

    Parameters
    ----------
    listed : the grids that the file has.
    asked : by kind, the name that the user gives, or "none", or None to go by `NAMES`.
    where : the file, for messages.

    Raises VolumeError for a name that no grid has, one that cannot be read, and where none or more than one
    might be the density.
    """
    readable = [grid.name for grid in listed if not grid.unreadable]
    found: dict[str, str | None] = {}
    for kind, usual in NAMES.items():
        name = asked.get(kind)
        if name is None:
            ranked = [(usual.index(plain(n)), n) for n in readable if plain(n) in usual]
            found[kind] = min(ranked)[1] if ranked else None
        else:
            found[kind] = None if name == NONE and kind != "density" else _named(listed, name, where)
    density = found["density"]
    if density is None:
        density = _remaining(listed, readable, found, where)
    return Found(density, found["temperature"], found["flame"], found["colour"])


def plain(name: str) -> str:
    """The last part of a name that is a path, in small letters."""
    return name.rsplit("/", 1)[-1].lower()


def _named(listed: Sequence[Listed], name: str, where: str) -> str:
    """The name itself, of a grid that is there and can be read."""
    for grid in listed:
        if grid.name == name:
            if grid.unreadable:
                raise VolumeError(f"grid {name!r} cannot be read: {grid.unreadable}", where)
            return name
    names = ", ".join(repr(grid.name) for grid in listed if grid.name)
    raise VolumeError(
        f"has no grid {name!r}", where, f"its grids are {names}" if names else "it has one grid"
    )


def _remaining(
    listed: Sequence[Listed], readable: Sequence[str], found: Mapping[str, str | None], where: str
) -> str:
    """The density where no grid is called so: the only one that is left, else what burns."""
    vectors = [grid.name for grid in listed if grid.channels == 3 or grid.kind == STAGGERED]
    used = {*found.values(), *vectors}
    rest = [name for name in readable if name not in used and plain(name) not in MOTION]
    if len(rest) == 1:
        return rest[0]
    burning = found["flame"] or found["temperature"]
    if not rest and burning is not None:
        return burning
    if rest:
        names = ", ".join(map(repr, rest))
        raise VolumeError(
            f"which of its grids is the density? It has {names}",
            where,
            f"choose one by {either('density=', '--density ')}{rest[0]!r}",
        )
    reasons = [f"{grid.name!r}: {grid.unreadable}" for grid in listed if grid.unreadable]
    raise VolumeError("has no grid to render", where, "; ".join(reasons))
