"""Write the OpenCL source that clvol composes for a scene, one self-contained file a kernel.

python tools/dump_kernel.py scenes/cloud.xml --majorant kdtree -o kernels
"""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import click
from scene_options import choice_options, open_scene

from clvol.cli.messages import fail
from clvol.cli.options import ExplainedCommand, definitions_option
from clvol.device.programs import stage_source
from clvol.errors import DeviceError, Error

if TYPE_CHECKING:
    from clvol.planning.plan import Plan


def dump(plan: Plan, folder: Path) -> list[Path]:
    """Write FOLDER/STAGE.cl for every stage of `plan`, and accumulate.cl; return the paths."""
    folder.mkdir(parents=True, exist_ok=True)
    written = []
    for stage in (*plan.stages, "accumulate"):
        path = folder / f"{stage}.cl"
        path.write_text(stage_source(plan, stage), encoding="utf-8")
        written.append(path)
    return written


@click.command(cls=ExplainedCommand)
@click.argument("scene", metavar="SCENE")
@click.option(
    "-o",
    "--output",
    type=click.Path(file_okay=False, path_type=Path),
    default=Path("kernels"),
    show_default=True,
    metavar="FOLDER",
    help="Where to write.",
)
@choice_options
@definitions_option
def main(
    scene: str, output: Path, device: str | None, definitions: tuple[tuple[str, str], ...], **choices: str
) -> None:
    """Write the composed source of each kernel that SCENE needs."""
    opened = open_scene(scene, dict(definitions), choices, device)
    for path in dump(opened.plan, output):
        lines = len(path.read_text(encoding="utf-8").splitlines())
        click.echo(f"{path}: {lines} lines, {path.stat().st_size} bytes")


if __name__ == "__main__":
    try:
        main()
    except DeviceError as error:
        fail(str(error), whole=True)
    except (Error, OSError) as error:
        fail(str(error))
