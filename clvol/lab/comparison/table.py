"""A comparison's summary: a row for each combination, in the report and as plain text."""

from __future__ import annotations

import io
import math
import os
import shutil
import sys
import textwrap
from typing import TYPE_CHECKING, NamedTuple

from clvol.lab.comparison.figures import COSTS, Figures
from clvol.lab.comparison.shorter import slope_spp
from clvol.lab.digits import two_digits, with_ends

if TYPE_CHECKING:
    from clvol.lab.comparison.findings import Findings
    from clvol.lab.statistics import Interval

VERDICTS = {
    (False, True): ("no bias seen", ""),
    (False, False): ("BIASED", ""),
    (True, True): ("labelled biased,", "not seen here"),
    (True, False): ("biased,", "as labelled"),
}
"""In the summary, in two lines, by what its label says and whether it agrees with the reference."""


class Cell(NamedTuple):
    """A figure, and the samples a pixel that it holds for; "" where they make no difference."""

    figure: str
    samples: str = ""

    def __str__(self) -> str:
        return f"{self.figure} {self.samples}".strip()


def table_rows(findings: Findings) -> tuple[list[str], list[list[Cell]]]:
    """Headings, which may be broken where they have a line's end, and rows of the summary."""
    heads = [
        *(
            "combination",
            "verdict",
            "rel. RMSE\nat equal time",
            *(["FLIP"] if has_flip_errors(findings) else []),
        ),
        *("rel. RMSE\nof all", "seconds\nof all", "look-ups\na sample"),
        *(f"efficiency\nby {cost}" for cost in COSTS.values()),
        *("slope over\nsamples", "slope over\nrenders", "largest\nerror"),
    ]
    return heads, [_row(f, findings) for f in findings.figures]


def has_flip_errors(findings: Findings) -> bool:
    """Whether FLIP was there to be asked."""
    return any(f.picture.flip is not None for f in findings.figures)


def _row(f: Figures, findings: Findings) -> list[Cell]:
    m, picture = f.measured, f.picture
    count = len(m.seconds)
    at, in_all = f"at {picture.render.spp} spp", f"at {count} × {m.spp} spp"
    per_sample = float(m.lookups.mean()) / (m.images[0, ..., 0].size * m.spp)
    lengths = [*slope_spp(m.spp)[::-1], m.spp]
    return [
        Cell(f.label),
        Cell(*VERDICTS[f.biased, f.verdict.agrees]),
        Cell(two_digits(picture.relrmse), f"{at}, {two_digits(picture.render.seconds)} s"),
        *([Cell(two_digits(picture.mean_flip), at)] if has_flip_errors(findings) else []),
        Cell(two_digits(math.sqrt(max(f.relmse.value[-1], 0.0))), in_all),
        Cell(f"{f.seconds[-1]:.3g}", f"for {count} × {m.spp} spp"),
        Cell(f"{per_sample:.3g}"),
        *(_efficiency(f, cost, findings) for cost in COSTS),
        _slope(f.render_slope, f"of {lengths[0]} to {lengths[-1]} spp"),
        _slope(f.slope, f"of 1 to {count} × {m.spp} spp"),
        Cell(f"{f.largest_error.difference:+.2g}", in_all),
    ]


def _slope(slope: Interval, samples: str) -> Cell:
    return Cell(f"{slope.value:.2f}", samples) if math.isfinite(slope.value) else Cell("–")


def _efficiency(figures: Figures, cost: str, findings: Findings) -> Cell:
    if cost not in figures.efficiency:
        return Cell("–")
    e, spp, base = figures.efficiency[cost], figures.measured.spp, findings[findings.baseline].measured.spp
    if figures.label == findings.baseline:
        return Cell("1 (baseline)", f"at {spp} spp")
    text = with_ends(e.ratio).replace(" to ", "–") + (" *" if e.significant else "")
    return Cell(text, f"at {spp} spp" if spp == base else f"at {spp} against {base} spp")


def text_table(findings: Findings, width: int | None = None) -> str:
    """The summary as plain text: a table, or a paragraph each where that is wider than `width` characters.

    None takes the terminal's width, and any where there is none.  Nothing is cut.
    """
    from rich import box
    from rich.console import Console
    from rich.table import Table
    from rich.text import Text

    heads, rows = table_rows(findings)
    table = Table(box=box.SIMPLE, title=None, show_lines=False)
    for number, head in enumerate(heads):
        table.add_column(head, justify="left" if number == 0 else "right")
    for row in rows:
        table.add_row(*(Text("\n".join(filter(None, cell))) for cell in row))
    text = io.StringIO()
    Console(file=text, width=10_000, color_system=None).print(table)
    lines = [line.rstrip() for line in text.getvalue().splitlines() if line.strip()]
    width = _terminal_width() if width is None else width
    if width and max(map(len, lines)) > width:
        lines = [line for row in rows for line in _paragraph(heads, [*map(str, row)], width)]
    if any(e.significant for f in findings.figures for e in f.efficiency.values()):
        lines.append(f"* significantly different from {findings.baseline}")
    return "\n".join(lines)


def _paragraph(heads: list[str], row: list[str], width: int) -> list[str]:
    """A combination's name and, below it, its cells; a line breaks only between them where it can."""
    cells = "; ".join(
        f"{head}: {cell}".replace("\n", " ").replace(" ", "\xa0")
        for head, cell in zip(heads[1:], row[1:], strict=True)
    )
    folded = textwrap.wrap(
        cells, max(width, 20), initial_indent="  ", subsequent_indent="  ", break_on_hyphens=False
    )
    return [row[0], *(line.replace("\xa0", " ") for line in folded)]


def _terminal_width() -> int | None:
    """Of the terminal that is written to, or what COLUMNS says; None for a file."""
    if not (sys.stdout.isatty() or os.environ.get("COLUMNS", "").isdigit()):
        return None
    return shutil.get_terminal_size().columns
