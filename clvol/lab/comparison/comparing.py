"""`clvol.compare`: from a scene and names to a Comparison."""

from __future__ import annotations

import platform
from contextlib import nullcontext
from typing import TYPE_CHECKING, Any

import numpy as np

from clvol.base.arguments import check_seed, positive, whole
from clvol.base.interrupts import interruptible
from clvol.device.device import Device, open_device
from clvol.errors import OptionError, either, option
from clvol.lab.comparison.bar import Bar
from clvol.lab.comparison.combine import open_lineup
from clvol.lab.comparison.figures import compute_figures
from clvol.lab.comparison.measure import REFERENCE_SAMPLES, Effort, Measured, measure
from clvol.lab.comparison.reference import Reference, read_reference
from clvol.lab.comparison.result import Comparison
from clvol.lab.efficiency import LEAST_ROUNDS
from clvol.lab.names import names_asked
from clvol.lab.trials import Trial
from clvol.planning.choices import Choices
from clvol.rendering.session import MAX_SAMPLES
from clvol.scene.digest import scene_digest
from clvol.scene.records import Scene
from clvol.version import __version__

if TYPE_CHECKING:
    import os
    from collections.abc import Iterable, Mapping

    from clvol.lab.comparison.entrants import Told

DEFAULT_SECONDS = 10.0
MOST_ROUNDS = 10_000
"""Every round's picture is kept."""


def compare(
    scene: Scene,
    *,
    time_limit: float | None = None,
    spp: int | None = None,
    rounds: int = 10,
    baseline: str | None = None,
    reference: str | os.PathLike[str] | None = None,
    reference_spp: int | None = None,
    step: float | None = None,
    seed: int | None = None,
    device: str | None = None,
    progress: bool | Told = False,
    **families: str | Iterable[str],
) -> Comparison:
    """Measure every combination of choices on a scene, by turns, against one reference.

    Parameters
    ----------
    scene
        From `load_file` or `load_dict`.
    time_limit
        About the seconds that each combination renders for, over all its rounds. The default is 10. With
        sampler sobol or joint it is the nearest that a power of two of samples allows. The reference takes
        about ten times as long as one combination, unless it is given. Renders with fewer samples take a
        third as long.
    spp
        Samples per pixel of one round instead, the same for all.
    rounds
        Independent renders of each combination, at least 4.
    baseline
        Label of the combination that efficiencies are relative to. The default is the first.
    reference
        An .exr to compare with, with the variance that `Result.save` writes. Otherwise one is rendered.
    reference_spp
        Samples per pixel of the reference, in all.
    step
        World length of a step, for the combinations that march.
    seed
        Of the first render. Every render has one of its own. The default is the scene's.
    device
        Index or part of the name of an OpenCL device.
    progress
        True for a progress bar, or a callable (seconds done, seconds expected, what is being done).
    **families
        Names by family of `clvol.planning.registry`, as ``techniques=["delta", "spectral"]`` or
        ``majorant="grid,kdtree"``. All combinations are measured.

    Returns
    -------
    Comparison
        The figures of all combinations. Ctrl-C ends the rounds early and keeps the complete ones, if they
        are at least 4. Otherwise it raises KeyboardInterrupt.

    Raises
    ------
    OptionError, SceneError, VolumeError, DeviceError
        What won't do, and why. A single combination without a reference is nothing to compare.
    """
    if not isinstance(scene, Scene):
        raise OptionError(
            f"compare takes a Scene, not {type(scene).__name__}", hint="make one with load_file or load_dict"
        )
    numbers = {"time_limit": time_limit, "spp": spp, "rounds": rounds, "reference_spp": reference_spp}
    asked, effort = check_asked(scene.seed if seed is None else seed, reference, families, **numbers)
    given = None if reference is None else read_reference(reference, scene)
    opened = open_device(device)
    bar = Bar() if progress is True else nullcontext(progress or _silent)
    with interruptible(), bar as told:
        lineup = open_lineup(
            opened, scene, asked, step, lambda n, of: told(n, 0.0, f"kernels, {n + 1} of {of}")
        )
        if given is None and len(lineup.trials) == 1:
            same = [f"{said} comes to the same as {label}" for said, label in lineup.doubles if said != label]
            raise _nothing_to_compare(same + [f"{said} is left out: {why}" for said, why in lineup.left_out])
        labels = list(lineup.trials)
        chosen = _baseline(labels, baseline)
        measured, truth, interrupted = measure(
            lineup, effort, given, lambda: Trial.open(opened, scene, Choices()), told
        )
        figures = compute_figures(measured, truth, chosen)
    about = _about(scene, opened, effort, step, measured, truth)
    return Comparison(
        figures, chosen, truth, lineup.left_out, lineup.doubles, interrupted, about, scene.files
    )


def check_asked(
    seed: int, reference: object, families: Mapping[str, str | Iterable[str]], **numbers: Any
) -> tuple[dict[str, tuple[str, ...]], Effort]:
    """Names by family, and how much to render; OptionError for what won't do, whatever the scene."""
    asked = names_asked(families)
    effort = _effort(seed=seed, **numbers)
    if reference is not None and numbers["reference_spp"] is not None:
        what = f"{option('reference_spp')} is for a reference that is rendered, and one is given"
        raise OptionError(what)
    if reference is None and all(len(names) == 1 for names in asked.values()):
        raise _nothing_to_compare([])
    return asked, effort


def _nothing_to_compare(reasons: list[str]) -> OptionError:
    """With a reference that is given even one combination is compared with something."""
    what = "; ".join(["only one combination: nothing to compare", *reasons])
    names = either("techniques=['delta', 'regular']", "--techniques delta,regular")
    return OptionError(what, hint=f"name several, as {names}, or give a {option('reference')}")


def _silent(done: float, expected: float, text: str) -> None:
    """Progress for nobody."""


def _effort(
    *,
    time_limit: float | None,
    spp: int | None,
    rounds: int,
    reference_spp: int | None,
    seed: int,
) -> Effort:
    """How much to render; OptionError for numbers that won't do."""
    if time_limit is not None and spp is not None:
        raise OptionError(
            f"{option('time_limit')} and {option('spp')} exclude each other", hint="give one of them"
        )
    if time_limit is not None:
        positive("time limit ", time_limit, " of seconds")
    seed = check_seed(seed)
    least = {"rounds": LEAST_ROUNDS, "spp": 1, "reference_spp": 1}
    most = {"rounds": MOST_ROUNDS, "spp": MAX_SAMPLES // REFERENCE_SAMPLES, "reference_spp": MAX_SAMPLES}
    given = {"rounds": rounds, "spp": spp, "reference_spp": reference_spp}
    for name, value in given.items():
        if value is None:
            continue
        if whole(name, value) < least[name]:
            raise OptionError(f"{option(name, value)} is too few", hint=f"give at least {least[name]}")
        if value > most[name]:
            raise OptionError(f"{option(name, value)} is too many", hint=f"give at most {most[name]}")
    return Effort(rounds, time_limit or DEFAULT_SECONDS, spp, reference_spp, seed)


def _baseline(labels: list[str], wanted: str | None) -> str:
    if wanted is None:
        return labels[0]
    if wanted not in labels:
        raise OptionError(f"no combination is called {wanted!r}", hint=f"baselines are {', '.join(labels)}")
    return wanted


def _about(
    scene: Scene,
    device: Device,
    effort: Effort,
    step: float | None,
    measured: list[Measured],
    truth: Reference,
) -> dict[str, object]:
    """How the comparison was made."""
    return {
        "scene": scene.source,
        "digest": scene_digest(scene),
        "width": truth.image.shape[1],
        "height": truth.image.shape[0],
        "rounds": len(measured[0].seconds),
        "rounds_planned": effort.rounds,
        "seconds_planned": effort.seconds if effort.spp is None else None,
        "step_of_marching": step,
        "seed": effort.seed,
        "reference": truth.source,
        "device": device.description,
        "clvol": __version__,
        "python": platform.python_version(),
        "numpy": np.__version__,
        "system": platform.platform(),
    }
