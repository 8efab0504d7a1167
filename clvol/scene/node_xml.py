"""The nodes of a scene that was read, as Mitsuba 3 XML that gives the same nodes again.

Numbers have all their digits.  What XML has no place for (arrays, meshes) goes to files, which `Files` names.
What stands in several places stands in the scene instead, with an id, and is referred to.
"""

from __future__ import annotations

from collections import Counter
from numbers import Real
from typing import TYPE_CHECKING, Any, Protocol

import numpy as np

from clvol.scene.lookup import find
from clvol.scene.nodes import NAMELESS, Node
from clvol.scene.records import Mesh
from clvol.scene.spectrum_plugins import SPECTRA
from clvol.scene.xml_text import plain_parameter, quoted
from clvol.volumes.grid import SparseGrid
from clvol.volumes.read import split_address

if TYPE_CHECKING:
    from collections.abc import Iterator
    from pathlib import Path

POINTS = ("position", "center", "p0", "p1", "origin", "target")
"""Parameters of three numbers that Mitsuba has as points; the others are vectors."""
FACTORS = ("scale", "emission_scale")
"""Parameters that are a number in Mitsuba: a grey colour is written as one."""
EXTINCTION = "sigma_t"
"""A colour of media that may be greater than 1: Mitsuba takes such a one as a volume alone."""


class Files(Protocol):
    """Where what XML cannot hold is put; each returns the file's name as the scene has it."""

    def named(self, path: Path, address: str | None) -> str:
        """A file that is there, and perhaps the array in it."""

    def picture(self, pixels: np.ndarray) -> str:
        """Linear colours, float32 (height, width, 3)."""

    def volume(self, samples: np.ndarray) -> str:
        """Samples on the unit cube, float32 [z, y, x] or [z, y, x, 3]."""

    def sparse(self, grid: SparseGrid) -> tuple[str, np.ndarray]:
        """The samples of a sparse grid, and where the unit cube that they fill is in the grid's world."""

    def mesh(self, mesh: Mesh) -> str:
        """Triangles."""


def nodes_xml(root: Node, files: Files, comment: str = "") -> str:
    """The scene as the text of an XML file, which begins with a comment.

    Raises
    ------
    SceneError
        A file that a node names and that is not there.
    """
    return _Writer(root, files).text(comment)


class _Writer:
    """State of one scene's writing: what is in several places, and its ids."""

    def __init__(self, root: Node, files: Files) -> None:
        self.root, self.files = root, files
        nodes = list(_nodes_in(root))
        counts = Counter(map(id, nodes))
        self.taken = {node.id for node in nodes if node.id} | set(root.aliases)
        self.shared = {id(node): "" for node in nodes if counts[id(node)] > 1 and not _is_plain(node)}
        self.top: list[str] = []

    def text(self, comment: str) -> str:
        """All lines."""
        for name, value in self.root.parameters():
            lines = self.parameter(name, value, self.root)
            self.top += ["", *lines]
        for alias, (target, _) in self.root.aliases.items():
            self.top.append(f"<alias id={quoted(target)} as={quoted(alias)}/>")
        head = [f"<!-- {comment.replace('--', '- -')} -->"] if comment else []
        inside = ["    " + line if line else "" for line in self.top]
        return "\n".join([*head, '<scene version="3.0.0">', *inside, "</scene>", ""])

    def plugin(self, name: str, node: Node) -> list[str]:
        """An element and what is inside of it; a reference to what stands in several places."""
        if id(node) not in self.shared:
            return self.element(name, node, node.id)
        if not self.shared[id(node)]:
            self.shared[id(node)] = node.id or self._new_id(node)
            lines = self.element("", node, self.shared[id(node)])
            self.top += ["", *lines]
        return [f"<ref{_name(name)} id={quoted(self.shared[id(node)])}/>"]

    def element(self, name: str, node: Node, own: str) -> list[str]:
        """A plugin where it stands."""
        given: str = node.type
        values: dict[str, Any] = dict(node.parameters())
        tag = "spectrum" if node.type in SPECTRA else node.kind
        if isinstance(values.get("filename"), str):
            values["filename"] = self._file(node, values["filename"])
        if isinstance(values.get("mesh"), Mesh):
            given = "ply"
            values |= self._mesh(values.pop("mesh"))
        if isinstance(values.get("grid"), SparseGrid):
            file, moved = self.files.sparse(values.pop("grid"))
            values |= {"filename": file, "to_world": values.get("to_world", np.eye(4)) @ moved}
        opening = f"<{tag}{_name(name)} type={quoted(given)}" + (f" id={quoted(own)}" if own else "")
        inside = [line for key, value in values.items() for line in self.parameter(key, value, node)]
        return (
            [f"{opening}>", *("    " + line for line in inside), f"</{tag}>"] if inside else [opening + "/>"]
        )

    def parameter(self, name: str, value: Any, owner: Node) -> list[str]:
        """The lines of one parameter."""
        label = f"name={quoted(name)}"
        if isinstance(value, Node):
            return self._value(name, value, owner) if _is_plain(value) else self.plugin(name, value)
        if plain := plain_parameter(name, value, _numbers):
            return [plain]
        array = np.asarray(value)
        if name == "bitmap":
            return [f'<string name="filename" value={quoted(self.files.picture(array))}/>']
        if name == "data":
            return [f'<string name="filename" value={quoted(self.files.volume(array))}/>']
        if array.shape in ((3, 3), (4, 4)):
            matrix = array if len(array) == 4 else _in_space(array)
            return [f'<transform {label}><matrix value="{_numbers(matrix)}"/></transform>']
        x, y, z = (_numbers(one) for one in array)
        return [f'<{"point" if name in POINTS else "vector"} {label} x="{x}" y="{y}" z="{z}"/>']

    def _value(self, name: str, value: Node, owner: Node) -> list[str]:
        """A reference or a colour."""
        if value.type == "ref":
            return [f"<ref{_name(name)} id={quoted(value['id'])}/>"]
        label = f"name={quoted(name)}"
        if "filename" in value:
            return [f"<spectrum {label} filename={quoted(self._file(value, value['filename']))}/>"]
        given = value["value"]
        if value.type == "rgb":
            if name in FACTORS and len(set(given)) == 1:
                return [f'<float {label} value="{_numbers(given[:1])}"/>']
            colour = f'<rgb {label} value="{_numbers(given)}"/>'
            if owner.kind == "medium" and name == EXTINCTION and np.max(given) > 1:
                inside = colour.replace(label, 'name="value"')
                return [f'<volume {label} type="constvolume">', f"    {inside}", "</volume>"]
            return [colour]
        if isinstance(given, Real):
            return [f'<spectrum {label} value="{_numbers(given)}"/>']
        pairs = ", ".join(f"{_numbers(wavelength)}:{_numbers(number)}" for wavelength, number in given)
        return [f'<spectrum {label} value="{pairs}"/>']

    def _mesh(self, mesh: Mesh) -> dict[str, Any]:
        given = {"filename": self.files.mesh(mesh)}
        return given if mesh.normals is not None else given | {"face_normals": True}

    def _file(self, node: Node, name: str) -> str:
        file, inside = split_address(name)
        where = node.place("filename")
        return self.files.named(find(file, node.folders, where, folder_too=True), inside)

    def _new_id(self, node: Node) -> str:
        number = 1
        while (made := f"{node.kind}_{number}") in self.taken:
            number += 1
        self.taken.add(made)
        return made


def _is_plain(node: Node) -> bool:
    """Whether it is a colour or a reference, and not a plugin."""
    return node.is_value or node.type == "ref"


def _nodes_in(node: Node) -> Iterator[Node]:
    """All nodes inside, those that stand in several places as often; what is inside of these once."""
    seen: set[int] = set()

    def inside(node: Node) -> Iterator[Node]:
        for _, value in node.parameters():
            if isinstance(value, Node):
                yield value
                if id(value) not in seen:
                    seen.add(id(value))
                    yield from inside(value)

    return inside(node)


def _in_space(plane: np.ndarray) -> np.ndarray:
    """A transform of the plane, 3x3, as one of space that does nothing to z."""
    matrix = np.eye(4)
    matrix[np.ix_([0, 1, 3], [0, 1, 3])] = plane
    return matrix


def _name(name: str) -> str:
    return "" if not name or name.startswith(NAMELESS) else f" name={quoted(name)}"


def _numbers(values: Any) -> str:
    """Numbers with all their digits."""
    return ", ".join(map(repr, np.atleast_1d(np.asarray(values, np.float64)).reshape(-1).tolist()))
