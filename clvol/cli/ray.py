"""`clvol ray`: what techniques do along one camera ray, as a picture."""

from __future__ import annotations

from contextlib import contextmanager
from typing import TYPE_CHECKING, Any

import click

from clvol.cli.messages import tell
from clvol.cli.options import (
    ExplainedCommand,
    RegistryNames,
    definitions_option,
    device_option,
    family_options,
    majorant_scale_option,
    outputs_option,
    quiet_option,
    skip_option,
    step_option,
)

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator

EXAMPLES = """
\b
Examples:
  clvol ray scenes/cloud.xml 64 64
  clvol ray scenes/smoke.xml 180 120 --techniques delta,spectral,regular -o ray.svg
  clvol ray scenes/cloud.xml 40 70 --techniques delta,decomposition --majorant kdtree -o ray.png -o ray.json
  clvol ray scenes/cloud.xml 64 64 --transmittances ratio,residual-ratio --control min -o transmittance.pdf
"""
WATCHED = ("technique", "transmittance")
CHANNELS = ("red", "green", "blue")
UNUSED = ("sampler", "lanes")
"""Families that decide nothing inside a medium: walks here have independent numbers of their own, and are
watched one by one."""


@click.command("ray", cls=ExplainedCommand, epilog=EXAMPLES)
@click.argument("scene", metavar="SCENE")
@click.argument("x", type=int, metavar="X")
@click.argument("y", type=int, metavar="Y")
@outputs_option(
    "Figure to write, .png, .svg or .pdf, or the numbers, .json; ray.png by default.",
    required=False,
)
@click.option(
    "--techniques",
    "--technique",
    type=RegistryNames("technique"),
    help="How collisions are sampled; three that differ by default.",
)
@click.option(
    "--transmittances",
    "--transmittance",
    type=RegistryNames("transmittance"),
    help="How transmittance is estimated; ratio,residual-ratio by default.",
)
@family_options(*WATCHED, *UNUSED)
@majorant_scale_option
@step_option
@click.option("--channel", type=click.Choice(CHANNELS), help="The most attenuated by default.")
@click.option("--walks", type=click.IntRange(1, 100), default=6, help="Walks shown one by one; 6 by default.")
@click.option("--seed", type=click.IntRange(min=0), help="Same seed, same walks; the scene's own by default.")
@device_option
@definitions_option
@skip_option
@quiet_option
def ray(
    scene: str,
    x: int,
    y: int,
    outputs: tuple[str, ...],
    channel: str | None,
    definitions: tuple[tuple[str, str], ...],
    quiet: bool,
    **options: Any,
) -> None:
    """Draw what techniques do along the camera ray through the centre of pixel X, Y of SCENE.

    Pixels count from 0, from the left and from the top.  The walks are those of a render, by the same device
    functions, in the first medium that the ray enters.
    """
    import clvol
    from clvol.base.output_files import check_spares
    from clvol.lab.ray.view import check_output

    outputs = outputs or ("ray.png",)
    for output in outputs:
        check_output(output)
    loaded = clvol.load_file(scene, **dict(definitions))
    for output in outputs:
        check_spares(output, loaded.files)
    number = None if channel is None else CHANNELS.index(channel)
    with _bar(quiet) as progress:
        view = clvol.trace_ray(loaded, x, y, channel=number, progress=progress, **options)
        for output in outputs:
            view.save(output)
    if not quiet:
        tell([", ".join(outputs), *view.summary()])


@contextmanager
def _bar(quiet: bool) -> Iterator[Callable[[int, int, str], None] | None]:
    """A progress bar on standard error, with the time left."""
    if quiet:
        yield None
        return
    from rich.progress import BarColumn, TextColumn, TimeRemainingColumn

    from clvol.base.progress import bar_of, error_console

    columns = TextColumn("{task.description}"), BarColumn(), TimeRemainingColumn()
    with bar_of(error_console(), *columns) as bar:
        task = bar.add_task("loading", total=None)
        yield lambda done, total, what: bar.update(task, completed=done, total=total, description=what)
