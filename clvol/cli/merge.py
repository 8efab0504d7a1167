"""`clvol merge`: pictures of disjoint samples into one."""

from __future__ import annotations

from typing import Any

import click

from clvol.cli.messages import mention
from clvol.cli.options import outputs_option, quiet_option
from clvol.cli.pictures import Shown, picture_options, write_views

EXAMPLES = """
\b
Examples:
  clvol render scenes/cloud.xml -o a.exr --samples 0,64     on one machine
  clvol render scenes/cloud.xml -o b.exr --samples 64,64    on another
  clvol merge a.exr b.exr -o cloud.exr -o cloud.png
"""


class MergeCommand(click.Command):
    """A command whose --help says what views there are."""

    def format_epilog(self, ctx: click.Context, formatter: click.HelpFormatter) -> None:
        """Write a section of them before the examples."""
        write_views(formatter)
        super().format_epilog(ctx, formatter)


@click.command(cls=MergeCommand, epilog=EXAMPLES)
@click.argument("pictures", metavar="PICTURE…", nargs=-1, required=True)
@outputs_option(
    "Picture to write, as of clvol render; may be given several times, and be one of the pictures.",
)
@picture_options
@quiet_option
def merge(pictures: tuple[str, ...], outputs: tuple[str, ...], quiet: bool, **options: Any) -> None:
    """Merge pictures of disjoint samples of one render, .exr files, into the picture of all samples.

    They are of the same scene, seed and choices: parts that --samples rendered, on several machines.
    """
    from clvol.base.output_files import check_spares
    from clvol.base.progress import format_noise
    from clvol.picture.loading import load_result
    from clvol.picture.merging import merge as merged
    from clvol.picture.saving import save_all

    shown = Shown.taken(options)
    shown.check(outputs)
    result = merged([load_result(picture) for picture in pictures])
    for output in outputs:
        check_spares(output, result.files)
    failures = save_all(shown.encoder(result), outputs)
    if not quiet:
        written = ", ".join(output for output in outputs if output not in failures) or "not saved"
        ranges = ", ".join(f"{first} to {first + count - 1}" for first, count in result.ranges)
        noise = format_noise(result.noise)
        mention([f"{written}: {result.samples[1]} spp (samples {ranges}), noise {noise}"])
    for failure in failures.values():
        raise failure
