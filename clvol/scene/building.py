"""From nodes to records: each node's record is made once, after those inside of it.

What cannot be made is noted among the library's faults, and left out of what it is in: reading goes on.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from clvol.errors import SceneError, VolumeError
from clvol.scene.faults import LostError
from clvol.scene.nodes import MAX_DEPTH, Node
from clvol.scene.reader import Reader
from clvol.scene.vocabulary import VITAL

if TYPE_CHECKING:
    from clvol.scene.library import Library

MOST_LOST = 20
"""Parameters that are left out of one plugin, each time reading it again, before it is given up."""


def build(node: Node, library: Library) -> Any:
    """The record of a node: the same object each time, so that what is shared stays shared.

    None where it cannot be made, which the library's faults say.
    """
    if id(node) not in library.built:
        library.open.append(node)
        library.built[id(node)] = _made(node, library)
        library.open.pop()
    return library.built[id(node)]


def build_whole(node: Node, library: Library) -> Any:
    """As `build`; SceneError or VolumeError where anything is wrong."""
    record = build(node, library)
    library.faults.check()
    return record


def _made(node: Node, library: Library) -> Any:
    """The record of a node, as if what cannot be read of it were not given; None where that is none."""
    try:
        library.check_supported(node)
    except SceneError as error:
        library.faults.note(error)
        return None
    lost = [key for key, child in node.parameters() if _is_lost(child, library)]
    while not any(key in VITAL for key in lost):
        reader = Reader(node.without(lost), library)
        try:
            record = library.plugins[reader.kind][node.type](reader)
            reader.finish()
            return record
        except (SceneError, VolumeError) as error:
            name = reader.failed_at
            consequence = lost and not name and type(error) is SceneError
            if not consequence:
                library.faults.note(error)
            if name not in node or name in lost or len(lost) >= MOST_LOST:
                if consequence:
                    break
                return None
            lost.append(name)
    library.faults.note_loss(f"{library.kind_of(node)} '{node.type}'", node.where)
    return None


def _is_lost(child: object, library: Library) -> bool:
    """Whether a parameter is a plugin that cannot be made."""
    if not isinstance(child, Node) or child.is_value:
        return False
    try:
        node = library.resolve(child)
        library.kind_of(node)
        if any(node is outer for outer in library.open) or len(library.open) > MAX_DEPTH:
            raise SceneError(f"'{node.type}' is nested without end", node.where)
    except LostError:
        return True
    except SceneError as error:
        library.faults.note(error)
        return True
    return build(node, library) is None
