"""`clvol info`: what a volume or a scene contains, and what a render of the scene would do."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import click

from clvol.cli.messages import tell
from clvol.cli.options import (
    ExplainedCommand,
    definitions_option,
    family_options,
    majorant_scale_option,
    step_option,
)
from clvol.errors import printable, spelled_out

EXAMPLES = """
\b
Examples:
  clvol info scenes/fire.vdb
  clvol info scenes/smoke.xml
  clvol info scenes/smoke.xml --technique spectral
"""


@click.command(cls=ExplainedCommand, epilog=EXAMPLES)
@click.argument("file", metavar="FILE")
@click.option("--grid", metavar="NAME", help="Only this grid of a .vdb or .nvdb, or this array of a .npz.")
@family_options()
@majorant_scale_option
@step_option
@definitions_option
def info(file: str, grid: str | None, definitions: tuple[tuple[str, str], ...], **choices: Any) -> None:
    """Say what a volume or a scene contains.

    FILE is a volume (.vdb, .nvdb, .vol, .npy, .npz, medical images, .tif, .h5 and others, see the formats in
    the documentation): its grids, sizes, boxes, values and memory; a picture that clvol wrote (.exr): how it
    was made; or a scene (.xml, .pbrt): its camera, film, media and lights, and the plan of its render: the
    choices that are in force and why, its features, its stages and what is compiled; what of it is refused
    as not supported, and what is taken as something else.  The choices below are those of
    `clvol render`.
    """
    from clvol.scene.loader import is_scene_file

    if is_scene_file(file):
        if grid is not None:
            raise click.UsageError("--grid chooses from a volume file, and this is a scene")
        _tell_scene(file, dict(definitions), choices)
        return
    if Path(file).suffix.lower() == ".exr" and grid is None and not definitions:
        import clvol

        tell([clvol.info(file)])
        return
    from clvol.scene.describe import describe_volume

    if definitions:
        raise click.UsageError("-D fills a scene's $NAMES, and this is a volume file")
    for name, value in choices.items():
        if value not in ("auto", 1.0, None):
            option = name.replace("_", "-")
            raise click.UsageError(f"--{option} is for the render of a scene, and this is a volume file")
    tell(map(printable, describe_volume(file, grid)))  # a name with line breaks in it is one line


def _tell_scene(file: str, definitions: dict[str, str], choices: dict[str, Any]) -> None:
    """Print what a scene contains, and the plan of its render with these choices."""
    from clvol.api.about import scene_file_lines

    lines = scene_file_lines(file, definitions, choices)
    tell(printable(spelled_out(line, command=True)) for line in lines)
