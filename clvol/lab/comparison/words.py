"""A comparison in words: sentences for the report and for the terminal."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

from clvol.lab.comparison.figures import ALPHA, COSTS, LEVEL, Efficiency, Figures
from clvol.lab.comparison.measure import is_low_discrepancy
from clvol.lab.comparison.shorter import slope_spp
from clvol.lab.digits import with_ends

if TYPE_CHECKING:
    from collections.abc import Iterator

    from clvol.lab.comparison.findings import Findings

_HEAVY = 0.5
"""A round with more of the squared error than this, and than four times its share, is not like the others."""


@dataclass(frozen=True)
class Sentence:
    """kind : "finding", "verdict" or "warning"."""

    kind: str
    text: str


def sentences(findings: Findings) -> list[Sentence]:
    """Everything that a reader should know, the most important first."""
    found = [Sentence("finding", text) for cost in COSTS for text in _efficiency(findings, cost)]
    found += [Sentence("finding", text) for text in _what_significant_means(findings)]
    for figures in findings.figures:
        found += [Sentence("verdict", _verdict(figures)), Sentence("verdict", _slope(figures))]
        if math.isfinite(figures.render_slope.value):
            found.append(Sentence("verdict", _render_slope(figures)))
    return found + [Sentence("warning", text) for text in _warnings(findings)]


def _efficiency(findings: Findings, cost: str) -> Iterator[str]:
    known = {f.label: f.efficiency[cost] for f in findings.figures if cost in f.efficiency}
    spp = {f.label: f.measured.spp for f in findings.figures}
    if not known:
        return
    base = findings.baseline
    others = {label: e for label, e in known.items() if label != base}
    for label, e in sorted(others.items(), key=lambda item: -item[1].ratio.value):
        at = f"{spp[label]}" if spp[label] == spp[base] else f"{spp[label]} against {spp[base]}"
        yield (
            f"By {COSTS[cost]}, {label} is {with_ends(e.ratio)} times as efficient as {base} "
            f"at {at} spp a render{_significance(e)}."
        )


def _what_significant_means(findings: Findings) -> Iterator[str]:
    """Once, whatever the kinds of cost: each has the same number of tests."""
    others = [f for f in findings.figures if f.label != findings.baseline]
    known = [
        COSTS[c]
        for c in COSTS
        if any(math.isfinite(f.efficiency[c].adjusted_p) for f in others if c in f.efficiency)
    ]
    if len(others) > 1 and known:
        yield (
            f"Significant means that the chance of calling any of these {len(others)} wrongly different from "
            f"{findings.baseline} is {100 * LEVEL:.0f} %, by {' and by '.join(known)} each (Holm's "
            "correction); intervals are 95 % each."
        )


def _significance(e: Efficiency) -> str:
    if not math.isfinite(e.adjusted_p):
        return ": not known, for want of a measurable error or cost"
    p = "p < 0.0001" if e.adjusted_p < 1e-4 else f"p = {e.adjusted_p:.2g}"
    if e.significant:
        return f": significantly {'more' if e.ratio.value > 1 else 'less'} ({p})"
    return f": no significant difference ({p})"


def _verdict(figures: Figures) -> str:
    verdict = figures.verdict
    if not verdict.agrees:
        blame = (
            "as its label says"
            if figures.biased
            else "though neither should be biased, so that one is wrong (clvol selftest)"
        )
        return f"{figures.label} differs from the reference, {blame}: {verdict.explanation}."
    label = ", labelled as biased," if figures.biased else ""
    found = verdict.explanation
    if math.isfinite(verdict.smallest_bias):
        found = (
            f"no difference beyond noise (p = {verdict.p:.2g}, an alarm is below {ALPHA:g}); a bias of "
            f"{verdict.smallest_bias:.2g} of the mean would have been seen"
        )
    return f"{figures.label}{label} agrees with the reference: {found}."


def _slope(figures: Figures) -> str:
    label, slope = figures.label, figures.slope
    means = f"MSE of means of k separate renders of {figures.measured.spp} spp falls over k with slope"
    if not math.isfinite(slope.value):
        return f"{label}: the slope of its error is unknown, the error is too near the reference's."
    low = f"{slope.low:.2f}" if math.isfinite(slope.low) else "-∞"
    band = f"{slope.value:.2f} ({low} to {slope.high:.2f})"
    if slope.low > -1 and (figures.biased or not figures.verdict.agrees):
        floor = math.sqrt(max(figures.relative_squared_bias, 0.0))
        return (
            f"{label} flattens: the {means} {band} where noise alone has -1; more samples do not bring its "
            f"relative RMSE below about {floor:.2g}, which is bias."
        )
    if not slope.low <= -1 <= slope.high:
        than = "flatter" if slope.low > -1 else "steeper"
        return (
            f"{label}'s {means} {band}, a little {than} than the -1 of noise alone; chance does that to "
            "about 3 in 100 unbiased combinations"
            + ("." if figures.biased else ", and the tests against the reference decide on bias.")
        )
    hidden = (
        ", so that its bias hides in its noise here" if figures.biased else ", as noise without bias does"
    )
    return f"{label}'s {means} {band}, compatible with -1{hidden}."


def _render_slope(figures: Figures) -> str:
    slope, measured = figures.render_slope, figures.measured
    meaning = "compatible with the -1 of independent samples"
    if slope.high < -1:
        meaning = "faster than the -1 of independent samples"
    elif slope.low > -1:
        meaning = "slower than the -1 of independent samples"
    return (
        f"The MSE of one render of {figures.label} falls over its samples, {min(slope_spp(measured.spp))} to "
        f"{measured.spp} spp, with slope {slope.value:.2f} (95 %: {slope.low:.2f} to {slope.high:.2f}), "
        f"{meaning}."
    )


def _warnings(findings: Findings) -> Iterator[str]:
    if findings.interrupted:
        count = len(findings.figures[0].seconds)
        yield f"Interrupted: only the {count} rounds that were complete are in this report."
    for said, why in findings.left_out:
        yield f"{said} is left out: {why}."
    for said, label in findings.doubles:
        if said == label:
            yield f"{label} was asked for in more than one way, and was measured once."
        else:
            yield f"{said} comes to the same as {label} on this scene, and was measured once."
    if not findings.reference.variance_known:
        yield (
            "The reference came without its variance, which could not be subtracted: all errors are too "
            "large by the same amount, curves flatten, and disagreement with it may be its own noise."
        )
    for figures in findings.figures:
        share, count = figures.worst_round, len(figures.seconds)
        if share > max(_HEAVY, 4 / count):
            yield (
                f"One round has {share:.0%} of {figures.label}'s squared error: rare bright samples. Its "
                "interval may be too narrow; measure with more rounds."
            )
        if figures.biased:
            yield (
                f"{figures.label} is biased: its efficiency is that of a render as long as all its rounds, "
                "and is less for longer ones."
            )
        spp = figures.measured.spp
        if is_low_discrepancy(figures.measured.trial) and (spp < 4 or spp & (spp - 1)):
            yield (
                f"{figures.label} draws from Sobol' sequences, whose gain is full at 4, 8, 16, … samples a "
                f"render; it has {spp}."
            )
        for note in figures.measured.notes:
            yield f"{figures.label}: {note}."
