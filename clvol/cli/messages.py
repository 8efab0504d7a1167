"""What commands tell: results, one-line errors, and clvol's log beside a progress bar."""

from __future__ import annotations

import io
import logging
import os
import sys
from contextlib import contextmanager, suppress
from copy import copy
from typing import TYPE_CHECKING, Any, NoReturn

import click

from clvol.base.interrupts import ENDING, interruptible
from clvol.errors import Error, Told, printable, shortened, spelled_out

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator, Sequence

    from rich.console import Console

USER_ERROR = 2
LONGEST_LINE = 3000
"""Characters of an error's line at most, whatever was on the command line."""
_PLAIN = {
    "integer range": "whole number",
    "integer": "whole number",
    "float range": "number",
    "float": "number",
}
"""What click's types are in words; the longer names first."""


class OneLineErrors(click.Group):
    """A command group whose users' mistakes end in one line on standard error and status 2, no traceback."""

    def resolve_command(
        self, ctx: click.Context, args: list[str]
    ) -> tuple[str | None, click.Command | None, list[str]]:
        """As `click.Group` does, and refuse options that are given twice and take one value."""
        name, command, rest = super().resolve_command(ctx, args)
        if command is not None and not ctx.resilient_parsing:
            check_once(command, click.Context(command, info_name=name, parent=ctx), rest)
        return name, command, rest

    def main(
        self,
        args: Sequence[str] | None = None,
        prog_name: str | None = None,
        complete_var: str | None = None,
        standalone_mode: bool = True,
        **extra: Any,
    ) -> Any:
        """Run the command as `click.Group.main` does, and exit; without `standalone_mode`, return."""
        if not standalone_mode:
            return super().main(args, prog_name, complete_var, standalone_mode=False, **extra)
        if isinstance(sys.stdout, io.TextIOWrapper):  # whatever the encoding, a summary is no reason to fail
            sys.stdout.reconfigure(errors="backslashreplace")
        with interruptible(ENDING) as interrupt:
            try:
                status = super().main(args, prog_name, complete_var, standalone_mode=False, **extra)
            except click.UsageError as error:
                fail(_usage_message(error))
            except click.ClickException as error:
                fail(error.format_message())
            except Error as error:
                fail(error.told(command=True), error.whole)
            except OSError as error:
                fail(f"{error.filename}: {error.strerror}" if error.filename else str(error))
            except MemoryError as error:
                fail(f"out of memory: {error}" if str(error) else "out of memory")
            except click.Abort:
                mention(["clvol: interrupted"], err=True)
                sys.exit(interrupt.status)
            sys.exit(status if isinstance(status, int) else 0)


def check_once(command: click.Command, ctx: click.Context, arguments: Sequence[str]) -> None:
    """click.UsageError for an option that is given twice, of which one would be left out without a word."""
    _, _, order = command.make_parser(ctx).parse_args(args=list(arguments))
    seen: set[str] = set()
    for one in order:
        if not isinstance(one, click.Option) or one.multiple or one.is_flag or one.count:
            continue
        if one.name in seen:
            raise click.UsageError(f"{max(one.opts, key=len)} is given twice", ctx)
        seen.add(str(one.name))


def fail(message: str, whole: bool = False) -> NoReturn:
    """Print one line on standard error, or the `whole` text (a build log, a list), and exit with status 2."""
    line = message if whole else printable(shortened(" ".join(message.split()), LONGEST_LINE))
    mention([f"clvol: error: {line}"], err=True)
    sys.exit(USER_ERROR)


def tell(lines: Iterable[str], err: bool = False) -> None:
    """Print lines on standard output (or error), whatever names are in them."""
    single = (line.expandtabs() for text in lines for line in text.split("\n"))
    click.echo("\n".join(map(printable, single)), err=err)


def mention(lines: Iterable[str], err: bool = False) -> None:
    """As `tell`, where it is no failure if nobody can read it: the terminal was closed, a pipe broke."""
    try:
        tell(lines, err)
    except OSError:
        with suppress(OSError, ValueError):  # or the interpreter fails on it when it exits
            os.dup2(os.open(os.devnull, os.O_WRONLY), (sys.stderr if err else sys.stdout).fileno())


def exit_by(ended_early: bool) -> NoReturn:
    """Exit as the signal says that ended the work, or came while it was saved; with 0 if there was none."""
    with interruptible() as interrupt:
        sys.exit(interrupt.status if ended_early or interrupt.asked() else 0)


def _usage_message(error: click.UsageError) -> str:
    message = error.format_message().rstrip(".")
    for of_click, plain in _PLAIN.items():
        message = message.replace(f"' is not a valid {of_click}", f"' is not a {plain}")
    command = error.ctx.command_path if error.ctx else "clvol"
    return f"{message[:1].lower()}{message[1:]}; see {command} --help"


def _as_typed(part: object) -> object:
    """A part of a message in the words of the command line, where it has such."""
    return spelled_out(part, command=True) if isinstance(part, Told) else part


@contextmanager
def logging_to(console: Console, verbose: bool) -> Iterator[None]:
    """Print clvol's log on the console, beside a progress bar too: warnings, and the plan with `verbose`."""

    class ConsoleHandler(logging.Handler):
        def emit(self, record: logging.LogRecord) -> None:
            prefix = f"clvol: {record.levelname.lower()}: " if record.levelno >= logging.WARNING else ""
            arguments = tuple(map(_as_typed, record.args)) if isinstance(record.args, tuple) else record.args
            said = copy(record)
            said.msg, said.args = _as_typed(record.msg), arguments
            line = printable(prefix + self.format(said))
            console.print(line, markup=False, highlight=False, emoji=False, soft_wrap=True)

    logger, handler = logging.getLogger("clvol"), ConsoleHandler()
    earlier = logger.level
    logger.addHandler(handler)
    logger.setLevel(logging.INFO if verbose else logging.WARNING)
    try:
        yield
    finally:
        logger.removeHandler(handler)
        logger.setLevel(earlier)
