"""Whether every way to render a scene makes the same picture of it.

On the user's own scene, each combination of choices is tested against all the others, with a stated rate of
false alarms and the smallest bias that would show.

The film is small and every combination renders as many samples, in rounds by turns, each of its own seed.
Combinations are the covering set of `clvol.lab.combinations`: each choice is tested, not each product.
"""

from __future__ import annotations

import itertools
import math
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from numbers import Real
from typing import TYPE_CHECKING

import numpy as np

from clvol.base.arguments import check_seed, flag, positive, whole
from clvol.device.device import Device, open_device
from clvol.errors import OptionError, option, shown
from clvol.lab.combinations import (
    LIGHTS,
    biased,
    covering,
    names_in_force,
    options_of,
)
from clvol.lab.judgement import Tested, judge
from clvol.lab.quiet import quiet_renders
from clvol.lab.reduced import reduced
from clvol.lab.seeds import independent_seeds
from clvol.lab.trials import Trial, rounds
from clvol.lab.verdict import SelfTest
from clvol.planning.choices import Choices
from clvol.rendering.session import MAX_SAMPLES
from clvol.scene.materials import Bitmap, Checkerboard, VolumeTexture
from clvol.scene.records import Scene
from clvol.scene.volume import largest_value

if TYPE_CHECKING:
    from clvol.picture.result import Result
    from clvol.scene.materials import Texture

LEAST_ROUNDS, MOST_ROUNDS = 4, 32
ENOUGH_ROUNDS = 2
"""To be judged after a Ctrl-C: their differences are the noise."""
_TRIAL_SPP = 4


@dataclass(frozen=True)
class Effort:
    """How much a self-test does: pixels of the film, seconds of rendering, and a number of combinations.

    Beyond that number no more pairs of choices are sought (None: every single choice is enough).
    """

    pixels: int
    seconds: float
    combinations: int | None


FULL, QUICK = Effort(4096, 120.0, 16), Effort(2304, 20.0, None)
Step = Callable[[str, int, int], None]
"""Told what is being done, how many steps of it are done, and of how many."""


def selftest(
    scene: Scene,
    *,
    quick: bool = False,
    seconds: float | None = None,
    alpha: float = 1e-4,
    seed: int = 0,
    device: str | None = None,
    spp: int | None = None,
    progress: Step | None = None,
) -> SelfTest:
    """Render a scene in every way that must make the same picture, and test whether it does.

    Parameters
    ----------
    scene
        From `load_file` or `load_dict`. Its film is made smaller. All else is as it is.
    quick
        A smaller film and fewer combinations: about a minute with the kernels built.
    seconds
        Of rendering, without the builds of kernels. The default is 120, or 20 if quick.
    alpha
        Probability that any combination of a sound scene is accused.
    seed
        All renders have seeds of their own, which follow from it.
    device
        Index or part of the name of an OpenCL device.
    spp
        Samples per pixel of each of `LEAST_ROUNDS` rounds, instead of what `seconds` allow.
    progress
        Called with what is done, the steps of it done, and how many there are.

    Returns
    -------
    SelfTest
        What was tested and the verdict. Ctrl-C after two rounds or more ends them, and those that are
        complete are judged.

    Raises
    ------
    OptionError, SceneError, VolumeError, DeviceError
        An alpha, scene, volume or device that won't do.
    KeyboardInterrupt
        Ctrl-C before two rounds were complete.
    """
    if not isinstance(scene, Scene):
        raise OptionError(f"selftest takes a Scene, not {type(scene).__name__}", hint="use load_file")
    if not isinstance(alpha, Real) or not 0 < alpha < 1:
        raise OptionError(f"alpha {shown(alpha)} is no probability", hint="give a small one, such as 1e-4")
    if seconds is not None:
        positive("", seconds, " of seconds")
    seed = check_seed(seed)
    if spp is not None and not 1 <= whole("spp", spp) <= MAX_SAMPLES:
        raise OptionError(f"{option('spp', spp)} cannot be rendered", hint=f"give 1 to {MAX_SAMPLES}")
    effort = QUICK if flag("quick", quick) else FULL
    tell = progress or (lambda what, done, total: None)
    small, opened = reduced(scene, effort.pixels), open_device(device)
    tell("kernels", 0, 1)
    trials = [Trial.open(opened, small, Choices())]
    with quiet_renders():
        pairs, all_pairs = open_covering(trials, opened, small, effort, tell)
        started = time.perf_counter()
        seeds, count = independent_seeds(seed, "selftest"), LEAST_ROUNDS
        if spp is None:
            spp, count = affordable(trials, seconds or effort.seconds, seeds)
        tested = _rendered(trials, spp, count, seeds, tell)
    elapsed, building = time.perf_counter() - started, sum(t.session.kernel_seconds for t in trials)
    for one in tested:
        one.found = brightest_light(small) / spp if one.names[LIGHTS] == "found" else 0.0
    judgement, size, had = judge(tested, alpha), small.film.window[2:], len(tested[0].images)
    return SelfTest(
        tested,
        alpha,
        size,
        spp,
        had,
        pairs,
        all_pairs,
        biased(),
        elapsed,
        building,
        count if had < count else 0,
        judgement,
    )


def brightest_light(scene: Scene) -> float:
    """Largest radiance, in any channel, of the lights that a path can find by chance."""
    surfaces = [_brightest(shape.emission) for shape in scene.shapes if shape.emission is not None]
    around = [light.radiance for light in scene.emitters if hasattr(light, "radiance")]
    return max((float(np.max(radiance)) for radiance in (*surfaces, *around)), default=0.0)


def open_covering(
    trials: list[Trial], device: Device, scene: Scene, effort: Effort, tell: Step
) -> tuple[int, int]:
    """Add to what `auto` comes to the combinations that cover every choice; the pairs had, and possible."""
    first = trials[0].session
    found = covering(first.plan, names_in_force(first.plan), effort.combinations)
    total = 1 + len(found.combinations)
    need = total * first.wavefront.bytes
    if need > device.info.global_memory / 2:
        raise OptionError(
            f"a self-test of this scene keeps {need / 2**30:.1f} GiB on the device, over half of what it has",
            hint="use volumes of a lower resolution",
        )
    for names in found.combinations:
        tell("kernels", len(trials), total)
        trials.append(Trial.open(device, scene, Choices().but(**names)))
    tell("kernels", total, total)
    return found.pairs, found.all_pairs


def affordable(trials: list[Trial], seconds: float, seeds: Iterator[int]) -> tuple[int, int]:
    """Samples per pixel of a round (a power of two) and rounds, so that all trials take about `seconds`."""
    cost = sum(t.render(next(seeds), _TRIAL_SPP).stats["seconds"]["render"] for t in trials) / _TRIAL_SPP
    in_all = max(seconds / cost, 1.0)
    spp = 2 ** max(0, math.floor(math.log2(in_all / (2 * LEAST_ROUNDS))))
    return spp, int(np.clip(in_all / spp, LEAST_ROUNDS, MOST_ROUNDS))


def _rendered(trials: list[Trial], spp: int, count: int, seeds: Iterator[int], tell: Step) -> list[Tested]:
    """The combinations with `count` rounds each, or those complete at a Ctrl-C, of which two are enough."""
    tested = [
        Tested(options_of(t), names_in_force(t.session.plan), t.session.plan.needs_bound) for t in trials
    ]
    rendered: list[list[Result]] = []
    tell("rounds", 0, count)
    try:
        for results in itertools.islice(rounds(trials, [spp] * len(trials), seeds), count):
            rendered.append(results)
            tell("rounds", len(rendered), count)
    except KeyboardInterrupt:
        if len(rendered) < ENOUGH_ROUNDS:
            raise
    for one, own in zip(tested, zip(*rendered, strict=True), strict=True):
        one.images = np.stack([r.image for r in own])
        one.totals = {
            name: sum(r.stats[name] for r in own)
            for name in ("non_finite", "walks_exhausted", "majorant_violations", "lookups")
        }
        one.largest_weight = max(r.stats["largest_weight"] for r in own)
    return tested


def _brightest(emission: Texture) -> float:
    """Largest component of a colour or texture."""
    if isinstance(emission, Bitmap):
        return float(emission.pixels.max())
    if isinstance(emission, Checkerboard):
        return max(*emission.color0, *emission.color1)
    if isinstance(emission, VolumeTexture):
        return largest_value(emission.volume)
    return max(emission)
