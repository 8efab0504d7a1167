"""Options of the commands that take a volume for a scene."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import click

from clvol.cli.options import RegistryChoice
from clvol.errors import OptionError

if TYPE_CHECKING:
    from collections.abc import Sequence

    from clvol.cli.options import F
    from clvol.scene.records import Scene
    from clvol.staging.fixed import Fixed
    from clvol.staging.source import Source

    _OptionType = click.ParamType[Any, Any]
else:
    _OptionType = click.ParamType  # generic from click 8.5 on


def spelled(option: str) -> str:
    """An option as the command line has it."""
    return f"--{option.replace('_', '-')}"


class VolumeValue(_OptionType):
    """What an option of `clvol.staging.options` takes; read when it is needed."""

    def __init__(self, option: str) -> None:
        self.name = option

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> Any:
        """The value, checked; OptionError where it won't do."""
        from clvol.staging.options import OPTIONS

        return OPTIONS[self.name].check(spelled(self.name), value)


class Background(RegistryChoice):
    """How light from behind a medium is weighed; or a colour to be behind all, or "transparent"."""

    def __init__(self) -> None:
        super().__init__("background", pilot=True)

    def get_metavar(self, param: click.Parameter, ctx: click.Context | None = None) -> str:
        """Both, as they stand in --help."""
        return f"{super().get_metavar(param, ctx)}|COLOUR"

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> Any:
        """A name of the registry as it is; else what `clvol.staging.options.background` makes of it."""
        from clvol.staging.options import background

        if value == "auto" or value in self.entries():
            return value
        try:
            return background("--background", value)
        except OptionError as error:
            hint = f"{error.hint}; how light is weighed is {', '.join(['auto', *self.entries()])}"
            raise OptionError(error.what, hint=hint) from None


def volume_options(command: F) -> F:
    """An option for everything that may be said of how a volume is shown, but for its background."""
    from clvol.staging.options import OPTIONS

    for name, option in reversed(OPTIONS.items()):
        if name == "background":
            continue
        spelling = spelled(name)
        if option.is_flag:
            command = click.option(spelling, name, is_flag=True, default=None, help=option.help)(command)
            continue
        kind = VolumeValue(name)
        command = click.option(
            spelling, *option.also, name, type=kind, metavar=option.metavar, help=option.help
        )(command)
    return command


@dataclass(frozen=True)
class Asked:
    """What the command line names to be rendered, and what it says of how that is shown.

    given : options of `clvol.staging.options` that were given.  definitions : what -D fills into a scene.
    assignments : what --set sets in it.
    """

    name: str
    is_volume: bool
    given: dict[str, Any]
    definitions: dict[str, str]
    assignments: tuple[tuple[str, str], ...] = ()

    @classmethod
    def taken(cls, name: str, options: dict[str, Any], definitions: Sequence[tuple[str, str]]) -> Asked:
        """The options of `volume_options`, taken out of those of a command.

        click.UsageError where options are for a volume, and this is a scene, or the reverse.
        """
        from clvol.planning.registry import FAMILIES
        from clvol.staging.options import OPTIONS
        from clvol.volumes.read import is_volume

        volume = is_volume(name)
        given = {option: options.pop(option) for option in OPTIONS if option != "background"}
        given = {option: value for option, value in given.items() if value is not None}
        if options["background"] not in ("auto", *FAMILIES["background"]):
            given["background"] = options["background"]
            options["background"] = "auto"
        if volume and definitions:
            raise click.UsageError("-D fills a scene's $NAMES, and this is a volume")
        if volume and options["sensor"]:
            raise click.UsageError("--sensor chooses from a scene's sensors, and this is a volume")
        for option in () if volume else given:
            if option != "background":
                raise click.UsageError(f"{spelled(option)} is for volumes, and this is a scene")
        return cls(name, volume, given, dict(definitions), options.pop("assignments"))

    def open(
        self,
        size: tuple[int, int] | None,
        source: Source | None = None,
        fixed: Fixed | None = None,
        turn: float | None = None,
    ) -> tuple[Scene, Sequence[str]]:
        """The scene, and what was chosen for it, in a line each.

        source, fixed, turn : of a frame of a sequence, as `clvol.staging.stage.stage` takes them.
        """
        from clvol.staging.source import Source
        from clvol.staging.stage import stage

        if self.is_volume:
            staged = stage(source or Source.of(self.name), self.given, size_of(size), fixed=fixed, turn=turn)
            return self._set(staged.load()), staged.lines
        import clvol
        from clvol.scene.views import before

        scene = self._set(clvol.load_file(self.name, **self.definitions))
        return (before(scene, self.given["background"]) if self.given else scene), ()

    def _set(self, scene: Scene) -> Scene:
        """The scene with its parameters as --set says."""
        if self.assignments:
            from clvol.scene.assignments import assign

            assign(scene, self.assignments)
        return scene


def size_of(size: tuple[int, int] | None) -> tuple[int, int]:
    """The size of the picture of a volume; OptionError for one that cannot be."""
    from clvol.scene.views import check_size
    from clvol.staging.stage import SIZE

    return SIZE if size is None else check_size(size)


class LookCommand(click.Command):
    """A command whose --help says what each look is."""

    def format_epilog(self, ctx: click.Context, formatter: click.HelpFormatter) -> None:
        """Write a section of them before the rest."""
        write_looks(formatter)
        super().format_epilog(ctx, formatter)


def write_looks(formatter: click.HelpFormatter) -> None:
    """A section of --help on --light."""
    from clvol.staging.looks import LOOKS

    with formatter.section("--light"):
        formatter.write_dl([(name, look.summary) for name, look in LOOKS.items()])
