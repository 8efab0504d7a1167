"""Which combinations of choices a scene has a use for, and small sets of them that leave no choice out.

Only unbiased choices count.  Two combinations are the same where they differ in what a scene makes no use of.
"""

from __future__ import annotations

import itertools
import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from clvol.errors import OptionError
from clvol.planning.choices import Choices
from clvol.planning.registry import FAMILIES

if TYPE_CHECKING:
    from collections.abc import Mapping

    from clvol.lab.trials import Trial
    from clvol.planning.plan import Plan

MOST_CONSIDERED = 4096
"""Of a larger product of choices so many combinations are drawn, always the same.

Half a second of planning.  On a cloud, a fire, smoke and a room they meet each pair of
choices that 12,000 others meet."""
Names = dict[str, str]


def unbiased(family: str) -> list[str]:
    """The unbiased choices of a family."""
    return [name for name, choice in FAMILIES[family].items() if not choice.biased]


def biased() -> list[str]:
    """The others, of every family, as "family name"."""
    return [f"{f} {name}" for f, table in FAMILIES.items() for name, choice in table.items() if choice.biased]


LIGHTS = "lights"
"""Beside the families: whether next-event estimation samples the lights, which a scene without
heterogeneous media does for any transmittance but `none`."""
KEYS = (*FAMILIES, LIGHTS)


def names_in_force(plan: Plan) -> Names:
    """The choices in force, by family, and `LIGHTS`; "none" or "analytic" where a scene has no use for it."""
    return {**plan.in_force, LIGHTS: "sampled" if plan.nee else "found"}


def options_of(trial: Trial) -> str:
    """What `clvol render` repeats a trial with."""
    plan = trial.session.plan
    if plan.nee and "--transmittance" not in trial.options:
        return f"{trial.options} --transmittance {plan.chosen['transmittance']}".strip()
    return trial.options


def in_force(scene: Plan, names: Mapping[str, str]) -> Names | None:
    """What explicit `names` of every family come to in a scene; None for what cannot be right.

    `scene`: any plan of it.
    """
    try:
        return names_in_force(scene.having(Choices().but(**names)))
    except OptionError:
        return None


def usable(scene: Plan) -> dict[tuple[str, ...], Names]:
    """Combinations to ask for, by what they come to (in the order of `KEYS`)."""
    tables = [unbiased(family) for family in FAMILIES]
    shape = [len(table) for table in tables]
    total = math.prod(shape)
    wanted: np.ndarray | range = range(total)
    if total > MOST_CONSIDERED:
        wanted = np.random.default_rng(0).choice(total, MOST_CONSIDERED, replace=False)
    found: dict[tuple[str, ...], Names] = {}
    for number in wanted:
        places = np.unravel_index(number, shape)
        names = {f: table[n] for f, table, n in zip(FAMILIES, tables, places, strict=True)}
        used = in_force(scene, names)
        if used is not None:
            found.setdefault(tuple(used[key] for key in KEYS), names)
    return found


@dataclass(frozen=True)
class Covering:
    """Combinations among which every choice that a scene has a use for occurs.

    pairs, all_pairs : how many pairs of choices occur together, and could.
    """

    combinations: tuple[Names, ...]
    pairs: int
    all_pairs: int


def covering(scene: Plan, first: Mapping[str, str], most: int | None = None) -> Covering:
    """A small set of combinations in which every choice occurs, and pairs of choices as far as `most` allows.

    Parameters
    ----------
    scene : any plan of it.
    first : names in force of a combination that is had already, and is not in the set.
    most : combinations beyond which no further pairs are sought; None: single choices are enough.
    """
    found = usable(scene)
    rows = np.array([key for key in found], dtype=object).reshape(len(found), len(KEYS))
    levels = [{name: n for n, name in enumerate(dict.fromkeys(column))} for column in rows.T]
    codes = np.array([[level[v] for level, v in zip(levels, row, strict=True)] for row in rows], int)
    start = [level.get(first[key], -1) for key, level in zip(KEYS, levels, strict=True)]
    singles = [np.zeros(len(level), bool) for level in levels]
    pairs = {
        (f, g): np.zeros((len(levels[f]), len(levels[g])), bool)
        for f, g in itertools.combinations(range(len(levels)), 2)
    }
    possible = sum(len(np.unique(codes[:, [f, g]], axis=0)) for f, g in pairs)
    asked = list(found.values())
    chosen: list[Names] = []

    def mark(row: np.ndarray) -> None:
        for f, single in enumerate(singles):
            single[row[f]] = True
        for (f, g), pair in pairs.items():
            pair[row[f], row[g]] = True

    if min(start) >= 0:
        mark(np.array(start))
    while True:
        new = sum(~table[codes[:, f]] for f, table in enumerate(singles))
        together = sum(~table[codes[:, f], codes[:, g]] for (f, g), table in pairs.items())
        best = int(np.argmax(new * len(pairs) * 2 + together))
        enough = not new[best] and (most is None or len(chosen) + 1 >= most or not together[best])
        if enough:
            return Covering(tuple(chosen), sum(int(t.sum()) for t in pairs.values()), possible)
        mark(codes[best])
        chosen.append(asked[best])
