"""What clvol's commands share: option types that read the registry, and options of several commands."""

from __future__ import annotations

import math
import re
from typing import TYPE_CHECKING, Any, TypeVar

import click

from clvol.errors import OptionError

if TYPE_CHECKING:
    from collections.abc import Callable

    _OptionType = click.ParamType[Any, Any]
else:
    _OptionType = click.ParamType  # generic from click 8.5 on

F = TypeVar("F", bound="Callable[..., Any] | click.Command")
"""What an option is added to, and what comes of it."""


class RegistryChoice(_OptionType):
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

    def convert(self, value: str, param: click.Parameter | None, ctx: click.Context | None) -> Any:
        """The value itself if it is known; OptionError with the known ones if not."""
        from clvol.planning.registry import check_choice

        return check_choice(self.name, value, self.pilot)


class RegistryNames(RegistryChoice):
    """Several names of one family, with commas between them."""

    def get_metavar(self, param: click.Parameter, ctx: click.Context | None = None) -> str:
        """The list as it stands in --help."""
        return "NAME,…"

    def convert(
        self, value: str | tuple[str, ...], param: click.Parameter | None, ctx: click.Context | None
    ) -> tuple[str, ...]:
        """The names; OptionError where there is none, or one is unknown."""
        from clvol.lab.names import split_names

        return split_names(self.name, value)


class Definition(_OptionType):
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


class Assignment(_OptionType):
    """A `NAME=value` pair that sets a parameter of a scene."""

    name = "name=value"

    def convert(
        self, value: str | tuple[str, str], param: click.Parameter | None, ctx: click.Context | None
    ) -> tuple[str, str]:
        """Split at the first "="; `clvol.scene.assignments` says what may stand there."""
        if isinstance(value, tuple):
            return value
        name, equals, text = value.partition("=")
        if not (equals and name.strip()):
            raise OptionError(
                f"--set takes NAME=VALUE, not '{value}'", hint="for example --set sensor.x_fov=30"
            )
        return name.strip(), text


class SampleRange(_OptionType):
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


class Size(_OptionType):
    """Width and height in pixels, as "640x480"."""

    name = "WxH"

    def convert(
        self, value: str | tuple[int, int], param: click.Parameter | None, ctx: click.Context | None
    ) -> tuple[int, int]:
        """The two numbers; `clvol.scene.views.in_size` says what they may be."""
        if isinstance(value, tuple):
            return value
        found = re.fullmatch(r"(\d{1,9})[x×](\d{1,9})", value.strip().lower())
        if not found:
            self.fail(f"takes width and height as 640x480, not '{value}'", param, ctx)
        return int(found[1]), int(found[2])


def finite(ctx: click.Context, param: click.Parameter, value: float | None) -> float | None:
    """Callback of a number option: refuse nan and infinity."""
    if value is not None and not math.isfinite(value):
        raise click.BadParameter("must be a finite number", ctx=ctx, param=param)
    return value


def outputs_option(help_text: str, required: bool = True) -> Callable[[F], F]:
    """-o FILE, any number of times, at least once where `required`."""
    return click.option(
        "-o", "--output", "outputs", metavar="FILE", multiple=True, required=required, help=help_text
    )


def positive_option(*names: str, **settings: Any) -> Callable[[F], F]:
    """An option that takes a finite number above 0."""
    above_zero = click.FloatRange(min=0, min_open=True)
    return click.option(*names, type=above_zero, callback=finite, **settings)


def named_once(
    ctx: click.Context, param: click.Parameter, value: tuple[tuple[str, str], ...]
) -> tuple[tuple[str, str], ...]:
    """Callback of an option that gives names values: refuse one that is given two."""
    seen: set[str] = set()
    for name, _ in value:
        if name in seen:
            raise click.BadParameter(f"{name} is given twice", ctx=ctx, param=param)
        seen.add(name)
    return value


definitions_option = click.option(
    "-D",
    "definitions",
    callback=named_once,
    type=Definition(),
    multiple=True,
    metavar="NAME=VALUE",
    help="Fill $NAME in the scene.",
)


def _skipping(ctx: click.Context, param: click.Parameter, value: bool) -> None:
    """Scenes are loaded without what is not supported as long as the command runs."""
    if value:
        from clvol.scene.faults import skip_unsupported

        ctx.with_resource(skip_unsupported())


skip_option = click.option(
    "--skip-unsupported",
    is_flag=True,
    expose_value=False,
    callback=_skipping,
    help="Leave out what is not supported in the scene, and say so.",
)
assignments_option = click.option(
    "--set",
    "assignments",
    callback=named_once,
    type=Assignment(),
    multiple=True,
    metavar="NAME=VALUE",
    help="Set a parameter of the scene, as clvol.traverse names it; may be given several times.",
)


def _listed(ctx: click.Context, param: click.Parameter, value: str | None) -> str | list[str] | None:
    """Several devices, with commas between them, as a list."""
    if value is None or "," not in value:
        return value
    return [part.strip() for part in value.split(",") if part.strip()]


devices_option = click.option(
    "--device",
    metavar="PATTERN",
    callback=_listed,
    help="Part of the device's name, several with commas between them, or all; see clvol devices.",
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


def family_options(*left_out: str, pilot: bool = False) -> Callable[[F], F]:
    """An option for every family of the registry but those left out: a name of it, "auto" by default.

    `pilot`: a technique may be "auto:pilot" too.
    """
    from clvol.planning.registry import FAMILIES, FAMILY_PURPOSE, option

    def add(command: F) -> F:
        for family in reversed([family for family in FAMILIES if family not in left_out]):
            kind, text = RegistryChoice(family, pilot), FAMILY_PURPOSE[family]
            command = click.option(option(family), type=kind, default="auto", help=text)(command)
        return command

    return add


class ExplainedCommand(click.Command):
    """A command whose --help ends with what the choices of each `RegistryChoice` mean, then its epilog."""

    def format_epilog(self, ctx: click.Context, formatter: click.HelpFormatter) -> None:
        """Write a section for each option that takes a name of the registry."""
        from clvol.planning.registry import INSTEAD

        for parameter in self.params:
            if isinstance(parameter.type, RegistryChoice):
                entries = parameter.type.entries()
                instead = INSTEAD.get(parameter.type.name, {}) if parameter.type.pilot else {}
                with formatter.section(parameter.opts[0]):
                    formatter.write_dl(
                        [*instead.items(), *((name, entry.summary) for name, entry in entries.items())]
                    )
        super().format_epilog(ctx, formatter)
