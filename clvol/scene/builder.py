"""From nodes to records: finds a plugin's kind, follows references, and builds each node once."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import TYPE_CHECKING, Any

from clvol.errors import SceneError
from clvol.scene.nodes import MAX_DEPTH, Node
from clvol.scene.reader import Reader
from clvol.scene.vocabulary import LATER, did_you_mean, join_hints, listed

if TYPE_CHECKING:
    from pathlib import Path

    from clvol.volumes.grid import Grid

PluginTable = Mapping[str, Mapping[str, Callable[[Reader], object]]]


class Builder:
    """Builds the plugins of one scene.

    Parameters
    ----------
    root : Node
        The scene, searched for ids.
    plugins : mapping of kind to mapping of plugin name to function
        What is supported; each function turns a `Reader` into a record.

    Raises
    ------
    SceneError
        Two nodes with the same id.
    """

    def __init__(self, root: Node, plugins: PluginTable) -> None:
        self.plugins = plugins
        self.grids: dict[tuple[Path, str | None], Grid] = {}
        self.reduced: dict[int, Any] = {}  # by id() of a grid or volume that `grids` or a record keeps alive
        self.taken: set[int] = set()  # id() of every plugin that another one holds or refers to
        self._ids: dict[str, Node] = {}
        self._built: dict[int, Any] = {}
        self._open: list[Node] = []
        self._collect_ids(root)
        for alias, (target, where) in root.aliases.items():
            self._add_alias(alias, target, where)

    def _collect_ids(self, node: Node) -> None:
        for _, value in node.parameters():
            if not isinstance(value, Node) or value.is_value or value.type == "ref":
                continue
            if value.id in self._ids:
                first = self._ids[value.id].where
                raise SceneError(f"the id '{value.id}' is given twice", value.where, f"first at {first}")
            if value.id:
                self._ids[value.id] = value
            self._collect_ids(value)

    def _add_alias(self, alias: str, target: str, where: str) -> None:
        if alias in self._ids:
            raise SceneError(f"the id '{alias}' is given twice", where, f"first at {self._ids[alias].where}")
        if target not in self._ids:
            raise SceneError(f"alias of an unknown id '{target}'", where, self._known_ids(target))
        self._ids[alias] = self._ids[target]

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
        by_type = next(
            (kind for table in (self.plugins, LATER) for kind, types in table.items() if node.type in types),
            "",
        )
        if node.kind and by_type and node.kind != by_type:
            raise SceneError(f"'{node.type}' is a {by_type}, not a {node.kind}", node.where)
        if not node.kind and not by_type:
            known = [name for types in self.plugins.values() for name in types]
            hint = join_hints(did_you_mean(node.type, known), f"supported: {listed(known)}")
            raise SceneError(f"unknown plugin '{node.type}'", node.where, hint)
        return node.kind or by_type

    def check_supported(self, node: Node) -> None:
        """Raise for a plugin that is unknown, or known but not supported in this version."""
        kind = self.kind_of(node)
        supported = self.plugins.get(kind, {})
        if node.type in supported:
            return
        what, guess = f"unknown {kind} '{node.type}'", did_you_mean(node.type, supported)
        if node.type in LATER.get(kind, ()):
            what, guess = f"{kind} '{node.type}' is not supported in this version", ""
        raise SceneError(what, node.where, join_hints(guess, f"supported: {listed(supported)}"))

    def build(self, node: Node) -> Any:
        """The record of a node; the same object each time, so that what is shared stays shared."""
        if id(node) not in self._built:
            self.check_supported(node)
            if any(node is outer for outer in self._open) or len(self._open) > MAX_DEPTH:
                raise SceneError(f"'{node.type}' is nested without end", node.where)
            self._open.append(node)
            reader = Reader(node, self)
            record = self.plugins[reader.kind][node.type](reader)
            reader.finish()
            self._open.pop()
            self._built[id(node)] = record
        return self._built[id(node)]
