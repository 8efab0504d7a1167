"""report.html: one file that shows everything, with nothing to fetch."""

from __future__ import annotations

import base64
import math
from html import escape
from pathlib import PurePath
from typing import TYPE_CHECKING

from clvol.lab.comparison.figures import ALPHA
from clvol.lab.comparison.flip import HINT
from clvol.lab.comparison.pictures import error_picture, error_scales, picture, round_pictures, round_scales
from clvol.lab.comparison.relative import DARK, relative_weight
from clvol.lab.comparison.style import CSS, SCRIPT
from clvol.lab.comparison.table import has_flip_errors, table_rows
from clvol.lab.comparison.words import sentences
from clvol.lab.digits import two_digits

if TYPE_CHECKING:
    from clvol.lab.comparison.findings import Findings

CAPTIONS = {
    "one_render_over_spp": "Relative MSE of one render over its samples.",
    "one_render_over_seconds": "Over its seconds, precomputation and kernel builds apart.",
    "one_render_over_lookups": "Over its look-ups of the density, which no machine changes.",
    "efficiency": "1 / (MSE × cost) over the baseline's, 95 % intervals; hollow: no significant difference.",
    "means_over_seconds": "Relative MSE of means of 1, 2, … renders over their time, precomputation counted.",
}


ONE_RENDER = (
    "Means over independent renders of each length, with 95 % intervals. The error of independent samples "
    "falls along the dashed line; that of samplers sobol and joint may fall faster; bias flattens."
)
MEANS = (
    "Errors of means of k = 1, 2, … separate renders, averaged over every order of them; bands are 95 % "
    "bootstraps over renders, on the wide side. Without bias they follow the dashed line, whatever the "
    "sampler, but for precomputation, which moves curves to the right; bias flattens them."
)


def html_report(findings: Findings, drawn: dict[str, bytes]) -> str:
    """The page; `drawn` are the plots of `plots.plots`."""
    name = PurePath(str(findings.about.get("scene", ""))).name or "scene"
    parts = [
        f"<h1>{escape(name)}: speed against error</h1>",
        f'<p class="lead">{_lead(findings)}</p>',
        "<h2>Pictures at equal time</h2>",
        _pictures(findings),
        "<h2>Error of one render</h2>",
        _plots(drawn, [name for name in drawn if name.startswith("one_render")]),
        f'<p class="note">{escape(ONE_RENDER)}</p>',
        "<h2>What was found</h2>",
        _words(findings),
        _summary(findings),
        _plots(drawn, ["efficiency"]),
        "<h2>All renders together</h2>",
        _rounds(findings),
        _plots(drawn, ["means_over_seconds"]),
        f'<p class="note">{escape(MEANS)}</p>',
        "<h2>How it was made</h2>",
        _made(findings),
    ]
    head = f'<meta charset="utf-8"><title>{escape(name)}: clvol compare</title>'
    view = '<meta name="viewport" content="width=device-width, initial-scale=1">'
    body = "\n".join(parts)
    return (
        f'<!doctype html>\n<html lang="en"><head>{head}{view}<style>{CSS}</style></head>\n'
        f"<body><main>\n{body}\n</main><script>{SCRIPT}</script></body></html>\n"
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
    """Cells are HTML."""
    head = "".join(f"<th>{escape(text)}</th>" for text in heads)
    body = "".join("<tr>" + "".join(f"<td>{cell}</td>" for cell in row) + "</tr>" for row in rows)
    return f'<div class="scroll"><table class="{kind}"><tr>{head}</tr>{body}</table></div>'


def _summary(findings: Findings) -> str:
    heads, rows = table_rows(findings)
    note = (
        f"Errors are relative to F² + ({DARK:g} · mean F)², F being the reference, whose own variance is "
        "subtracted; spp are samples a pixel. Efficiency: times the baseline's, with its 95 % interval; it "
        "holds for renders of as many samples as stand beside it (samplers sobol and joint gain with their "
        f"number); * significantly different. Verdicts raise a false alarm with probability {ALPHA:g}."
    )
    cells = [
        [escape(c.figure) + (f"<small>{escape(c.samples)}</small>" if c.samples else "") for c in row]
        for row in rows
    ]
    return _table(heads, cells) + f'<p class="note">{escape(note)}</p>'


def _plots(drawn: dict[str, bytes], names: list[str]) -> str:
    figures = []
    for name in names:
        if name in drawn:
            caption = escape(CAPTIONS[name])
            wide = ' class="wide"' if name == "efficiency" else ""
            figures.append(
                f"<figure{wide}>{_img(drawn[name], caption)}<figcaption>{caption}</figcaption></figure>"
            )
    return f'<div class="plots">{"".join(figures)}</div>'


def _img(png: bytes, alt: str, attributes: str = "") -> str:
    data = base64.b64encode(png).decode("ascii")
    return f'<img alt="{alt}"{attributes} src="data:image/png;base64,{data}">'


def _pictures(findings: Findings) -> str:
    """A column for each combination: its picture, its error, its FLIP error."""
    (scale, flip_scale), flips = error_scales(findings), has_flip_errors(findings)
    keys = [f"Below: error of each pixel, relative{_scale('magma', '0', f'{scale:.2g}')}"]
    keys += (
        [f"At the bottom: FLIP error{_scale('magma', '0', f'{flip_scale:.2g}')}"] if flips else [escape(HINT)]
    )
    key = f'<div class="key">{"".join(f"<div>{text}</div>" for text in keys)}</div>'
    truth = _img(picture(findings.reference.image), "reference", ' id="reference"')
    said = f"{findings.reference.spp} spp" if findings.reference.spp else "as given"
    own = math.sqrt(float((findings.reference.variance * relative_weight(findings.reference.image)).mean()))
    said += (
        f"<br>its own rel. RMSE {two_digits(own)}"
        if findings.reference.variance_known
        else "<br>its error unknown"
    )
    cards = [f"<figure><figcaption><strong>reference</strong>{said}</figcaption>{truth}{key}</figure>"]
    for f in findings.figures:
        shown, label = f.picture, escape(f.label + (" (biased)" if f.biased else ""))
        words = f"{shown.render.spp} spp in {two_digits(shown.render.seconds)} s"
        words += f"<br>rel. RMSE {two_digits(shown.relrmse)}"
        words += "" if shown.flip is None else f", FLIP {two_digits(shown.mean_flip)}"
        images = [_img(picture(shown.render.image), label, ' class="shown"')]
        images.append(_img(error_picture(shown.error, scale), f"error of {label}"))
        if shown.flip is not None:
            images.append(_img(error_picture(shown.flip, flip_scale), f"FLIP error of {label}"))
        cards.append(
            f"<figure><figcaption><strong>{label}</strong>{words}</figcaption>{''.join(images)}</figure>"
        )
    note = (
        "One render of each, of as many samples as the same time allowed; precomputation and kernel builds "
        "are apart. Press a picture to see the reference in its place."
    )
    return f'<div class="pictures cards">{"".join(cards)}</div><p class="note">{escape(note)}</p>'


def _rounds(findings: Findings) -> str:
    """What shows only in many renders: where they are noisy, and where their mean is wrong."""
    scales = round_scales(findings)
    rows: list[list[tuple[str, bytes]]] = [[], []]
    for f in findings.figures:
        for row, png in zip(rows, round_pictures(f, findings, scales), strict=True):
            row.append((escape(f.label + (" (biased)" if f.biased else "")), png))
    titles = (
        ("Relative RMS error of one render", _scale("magma", "0", f"{scales[0]:.2g}")),
        (
            "Relative difference of the mean of all renders: structure is bias, speckle is noise",
            _scale("signed", f"-{scales[1]:.2g}", f"+{scales[1]:.2g}"),
        ),
    )
    parts = []
    for (title, scale), row in zip(titles, rows, strict=True):
        figures = "".join(
            f"<figure>{_img(png, label)}<figcaption>{label}</figcaption></figure>" for label, png in row
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
    tables = (["", ""], facts), (heads, rows)
    return "".join(_table(head, [[*map(escape, row)] for row in body], "left") for head, body in tables)
