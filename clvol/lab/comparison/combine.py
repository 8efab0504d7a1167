"""What is compared: every combination of the names asked for, without doubles and impossible ones."""

from __future__ import annotations

import itertools
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

from clvol.errors import OptionError
from clvol.lab.trials import Trial
from clvol.planning.choices import Choices
from clvol.planning.registry import FAMILIES

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping

    from clvol.device.device import Device
    from clvol.scene.records import Scene


@dataclass(frozen=True, eq=False)
class Lineup:
    """The combinations that will be measured.

    Parameters
    ----------
    trials : Trial by label; the label has the names of the families of which several were asked for.
    left_out : (what was asked for, why it cannot be).
    doubles : (what was asked for, the label it comes to).
    """

    trials: dict[str, Trial]
    left_out: tuple[tuple[str, str], ...] = ()
    doubles: tuple[tuple[str, str], ...] = field(default=())


def open_lineup(
    device: Device,
    scene: Scene,
    asked: Mapping[str, tuple[str, ...]],
    step: float | None = None,
    opened: Callable[[int, int], None] = lambda done, total: None,
) -> Lineup:
    """Open every combination of `asked`; `opened` is told how many of how many are done.

    `step` is for those that march.

    OptionError where none is possible.
    """
    varied = [family for family, names in asked.items() if len(names) > 1]
    if step is not None and not any(_marches({family: n}) for family, names in asked.items() for n in names):
        raise OptionError("step is for ray marching, and nothing marches here", hint="compare marching too")
    products = [dict(zip(asked, names, strict=True)) for names in itertools.product(*asked.values())]
    trials: list[Trial] = []
    left_out, doubles = [], []
    for number, wanted in enumerate(products):
        opened(number, len(products))
        said = _said(wanted, varied)
        try:
            choices = Choices.for_scene(scene, wanted)
            choices = choices.but(step=step if _marches(choices.names) else None)
            if not trials:  # the first of a process pays for what the others find done: opened, and forgotten
                Trial.open(device, scene, choices)
            trial = Trial.open(device, scene, choices)
        except OptionError as error:
            left_out.append((said, str(error)))
            continue
        same = next((other for other in trials if other.names == trial.names), None)
        if same is None:
            trials.append(trial)
        else:
            doubles.append((said, same))
    if not trials:
        raise OptionError(
            "none of these combinations is possible: " + "; ".join(f"{s}: {why}" for s, why in left_out)
        )
    labels = _labels(trials, varied)
    named = tuple((said, labels[trials.index(trial)]) for said, trial in doubles)
    return Lineup(dict(zip(labels, trials, strict=True)), tuple(left_out), named)


def _marches(names: Mapping[str, str]) -> bool:
    """Whether one of these names is that of fixed steps."""
    return any(name in FAMILIES[f] and FAMILIES[f][name].biased for f, name in names.items())


def _said(names: Mapping[str, str], varied: list[str]) -> str:
    """A combination in the words of whoever asked for it."""
    return "/".join(names[family] for family in varied or ["technique"])


def _labels(trials: list[Trial], varied: list[str]) -> list[str]:
    """Names of the varied families that differ, and of others too where those alone would not tell apart."""
    differing = [f for f in varied if len({trial.names[f] for trial in trials}) > 1]
    labels = [_said(trial.names, differing) for trial in trials]
    if len(set(labels)) < len(labels):
        differing = [f for f in FAMILIES if len({trial.names[f] for trial in trials}) > 1]
        labels = [_said(trial.names, differing) for trial in trials]
    return labels
