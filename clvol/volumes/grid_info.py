"""What a file says about its grids without their trees, and which of them a name means."""

from __future__ import annotations

import logging
from dataclasses import dataclass
from typing import TYPE_CHECKING, Protocol, TypeVar

if TYPE_CHECKING:
    from collections.abc import Sequence

    import numpy as np

log = logging.getLogger("clvol")


@dataclass(frozen=True, eq=False)
class GridInfo:
    """What a file says about one grid without its tree.

    name : "density", or "density[1]" for the second of that name.
    value_type : "float", "vec3s", "Fp8", …; half : values stored as 16-bit floats in spite of it.
    channels : values of a sample, 1 or 3; 0 where the grid cannot be read.
    kind : "fog volume", "level set", "staggered" or "" (clvol.volumes.grid.KINDS).
    compression : any of "zip", "blosc", "active mask".
    active_box : int32 (2, 3), inclusive, and active_voxels : what the file says, None if it does not.
    transform : the format's name of the map; index_to_world : float64 (4, 4), None if it is not affine.
    parent : name of the grid whose tree it shares, or "".
    unreadable : why the grid cannot be read; "" where it can.
    """

    name: str
    value_type: str
    half: bool
    channels: int
    kind: str
    compression: tuple[str, ...]
    active_box: np.ndarray | None
    active_voxels: int | None
    transform: str
    index_to_world: np.ndarray | None
    parent: str
    unreadable: str


class Named(Protocol):
    """An entry of a file's directory: `plain_name` is what several may be called, `name` only this one."""

    @property
    def plain_name(self) -> str: ...  # noqa: D102

    @property
    def name(self) -> str: ...  # noqa: D102


Entry = TypeVar("Entry", bound=Named)


def numbered(plain_name: str, number: int) -> str:
    """A name in OpenVDB's way: the second "density", number 1, is "density[1]"."""
    return f"{plain_name}[{number}]" if number else plain_name


def entries_named(entries: Sequence[Entry], name: str, where: str) -> list[Entry]:
    """Those entries that a name means, the first of which is taken.  "density[0]" is the first "density".

    A warning says where there are several of a plain name.
    """
    exact = [entry for entry in entries if entry.name == name]
    exact.sort(key=lambda entry: entry.plain_name != name)  # one that is called "density[1]" comes first
    alike = [entry for entry in entries if entry.plain_name == name]
    if len(alike) > 1:
        names = ", ".join([f"{name}[0]", *(entry.name for entry in alike[1:])])
        log.warning(
            "%s: has %d grids named %r; the first is taken, choose by %s", where, len(alike), name, names
        )
    return exact or alike or [entry for entry in entries if f"{entry.name}[0]" == name]


def chosen(entries: Sequence[Entry], grid: str | int | None, where: str) -> list[Entry]:
    """The entries that a name, a number, or no name at all means, the first of which is taken.

    None : "density", or the only grid that there is.
    """
    if isinstance(grid, int):
        return list(entries[grid : grid + 1]) if grid >= 0 else []
    if grid is None and len(entries) == 1:
        return list(entries)
    return entries_named(entries, "density" if grid is None else grid, where)


def missing(grid: str | int | None) -> str:
    """For the error about a grid that is not there."""
    return f"has no grid {'density' if grid is None else grid!r}"


def listed_names(entries: Sequence[Named]) -> str:
    """For the hint of an error about a grid that is not there."""
    names = ", ".join(repr(entry.name) for entry in entries)
    return f"its grids are {names}" if names else "it has no grids at all"
