"""XML text to a tree of elements that know their line; entities and external documents are refused."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING, NoReturn
from xml.parsers import expat

from clvol.base.files import open_regular
from clvol.errors import SceneError
from clvol.scene.nodes import MAX_DEPTH

if TYPE_CHECKING:
    from pathlib import Path


@dataclass
class Element:
    """One XML element; `where` is "file:line".  `old`: of a scene of Mitsuba before version 2."""

    tag: str
    attributes: dict[str, str]
    where: str
    children: list[Element] = field(default_factory=list)
    old: bool = False


def parse_elements(path: Path) -> Element:
    """The root element of XML file `path`.

    Raises
    ------
    SceneError
        With file and line: unreadable, not well-formed, text between elements, a document type with
        entities or an external part, or elements nested deeper than `MAX_DEPTH`.
    """
    with open_regular(path, SceneError, "scene file") as file:
        text = file.read()
    return parse_text(text, str(path))


def parse_text(text: bytes | str, name: str) -> Element:
    """The root element of XML; as `parse_elements`, which errors call `name`."""
    parser = expat.ParserCreate()
    tree = _TreeMaker(name, parser)
    parser.StartElementHandler = tree.start
    parser.EndElementHandler = tree.end
    parser.CharacterDataHandler = tree.text
    parser.StartDoctypeDeclHandler = tree.doctype
    parser.EntityDeclHandler = tree.entity
    try:
        parser.Parse(text, True)
    except expat.ExpatError as error:
        reason = expat.ErrorString(error.code)
        raise SceneError(f"broken XML: {reason}", f"{name}:{error.lineno}") from None
    except (LookupError, ValueError) as error:  # encodings that expat leaves to Python
        raise SceneError(f"cannot decode the scene file: {error}", name, "save it as UTF-8") from None
    return tree.open[0].children[0]


class _TreeMaker:
    """Expat's handlers; `open` is the stack of elements being read, with a stand-in for the document."""

    def __init__(self, name: str, parser: expat.XMLParserType) -> None:
        self.name, self.parser = name, parser
        self.open = [Element("", {}, name)]

    def fail(self, what: str, hint: str = "") -> NoReturn:
        raise SceneError(what, f"{self.name}:{self.parser.CurrentLineNumber}", hint)

    def start(self, tag: str, attributes: dict[str, str]) -> None:
        if len(self.open) > MAX_DEPTH:
            self.fail(f"elements are nested more than {MAX_DEPTH} deep")
        element = Element(tag, attributes, f"{self.name}:{self.parser.CurrentLineNumber}")
        self.open[-1].children.append(element)
        self.open.append(element)

    def end(self, tag: str) -> None:
        self.open.pop()

    def text(self, text: str) -> None:
        if text.strip():
            self.fail(f"unexpected text '{text.strip()[:40]}'", "values are written as attributes")

    def doctype(self, name: str, system_id: str | None, public_id: str | None, internal: bool) -> None:
        if system_id or public_id:
            self.fail("an external document type is refused", "remove the <!DOCTYPE> line")

    def entity(self, name: str, *_: object) -> None:
        self.fail(
            f"the entity '{name}' is refused", 'use <default name="..." value="..."/> and $name instead'
        )
