"""The nested dicts that a scene is before it becomes records; each knows where it was written.

XML files and Python dicts both turn into `Node`s, and everything after that treats them alike.
Nothing here knows what a plugin or a parameter means.
"""

from __future__ import annotations

from collections.abc import Container, Iterator, Mapping
from pathlib import Path
from typing import Any

from clvol.errors import SceneError, shown
from clvol.scene.loaded_meshes import dict_of_loaded_mesh, is_loaded_mesh

MAX_DEPTH = 64
"""Deepest nesting accepted: far beyond any scene, well within Python's recursion limit."""

NAMELESS = "nameless "
"""How the made-up names of plugins begin that have none."""

VALUE_TYPES = ("rgb", "spectrum")
"""Nodes that stand for a value, not for a plugin."""


class Node(dict[str, Any]):
    """One plugin or colour: parameter name -> value, with the plugin's name under "type".

    Parameters
    ----------
    where : str
        Its place for messages: "scene.xml:12", or "scene.shape_1" for dicts.
    kind : str
        What the XML tag calls it ("shape", "medium", …); "" in dicts, where the type alone tells.
    id : str
        Name that a `ref` may use; "" without.
    folders : list of Path
        Where relative file names are looked for, first match first.

    `old`: whether it is of a scene of Mitsuba before version 2; `unheeded`: what such a one gives in vain.
    A scene's `aliases` are further ids: name -> (the id it stands for, where).
    """

    def __init__(self, where: str, kind: str = "", id: str = "", folders: list[Path] | None = None) -> None:
        super().__init__()
        self.where, self.kind, self.id = where, kind, id
        self.folders = folders if folders is not None else [Path()]
        self.places: dict[str, str] = {}
        self.aliases: dict[str, tuple[str, str]] = {}
        self.old, self.unheeded = False, set[str]()
        self._nameless = 0

    @property
    def type(self) -> str:
        """The plugin's name."""
        name: str = self["type"]
        return name

    @property
    def is_value(self) -> bool:
        """Whether this is a colour and not a plugin."""
        return not self.kind and self.type in VALUE_TYPES

    def place(self, key: str) -> str:
        """Where parameter `key` was written."""
        return self.places.get(key, self.where)

    def parameters(self) -> Iterator[tuple[str, object]]:
        """All (name, value) but "type"."""
        return ((key, value) for key, value in self.items() if key != "type")

    def add(self, key: str, value: object, where: str) -> None:
        """Set parameter `key`, once.

        Raises
        ------
        SceneError
            The node has it already.
        """
        if key in self:
            raise SceneError(f"'{key}' is given twice in '{self.get('type', self.kind)}'", where)
        self[key] = value
        self.places[key] = where

    def without(self, keys: Container[str]) -> Node:
        """The node as if these parameters were not given."""
        left = Node(self.where, self.kind, self.id, self.folders)
        left.update((key, value) for key, value in self.items() if key not in keys)
        left.places, left.old, left.unheeded = self.places, self.old, self.unheeded
        return left

    def add_nameless(self, value: Node) -> None:
        """Add a plugin that has no name, under one that no file gives."""
        self.add(f"{NAMELESS}{self._nameless}", value, value.where)
        self._nameless += 1


def from_dict(source: Mapping[str, object], where: str = "scene", depth: int = 0) -> Node:
    """A scene dict as nodes; `where` is the path so far, as in ``scene.shape_1.interior``.

    Raises
    ------
    SceneError
        A dict without a "type", a key that is not a string, or nesting without end.
    """
    if depth > MAX_DEPTH:
        raise SceneError(f"dicts are nested more than {MAX_DEPTH} deep", where, "does one contain itself?")
    if not isinstance(source, Mapping):
        if _is_loaded(source):
            hint = "give the dict that mi.load_dict made it from"
            raise SceneError(f"a Mitsuba {type(source).__name__} is loaded already", where, hint)
        raise SceneError(f"expected a dict, got {type(source).__name__}", where)
    if not isinstance(source.get("type"), str):
        raise SceneError("a dict without a 'type'", where, "give the plugin's name: {'type': 'sphere', ...}")
    key_as_id = where.rpartition(".")[2] if depth == 1 else ""  # Mitsuba: at the top, keys are ids
    node_id = source.get("id", key_as_id) if source["type"] != "ref" else ""
    if not isinstance(node_id, str):
        raise SceneError(f"expected a string as id, got {shown(node_id)}", f"{where}.id")
    node = Node(where, id=node_id)
    for key, value in source.items():
        if not isinstance(key, str):
            raise SceneError(f"parameter names are strings, got {shown(key)}", where)
        if key == "id" and source["type"] != "ref":
            continue
        path = f"{where}.{key}"
        if is_loaded_mesh(value):
            value = dict_of_loaded_mesh(value, path)
        elif _is_loaded(value):
            what = f"a Mitsuba {type(value).__name__} that is loaded already tells too little of itself"
            raise SceneError(what, path, "give the dict that mi.load_dict made it from")
        node.add(key, from_dict(value, path, depth + 1) if isinstance(value, Mapping) else value, path)
    return node


def _is_loaded(value: object) -> bool:
    """Whether it is a plugin of Mitsuba; its bitmaps and grids are arrays too, and taken as such."""
    made = any((kind.__module__, kind.__name__) == ("mitsuba", "Object") for kind in type(value).__mro__)
    return made and not hasattr(value, "__array_interface__")
