"""`clvol info`: what a volume or a scene contains."""

from __future__ import annotations

from pathlib import Path

import click

from clvol.cli.messages import tell
from clvol.cli.options import definitions_option
from clvol.errors import printable


@click.command()
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
