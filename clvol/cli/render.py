"""`clvol render`: a scene or a volume into pictures."""

from __future__ import annotations

import os
from contextlib import AbstractContextManager, nullcontext
from typing import TYPE_CHECKING, Any

import click
from click.core import ParameterSource

from clvol.cli.cluster import client_of, cluster_options
from clvol.cli.frames import Frames, Series, check_series, frame_options
from clvol.cli.messages import logging_to
from clvol.cli.options import (
    ExplainedCommand,
    SampleRange,
    Size,
    assignments_option,
    definitions_option,
    devices_option,
    family_options,
    majorant_scale_option,
    outputs_option,
    positive_option,
    quiet_option,
    skip_option,
    step_option,
)
from clvol.cli.painter import Painter
from clvol.cli.pictures import Shown, picture_options, write_views
from clvol.cli.quality import Quality, extent_of, write_qualities
from clvol.cli.volumes import Asked, Background, volume_options, write_looks

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from clvol.picture.tev import Tev

THE_FIRST = ".exr"
"""What --resume without a file stands for: that of the first picture that keeps its samples."""
EXAMPLES = """
\b
Examples:
  clvol render scenes/fire.vdb -o fire.png
  clvol render smoke.vdb -o smoke.png --light studio --view front --quality draft
  clvol render 'smoke.####.vdb' -o 'smoke.####.png' --frames 1-100:2
  clvol render smoke.vdb -o turn.mp4 --turntable 96
  clvol render scenes/fire.xml -o fire.exr
  clvol render scenes/cloud.xml -o cloud.exr -o cloud.png --spp 256
  clvol render scenes/cloud.xml -o cloud.exr --time 20 -v
  clvol render scenes/cloud.xml -o cloud.exr -D res=512 --majorant global
  clvol render scenes/cloud.xml -o cloud.exr --tev
  clvol render scenes/cloud.xml -o near.png --set sensor.x_fov=20 --set shape.interior.scale=80
  clvol render scenes/cloud.xml -o cloud.exr --technique decomposition --transmittance residual-ratio
  clvol render scenes/smoke.xml -o smoke.exr --technique auto:pilot
  clvol render scenes/cloud.xml -o cloud.exr --target-error 0.01
  clvol render scenes/fire.xml -o fire.exr --technique weighted-delta --majorant-scale 0.8
  clvol render scenes/smoke.xml -o smoke.exr --aov cells --aov largest_weight
  clvol render scenes/room.xml -o room.exr --profile --trace room.json
  clvol render scenes/cloud.xml -o cloud.exr --resume --spp 1024
  clvol render scenes/cloud.xml -o cloud.exr --spp 4096 --scheduler tcp://10.0.0.1:8786
  clvol render scenes/cloud.xml -o cloud.exr --spp 4096 --checkpoint cloud.npz
  clvol render scenes/cloud.xml -o cloud.exr --spp 4096 --resume cloud.npz
"""


class RenderCommand(ExplainedCommand):
    """As `ExplainedCommand`, and what AOVs, lights, qualities and views there are."""

    def format_epilog(self, ctx: click.Context, formatter: click.HelpFormatter) -> None:
        """Write a section of the pictures before the rest."""
        from clvol.planning.registry import AOVS

        with formatter.section("--aov"):
            formatter.write_dl(list(AOVS.items()))
        write_looks(formatter)
        write_qualities(formatter)
        write_views(formatter)
        super().format_epilog(ctx, formatter)


@click.command(cls=RenderCommand, epilog=EXAMPLES)
@click.argument("scene", metavar="SCENE")
@outputs_option(
    "Picture to write: .exr has everything; .png, .jpg, .tif, .hdr and others the picture. "
    "May be given several times.",
)
@volume_options
@click.option(
    "--background",
    type=Background(),
    default="auto",
    help="Colour behind all, which lights nothing, or transparent; or how light from there is weighed.",
)
@family_options("background", pilot=True)
@majorant_scale_option
@step_option
@click.option(
    "--aov",
    multiple=True,
    metavar="NAME",
    help="Add a picture to the .exr, of those below; may be given several times.",
)
@click.option("--size", type=Size(), metavar="WxH", help="Pixels, as 640x480; the scene's own by default.")
@click.option(
    "--sensor", type=click.IntRange(min=0), metavar="N", help="Which of the scene's sensors, from 0."
)
@click.option("--spp", type=click.IntRange(min=1), help="Samples per pixel; the scene's own by default.")
@click.option(
    "--samples",
    type=SampleRange(),
    metavar="FIRST,COUNT",
    help="Only COUNT samples of each pixel, from number FIRST on, instead of the first --spp.",
)
@click.option(
    "--resume",
    is_flag=False,
    flag_value=THE_FIRST,
    metavar="[FILE]",
    help="Go on from a checkpoint, or where an .exr ended, whose samples count towards --spp; "
    "without FILE from the first that is written, if it is there.",
)
@click.option(
    "--checkpoint",
    metavar="FILE",
    help="Keep there what the render has; if the file is there, go on from it, to the same bits.",
)
@positive_option(
    "--every",
    "checkpoint_every",
    metavar="SECONDS",
    help="How often the checkpoint is written.  [default: 60]",
)
@click.option("--quality", type=Quality(), help="How much noise is left; good for volumes by default.")
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
@devices_option
@cluster_options
@definitions_option
@skip_option
@assignments_option
@picture_options
@click.option(
    "-v",
    "--verbose",
    is_flag=True,
    help="Print the plan as `clvol info` does, with choices and their reasons, memory, and time by stage.",
)
@click.option("--profile", is_flag=True, help="Print where the time went, kernel by kernel.")
@click.option(
    "--trace",
    metavar="FILE",
    help="Write when each kernel ran, as a .json that Perfetto and chrome://tracing show.",
)
@frame_options
@click.option(
    "--tev",
    "tev",
    is_flag=False,
    flag_value="localhost",
    metavar="[HOST:PORT]",
    help="Show the picture in the viewer tev as it refines; on this machine by default.",
)
@quiet_option
def render(
    scene: str,
    outputs: tuple[str, ...],
    definitions: tuple[tuple[str, str], ...],
    verbose: bool,
    trace: str | None,
    tev: str | None,
    quiet: bool,
    **options: Any,
) -> None:
    """Render SCENE, a Mitsuba 3 XML file, a .pbrt file or a volume, into one or more pictures.

    A volume (.vdb, .nvdb, .vol, .npy, .npz, and what the extra `science` reads) is framed, scaled so that it
    reads well, and lit; what was chosen is printed. Ctrl-C ends the render early and keeps the picture so
    far, and so do SIGTERM and SIGHUP.
    """
    from clvol.api.extent import check_alone
    from clvol.base.progress import error_console

    shown = Shown.taken(options)
    asked = Asked.taken(scene, options, definitions)
    extent = extent_of(options, asked.is_volume)
    listed, turntable = options.pop("frames"), options.pop("turntable")
    overwrite, fps = options.pop("overwrite"), options.pop("fps")
    frames = Frames.of(asked, outputs, listed, turntable)
    _check_used(frames, overwrite)
    first = outputs if frames is None else frames.first_outputs
    _take_checkpoint(options, frames is not None)
    read = {scene: "the scene"} | ({asked.given["light"]: "the light"} if asked.given.get("light") else {})
    _check_files(read, first, (options["checkpoint"], trace), shown, bool(options["aov"]))
    resumes = options.pop("resume")
    options["resume"] = resumes and _source(resumes, outputs, frames is not None)
    goes_on = resumes == THE_FIRST or options["resume"]
    cluster = options.pop("scheduler"), options.pop("workers")
    sharing = {"client": next((given for given in cluster if given is not None), None)}
    check_alone(options | extent | sharing | {"resume": goes_on}, scene_chooses=not asked.is_volume)
    console, profiled = error_console(), options.pop("profile")
    options |= extent | {"profile": profiled or trace is not None}
    with logging_to(console, verbose), _tev_at(tev) as viewer, client_of(*cluster) as client:
        options["client"] = client
        painter = Painter(asked, options, shown, trace, quiet, console, viewer)
        if frames is not None:
            check_series(options, shown, trace, frames)
            series = Series(asked, frames, painter, shown, options["size"], overwrite, quiet, console, fps)
            series.run()
        painter.picture(outputs, profiled)


def _tev_at(address: str | None) -> AbstractContextManager[Tev | None]:
    """The viewer that --tev names, to be left at the end."""
    if address is None:
        return nullcontext()
    from clvol.picture.tev import Tev

    return Tev(address)


def _check_used(frames: Frames | None, overwrite: bool) -> None:
    """Refuse options of sequences and films where there is none."""
    given = click.get_current_context().get_parameter_source("fps") is not ParameterSource.DEFAULT
    if given and not (frames and frames.films):
        raise click.UsageError("--fps is for films, as -o smoke.mp4")
    if overwrite and frames is None:
        raise click.UsageError(
            "--overwrite is for sequences and turntables: one picture is written anew anyway"
        )


def _take_checkpoint(options: dict[str, Any], series: bool) -> None:
    """Refuse what says nothing, and fill in how often."""
    if options["checkpoint"] is None and options["checkpoint_every"] is not None:
        raise click.UsageError("--every says how often the --checkpoint is written, and there is none")
    if options["checkpoint"] is not None and series:
        raise click.UsageError("--checkpoint is of one picture; of frames, those that are there are kept")
    options["checkpoint_every"] = options["checkpoint_every"] or 60.0


def _source(given: str, outputs: Sequence[str], series: bool) -> str | None:
    """The file that --resume names, else the first output that has samples, or None where it is not there."""
    if series:
        raise click.UsageError("--resume goes on with one picture; of frames, those that are there are kept")
    if given != THE_FIRST:
        return given
    first = next((output for output in outputs if output.lower().endswith(".exr")), None)
    if first is None:
        raise click.UsageError("--resume needs an .exr to go on from")
    return first if os.path.lexists(first) else None


def _check_files(
    read: Mapping[str, str],
    outputs: Sequence[str],
    others: tuple[str | None, str | None],
    shown: Shown,
    aovs: bool,
) -> None:
    """Refuse what could not be written after a long render, and what nothing would be written of."""
    from clvol.picture.profile import check_trace

    shown.check(outputs)
    if aovs and not any(output.lower().endswith(".exr") for output in outputs):
        raise click.UsageError("--aov needs an .exr to write to")
    checkpoint, trace = others
    if trace is not None:
        check_trace(trace)
    _check_distinct(read, (*outputs, *(other for other in (checkpoint, trace) if other is not None)))


def _check_distinct(read: Mapping[str, str], outputs: Sequence[str]) -> None:
    """Refuse pictures that would replace each other or what is `read`, whatever the links to them."""
    names = {os.path.realpath(name): what for name, what in read.items()}
    for output in outputs:
        place = os.path.realpath(output)
        if place in names:
            raise click.UsageError(f"{output}: would replace {names[place]}")
        names[place] = "another picture"
