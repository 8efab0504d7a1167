"""The tokens of .pbrt files: words, quoted strings, numbers, and all that stands between brackets at once."""

from __future__ import annotations

import codecs
import gzip
import re
import zlib
from dataclasses import dataclass
from itertools import filterfalse
from typing import TYPE_CHECKING

import numpy as np

from clvol.base.files import open_regular
from clvol.base.memory import available_memory, format_bytes
from clvol.errors import SceneError, shortened

if TYPE_CHECKING:
    from pathlib import Path

MAX_OPEN, MAX_FILES = 64, 10_000
"""Most files that include each other, and most in all, counted as often as they are read."""
_SHARE = 8
"""A file may take one part in so many of the free memory: its numbers take several times its text."""
_PART = 2**20
_SKIPPED = re.compile(rb"(?:\s+|#[^\n]*)*")
_TOKEN = re.compile(rb'"(?:[^"\\\n]|\\[^\n])*"|[\[\]]|[^\s"\[\]#]+')
_ESCAPE = re.compile(r"\\(.)")
_ESCAPED = {"n": "\n", "t": "\t", "r": "\r", "b": "\b", "f": "\f"}

Values = np.ndarray | list[str]
"""Numbers as float64, or words and strings."""


@dataclass(frozen=True)
class Token:
    """A word, a quoted string, or one number or the values between brackets; `where` it is, as file:line."""

    kind: str  # "word" | "string" | "values"
    text: str
    where: str
    values: Values | None = None


@dataclass
class _Source:
    text: bytes
    name: str
    path: Path
    at: int = 0
    line: int = 1


def read_bytes(path: Path, where: str) -> bytes:
    """The contents of a file, unpacked where it ends in .gz; bounded by the memory that is free.

    Raises
    ------
    SceneError
        Not a file, damaged, or too large.
    """
    free = available_memory()
    limit = 2**31 if free is None else max(free // _SHARE, 2**20)
    try:
        with open_regular(path, SceneError, "file") as file:
            opened = gzip.GzipFile(fileobj=file) if path.suffix == ".gz" else file
            data: bytes = opened.read(limit + 1)
    except (OSError, EOFError, zlib.error) as error:
        raise SceneError(f"'{path}' cannot be read: {error}", where) from None
    if len(data) > limit:
        raise SceneError(f"'{path}' holds more than {format_bytes(limit)}", where, "it needs more memory")
    return data


class Tokens:
    """The tokens of a file and of those that it includes, in the order in which they stand.

    As in pbrt the parameters of a statement may go on after the end of an included file.
    """

    def __init__(self, path: Path) -> None:
        self._open: list[_Source] = []
        self._kept: list[Token] = []
        self._files = 0
        self.end = str(path)  # where the last token was
        self.include(path, "")

    def include(self, path: Path, where: str) -> None:
        """Go on with the tokens of another file."""
        resolved = path.resolve()
        if any(source.path == resolved for source in self._open):
            raise SceneError(f"'{path}' includes itself", where)
        self._files += 1
        if len(self._open) >= MAX_OPEN or self._files > MAX_FILES:
            raise SceneError("the scene includes too many files", where, f"at most {MAX_FILES}")
        text = read_bytes(path, where).removeprefix(codecs.BOM_UTF8)
        self._open.append(_Source(text, str(path), resolved))

    @property
    def depth(self) -> int:
        """How many files are open."""
        return len(self._open)

    def back(self, token: Token) -> None:
        """Give a token back, which is then the next one."""
        self._kept.append(token)

    def next(self) -> Token | None:
        """The next token, or None at the end of everything."""
        if self._kept:
            return self._kept.pop()
        while self._open:
            source = self._open[-1]
            found = self._raw(source)
            if found is None:
                self._open.pop()
                continue
            self.end = where = f"{source.name}:{source.line}"
            if found == b"[":
                return Token("values", "[", where, self._values(source, where))
            if found == b"]":
                raise SceneError("a ']' without its '['", where)
            return _single(found, where)
        return None

    def _raw(self, source: _Source) -> bytes | None:
        """The next piece of a file, None at its end."""
        start = source.at
        skipped = _SKIPPED.match(source.text, start)
        assert skipped is not None
        source.at = skipped.end()
        source.line += source.text.count(b"\n", start, source.at)
        if source.at == len(source.text):
            return None
        found = _TOKEN.match(source.text, source.at)
        if found is None:
            raise SceneError("a string without its end", f"{source.name}:{source.line}")
        source.at = found.end()
        return found[0]

    def _values(self, source: _Source, where: str) -> Values:
        """What stands between brackets: numbers, or strings and words."""
        end = source.text.find(b"]", source.at)
        body = b"" if end < 0 else source.text[source.at : end]
        if end >= 0 and b'"' not in body and b"#" not in body and b"[" not in body:
            source.line += body.count(b"\n")
            source.at = end + 1
            return _numbers_or_words(body, where)
        pieces = []
        while (piece := self._raw(source)) != b"]":
            if piece is None or piece == b"[":
                raise SceneError("a '[' without its ']'", where)
            pieces.append(piece)
        if any(piece.startswith(b'"') for piece in pieces):
            return [_single(piece, where).text for piece in pieces]
        return _numbers_or_words(b" ".join(pieces), where)


def _single(piece: bytes, where: str) -> Token:
    text = piece.decode("utf-8", "replace")
    if piece.startswith(b'"'):
        plain = _ESCAPE.sub(lambda match: _ESCAPED.get(match[1], match[1]), text[1:-1])
        return Token("string", plain, where)
    if text[0] in "+-.0123456789":
        return Token("values", text, where, _numbers_or_words(piece, where))
    return Token("word", text, where)


def _numbers_or_words(body: bytes, where: str) -> Values:
    """Numbers, read in parts of bounded size; or the words true and false."""
    parts, at = [], 0
    try:
        while at < len(body):
            end = min(at + _PART, len(body))
            while end < len(body) and not body[end : end + 1].isspace():
                end += 1
            parts.append(np.fromiter(map(float, body[at:end].split()), np.float64))
            at = end
    except ValueError:
        words, truths = body.split(maxsplit=_PART), (b"true", b"false")
        if all(word in truths for word in words):
            return [word.decode() for word in words]
        wrong = min(filterfalse(_is_number, words), key=truths.__contains__)  # a truth where nothing else is
        raise SceneError(
            f"'{shortened(wrong.decode('utf-8', 'replace'), 60)}' is not a number", where
        ) from None
    numbers = np.concatenate(parts) if parts else np.empty(0)
    if not np.isfinite(numbers).all():
        raise SceneError("numbers must be finite", where)
    return numbers


def _is_number(word: bytes) -> bool:
    try:
        float(word)
    except ValueError:
        return False
    return True
