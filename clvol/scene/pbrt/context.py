"""What all translating shares: making nodes, and telling what is refused or taken as something else."""

from __future__ import annotations

from contextlib import contextmanager
from typing import TYPE_CHECKING, Any

import numpy as np

from clvol.errors import Error
from clvol.scene.nodes import Node
from clvol.scene.pbrt.colours import colour

if TYPE_CHECKING:
    from collections.abc import Iterator
    from pathlib import Path

    from clvol.scene.faults import Faults
    from clvol.scene.pbrt.parameters import Parameters
    from clvol.scene.pbrt.statements import Read


class Context:
    """A file that was read, the nodes made of it, and what was said and refused on the way.

    exposure : what all lights are multiplied by, since the film's picture is.
    """

    def __init__(self, read: Read, folders: list[Path], where: str, faults: Faults) -> None:
        self.read, self.folders = read, folders
        self.root = Node(where, "scene", folders=folders)
        self.root.add("type", "scene", where)
        self.exposure = 1.0
        self.faults = faults

    def node(self, kind: str, type: str, where: str, **values: Any) -> Node:
        """A plugin with parameters, those that are None left out; `id`: what refers to it says."""
        made = Node(where, kind, values.pop("id", ""), self.folders)
        made.add("type", type, where)
        for name, value in values.items():
            if value is not None:
                made.add(name, value, where)
        return made

    def rgb(self, value: np.ndarray, where: str) -> Node:
        """A colour as a parameter's value."""
        return self.node("", "rgb", where, value=[float(one) for one in value])

    def reference(self, id: str, where: str) -> Node:
        """Another plugin of the scene as a parameter's value."""
        made = Node(where)
        made.add("type", "ref", where)
        made.add("id", id, where)
        return made

    def colour(
        self, parameters: Parameters, name: str, default: float, space: str, bounded: bool = False
    ) -> np.ndarray:
        """A reflectance or coefficient, float64 (3,)."""
        found = parameters.get(name, "rgb", "spectrum", "float", "blackbody")
        return np.full(3, default) if found is None else colour(found, space, self.folders, bounded)

    def say(self, what: str, where: str) -> None:
        """That something is taken as something else: once for all alike, and in pictures' metadata."""
        self.faults.approximate(what, where)

    @contextmanager
    def collecting(self) -> Iterator[None]:
        """Go on after a fault within, so that all are told at once."""
        try:
            yield
        except Error as error:
            self.faults.note(error)
