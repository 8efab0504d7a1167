"""Renders the hard cases in every way, and writes the page of what they show.

docs/hard-cases.jsonl keeps the figures of each case, one a line, as soon as they are there, so that hours of
them may be had in parts.  To render a case anew, delete its line.
"""

from __future__ import annotations

import json
import math
from typing import TYPE_CHECKING, Any

import click
import hard_mitsuba
from folders import ROOT

from clvol.device.device import open_device
from clvol.lab.hard.case import NOISY, ROUNDING
from clvol.lab.hard.suite import ALPHA, CASES, GROUPS, every_way, run
from clvol.lab.hard.summary import Summary
from clvol.lab.quiet import quiet_renders

if TYPE_CHECKING:
    from collections.abc import Iterable, Sequence
    from pathlib import Path

    from clvol.lab.hard.case import Case

FIGURES = ROOT / "docs" / "hard-cases.jsonl"
SEED = 2
INTRODUCTION = """\
# Hard cases

Scenes on which renderers give NaN, black pixels, leaks or a wrong number. Each is described once, in
`clvol/lab/hard/`, with the number that its picture must show. `python tools/docs.py hard` renders it by every
technique, transmittance and majorant that the scene tells apart, samplers by turns, and holds the mean of
each picture to that number. `docs/hard-cases.jsonl` keeps the figures, and on which device each was rendered:
{device}.

- **expected**: by closed form, or by float64 quadrature with code that shares nothing with the kernels
  (`clvol/lab/hard/block.py`, `clvol/lab/hard/scenes.py`).
- **seen**: mean of all ways that are not too noisy, with its standard error.
- **of one way**: the relative standard error of one of them (root mean square, of the noisiest channel),
  which is what a verdict can see. A way that is off by seven of these is mostly called wrong. One that is
  off by less may pass, and many of them show in the mean of all.
- **right**: ways whose mean is within its error of what is expected. Relative errors below {rounding:g} are
  those of float32. All ways of a case together would raise a false alarm once in {alarm:,}.
- **too noisy**: ways whose relative standard error is above {noisy:.0%}, so that they show nothing and are
  not decided: {undecided}.
- **wrong**: all others, and any with a sample that is not finite, a walk that was given up or a density above
  a bound that the technique needs.
- **Mitsuba {mitsuba}**: what its `volpath` (scalar_rgb) showed of the scene with as many samples, in at most
  {seconds} s. "right" is within chance and {slack:.1%}. – where the scene has what only clvol reads.

`clvol selftest` renders these cases in one way each, with `--quick` some of them. So do `pytest -m contract`,
but for two of half a minute each, and `pytest`. `pytest tests/hard -m hard_full` renders them in every way.

What is no mean of a picture has tests of its own:

- a million samples in a pixel, the last samples of 2³² - 1 and one more, which is refused, paths of 1e4
  scatterings by every technique and of 1e5: `tests/hard/test_many.py`
- the formulas themselves, by adding and doubling and by published tables; that the planes in which rays are
  said to be are those of every technique's tree: `tests/hard/test_expected.py`
- numbers of neighbours: `tests/hard/test_random.py`; reported variance: `tests/hard/test_statistics.py`
- peaks that single precision does not tell, analog techniques and bounds that do not hold, which are refused:
  `tests/hard/test_cases.py`
- occluders a hair before lamps of every shape: `tests/transport/test_occluders.py`
- half-spaces of albedo 0.5 to 0.99, and a white slab, which loses nothing:
  `tests/transport/test_techniques.py`
"""


def measured(cases: Sequence[Case], figures: Path) -> dict[str, Summary]:
    """Of each case, rendered now unless the file has it already."""
    found = read(figures) if figures.exists() else {}
    device = open_device(None)
    for case in cases:
        if case.name in found:
            continue
        with quiet_renders():
            seen = list(run(device, [case], every_way, SEED))
        found[case.name] = Summary.of(seen, ALPHA, device.description)
        with figures.open("a", encoding="utf-8") as file:
            file.write(json.dumps(found[case.name].as_dict()) + "\n")
        click.echo(row(case, found[case.name]))
    return found


def read(figures: Path) -> dict[str, Summary]:
    """Figures of earlier runs."""
    lines = map(json.loads, figures.read_text(encoding="utf-8").splitlines())
    return {
        line["case"]: Summary(**{k: tuple(v) if isinstance(v, list) else v for k, v in line.items()})
        for line in lines
    }


def page(found: dict[str, Summary]) -> str:
    """docs/hard-cases.md."""
    theirs = hard_mitsuba.read()
    version = max(seen["version"] for seen in theirs.values() if "version" in seen)
    devices = "; ".join(dict.fromkeys(summary.device for summary in found.values()))
    lines = [
        INTRODUCTION.format(
            device=devices,
            rounding=ROUNDING,
            noisy=NOISY,
            undecided=undecided(found.values()),
            alarm=round(1 / ALPHA),
            mitsuba=version,
            seconds=hard_mitsuba.SECONDS,
            slack=hard_mitsuba.SLACK,
        )
    ]
    for group, cases in GROUPS.items():
        have = [case for case in cases if case.name in found]
        if not have:
            continue
        lines += [f"\n## {group.capitalize()}\n"]
        lines += [
            f"| case | expected | seen | of one way | right | too noisy | wrong | Mitsuba {version} |",
            "|---|---|---|---|---|---|---|---|",
        ]
        lines += [f"{row(case, found[case.name])} {beside(theirs.get(case.name))} |" for case in have]
        sources = dict.fromkeys(case.source for case in have)
        lines += ["", f"Expected by {'; '.join(sources)}."]
        notes = dict.fromkeys(case.note for case in have if case.note)
        lines += ["", *(f"- {note[0].upper()}{note[1:]}." for note in notes)]
    return "\n".join(lines) + "\n"


def row(case: Case, found: Summary) -> str:
    """A line of the table."""
    seen = ", ".join(said(m, e) for m, e in zip(found.mean, found.error, strict=True))
    expected = ", ".join(f"{value:.6g}" for value in found.expected)
    verdicts = " | ".join((str(found.right), *(str(count or "–") for count in (found.noisy, found.wrong))))
    return f"| {case.name} | {expected} | {seen} | {share(found.of_one)} | {verdicts} |"


def share(value: float) -> str:
    """A relative error as per cent."""
    return f"{100 * value:.2g}%" if value >= 1e-5 else "–"


def undecided(found: Iterable[Summary]) -> str:
    """How many ways show nothing, of how many, and in which cases."""
    summaries = list(found)
    of_all = sum(summary.right + summary.noisy + summary.wrong for summary in summaries)
    noisy = {summary.case: summary.noisy for summary in summaries if summary.noisy}
    if not noisy:
        return f"none of {of_all:,} ways of {len(summaries)} cases"
    where = "; ".join(f"{count} of {case}" for case, count in noisy.items())
    return f"{sum(noisy.values()):,} of {of_all:,} ways of {len(summaries)} cases ({where})"


def beside(seen: dict[str, Any] | None) -> str:
    """What Mitsuba showed, in a cell of the table: a word where it is right."""
    if seen is None:
        return "–"
    if seen["word"] not in ("wrong", "black"):
        return str(seen["word"])
    numbers = ", ".join(said(m, e) for m, e in zip(seen["mean"], seen["error"], strict=True))
    return f"**{seen['word']}**: {numbers}"


def said(mean: float, error: float) -> str:
    """A mean to the digits that it has, and its standard error."""
    if error <= 0 or mean == 0:
        return f"{mean:.6g}"
    digits = max(1, math.ceil(math.log10(abs(mean) / error)) + 1)
    return f"{mean:.{min(digits, 7)}g} ± {error:.1g}"


def chosen(groups: Sequence[str]) -> list[Case]:
    """The cases of these groups, or all."""
    return [case for case in CASES if not groups or case.group in groups]
