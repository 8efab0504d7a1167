"""A comparison's summary: a row for each combination, in the report and as plain text."""

from __future__ import annotations

import io
import math
import os
import shutil
import sys
import textwrap
from typing import TYPE_CHECKING

from clvol.lab.comparison.figures import COSTS, Figures
from clvol.lab.digits import with_ends

if TYPE_CHECKING:
    from clvol.lab.comparison.findings import Findings

VERDICTS = {
    (False, True): "no bias seen",
    (False, False): "BIASED",
    (True, True): "labelled biased, not seen here",
    (True, False): "biased, as labelled",
}
"""In the summary, by what its label says and whether it agrees with the reference."""


def table_rows(findings: Findings) -> tuple[list[str], list[list[str]]]:
    """Headings and rows of the summary."""
    heads = [
        "combination",
        "spp a render",
        "rel. RMSE",
        "seconds",
        "look-ups per sample",
        "efficiency by time",
        "efficiency by look-ups",
        "slope over renders",
        "over samples",
        "largest error",
        "verdict",
    ]
    rows = []
    for f in findings.figures:
        pixels = f.measured.images[0, ..., 0].size
        per_sample = float(f.measured.lookups.mean()) / (pixels * f.measured.spp)
        ratios = [_cell(f, cost, findings.baseline) for cost in COSTS]
        slopes = [f"{s.value:.2f}" if math.isfinite(s.value) else "–" for s in (f.slope, f.render_slope)]
        rows.append(
            [
                f.label,
                str(f.measured.spp),
                f"{math.sqrt(max(f.relmse.value[-1], 0.0)):.3g}",
                f"{f.seconds[-1]:.3g}",
                f"{per_sample:.3g}",
                *ratios,
                *slopes,
                f"{f.largest_error.difference:+.2g}",
                VERDICTS[f.biased, f.verdict.agrees],
            ]
        )
    return heads, rows


def _cell(figures: Figures, cost: str, baseline: str) -> str:
    if cost not in figures.efficiency:
        return "–"
    e = figures.efficiency[cost]
    if figures.label == baseline:
        return "1 (baseline)"
    return with_ends(e.ratio).replace(" to ", "–") + (" *" if e.significant else "")


def text_table(findings: Findings, width: int | None = None) -> str:
    """The summary as plain text: a table, or a paragraph each where that is wider than `width` characters.

    None takes the terminal's width, and any where there is none.  Nothing is cut.
    """
    from rich import box
    from rich.console import Console
    from rich.table import Table
    from rich.text import Text

    heads, rows = table_rows(findings)
    table = Table(box=box.SIMPLE, title=None)
    for number, head in enumerate(heads):
        table.add_column(head, justify="left" if number == 0 else "right")
    for row in rows:
        table.add_row(*map(Text, row))
    text = io.StringIO()
    Console(file=text, width=10_000, color_system=None).print(table)
    lines = [line.rstrip() for line in text.getvalue().splitlines() if line.strip()]
    width = _terminal_width() if width is None else width
    if width and max(map(len, lines)) > width:
        lines = [line for row in rows for line in _paragraph(heads, row, width)]
    if any(e.significant for f in findings.figures for e in f.efficiency.values()):
        lines.append(f"* significantly different from {findings.baseline}")
    return "\n".join(lines)


def _paragraph(heads: list[str], row: list[str], width: int) -> list[str]:
    """A combination's name and, below it, its cells; a line breaks only between them where it can."""
    cells = "; ".join(
        f"{head}: {cell}".replace(" ", "\xa0") for head, cell in zip(heads[1:], row[1:], strict=True)
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
