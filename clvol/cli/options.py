"""What clvol's commands share: one-line errors, and option types that read the registry."""

from __future__ import annotations

import io
import math
import os
import sys
from contextlib import suppress
from typing import TYPE_CHECKING, Any, NoReturn

import click

from clvol.base.interrupts import ENDING, interruptible
from clvol.errors import DeviceError, Error, OptionError, printable, shortened

if TYPE_CHECKING:
    from collections.abc import Iterable, Sequence

USER_ERROR = 2
LONGEST_LINE = 3000
"""Characters of an error's line at most, whatever was on the command line."""
PILOT_HELP = [("auto:pilot", "measures, then picks the technique, transmittance and majorant left at auto")]


class OneLineErrors(click.Group):
    """A command group whose users' mistakes end in one line on standard error and status 2, no traceback."""

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
            except DeviceError as error:
                fail(str(error), whole=True)
            except Error as error:
                fail(str(error))
            except OSError as error:
                fail(f"{error.filename}: {error.strerror}" if error.filename else str(error))
            except MemoryError as error:
                fail(f"out of memory: {error}" if str(error) else "out of memory")
            except click.Abort:
                mention(["clvol: interrupted"], err=True)
                sys.exit(interrupt.status)
            sys.exit(status if isinstance(status, int) else 0)


def fail(message: str, whole: bool = False) -> NoReturn:
    """Print one line on standard error, or the `whole` text (a build log), and exit with status 2."""
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
    command = error.ctx.command_path if error.ctx else "clvol"
    return f"{message[:1].lower()}{message[1:]}; see {command} --help"


class RegistryChoice(click.ParamType):
    """A name of one family of `clvol.planning.registry`, or "auto"; the registry is read when it is needed.

    `pilot`: a technique may be "auto:pilot" too.
    """

    def __init__(self, family: str, pilot: bool = False) -> None:
        self.name, self.pilot = family, pilot

    def entries(self) -> dict[str, Any]:
        """The family's table: name to an object with a one-line `summary`."""
        from clvol.planning.registry import FAMILIES

        return FAMILIES[self.name]

    def get_metavar(self, param: click.Parameter, ctx: click.Context | None = None) -> str:
        """The choices as they stand in --help."""
        from clvol.planning.registry import automatic

        return f"[{'|'.join([*(automatic(self.name) if self.pilot else ['auto']), *self.entries()])}]"

    def convert(self, value: str, param: click.Parameter | None, ctx: click.Context | None) -> str:
        """The value itself if it is known; OptionError with the known ones if not."""
        from clvol.planning.registry import check_choice

        return check_choice(self.name, value, self.pilot)


class Definition(click.ParamType):
    """A `name=value` pair that fills a scene's <default>."""

    name = "name=value"

    def convert(
        self, value: str, param: click.Parameter | None, ctx: click.Context | None
    ) -> tuple[str, str]:
        """Split at the first "="; OptionError where there is none or nothing stands before it."""
        name, equals, text = value.partition("=")
        if not (equals and name.isidentifier()):
            raise OptionError(f"-D takes name=value, not '{value}'", hint="for example -D res=256")
        return name, text


class SampleRange(click.ParamType):
    """First sample and how many, as "4,12"."""

    name = "first,count"

    def convert(
        self, value: str | tuple[int, int], param: click.Parameter | None, ctx: click.Context | None
    ) -> tuple[int, int]:
        """The two numbers; `clvol.render` says what they may be."""
        if isinstance(value, tuple):
            return value
        try:
            first, count = map(int, value.split(","))
        except ValueError:
            self.fail(f"takes two numbers as 4,12, not '{value}'", param, ctx)
        return first, count


def finite(ctx: click.Context, param: click.Parameter, value: float | None) -> float | None:
    """Callback of a number option: refuse nan and infinity."""
    if value is not None and not math.isfinite(value):
        raise click.BadParameter("must be a finite number", ctx=ctx, param=param)
    return value


def positive_option(*names: str, **settings: Any) -> Any:
    """An option that takes a finite number above 0."""
    above_zero = click.FloatRange(min=0, min_open=True)
    return click.option(*names, type=above_zero, callback=finite, **settings)


definitions_option = click.option(
    "-D",
    "definitions",
    type=Definition(),
    multiple=True,
    metavar="NAME=VALUE",
    help="Fill $NAME in the scene.",
)
device_option = click.option(
    "--device", metavar="PATTERN", help="Part of the device's name; see clvol devices."
)
quiet_option = click.option("--quiet", is_flag=True, help="No progress bar and no summary.")
majorant_scale_option = positive_option(
    "--majorant-scale",
    default=1.0,
    metavar="FACTOR",
    help="Multiply every bound of the density, for experiments.",
)
step_option = positive_option(
    "--step", metavar="LENGTH", help="Step of ray marching; the edge of a voxel by default."
)


def choice_options(command: Any) -> Any:
    """An option for every family of the registry that takes a name of it; "auto" by default."""
    from clvol.planning.registry import FAMILIES, FAMILY_PURPOSE

    for family in reversed(FAMILIES):
        text = FAMILY_PURPOSE[family]
        option = click.option(f"--{family}", type=RegistryChoice(family, True), default="auto", help=text)
        command = option(command)
    return command


class ExplainedCommand(click.Command):
    """A command whose --help ends with what the choices of each `RegistryChoice` mean, then its epilog."""

    def format_epilog(self, ctx: click.Context, formatter: click.HelpFormatter) -> None:
        """Write a section for each option that takes a name of the registry."""
        for parameter in self.params:
            if isinstance(parameter.type, RegistryChoice):
                entries = parameter.type.entries()
                automatic = PILOT_HELP if parameter.type.pilot and parameter.type.name == "technique" else []
                with formatter.section(parameter.opts[0]):
                    formatter.write_dl(
                        [*automatic, *((name, entry.summary) for name, entry in entries.items())]
                    )
        super().format_epilog(ctx, formatter)


class RenderCommand(ExplainedCommand):
    """As `ExplainedCommand`, and what the pictures that --aov adds show."""

    def format_epilog(self, ctx: click.Context, formatter: click.HelpFormatter) -> None:
        """Write a section of the pictures before the rest."""
        from clvol.planning.registry import AOVS

        with formatter.section("--aov"):
            formatter.write_dl(list(AOVS.items()))
        super().format_epilog(ctx, formatter)
