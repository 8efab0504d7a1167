"""`clvol compare`: techniques and other choices against each other on one scene, into a report."""

from __future__ import annotations

import shlex
from typing import Any

import click

from clvol.cli.messages import exit_by, logging_to, mention
from clvol.cli.options import (
    ExplainedCommand,
    F,
    RegistryNames,
    definitions_option,
    device_option,
    positive_option,
    quiet_option,
    skip_option,
)

EXAMPLES = """
\b
Examples:
  clvol compare scenes/cloud.xml -D res=64 --techniques delta,decomposition,regular -o report/
  clvol compare scenes/smoke.xml -D width=72 -D height=96 --techniques delta,spectral,marching \\
      --time 20 -o smoke/
  clvol compare scenes/cloud.xml -D res=64 --techniques delta,spectral --majorants global,grid,kdtree \\
      --baseline delta/grid -o report/
  clvol compare scenes/cloud.xml -D res=64 --techniques delta,regular --spp 16 --rounds 20 -o report/
  clvol compare scenes/cloud.xml -D res=64 --transmittances ratio,none --reference report/reference.exr \\
      -o again/
"""


class _Command(ExplainedCommand):
    """Remembers its arguments, for the report."""

    def parse_args(self, ctx: click.Context, args: list[str]) -> list[str]:
        ctx.meta["clvol.arguments"] = list(args)
        return super().parse_args(ctx, args)


def _names_options(command: F) -> F:
    """--techniques or --technique, and the same for every family of the registry."""
    from clvol.lab.names import plural
    from clvol.planning.registry import FAMILIES, FAMILY_PURPOSE, option

    for family in reversed(FAMILIES):
        spellings = (option(plural(family)), option(family))
        kind = RegistryNames(family)
        text = FAMILY_PURPOSE[family]
        command = click.option(*spellings, family, type=kind, default="auto", help=text)(command)
    return command


@click.command("compare", cls=_Command, epilog=EXAMPLES)
@click.argument("scene", metavar="SCENE")
@click.option("-o", "--output", metavar="FOLDER", required=True, help="Report to write, or to replace.")
@_names_options
@positive_option(
    "--time",
    "time_limit",
    metavar="SECONDS",
    help="About the seconds that each combination renders for, over all rounds; 10 by default; with sampler "
    "sobol or joint the nearest that a power of two of samples allows. The reference takes about ten times "
    "as long as one of them.",
)
@click.option(
    "--spp",
    type=click.IntRange(min=1),
    help="Samples per pixel of one round instead; a power of two suits samplers sobol and joint.",
)
@click.option(
    "--rounds",
    type=click.IntRange(min=4),
    default=10,
    show_default=True,
    help="Independent renders of each combination, by turns.",
)
@click.option("--baseline", metavar="LABEL", help="What efficiencies are relative to; the first by default.")
@click.option("--reference", metavar="FILE.exr", help="Compare with this; rendered if none is given.")
@click.option("--reference-spp", type=click.IntRange(min=1), help="Samples per pixel of the reference.")
@positive_option(
    "--step",
    metavar="LENGTH",
    help="Step of the combinations that march; the edge of a voxel by default.",
)
@click.option("--seed", type=click.IntRange(min=0), help="Of the first render; the scene's own by default.")
@device_option
@definitions_option
@skip_option
@quiet_option
def compare(
    scene: str, output: str, definitions: tuple[tuple[str, str], ...], quiet: bool, **options: Any
) -> None:
    """Measure which choices are the most efficient on SCENE, and whether their pictures are right.

    Every combination of the names given is rendered by turns and compared with one reference. The FOLDER gets
    report.html, report.json, plots and the reference. Ctrl-C ends the rounds early and still writes them.
    """
    from clvol.base.progress import error_console
    from clvol.lab.comparison.bar import Bar
    from clvol.lab.comparison.comparing import check_asked
    from clvol.lab.comparison.report import check_folder, write_or_keep
    from clvol.planning.registry import FAMILIES

    if options["spp"] is not None and options["time_limit"] is not None:
        raise click.UsageError("give --spp or --time, not both")
    if options["reference"] is not None and options["reference_spp"] is not None:
        raise click.UsageError("give --reference or --reference-spp, not both")
    numbers = {name: options[name] for name in ("time_limit", "spp", "rounds", "reference_spp")}
    families = {family: options[family] for family in FAMILIES}
    check_asked(options["seed"] or 0, options["reference"], families, **numbers)
    check_folder(output)
    console = error_console()
    with logging_to(console, verbose=False):
        import clvol

        loaded = clvol.load_file(scene, **dict(definitions))
        check_folder(output, loaded.files)
        progress: Any = False if quiet else Bar(console)
        comparison = _run(clvol.compare, loaded, progress, options)
        arguments = click.get_current_context().meta.get("clvol.arguments", [])
        comparison.about["command"] = shlex.join(["clvol", "compare", *arguments])
        write_or_keep(comparison, output)
    if comparison.interrupted:
        rounds = comparison.about["rounds"]
        mention([f"clvol: interrupted after {rounds} rounds, saved what there is"], err=True)
    if not quiet:
        mention([repr(comparison), "", *comparison.words, "", f"{output}: report.html"])
    exit_by(comparison.interrupted)


def _run(compared: Any, scene: Any, progress: Any, options: dict[str, Any]) -> Any:
    """With a progress bar, or without."""
    if not progress:
        return compared(scene, **options)
    with progress:
        return compared(scene, progress=progress, **options)
