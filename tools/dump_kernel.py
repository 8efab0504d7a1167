"""Write the OpenCL source that clvol composes for a scene, one self-contained file a kernel.

    python tools/dump_kernel.py scenes/cloud.xml --majorant kdtree -o kernels
"""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import click

from clvol.cli_options import Definition, ExplainedCommand, RegistryChoice, fail
from clvol.config import KernelConfig
from clvol.device import open_device
from clvol.errors import DeviceError, Error
from clvol.prepare import prepare
from clvol.programs import stage_source
from clvol.registry import FAMILIES, check_choice
from clvol.renderer import kernel_config
from clvol.scene import load_file


def scene_config(
    path: str, defaults: dict[str, str], choices: dict[str, str], pattern: str | None
) -> KernelConfig:
    """What `clvol render` would compile for this scene, these choices and this device."""
    scene = load_file(path, **defaults)
    for family, value in choices.items():
        if value == "auto":
            choices[family] = check_choice(family, scene.integrator.choices.get(family, "auto"))
    device = open_device(pattern)
    return kernel_config(prepare(scene, choices["majorant"]), choices, device)


def dump(config: KernelConfig, folder: Path) -> list[Path]:
    """Write FOLDER/STAGE.cl for every stage of `config`, and accumulate.cl; return the paths."""
    folder.mkdir(parents=True, exist_ok=True)
    written = []
    for stage in (*config.stages, "accumulate"):
        path = folder / f"{stage}.cl"
        path.write_text(stage_source(config, stage), encoding="utf-8")
        written.append(path)
    return written


def registry_options(command: Callable) -> Callable:
    """One option for each family of choices in `clvol.registry`."""
    for family in reversed(FAMILIES):
        command = click.option(f"--{family}", type=RegistryChoice(family), default="auto")(command)
    return command


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
@registry_options
@click.option("--device", metavar="PATTERN", help="Part of the device's name; see clvol devices.")
@click.option(
    "-D", "definitions", type=Definition(), multiple=True, metavar="NAME=VALUE", help="Fill $NAME in the scene."
)
def main(
    scene: str, output: Path, device: str | None, definitions: tuple[tuple[str, str], ...], **choices: str
) -> None:
    """Write the composed source of each kernel that SCENE needs."""
    for path in dump(scene_config(scene, dict(definitions), choices, device), output):
        text = path.read_text(encoding="utf-8")
        click.echo(f"{path}: {text.count(chr(10))} lines, {len(text)} bytes")


if __name__ == "__main__":
    try:
        main()
    except DeviceError as error:
        fail(str(error), whole=True)
    except (Error, OSError) as error:
        fail(str(error))
