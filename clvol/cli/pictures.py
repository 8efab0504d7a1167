"""Options of the commands that write pictures: how these are shown, and what their files hold."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator, Sequence

    from clvol.cli.options import F
    from clvol.picture.result import Result

    _OptionType = click.ParamType[Any, Any]
else:
    _OptionType = click.ParamType  # generic from click 8.5 on


class Stops(_OptionType):
    """A number of stops, or "auto"."""

    name = "stops"

    def convert(
        self, value: str | float, param: click.Parameter | None, ctx: click.Context | None
    ) -> float | str:
        """The number, finite, or "auto"."""
        if value == "auto":
            return "auto"
        try:
            stops = float(value)
        except ValueError:
            self.fail(f"takes a number of stops or auto, not '{value}'", param, ctx)
        if not math.isfinite(stops):
            self.fail("must be a finite number", param, ctx)
        return stops


_OPTIONS = (
    click.option(
        "--denoise",
        is_flag=True,
        help="Show the picture without its noise; an .exr has it as a layer beside the unbiased one.",
    ),
    click.option(
        "--exposure",
        type=Stops(),
        default=0.0,
        metavar="STOPS|auto",
        help="Brighten what a display shows by so many stops, or as a photographer would.",
    ),
    click.option("--display", metavar="NAME", help="What the picture is shown on; see below."),
    click.option("--view-transform", metavar="NAME", help="How radiance becomes its colours; see below."),
    click.option(
        "--component-format",
        metavar="TYPE",
        help="Numbers in the files that can hold such: uint8, uint16, float16 or float32.",
    ),
)


def picture_options(command: F) -> F:
    """Options that say how pictures are shown and written.

    `Shown.taken` takes all but --denoise, which is an option of `clvol.render`.
    """
    for option in reversed(_OPTIONS):
        command = option(command)
    return command


@dataclass(frozen=True)
class Shown:
    """What the options say.

    Parameters
    ----------
    exposure, display, view_transform, component_format : as `clvol.picture.result.Result.save` takes them.
    """

    exposure: float | str
    display: str | None
    view_transform: str | None
    component_format: str | None

    @classmethod
    def taken(cls, options: dict[str, Any]) -> Shown:
        """The options of `picture_options`, taken out of those of a command."""
        return cls(*(options.pop(name) for name in cls.__dataclass_fields__))

    def check(self, outputs: Sequence[str]) -> None:
        """Refuse what could not be written after a long render, and what nothing would be written of."""
        from clvol.picture.formats import check_component, component_of, is_linear
        from clvol.picture.saving import check_picture
        from clvol.picture.view_transform import View

        suffixes = [Path(output).suffix.lower() for output in outputs]
        view, component = View(self.exposure, self.display, self.view_transform), self.component_format
        for output in outputs:
            check_picture(output, view)
        if component is not None and all(component_of(suffix, component) != component for suffix in suffixes):
            check_component(suffixes[0], component)
        if (
            outputs
            and view != View()
            and all(is_linear(component_of(suffix, component)) for suffix in suffixes)
        ):
            names = {"--exposure": self.exposure, "--display": self.display}
            given = next((name for name, value in names.items() if value), "--view-transform")
            raise click.UsageError(
                f"{given} needs a picture for a display to write to, as a .png: "
                f"{outputs[0]} is as bright as the scene"
            )

    def said(self, result: Result) -> Iterator[str]:
        """What was chosen for a picture, in a line each."""
        if self.exposure != self.fixed(result).exposure:
            yield f"  exposure {self.fixed(result).exposure:+.2f} stops"

    def fixed(self, result: Result) -> Shown:
        """With the stops that "auto" comes to for a picture, for those that are to look like it."""
        from clvol.picture.encoding import shown_layers
        from clvol.picture.exposure import stops_of

        return replace(self, exposure=stops_of(self.exposure, shown_layers(result)[0]))

    def encoder(self, result: Result) -> Callable[[str], bytes]:
        """What makes files of a result, by suffix."""
        return lambda suffix: result.encode(
            suffix,
            self.exposure,
            display=self.display,
            view_transform=self.view_transform,
            component_format=self.component_format,
        )


def write_views(formatter: click.HelpFormatter) -> None:
    """A section of --help on displays and views."""
    with formatter.section("--display, --view-transform"):
        formatter.write_text(
            "Names, or parts of them, of the ACES configuration, or of the one that the environment variable "
            "OCIO names. ACES has the displays sRGB (the default), 'Display P3', 'Rec.1886' and others, with "
            "the views 'ACES 2.0' (the default, which keeps hues), 'Un-tone-mapped' (radiance up to 1 as it "
            "is) and 'Raw'. The error of a name that there is not lists all."
        )
