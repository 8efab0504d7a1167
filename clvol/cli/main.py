"""The `clvol` command, a group of those in the files beside this one.

Heavy modules are imported where they are used, so that --help is quick.
"""

from __future__ import annotations

import click

from clvol.cli.compare import compare
from clvol.cli.devices import devices
from clvol.cli.info import info
from clvol.cli.merge import merge
from clvol.cli.messages import OneLineErrors
from clvol.cli.ray import ray
from clvol.cli.render import render
from clvol.cli.scene import scene
from clvol.cli.selftest import selftest
from clvol.cli.view import view

EXAMPLES = """
\b
Examples:
  clvol render scenes/fire.vdb -o fire.png
  clvol scene scenes/fire.vdb -o fire.xml
  clvol render scenes/fire.xml -o fire.exr
  clvol merge a.exr b.exr -o fire.exr
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
    epilog=EXAMPLES,
    context_settings={"help_option_names": ["-h", "--help"]},
)
@click.version_option(package_name="clvol", message="clvol %(version)s")
@click.pass_context
def main(ctx: click.Context) -> None:
    """Render participating media with OpenCL."""
    if ctx.invoked_subcommand is None:
        click.echo(ctx.get_help())


for command in (render, scene, merge, info, devices, selftest, ray, compare, view):
    main.add_command(command)

if __name__ == "__main__":
    main()
