"""What a scene's nodes are: finds a plugin's kind, follows references, and keeps what has been built."""

from __future__ import annotations

from collections.abc import Callable, Container, Mapping
from typing import TYPE_CHECKING, Any

from clvol.errors import SceneError
from clvol.scene.faults import Faults, LostError, UnsupportedError
from clvol.scene.nodes import Node
from clvol.scene.vocabulary import KNOWN, did_you_mean, join_hints, listed

if TYPE_CHECKING:
    from pathlib import Path

    from clvol.volumes.grid import Grid

Grids = dict[tuple["Path", str | None, str], "Grid"]
"""Volumes by file, grid and what is made of a level set: each is read once."""
PluginTable = Mapping[str, Mapping[str, Callable[[Any], object]]]
"""By kind and name of the plugin; each function turns a `clvol.scene.reader.Reader` into a record."""


class Library:
    """The plugins of one scene: which there are, what they are called, and the records of those built.

    Parameters
    ----------
    root : Node
        The scene, searched for ids.
    plugins : PluginTable
        What is supported.
    grids : dict, optional
        Volumes that were read before, by file and grid; those read from now on join them.

    faults : Faults, optional
        What has been found to be wrong; what is found from now on, as two nodes with the same id, joins it.
    """

    def __init__(
        self, root: Node, plugins: PluginTable, grids: Grids | None = None, faults: Faults | None = None
    ) -> None:
        self.root, self.plugins = root, plugins
        self.faults = Faults() if faults is None else faults
        self.grids: Grids = {} if grids is None else grids
        self.reduced: dict[int, Any] = {}  # by id() of a grid or volume that `grids` or a record keeps alive
        self.sanitized: dict[tuple[int, bool], Any] = {}  # the same, and whether negative ones stay
        self.taken: set[int] = set()  # id() of every plugin that another one holds or refers to
        self.built: dict[int, Any] = {}  # records, by id() of their node; None where there is none
        self.open: list[Node] = []  # what is being built, the outermost first
        self._ids: dict[str, Node] = {}
        self._collect_ids(root)
        for alias, (target, where) in root.aliases.items():
            self._add_alias(alias, target, where)

    def _collect_ids(self, node: Node) -> None:
        for _, value in node.parameters():
            if not isinstance(value, Node) or value.is_value or value.type == "ref":
                continue
            if value.id in self._ids:
                first = self._ids[value.id].where
                what = f"the id '{value.id}' is given twice"
                self.faults.note(SceneError(what, value.where, f"first at {first}"))
            elif value.id:
                self._ids[value.id] = value
            self._collect_ids(value)

    def _add_alias(self, alias: str, target: str, where: str) -> None:
        if alias in self._ids:
            first = f"first at {self._ids[alias].where}"
            self.faults.note(SceneError(f"the id '{alias}' is given twice", where, first))
        elif target in self._ids:
            self._ids[alias] = self._ids[target]
        elif self._is_lost(target):
            self.faults.lost_ids.add(alias)
        else:
            what = f"alias of an unknown id '{target}'"
            self.faults.note(SceneError(what, where, self._known_ids(target)))

    def _is_lost(self, target: str) -> bool:
        """Whether what has this id may have been in what could not be read."""
        return target not in self._ids and (target in self.faults.lost_ids or self.faults.lost_file)

    def _known_ids(self, wanted: str) -> str:
        return join_hints(did_you_mean(wanted, self._ids), f"ids here: {listed(self._ids)}")

    def resolve(self, node: Node) -> Node:
        """The node that a `ref` stands for; any other node itself."""
        if node.type != "ref":
            return node
        target = node.get("id")
        for key, _ in node.parameters():
            if key not in ("id", "name"):
                raise SceneError(f"unknown parameter '{key}' of 'ref'", node.place(key), "supported: id")
        if not isinstance(target, str):
            raise SceneError("a ref without an id", node.where)
        if self._is_lost(target):
            raise LostError(f"'{target}' could not be read", node.where)
        if target not in self._ids:
            raise SceneError(f"ref to an unknown id '{target}'", node.where, self._known_ids(target))
        return self._ids[target]

    def kind_of(self, node: Node) -> str:
        """What a node is ("shape", "medium", …): its XML tag, or what its type says.

        Raises
        ------
        SceneError
            An unknown type without a tag, or a tag that contradicts the type.
        """
        tables: list[Mapping[str, Container[str]]] = [self.plugins, *(table for table, _ in KNOWN)]
        kinds = [kind for table in tables for kind, types in table.items() if node.type in types]
        by_type = node.kind if node.kind in kinds else next(iter(kinds), "")
        if node.kind and by_type and node.kind != by_type:
            raise SceneError(f"'{node.type}' is a {by_type}, not a {node.kind}", node.where)
        if not node.kind and not by_type:
            known = [name for types in self.plugins.values() for name in types]
            hint = join_hints(did_you_mean(node.type, known), f"supported: {listed(known)}")
            raise UnsupportedError(f"unknown plugin '{node.type}'", node.where, hint)
        return node.kind or by_type

    def sensors(self) -> list[Node]:
        """The scene's sensors, as they are given."""
        nodes = [
            value for _, value in self.root.parameters() if isinstance(value, Node) and not value.is_value
        ]
        return [node for node in nodes if node.type != "ref" and self.kind_of(node) == "sensor"]

    def check_supported(self, node: Node) -> None:
        """Raise for a plugin that is unknown, or known but not supported in this version."""
        kind = self.kind_of(node)
        supported = self.plugins.get(kind, {})
        if node.type in supported:
            return
        every = f"supported: {listed(supported)}"
        for table, said in KNOWN:
            if node.type in table.get(kind, {}):
                what = f"{kind} '{node.type}' is not supported{said}"
                raise UnsupportedError(what, node.where, table[kind][node.type] or every)
        what, guess = f"unknown {kind} '{node.type}'", did_you_mean(node.type, supported)
        raise UnsupportedError(what, node.where, join_hints(guess, every))
