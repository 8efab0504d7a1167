"""The `clvol` command, with render, info and devices; other commands have files of their own.

Heavy modules are imported where they are used.
"""

from __future__ import annotations

import logging
import os
from contextlib import contextmanager, nullcontext
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from clvol.cli.compare import compare
from clvol.cli.options import (
    OneLineErrors,
    RenderCommand,
    SampleRange,
    choice_options,
    definitions_option,
    device_option,
    exit_by,
    finite,
    majorant_scale_option,
    mention,
    positive_option,
    quiet_option,
    step_option,
    tell,
)
from clvol.cli.ray import ray
from clvol.cli.selftest import selftest
from clvol.errors import printable

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

    from rich.console import Console

    from clvol.picture.result import Result

RENDER_EXAMPLES = """
\b
Examples:
  clvol render scenes/fire.xml -o fire.exr
  clvol render scenes/cloud.xml -o cloud.exr -o cloud.png --spp 256
  clvol render scenes/cloud.xml -o cloud.exr --time 20 -v
  clvol render scenes/cloud.xml -o cloud.exr -D res=512 --majorant global
  clvol render scenes/cloud.xml -o cloud.exr --technique decomposition --transmittance residual-ratio
  clvol render scenes/smoke.xml -o smoke.exr --technique auto:pilot
  clvol render scenes/cloud.xml -o cloud.exr --target-error 0.01
  clvol render scenes/fire.xml -o fire.exr --technique weighted-delta --majorant-scale 0.8
  clvol render scenes/smoke.xml -o smoke.exr --aov cells --aov largest_weight
"""

GROUP_EXAMPLES = """
\b
Examples:
  clvol render scenes/fire.xml -o fire.exr
  clvol compare scenes/smoke.xml --techniques delta,spectral -o report/
  clvol selftest scenes/smoke.xml --quick
  clvol ray scenes/smoke.xml 100 60
  clvol info scenes/fire.vdb
  clvol devices
"""


@click.group(
    "clvol",
    cls=OneLineErrors,
    invoke_without_command=True,
    epilog=GROUP_EXAMPLES,
    context_settings={"help_option_names": ["-h", "--help"]},
)
@click.version_option(package_name="clvol", message="clvol %(version)s")
@click.pass_context
def main(ctx: click.Context) -> None:
    """Render participating media with OpenCL."""
    if ctx.invoked_subcommand is None:
        click.echo(ctx.get_help())


@main.command(cls=RenderCommand, epilog=RENDER_EXAMPLES)
@click.argument("scene", metavar="SCENE")
@click.option(
    "-o",
    "--output",
    "outputs",
    metavar="FILE",
    multiple=True,
    required=True,
    help="Picture to write, .exr or .png; may be given several times.",
)
@choice_options
@majorant_scale_option
@step_option
@click.option(
    "--aov",
    multiple=True,
    metavar="NAME",
    help="Add a picture to the .exr, of those below; may be given several times.",
)
@click.option("--spp", type=click.IntRange(min=1), help="Samples per pixel; the scene's own by default.")
@click.option(
    "--samples",
    type=SampleRange(),
    metavar="FIRST,COUNT",
    help="Only COUNT samples of each pixel, from number FIRST on, instead of the first --spp.",
)
@positive_option(
    "--time",
    "time_limit",
    metavar="SECONDS",
    help="Render for so long instead.",
)
@positive_option(
    "--target-error",
    metavar="NOISE",
    help="Render until the mean relative standard error is below NOISE, as 0.01, with samples where "
    "noise is; --spp or --time then say how long at most.",
)
@click.option("--seed", type=click.IntRange(min=0), help="Same seed, same bits; the scene's own by default.")
@device_option
@definitions_option
@click.option(
    "--exposure",
    type=float,
    default=0.0,
    callback=finite,
    metavar="STOPS",
    help="Brighten a .png by so many stops.",
)
@click.option("-v", "--verbose", is_flag=True, help="Print features, built units, memory and time by stage.")
@quiet_option
def render(
    scene: str,
    outputs: tuple[str, ...],
    spp: int | None,
    time_limit: float | None,
    definitions: tuple[tuple[str, str], ...],
    exposure: float,
    verbose: bool,
    quiet: bool,
    **options: Any,
) -> None:
    """Render SCENE, a Mitsuba 3 XML file, into one or more pictures.

    Ctrl-C ends the render early and keeps the picture so far; so do SIGTERM and SIGHUP.
    """
    from clvol.base.progress import RichProgress, error_console
    from clvol.picture.saving import check_disk, check_picture, save_all

    if spp is not None and time_limit is not None:
        raise click.UsageError("give --spp or --time, not both")
    for output in outputs:
        check_picture(output, exposure)
    if options["aov"] and not any(output.lower().endswith(".exr") for output in outputs):
        raise click.UsageError("--aov needs an .exr to write to")
    if exposure and not any(output.lower().endswith(".png") for output in outputs):
        raise click.UsageError("--exposure needs a .png to write to: an .exr is as bright as the scene")
    _check_distinct(scene, outputs)
    console = error_console()
    with _logging_to(console, verbose):
        import clvol

        loaded = clvol.load_file(scene, **dict(definitions))
        pixels = loaded.film.window[2] * loaded.film.window[3]
        for output in outputs:
            check_disk(output, pixels, len(options["aov"]))
        piloted = options["technique"] == "auto:pilot"
        if piloted and not quiet and not console.is_terminal:
            from clvol.lab.repeat import announcement

            mention([announcement(loaded, options)], err=True)
        with nullcontext(False) if quiet else RichProgress(console) as progress:
            result = clvol.render(loaded, spp=spp, time_limit=time_limit, progress=progress, **options)
        if piloted:
            from clvol.lab.repeat import with_definitions

            result.metadata["repeat"] = with_definitions(result.metadata["repeat"], dict(definitions))
        failures = save_all(lambda suffix: result.encode(suffix, exposure), outputs)
    written = [output for output in outputs if output not in failures]
    if result.stats["interrupted"]:
        saved = ", saved what there is" if written else ""
        mention([f"clvol: interrupted after {result.samples[1]} spp{saved}"], err=True)
    if not quiet:
        mention(_summary(result, written))
    for failure in failures.values():
        raise failure
    exit_by(result.stats["interrupted"])


def _check_distinct(scene: str, outputs: Sequence[str]) -> None:
    """Refuse pictures that would replace each other or the scene, whatever the links to them."""
    names = {os.path.realpath(scene): "the scene"}
    for output in outputs:
        place = os.path.realpath(output)
        if place in names:
            raise click.UsageError(f"{output}: would replace {names[place]}")
        names[place] = "another picture"


@contextmanager
def _logging_to(console: Console, verbose: bool) -> Iterator[None]:
    """Print clvol's log on the console, beside a progress bar too: warnings, and the plan with `verbose`."""

    class ConsoleHandler(logging.Handler):
        def emit(self, record: logging.LogRecord) -> None:
            prefix = f"clvol: {record.levelname.lower()}: " if record.levelno >= logging.WARNING else ""
            line = printable(prefix + self.format(record))
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


def _summary(result: Result, written: Sequence[str]) -> Iterator[str]:
    """What was written, what it cost and how sure it is."""
    from clvol.base.progress import format_noise

    height, width = result.image.shape[:2]
    about, count = result.metadata, result.samples[1]
    seconds = about["seconds"]
    rate = width * height * count / max(seconds, 1e-9)
    mean = " on the mean" if "target_error" in about else ""
    yield f"{', '.join(written) or 'not saved'}: {width} x {height} pixels, {count} spp{mean}"
    yield f"  {seconds:.2f} s, {rate:,.0f} samples/s, noise {format_noise(result.noise)}"
    choices = ("technique", "transmittance", "majorant", "lookup")
    used = [f"{key} {about[key]}" for key in choices if about[key] != "none" or key == "transmittance"]
    lookups = result.stats["lookups"] / max(width * height * count, 1)
    if used == ["transmittance none"]:
        yield "  no media"
    else:
        yield f"  {', '.join(used)}; {lookups:.4g} look-ups per sample"
    if "pilot" in about:
        yield f"  pilot: {about['pilot_reason']}; repeat with"
        yield f"  {about['repeat']}"


@main.command()
@click.argument("file", metavar="FILE")
@click.option("--grid", metavar="NAME", help="Only this grid of a .vdb, or this array of a .npz.")
@definitions_option
def info(file: str, grid: str | None, definitions: tuple[tuple[str, str], ...]) -> None:
    """Say what a volume or a scene contains.

    FILE is a volume (.vdb, .vol, .npy, .npz): its grids, sizes, boxes, values and memory; or a scene
    (.xml): its camera, film, media and lights.
    """
    from clvol.scene import describe

    if Path(file).suffix.lower() == ".xml":
        import clvol

        if grid is not None:
            raise click.UsageError("--grid chooses from a volume file, and this is a scene")
        lines = describe.describe_scene(clvol.load_file(file, **dict(definitions)))
    else:
        if definitions:
            raise click.UsageError("-D fills a scene's $NAMES, and this is a volume file")
        lines = describe.describe_volume(file, grid)
    tell(map(printable, lines))  # a line of names with line breaks in them is one line


@main.command()
def devices() -> None:
    """List the OpenCL devices; the first is used unless --device names another."""
    from clvol.device.device import list_devices
    from clvol.scene import describe

    for device in list_devices():
        memory = describe.format_bytes(device.global_memory)
        click.echo(f"{device.index}: {device.name}")
        click.echo(f"   {device.platform}, {device.version}")
        click.echo(f"   {device.kind}, {device.compute_units} compute units, {memory}")


main.add_command(selftest)

main.add_command(ray)

main.add_command(compare)

if __name__ == "__main__":
    main()
