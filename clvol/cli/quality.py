"""--quality: names for how much noise is left, and how many samples that may take."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import click

if TYPE_CHECKING:
    _OptionType = click.ParamType[Any, Any]
else:
    _OptionType = click.ParamType  # generic from click 8.5 on


@dataclass(frozen=True)
class Extent:
    """What a name stands for: the mean relative error that ends a render, and the most samples per pixel."""

    error: float
    most: int


QUALITIES = {"draft": Extent(0.1, 8), "good": Extent(0.05, 128), "final": Extent(0.015, 2048)}
"""--quality: name and what it is."""
USUAL = "good"
"""Of volumes, which say nothing of samples."""
FEW = 16
"""Samples that a render to a target error gives every pixel anyway: up to so many are just drawn."""


class Quality(_OptionType):
    """A name of `QUALITIES`."""

    name = "quality"

    def get_metavar(self, param: click.Parameter, ctx: click.Context | None = None) -> str:
        """The names as they stand in --help."""
        return f"[{'|'.join(QUALITIES)}]"

    def convert(self, value: str, param: click.Parameter | None, ctx: click.Context | None) -> str:
        """The name, if it is one."""
        if value not in QUALITIES:
            self.fail(f"'{value}' is not one of {', '.join(QUALITIES)}", param, ctx)
        return value


def extent_of(options: dict[str, Any], is_volume: bool) -> dict[str, Any]:
    """How long to render, as `clvol.render` takes it; --quality is taken out of the options.

    click.UsageError for options that contradict each other.
    """
    quality = options.pop("quality")
    names = ("spp", "samples", "time_limit", "target_error")
    given = {name: options.pop(name) for name in names}
    if given["spp"] is not None and given["time_limit"] is not None and given["target_error"] is None:
        raise click.UsageError("give --spp or --time, not both")
    if quality is None:
        if not is_volume or any(value is not None for value in given.values()):
            return given
        quality = USUAL
    for name in ("samples", "target_error"):
        if given[name] is not None:
            raise click.UsageError(f"give --quality or --{name.replace('_', '-')}, not both")
    extent = QUALITIES[quality]
    if given["spp"] is None and given["time_limit"] is None:
        if extent.most <= FEW:
            return given | {"spp": extent.most}
        given["spp"] = extent.most
    return given | {"target_error": extent.error}


def write_qualities(formatter: click.HelpFormatter) -> None:
    """A section of --help on --quality."""
    rows = [
        (name, f"{100 * extent.error:g} % noise on the mean, or {extent.most} samples a pixel")
        for name, extent in QUALITIES.items()
    ]
    with formatter.section("--quality"):
        formatter.write_dl(rows)
