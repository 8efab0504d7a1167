"""Files that the tools write: refused at once where they cannot be written, replaced whole or not at all."""

from __future__ import annotations

import os
import secrets
import tempfile
from pathlib import Path

import click


def writable(
    context: click.Context | None, parameter: click.Parameter | None, path: Path | None
) -> Path | None:
    """A click callback: click.BadParameter now for what `write` could not write after a long measurement."""
    if path is None:
        return None
    target = Path(os.path.realpath(path))
    if target.is_dir():
        raise click.BadParameter(f"{path} is a folder")
    try:  # the only sure way to know
        with tempfile.TemporaryFile(dir=target.parent):
            pass
    except OSError as error:
        raise click.BadParameter(f"cannot write to {target.parent}: {error.strerror}") from None
    return path


def write(path: Path, text: str) -> None:
    """Replace a file by `text` in UTF-8, or leave it as it was."""
    target = Path(os.path.realpath(path))
    made = target.with_name(f".{target.name}.{secrets.token_hex(4)}")
    try:
        made.write_text(text, encoding="utf-8")
        made.replace(target)
    finally:
        made.unlink(missing_ok=True)


def between(text: str, first: str, last: str, where: str) -> tuple[str, str]:
    """What stands before and after a part of `text`, with the markers that enclose the part.

    Raises click.ClickException where the markers do not stand there once each, in this order.
    """
    before, found, rest = text.partition(first)
    _, ended, after = rest.partition(last)
    if not (found and ended) or text.count(first) != 1 or text.count(last) != 1:
        raise click.ClickException(f"{where} must have once '{first}' and, after it, '{last}'")
    return before + first, last + after
