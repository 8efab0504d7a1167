"""Puts a kernel's files together by their own `#include`s and `#if`s.

What the given macros decide is decided here: hidden text goes, and with it what it would include.  Any other
directive is left to the compiler.  `#line` is kept, so that build logs name files and lines.
"""

from __future__ import annotations

import re
from dataclasses import dataclass, field
from functools import lru_cache
from typing import TYPE_CHECKING, NamedTuple

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping

_DIRECTIVE = re.compile(r"^\s*#\s*(include|ifdef|ifndef|if|elif|else|endif)\b\s*(.*?)\s*(?:/\*.*)?$")
_IDENTIFIER = re.compile(r"\b[A-Za-z_]\w*\b")
_NOTHING = re.compile(
    r"(?:\s++|/\*.*?\*/|#line[^\n]*+|#ifndef (\w+_H)\n#define \1\n|#endif[^\n]*+)*+", re.DOTALL
)
"""What is left of a file that holds nothing."""


class _Piece(NamedTuple):
    """A directive, or lines up to the next one.

    number : of its first line in the file.  word, operand : of a directive, else "".
    """

    number: int
    lines: list[str]
    word: str
    operand: str


@lru_cache(maxsize=512)
def _pieces(text: str) -> list[_Piece]:
    """A file in its pieces; every stage of every plan expands the same files."""
    pieces: list[_Piece] = []
    for number, line in enumerate(text.splitlines(), 1):
        match = _DIRECTIVE.match(line) if "#" in line else None
        if match:
            pieces.append(_Piece(number, [line], match[1], match[2]))
        elif pieces and not pieces[-1].word:
            pieces[-1].lines.append(line)
        else:
            pieces.append(_Piece(number, [line], "", ""))
    return pieces


@dataclass
class _Conditional:
    """An open `#if`.

    decided : its branches are chosen here, else by the compiler.  active : the present branch is kept.
    over : no later branch is.
    """

    decided: bool
    active: bool
    over: bool


@dataclass
class _Lines:
    """Lines of a file that are kept, with `#line` where some are missing before."""

    name: str
    kept: list[str] = field(default_factory=list)
    expected: int = 0

    def keep(self, number: int, lines: list[str]) -> None:
        if number != self.expected:
            self.kept.append(f'#line {number} "{self.name}"')
        self.kept += lines
        self.expected = number + len(lines)

    def insert(self, lines: list[str]) -> None:
        if lines:
            self.kept += lines
            self.expected = 0


class Preprocessor:
    """Expands text; a file that is included several times stands where it comes first.

    Parameters
    ----------
    read : gives a file's text by the name in its `#include`.
    macros : values of the macros by which `#if` and `#elif` are decided.
    slots : names of the files that `#include MACRO` stands for.
    """

    def __init__(
        self, read: Callable[[str], str], macros: Mapping[str, int], slots: Mapping[str, str]
    ) -> None:
        self.read, self.macros, self.slots = read, macros, slots
        self._seen: set[str] = set()

    def file(self, name: str) -> list[str]:
        """Lines of a file; none if it stands somewhere already, or holds nothing where these macros hold."""
        if name in self._seen:
            return []
        self._seen.add(name)
        lines = self.expand(self.read(name), name)
        return [] if _NOTHING.fullmatch("\n".join(lines) + "\n") else lines

    def expand(self, text: str, name: str) -> list[str]:
        """Lines of `text`, which messages call `name`."""
        lines = _Lines(name)
        conditionals: list[_Conditional] = []
        active = True
        for number, piece, word, operand in _pieces(text):
            if word == "include":
                if active:
                    lines.insert(self.file(self._target(operand)))
                continue
            kept: list[str] | None = piece
            if word:
                left = self._branch(word, operand, piece[0], conditionals)
                kept = None if left is None else [left]
                active = all(c.active for c in conditionals)
            if active and kept is not None:
                lines.keep(number, kept)
        return lines.kept

    def _target(self, operand: str) -> str:
        return operand.strip('"') if operand.startswith('"') else self.slots[operand]

    def _branch(self, word: str, operand: str, line: str, open_: list[_Conditional]) -> str | None:
        """Follow a conditional directive; returns what the compiler still has to see of it."""
        if word in ("if", "ifdef", "ifndef"):
            value = self._value(operand) if word == "if" and all(c.active for c in open_) else None
            open_.append(_Conditional(value is not None, value is not False, value is True))
            return line if value is None else None
        if word == "endif":
            return None if open_.pop().decided else line
        this = open_[-1]
        if not this.decided:
            return line
        value = True if word == "else" else self._value(operand)
        if this.over or value is not None:
            this.active = not this.over and value is True
            this.over |= this.active
            return None
        this.decided, this.active = False, True
        return f"#if {operand}"

    def _value(self, condition: str) -> bool | None:
        """Truth of a condition of integers and macros that are given; None where there are others."""
        if not self.macros.keys() >= set(_IDENTIFIER.findall(condition)):
            return None
        numbers = _IDENTIFIER.sub(lambda name: str(self.macros[name[0]]), condition)
        python = re.sub("!(?!=)", " not ", numbers.replace("&&", " and ").replace("||", " or "))
        return bool(eval(python, {"__builtins__": {}}))
