"""Mitsuba 3 XML to the nodes that the same dicts give: defaults, includes, paths, transforms, values.

What plugins and parameters mean is not known here; how XML writes numbers, colours and matrices is.
"""

from __future__ import annotations

import os
import re
from numbers import Real
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from clvol.base.files import open_regular, other_kind
from clvol.base.kinds import kind_of_file
from clvol.errors import SceneError, either, shortened, shown
from clvol.scene import transforms
from clvol.scene.faults import Faults, MissingFileError, UnsupportedError
from clvol.scene.lookup import find
from clvol.scene.nodes import NAMELESS, Node
from clvol.scene.upgrade import upgraded
from clvol.scene.vocabulary import did_you_mean, join_hints, listed
from clvol.scene.xml_tree import Element, parse_elements, parse_text
from clvol.scene.xml_values import (
    fail,
    parse_float,
    parse_floats,
    parse_integer,
    parse_rgb,
    parse_spectrum,
    parse_xyz,
)
from clvol.volumes.read import SUFFIXES, is_volume

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping

PLUGIN_TAGS = (
    *("scene", "shape", "bsdf", "medium", "volume", "phase", "emitter"),
    *("sensor", "film", "rfilter", "sampler", "integrator", "texture"),
)
VALUE_TAGS = ("float", "integer", "boolean", "string", "rgb", "spectrum", "point", "vector")
OTHER_TAGS = ("transform", "default", "include", "path", "ref", "alias")
TRANSFORM_TAGS = ("translate", "scale", "rotate", "lookat", "matrix")

MAX_TEXT, MAX_TEXTS = 2**20, 2**24
"""Longest attribute, and most characters of all together, that come from $names: defaults made of defaults
can grow without end."""
MAX_NAME = 256
"""Longest name of a default."""
MAX_FILES = 1000
"""Most files one scene may include, counted as often as they are."""
_REFERENCE = re.compile(r"(?<!\\)\$(\w*)", re.ASCII)


def read_xml(path: Path, keywords: Mapping[str, object], faults: Faults) -> Node:
    """The scene in XML file `path`, with `keywords` in place of its defaults.

    Elements that cannot be read are noted among the faults, and left out.

    Raises
    ------
    SceneError
        With file and line, where there is nothing to go on with.
    """
    if str(path).lstrip().startswith("<"):
        raise SceneError(
            f"a file's name is wanted, got XML: '{shortened(str(path), 40)}'",
            hint=either("load_string takes XML", "save it as a file"),
        )
    if not os.path.isfile(path):  # false, unlike Path.is_file, for a name too long for the system
        if kind := other_kind(path):
            hint = "name the .xml file in it" if os.path.isdir(path) else ""
            raise SceneError(f"'{path}' is {kind}, not a scene file", hint=hint)
        raise SceneError(f"scene file '{path}' does not exist")
    if is_volume(path):
        hint = either(
            "volume_scene makes a scene of it", "`clvol scene` makes a scene of it, `clvol render` a picture"
        )
        raise SceneError(f"'{path}' is a volume, not a scene", hint=hint)
    _check_xml(path)
    reader = _XmlReader(keywords, faults)
    return _finished(reader, reader.file(path, [], ""), keywords, str(path))


def is_old(path: Path) -> bool:
    """Whether an XML file is a scene of Mitsuba before version 2, which is read as one of version 3.

    SceneError for a file that is not there or is no XML.
    """
    if not os.path.isfile(path):
        raise SceneError(f"scene file '{path}' does not exist")
    _check_xml(path)
    return parse_elements(path).attributes.get("version", "")[:1] in ("0", "1")


def _check_xml(path: Path) -> None:
    """SceneError for a file that is something else, with what to do about that."""
    with open_regular(path, SceneError, "scene file") as file:
        head = file.read(256).lstrip(b"\xef\xbb\xbf\xff\xfe\0 \t\r\n")
    what, hint = kind_of_file(path)
    if head.startswith(b"<") or (not what and path.suffix.lower() == ".xml"):
        return
    known = f"scenes are Mitsuba's .xml, volumes {', '.join(SUFFIXES[:5])} and others"
    neither = "not a scene" if "volume" in what else "neither a scene nor a volume"
    raise SceneError(f"is {what + ', ' if what else ''}{neither}", str(path), hint or known)


TEXT = "the text"
"""What errors call XML that is in no file."""


def read_xml_text(text: str, keywords: Mapping[str, object], faults: Faults) -> Node:
    """The scene in XML; as `read_xml`, with files looked for in the working directory."""
    if not text.lstrip("\ufeff \t\r\n").startswith("<"):
        hint = "load_file takes the name of a file"
        raise SceneError(f"XML is wanted, got '{shortened(text, 40)}'", hint=hint)
    reader = _XmlReader(keywords, faults)
    return _finished(reader, reader.root(parse_text(text, TEXT), [Path()]), keywords, TEXT)


def _finished(reader: _XmlReader, root: Node, keywords: Mapping[str, object], where: str) -> Node:
    """A scene that was read, if it is one and every keyword is in it."""
    root.aliases = reader.aliases
    if root.kind != "scene":
        raise SceneError(f"the root element must be <scene>, not <{root.kind}>", root.where)
    unused = sorted(set(keywords) - reader.used)
    names = sorted(set(reader.values) - set(keywords) | reader.used)
    for name in () if reader.faults.lost_file else unused:
        what = f"no ${name} in the scene uses the value given for '{name}'"
        hint = join_hints(did_you_mean(name, names), f"the scene's names: {listed(names)}")
        reader.faults.note(SceneError(what, where, hint))
    return root


class _XmlReader:
    """State of one scene's reading: the values of $names, which were used, and the files being read."""

    def __init__(self, keywords: Mapping[str, object], faults: Faults) -> None:
        self.faults = faults
        self.values = {name: _as_text(value) for name, value in keywords.items()}
        self.used: set[str] = set()
        self.aliases: dict[str, tuple[str, str]] = {}
        self.reading: list[Path] = []
        self.files = self.replaced = 0

    # -- files -------------------------------------------------------------------------------------

    def file(self, path: Path, folders: list[Path], included_at: str) -> Node:
        """The root node of a file; `folders` are those of the file that includes it."""
        resolved = path.resolve()
        if resolved in self.reading:
            raise SceneError(f"'{path}' includes itself", included_at)
        self.files += 1
        if self.files > MAX_FILES:
            raise SceneError(f"the scene includes more than {MAX_FILES} files", included_at)
        self.reading.append(resolved)
        try:
            return self.root(parse_elements(path), [path.parent, *folders])
        finally:
            self.reading.pop()

    def root(self, element: Element, folders: list[Path]) -> Node:
        """The node of a document's root, whose files are looked for in `folders`."""
        if element.tag not in PLUGIN_TAGS:
            fail(element, f"unknown element <{element.tag}>", "a scene file begins with <scene>")
        attributes = self.attributes(element, "type", "id", "name", "version")
        version = attributes.get("version", "")
        if not re.fullmatch(r"[0-3]\.\d+(\.\d+)?", version, re.ASCII):
            what = f"version '{version}' is not supported" if version else "the version is missing"
            fail(element, what, f'for Mitsuba 2 and 3, write <{element.tag} version="3.0.0">')
        if version[0] in "01":
            element = upgraded(element, self.faults)
        return self.plugin(element, folders)

    def include(self, element: Element, parent: Node) -> None:
        """Put the children of an included <scene>, or another included plugin, into `parent`."""
        attributes = self.attributes(element, "!filename", "name")
        path = find(attributes["filename"], parent.folders, element.where)
        node = self.file(path, parent.folders, element.where)
        if node.kind != "scene":
            _add_child(parent, attributes.get("name", ""), node)
            return
        for key, value in node.parameters():
            if isinstance(value, Node) and key.startswith(NAMELESS):
                parent.add_nameless(value)
            else:
                parent.add(key, value, node.place(key))

    # -- elements ----------------------------------------------------------------------------------

    def attributes(self, element: Element, *allowed: str) -> dict[str, str]:
        """An element's attributes with $names replaced; a "!" marks those that must be there."""
        names = [name.lstrip("!") for name in allowed]
        for name in element.attributes:
            if name not in names:
                hint = join_hints(did_you_mean(name, names), f"supported: {listed(names)}")
                fail(element, f"unknown attribute '{name}' of <{element.tag}>", hint)
        for name in allowed:
            if name.startswith("!") and name[1:] not in element.attributes:
                fail(element, f"<{element.tag}> needs the attribute '{name[1:]}'")
        return {name: self.substitute(text, element) for name, text in element.attributes.items()}

    def substitute(self, text: str, element: Element) -> str:
        r"""`text` with each $name replaced by its value, and each \$ by a dollar sign."""
        length = 0

        def value(match: re.Match[str]) -> str:
            nonlocal length
            # As in Mitsuba the longest known name wins: $width2 may be $width followed by a 2.
            word = match[1]
            ends = range(min(len(word), MAX_NAME), 0, -1)
            name = next((word[:end] for end in ends if word[:end] in self.values), None)
            if name is None:
                word = shortened(word, 60)
                hint = join_hints(did_you_mean(word, self.values), f"known: {listed(self.values)}")
                fail(element, f"${word} has no value", hint)
            self.used.add(name)
            length += len(self.values[name])
            self.replaced += len(self.values[name])
            if length > MAX_TEXT:
                fail(element, f"the text is longer than {MAX_TEXT} characters once ${name} is replaced")
            if self.replaced > MAX_TEXTS:
                fail(element, f"the values of all $names together are longer than {MAX_TEXTS} characters")
            return self.values[name] + word[len(name) :]

        return _REFERENCE.sub(value, text).replace("\\$", "$")

    def plugin(self, element: Element, folders: list[Path]) -> Node:
        """A plugin's node with everything inside it."""
        if element.tag == "scene":
            attributes = {"type": "scene"} | self.attributes(element, "version", "id", "name")
        else:
            attributes = self.attributes(element, "!type", "id", "name", "version")
        node = Node(element.where, element.tag, attributes.get("id", ""), folders)
        node.old = element.old
        node.add("type", attributes["type"], element.where)
        for child in element.children:
            try:
                self.child(child, node)
            except SceneError as error:
                self.faults.note(error)
                self.faults.lost_ids |= set(_ids_in(child))
                self.faults.lost_file |= child.tag == "include"
        return node

    def child(self, element: Element, parent: Node) -> None:
        """Add what one element inside a plugin says to the plugin's node."""
        tag = element.tag
        if tag in PLUGIN_TAGS[1:]:
            if "version" in element.attributes:
                fail(element, f"unknown attribute 'version' of <{tag}>", "a file's first element has it")
            node = self.plugin(element, parent.folders)
            _add_child(parent, self.substitute(element.attributes.get("name", ""), element), node)
        elif tag == "alias":
            _no_children(element)
            self.alias(element)
        elif tag == "spectrum" and "type" in element.attributes:
            node = self.plugin(element, parent.folders)
            node.kind = "texture"
            _add_child(parent, self.substitute(element.attributes.get("name", ""), element), node)
        elif tag in VALUE_TAGS:
            _no_children(element)
            name, value = self.value(element, parent.folders)
            parent.add(name, value, element.where)
        elif tag == "transform":
            name = self.attributes(element, "!name")["name"]
            parent.add(name, self.transform(element), element.where)
        elif tag == "ref":
            _no_children(element)
            attributes = self.attributes(element, "!id", "name")
            node = Node(element.where)
            node.add("type", "ref", element.where)
            node.add("id", attributes["id"], element.where)
            _add_child(parent, attributes.get("name", ""), node)
        elif tag == "include":
            _no_children(element)
            self.include(element, parent)
        elif tag in ("default", "path"):
            _no_children(element)
            self.directive(element, parent)
        else:
            tags = (*PLUGIN_TAGS[1:], *VALUE_TAGS, *OTHER_TAGS)
            hint = join_hints(did_you_mean(tag, tags), _only_inside(tag))
            raise UnsupportedError(f"unknown element <{tag}>", element.where, hint)

    def alias(self, element: Element) -> None:
        """<alias> gives what has one id a second one."""
        attributes = self.attributes(element, "!id", "!as")
        if attributes["as"] in self.aliases:
            first = self.aliases[attributes["as"]][1]
            fail(element, f"the id '{attributes['as']}' is given twice", f"first at {first}")
        self.aliases[attributes["as"]] = attributes["id"], element.where

    def directive(self, element: Element, parent: Node) -> None:
        """<default> sets a $name that has no value yet; <path> adds a folder to look for files in."""
        if element.tag == "default":
            attributes = self.attributes(element, "!name", "!value")
            name = attributes["name"]
            if len(name) > MAX_NAME or not re.fullmatch(r"\w+", name, re.ASCII):
                what = f"'{shortened(name, 60)}' cannot be the name of a default"
                fail(element, what, f"use letters, digits and _, at most {MAX_NAME}")
            self.values.setdefault(name, attributes["value"])
            return
        folder = self.attributes(element, "!value")["value"]
        if parent.kind != "scene":
            fail(element, "<path> belongs directly into <scene>")
        found = [base / folder for base in parent.folders if os.path.isdir(base / folder)]
        if not found:
            hint = "paths are relative to the scene file"
            raise MissingFileError(f"folder '{folder}' does not exist", element.where, hint)
        parent.folders.insert(0, found[0])

    # -- values ------------------------------------------------------------------------------------

    def value(self, element: Element, folders: list[Path]) -> tuple[str, object]:
        """(name, value) of a <float>, <integer>, …, <vector>."""
        tag = element.tag
        if tag in ("point", "vector"):
            attributes = self.attributes(element, "!name", "value", "x", "y", "z")
            return attributes["name"], parse_xyz(element, attributes)
        if tag == "spectrum" and "filename" in element.attributes:
            attributes = self.attributes(element, "!name", "!filename")
            node = Node(element.where, folders=folders)
            node.add("type", tag, element.where)
            node.add("filename", attributes["filename"], element.where)
            return attributes["name"], node
        attributes = self.attributes(element, "!name", "!value")
        name, text = attributes["name"], attributes["value"]
        if tag == "float":
            return name, parse_float(element, text)
        if tag == "integer":
            return name, parse_integer(element, text)
        if tag == "boolean":
            if text.lower() not in ("true", "false"):
                fail(element, f"'{text}' is not a boolean", "write true or false")
            return name, text.lower() == "true"
        if tag == "string":
            return name, text
        if tag == "spectrum" and element.old and ":" not in text:
            tag = "rgb"  # which such lists of numbers were
        node = Node(element.where)
        node.add("type", tag, element.where)
        node.add(
            "value",
            parse_rgb(element, text) if tag == "rgb" else parse_spectrum(element, text),
            element.where,
        )
        return name, node

    def transform(self, element: Element) -> np.ndarray:
        """The 4x4 matrix of a <transform>: its operations, later ones applied after earlier ones."""
        matrix = np.eye(4)
        for child in element.children:
            _no_children(child)
            try:
                matrix = self.operation(child) @ matrix
            except SceneError as error:
                raise error if error.where else SceneError(error.what, child.where, error.hint) from None
        return matrix

    def operation(self, element: Element) -> np.ndarray:
        """One step of a transform."""
        tag = element.tag
        if tag == "translate":
            return transforms.translate(
                parse_xyz(element, self.attributes(element, "value", "x", "y", "z"), 0.0)
            )
        if tag == "scale":
            return transforms.scale(parse_xyz(element, self.attributes(element, "value", "x", "y", "z"), 1.0))
        if tag == "rotate":
            attributes = self.attributes(element, "!angle", "value", "x", "y", "z")
            return transforms.rotate(
                parse_xyz(element, attributes, 0.0), parse_float(element, attributes["angle"])
            )
        if tag == "lookat":
            attributes = self.attributes(element, "!origin", "!target", "up")
            origin, target = (parse_floats(element, attributes[name], (3,)) for name in ("origin", "target"))
            up = parse_floats(element, attributes["up"], (3,)) if attributes.get("up") else None
            return transforms.look_at(origin, target, transforms.any_up(origin, target) if up is None else up)
        if tag == "matrix":
            numbers = parse_floats(element, self.attributes(element, "!value")["value"], (9, 16))
            matrix = np.eye(4)
            side = 3 if len(numbers) == 9 else 4
            matrix[:side, :side] = np.reshape(numbers, (side, side))
            return matrix
        hint = join_hints(did_you_mean(tag, TRANSFORM_TAGS), f"supported: {listed(TRANSFORM_TAGS)}")
        fail(element, f"unknown transform <{tag}>", hint)


def _add_child(parent: Node, name: str, node: Node) -> None:
    """Add a plugin or ref under its name, or a made-up one when it has none."""
    if name:
        parent.add(name, node, node.where)
    else:
        parent.add_nameless(node)


def _ids_in(element: Element) -> Iterator[str]:
    """The ids of a plugin's element and of those inside."""
    if element.tag in PLUGIN_TAGS:
        yield from filter(None, [element.attributes.get("id")])
        for child in element.children:
            yield from _ids_in(child)


def _no_children(element: Element) -> None:
    if element.children:
        fail(element.children[0], f"<{element.children[0].tag}> cannot be inside <{element.tag}>")


def _only_inside(tag: str) -> str:
    return f"<{tag}> belongs into a <transform>" if tag in TRANSFORM_TAGS else ""


def _as_text(value: object) -> str:
    """A keyword's value as XML would write it."""
    if isinstance(value, bool | np.bool_):
        return "true" if value else "false"
    if isinstance(value, list | tuple | np.ndarray):
        return ", ".join(_as_text(part) for part in value)
    if not isinstance(value, str | Real | np.generic | os.PathLike):
        raise SceneError(f"a default's value is a string, a number or a list of them, got {shown(value)}")
    return str(value)
