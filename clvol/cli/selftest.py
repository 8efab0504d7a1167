"""`clvol selftest`: whether every way to render a scene makes the same picture, and hard cases theirs."""

from __future__ import annotations

import math
import sys
import textwrap
from typing import TYPE_CHECKING

import click

from clvol.cli.messages import exit_by, mention
from clvol.cli.options import definitions_option, device_option, positive_option, skip_option
from clvol.errors import OptionError

if TYPE_CHECKING:
    import numpy as np
    from rich.console import Console
    from rich.progress import TaskID

    from clvol.lab.judgement import Tested
    from clvol.lab.verdict import SelfTest

EXAMPLES = """
\b
Examples:
  clvol selftest scenes/cloud.xml
  clvol selftest scenes/smoke.xml --quick
  clvol selftest scenes/room.xml --time 600 --alpha 1e-6
  clvol selftest --quick

Exits with 0 where all agree, 1 where one disagrees or is faulty, 2 for a mistake, 130 for
Ctrl-C.
"""


@click.command(epilog=EXAMPLES)
@click.argument("scene", metavar="[SCENE]", required=False)
@click.option("--quick", is_flag=True, help="Fewer combinations on a smaller film, or fewer cases.")
@positive_option(
    "--time",
    "seconds",
    metavar="SECONDS",
    help="Render for so long, the building of kernels apart; 120 by default, 20 with --quick.",
)
@click.option(
    "--alpha",
    type=click.FloatRange(0, 1, min_open=True, max_open=True),
    default=1e-4,
    show_default=True,
    help="Probability of accusing any combination of a sound scene.",
)
@click.option(
    "--seed", type=click.IntRange(0, 2**64 - 1), default=0, show_default=True, help="Same seed, same samples."
)
@device_option
@definitions_option
@skip_option
def selftest(
    scene: str | None,
    quick: bool,
    seconds: float | None,
    alpha: float,
    seed: int,
    device: str | None,
    definitions: tuple[tuple[str, str], ...],
) -> None:
    """Test that every way to render SCENE makes the same picture of it.

    Techniques, transmittances, majorants, look-ups and all other unbiased choices that the scene has a use
    for are rendered at a small size, in combinations that leave none out, each against all others: their
    tiles and their means. Says the smallest bias that would have been seen.

    Without a SCENE: hard cases of clvol's own, whose pictures are known, on this device.
    """
    from rich.console import Console

    import clvol
    from clvol.base.progress import error_console

    if scene is None:
        for name, given in (("--time", seconds), ("-D", definitions)):
            if given:
                raise OptionError(f"{name} is for a scene", hint="name one, or leave it out")
        hard_cases(quick, alpha, seed, device)
        return
    loaded = clvol.load_file(scene, **dict(definitions))
    try:
        with _Steps(error_console()) as steps:
            found = clvol.selftest(
                loaded,
                quick=quick,
                seconds=seconds,
                alpha=alpha,
                seed=seed,
                device=device,
                progress=steps.tell,
            )
    except KeyboardInterrupt:
        mention(["clvol: interrupted before the second round: no verdict"], err=True)
        exit_by(True)
    console = Console()
    width = console.width if console.is_terminal else 0  # a file or a pipe has no width to keep to
    lines = [*table_of(found, width), "", *(line for note in notes(found) for line in wrapped(note, width))]
    click.echo("\n".join(lines))
    if not found.passed:
        sys.exit(1)
    exit_by(bool(found.interrupted_of))


def hard_cases(quick: bool, alpha: float, seed: int, device: str | None) -> None:
    """Render the hard cases, each in one way, and tell what they show; exit status 1 where one is wrong."""
    from clvol.device.device import open_device
    from clvol.lab.hard.suite import CASES, quick_part, run
    from clvol.lab.quiet import quiet_renders

    cases = quick_part() if quick else CASES
    level, wrong, noisy = alpha / len(cases), 0, 0
    opened = open_device(device)
    with quiet_renders():
        for seen in run(opened, cases, seed=seed):
            word = seen.word(level)
            wrong, noisy = wrong + (word == "WRONG"), noisy + (word == "too noisy")
            mean, error, expected = (_numbers(v) for v in (seen.mean, seen.error, seen.expected))
            why = "".join(f"; {fault}" for fault in seen.faults)
            click.echo(f"{word:9}  {seen.case.name}: {mean} ± {error}, expected {expected}{why}")
    right = len(cases) - wrong - noisy
    click.echo(f"{right} of {len(cases)} cases are right, {noisy} too noisy to show anything, {wrong} wrong.")
    if wrong:
        sys.exit(1)


def _numbers(values: np.ndarray) -> str:
    """One number for each channel, or one where all are the same."""
    return ", ".join(f"{v:.5g}" for v in dict.fromkeys(values.tolist()))


class _Steps:
    """A progress bar with the time left on standard error; silent where that is no terminal."""

    def __init__(self, console: Console) -> None:
        from rich.progress import BarColumn, MofNCompleteColumn, TextColumn, TimeRemainingColumn

        from clvol.base.progress import bar_of

        columns = TextColumn("{task.description}"), BarColumn(), MofNCompleteColumn(), TimeRemainingColumn()
        self._bar = bar_of(console, *columns)
        self._tasks: dict[str, TaskID] = {}

    def __enter__(self) -> _Steps:
        self._bar.start()
        return self

    def __exit__(self, *_exception: object) -> None:
        self._bar.stop()

    def tell(self, what: str, done: int, total: int) -> None:
        """Show how far `what` is."""
        if what not in self._tasks:
            self._tasks[what] = self._bar.add_task(what, total=total)
        self._bar.update(self._tasks[what], completed=done, total=total)


TOGETHER = "\N{NO-BREAK SPACE}"
HEADINGS = ("#", "mean", "p", "sees a bias of", "verdict")


def table_of(found: SelfTest, width: int = 0) -> list[str]:
    """Lines of plain text: each combination's number and figures, below them where it differs.

    width : columns of the terminal, at which options are wrapped; 0 for a file, whose lines have no end.
    """
    families = [f for f in found.tested[0].names if len({t.names[f] for t in found.tested}) > 1]
    rows = [
        (str(n), *_figures(one, len(found.tested)), _word(one)) for n, one in enumerate(found.tested, start=1)
    ]
    widths = [max(map(len, column)) for column in zip(HEADINGS, *rows, strict=True)]
    indent = " " * (widths[0] + 2)

    def line(row: tuple[str, ...]) -> str:
        figures = (text.rjust(size) for text, size in zip(row[:-1], widths, strict=False))
        return "  ".join([*figures, row[-1]])

    lines = [line(HEADINGS)]
    for one, row in zip(found.tested, rows, strict=True):
        used = [f for f in families if one.names[f] != "none" or f == "transmittance"]
        names = ", ".join(f"{family}{TOGETHER}{one.names[family]}" for family in used)
        lines += [line(row), *(wrapped(indent + names, width, indent) if names else ())]
    return lines


def wrapped(text: str, width: int, indent: str = "") -> list[str]:
    """Lines of at most so many columns, broken between words; the text itself for a width of 0."""
    lines = [text]
    if width:
        wrapper = textwrap.TextWrapper(
            width, subsequent_indent=indent, break_long_words=False, break_on_hyphens=False
        )
        lines = wrapper.wrap(text)
    return [line.replace(TOGETHER, " ") for line in lines]


def _figures(one: Tested, count: int) -> tuple[str, str, str]:
    mean = f"{one.images.mean():.5g}"
    if one.agreement is None:
        return mean, "-", "-"
    bias = one.agreement.smallest_bias
    seen = f"{100 * bias:.2g} %" if math.isfinite(bias) else "-"
    return mean, f"{min(1.0, one.agreement.p * count):.2g}", seen


def _word(one: Tested) -> str:
    words = [] if one.agrees else ["DISAGREES"]
    words += ["undecided"] if one.doubtful else []
    words += [f"FAULTY: {fault}" for fault in one.faults]
    return "; ".join(words) or "agrees"


def notes(found: SelfTest) -> list[str]:
    """How it was tested, and the verdict."""
    width, height = found.size
    cut = f", interrupted before all {found.interrupted_of}" if found.interrupted_of else ""
    left_out = f"; left out as biased: {', '.join(found.left_out)}" if found.left_out else ""
    return [
        f"{width} x {height} pixels, {found.rounds} rounds of {found.spp} spp each{cut}; "
        f"{found.seconds:.1f} s of rendering, {found.kernel_seconds:.0f} s of building kernels; "
        f"every choice occurs, and {found.pairs} of {found.all_pairs} pairs of choices{left_out}.",
        "p: of the greatest deviation from all others, of tiles and means, adjusted for everything tested; "
        f"an accusation of a sound scene has probability {found.alpha:g} at most.",
        *(
            f"{one.options}: weights grew to {one.largest_weight:.2g}; it is noisier than its rounds show."
            for one in found.tested
            if one.heavy
        ),
        found.verdict,
    ]
