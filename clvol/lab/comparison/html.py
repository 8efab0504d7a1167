"""report.html: one file that shows everything, with nothing to fetch."""

from __future__ import annotations

import base64
from html import escape
from pathlib import PurePath
from typing import TYPE_CHECKING

from clvol.lab.comparison.figures import ALPHA, DARK
from clvol.lab.comparison.plots import error_pictures, error_scales, picture
from clvol.lab.comparison.table import table_rows
from clvol.lab.comparison.words import sentences

if TYPE_CHECKING:
    from clvol.lab.comparison.findings import Findings

CSS = """
:root { --ink: #22272e; --soft: #68707c; --line: #e3e6ea; --wash: #f7f8fa; --accent: #0072b2; }
* { box-sizing: border-box; }
body { margin: 0; color: var(--ink); background: white;
  font: 15px/1.55 system-ui, -apple-system, "Segoe UI", "DejaVu Sans", sans-serif; }
main { max-width: 1120px; margin: 0 auto; padding: 32px 24px 64px; }
h1 { font-size: 26px; margin: 0 0 4px; } h2 { font-size: 18px; margin: 40px 0 12px; }
.lead, figcaption, .note { color: var(--soft); } .note { font-size: 13px; }
code { font: 13px ui-monospace, "DejaVu Sans Mono", monospace; background: var(--wash); padding: 1px 5px;
  border-radius: 4px; overflow-wrap: anywhere; }
ul.words { list-style: none; padding: 0; margin: 12px 0; }
ul.words li { margin: 6px 0; padding: 7px 14px; border-left: 4px solid var(--line); background: var(--wash);
  border-radius: 0 6px 6px 0; overflow-wrap: anywhere; }
ul.words li.finding { border-color: var(--accent); } ul.words li.verdict { border-color: #009e73; }
ul.words li.alarm { border-color: #c62828; background: #fdf1f0; }
ul.words li.warning { border-color: #e69f00; background: #fff9ec; }
.scroll { overflow-x: auto; } table { border-collapse: collapse; width: 100%; font-size: 14px; }
th, td { padding: 6px 10px; border-bottom: 1px solid var(--line); text-align: right; vertical-align: top;
  font-variant-numeric: tabular-nums; }
th { color: var(--soft); font-weight: 600; } th:first-child, td:first-child { text-align: left; }
table.left th, table.left td { text-align: left; }
.plots { display: flex; flex-wrap: wrap; gap: 16px; } .plots img { width: 100%; }
.plots figure { flex: 1 1 440px; max-width: 540px; }
.plots figure.wide { flex-basis: 100%; max-width: 900px; }
figure { margin: 0; } figcaption { font-size: 13px; margin-top: 2px; }
.pictures { display: flex; flex-wrap: wrap; gap: 14px; } .pictures figure { flex: 0 1 246px; }
.pictures img { width: 100%; min-width: 160px; image-rendering: pixelated; border-radius: 4px;
  display: block; }
.bar { height: 10px; width: 246px; border-radius: 5px; margin: 4px 0; }
.magma { background: linear-gradient(90deg, #000004, #51127c, #b73779, #fc8961, #fcfdbf); }
.signed { background: linear-gradient(90deg, #053061, #4393c3, #f7f7f7, #d6604d, #67001f); }
.ends { display: flex; justify-content: space-between; width: 246px; font-size: 12px; color: var(--soft); }
"""

CAPTIONS = {
    "relmse_over_seconds": "Relative MSE over time, precomputation counted, kernel builds apart.",
    "rmse_over_seconds": "RMSE over time.",
    "relmse_over_lookups": "Relative MSE over look-ups of the density, which no machine changes.",
    "rmse_over_lookups": "RMSE over look-ups.",
    "efficiency": "1 / (MSE × cost) over the baseline's, 95 % intervals; hollow: no significant difference.",
}


def html_report(findings: Findings, drawn: dict[str, bytes]) -> str:
    """The page; `drawn` are the plots of `plots.plots`."""
    name = PurePath(str(findings.about.get("scene", ""))).name or "scene"
    parts = [
        f"<h1>{escape(name)}: speed against error</h1>",
        f'<p class="lead">{_lead(findings)}</p>',
        "<h2>What was found</h2>",
        _words(findings),
        _summary(findings),
        "<h2>Error over cost</h2>",
        _plots(drawn),
        "<h2>Pictures</h2>",
        _pictures(findings),
        "<h2>How it was made</h2>",
        _made(findings),
    ]
    head = f'<meta charset="utf-8"><title>{escape(name)}: clvol compare</title>'
    view = '<meta name="viewport" content="width=device-width, initial-scale=1">'
    body = "\n".join(parts)
    return (
        f'<!doctype html>\n<html lang="en"><head>{head}{view}<style>{CSS}</style></head>\n'
        f"<body><main>\n{body}\n</main></body></html>\n"
    )


def _lead(findings: Findings) -> str:
    about, count = findings.about, len(findings.figures)
    what = "combination" if count == 1 else "combinations"
    size = f"{about.get('width', '?')} × {about.get('height', '?')} pixels"
    return escape(
        f"{count} {what}, {about.get('rounds', '?')} independent rounds of each by turns, {size}; "
        f"baseline {findings.baseline}; reference {findings.reference.source}."
    )


def _words(findings: Findings) -> str:
    alarms = {f.label for f in findings.figures if not f.verdict.agrees}
    items = []
    for sentence in sentences(findings):
        alarm = sentence.kind == "verdict" and any(
            sentence.text.startswith(f"{label} {verb}")
            for label in alarms
            for verb in ("differs", "flattens")
        )
        items.append(f'<li class="{"alarm" if alarm else sentence.kind}">{escape(sentence.text)}</li>')
    return f'<ul class="words">{"".join(items)}</ul>'


def _table(heads: list[str], rows: list[list[str]], kind: str = "") -> str:
    head = "".join(f"<th>{escape(text)}</th>" for text in heads)
    body = "".join("<tr>" + "".join(f"<td>{escape(c)}</td>" for c in row) + "</tr>" for row in rows)
    return f'<div class="scroll"><table class="{kind}"><tr>{head}</tr>{body}</table></div>'


def _summary(findings: Findings) -> str:
    note = (
        f"Relative RMSE and largest error: of the mean of all rounds; relative to F² + ({DARK:g} · mean F)², "
        "F being the reference, whose own variance is subtracted. Efficiency: times the baseline's, with its "
        "95 % interval, for renders of as many samples as the table says (samplers sobol and joint gain with "
        f"their number); * significantly different. Verdicts raise a false alarm with probability {ALPHA:g}."
    )
    return _table(*table_rows(findings)) + f'<p class="note">{escape(note)}</p>'


def _plots(drawn: dict[str, bytes]) -> str:
    figures = []
    for name, png in drawn.items():
        caption = escape(CAPTIONS[name])
        wide = ' class="wide"' if name == "efficiency" else ""
        figures.append(f"<figure{wide}>{_img(png, caption)}<figcaption>{caption}</figcaption></figure>")
    note = (
        "Errors of means of k = 1, 2, … separate renders, averaged over every order of them; bands are 95 % "
        "bootstraps over renders, on the wide side. Means of separate renders without bias follow the dashed "
        "line, whatever the sampler, but for precomputation, which moves curves over time to the right; bias "
        "flattens. Fitted slopes are over k."
    )
    return f'<div class="plots">{"".join(figures)}</div><p class="note">{escape(note)}</p>'


def _img(png: bytes, alt: str) -> str:
    data = base64.b64encode(png).decode("ascii")
    return f'<img alt="{alt}" src="data:image/png;base64,{data}">'


def _pictures(findings: Findings) -> str:
    scales = error_scales(findings)
    rows: list[list[tuple[str, bytes]]] = [[("reference", picture(findings.reference.image))], [], []]
    for f in findings.figures:
        shown = [picture(f.image), *error_pictures(f, findings, scales)]
        for row, png in zip(rows, shown, strict=True):
            row.append((f.label + (" (biased)" if f.biased else ""), png))
    titles = (
        ("Means of all rounds", ""),
        ("Relative RMS error of one round", _scale("magma", "0", f"{scales[0]:.2g}")),
        (
            "Relative difference of the mean of all rounds: structure is bias, speckle is noise",
            _scale("signed", f"-{scales[1]:.2g}", f"+{scales[1]:.2g}"),
        ),
    )
    parts = []
    for (title, scale), row in zip(titles, rows, strict=True):
        figures = "".join(
            f"<figure>{_img(png, escape(label))}<figcaption>{escape(label)}</figcaption></figure>"
            for label, png in row
        )
        parts.append(f'<p class="lead">{escape(title)}</p>{scale}<div class="pictures">{figures}</div>')
    return "\n".join(parts)


def _scale(kind: str, low: str, high: str) -> str:
    return f'<div class="bar {kind}"></div><div class="ends"><span>{low}</span><span>{high}</span></div>'


def _made(findings: Findings) -> str:
    facts = [[k.replace("_", " "), str(v)] for k, v in findings.about.items() if v is not None]
    rows = []
    for f in findings.figures:
        m = f.measured
        spp = f"{m.spp} spp × {len(m.seeds)}"
        seconds = f"{m.trial.precompute_seconds:.2f} + {m.seconds.sum():.2f}"
        kernels = f"{m.trial.session.kernel_seconds:.2f}"
        options = m.trial.options or "closed forms, no options"
        rows.append(
            [f.label, spp, seconds, kernels, f"{len(m.seeds)} of {min(m.seeds)} to {max(m.seeds)}", options]
        )
    heads = ["combination", "samples", "precomputation + render, s", "kernel builds, s", "seeds", "options"]
    return _table(["", ""], facts, "left") + _table(heads, rows, "left")
