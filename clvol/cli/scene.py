"""`clvol scene`: what `clvol render` makes of a volume or of another format's scene, as a file."""

from __future__ import annotations

from typing import Any

import click

from clvol.cli.messages import tell
from clvol.cli.options import Size, definitions_option, quiet_option
from clvol.cli.volumes import LookCommand, VolumeValue, size_of, spelled, volume_options

EXAMPLES = """
\b
Examples:
  clvol scene smoke.vdb -o smoke.xml
  clvol scene scenes/fire.vdb -o fire.xml --view front --light studio --size 1280x720
  clvol scene explosion.pbrt -o explosion.xml
  clvol render fire.xml -o fire.png --quality good
"""


@click.command(cls=LookCommand, epilog=EXAMPLES)
@click.argument("volume", metavar="VOLUME_OR_SCENE")
@click.option("-o", "--output", metavar="FILE.xml", required=True, help="Scene to write.")
@volume_options
@click.option(
    "--background", type=VolumeValue("background"), metavar="COLOUR", help="Colour behind it, or transparent."
)
@click.option("--size", type=Size(), metavar="WxH", help="Pixels of the picture, as 640x480.")
@click.option("--spp", type=click.IntRange(min=1), help="Samples per pixel.")
@definitions_option
@click.option("--overwrite", is_flag=True, help="Replace files that are there already.")
@quiet_option
def scene(
    volume: str,
    output: str,
    size: tuple[int, int] | None,
    spp: int | None,
    definitions: tuple[tuple[str, str], ...],
    overwrite: bool,
    quiet: bool,
    **given: Any,
) -> None:
    """Write the scene that `clvol render` would render, as a Mitsuba 3 XML file.

    Of a volume, it names the volume's file. A light that XML cannot hold lies beside it, as
    FILE_environment.exr. What was chosen stands in its first lines.

    Of a scene of PBRT-v4 (.pbrt), or of Mitsuba before version 2, it is what clvol reads of it. Meshes,
    samples and pictures of a .pbrt lie beside it.
    """
    from clvol.scene.loader import is_scene_file
    from clvol.staging.saving import check_scene, save_scene
    from clvol.staging.source import Source
    from clvol.staging.stage import SPP, stage

    if is_scene_file(volume):
        _convert(volume, output, given | {"size": size, "spp": spp}, definitions, overwrite, quiet)
        return
    if definitions:
        raise click.UsageError("-D fills a scene's $NAMES, and this is a volume")
    check_scene(output, volume)
    staged = stage(Source.of(volume), given, size_of(size), spp or SPP)
    staged.load()
    written = save_scene(staged, output, overwrite)
    if not quiet:
        tell([*staged.lines, f"{', '.join(written)}: the scene"])


def _convert(
    source: str,
    output: str,
    given: dict[str, Any],
    definitions: tuple[tuple[str, str], ...],
    overwrite: bool,
    quiet: bool,
) -> None:
    """Write a scene of another format or version; options of volumes are refused."""
    from clvol.staging.converting import convert_scene

    for option, value in given.items():
        if value is not None:
            raise click.UsageError(f"{spelled(option)} is for volumes, and this is a scene")
    written = convert_scene(source, output, dict(definitions), overwrite)
    if not quiet:
        first, *others = written
        beside = f", and {', '.join(others)}" if len(others) < 3 else f", and {len(others)} files beside it"
        tell([f"{first}{beside if others else ''}: the scene"])
