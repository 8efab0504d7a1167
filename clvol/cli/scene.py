"""`clvol scene`: the scene that `clvol render` makes of a volume, as a file to go on from."""

from __future__ import annotations

from typing import Any

import click

from clvol.cli.messages import tell
from clvol.cli.options import Size, quiet_option
from clvol.cli.volumes import LookCommand, VolumeValue, size_of, volume_options

EXAMPLES = """
\b
Examples:
  clvol scene smoke.vdb -o smoke.xml
  clvol scene scenes/fire.vdb -o fire.xml --view front --light studio --size 1280x720
  clvol render fire.xml -o fire.png --quality good
"""


@click.command(cls=LookCommand, epilog=EXAMPLES)
@click.argument("volume", metavar="VOLUME")
@click.option("-o", "--output", metavar="FILE.xml", required=True, help="Scene to write.")
@volume_options
@click.option(
    "--background", type=VolumeValue("background"), metavar="COLOUR", help="Colour behind it, or transparent."
)
@click.option("--size", type=Size(), metavar="WxH", help="Pixels of the picture, as 640x480.")
@click.option("--spp", type=click.IntRange(min=1), help="Samples per pixel.")
@click.option("--overwrite", is_flag=True, help="Replace a light beside the scene that is there already.")
@quiet_option
def scene(
    volume: str,
    output: str,
    size: tuple[int, int] | None,
    spp: int | None,
    overwrite: bool,
    quiet: bool,
    **given: Any,
) -> None:
    """Write the scene that `clvol render VOLUME` would render, as a Mitsuba 3 XML file.

    It names the volume's file. A light that XML cannot hold lies beside it, as FILE_environment.exr. What was
    chosen stands in its first lines.
    """
    from clvol.staging.saving import check_scene, save_scene
    from clvol.staging.source import Source
    from clvol.staging.stage import SPP, stage

    check_scene(output, volume)
    staged = stage(Source.of(volume), given, size_of(size), spp or SPP)
    staged.load()
    written = save_scene(staged, output, overwrite)
    if not quiet:
        tell([*staged.lines, f"{', '.join(written)}: the scene"])
