"""`clvol.render`: from a scene and the user's choices to a Result; `clvol.plan`: to what it would do."""

from __future__ import annotations

import logging
import math
import operator
import time
from contextlib import nullcontext
from typing import TYPE_CHECKING, Any

from clvol.base.arguments import check_seed, positive
from clvol.base.interrupts import interruptible
from clvol.base.progress import Progress, ProgressCallback, RichProgress
from clvol.device.device import Device, open_device
from clvol.errors import OptionError, shown
from clvol.picture.profile import RENDER
from clvol.planning import registry
from clvol.planning.choices import NUMBERS, Choices
from clvol.planning.plan import Plan
from clvol.rendering.adaptive import TargetRender
from clvol.rendering.outcome import make_result
from clvol.rendering.profiler import Profiler, timed
from clvol.rendering.session import MAX_SAMPLES, Session
from clvol.scene.records import Scene
from clvol.scene.views import viewed

if TYPE_CHECKING:
    from collections.abc import Sequence

    from clvol.lab.pilot import Found
    from clvol.picture.result import Result

log = logging.getLogger("clvol")


def render(
    scene: Scene,
    *,
    spp: int | None = None,
    seed: int | None = None,
    sensor: int | None = None,
    size: tuple[int, int] | None = None,
    technique: str = "auto",
    transmittance: str = "auto",
    majorant: str = "auto",
    lookup: str = "auto",
    absorption: str = "auto",
    gathering: str = "auto",
    roulette: str = "auto",
    background: str = "auto",
    probability: str = "auto",
    control: str = "auto",
    sampler: str = "auto",
    shadow_cache: str = "auto",
    light_choice: str = "auto",
    next_event: str = "auto",
    lanes: str = "auto",
    majorant_scale: float = 1.0,
    step: float | None = None,
    aov: Sequence[str] = (),
    time_limit: float | None = None,
    target_error: float | None = None,
    device: str | None = None,
    progress: bool | ProgressCallback = False,
    samples: tuple[int, int] | None = None,
    pool: int | None = None,
    profile: bool = False,
) -> Result:
    """Render a scene.

    Parameters
    ----------
    scene
        From `load_file` or `load_dict`.
    spp, seed
        Samples per pixel and 64-bit seed. They default to the scene's.
    sensor
        Which of the scene's sensors sees it, from 0. The default is the first.
    size
        Pixels (width, height) instead of those of the scene's film. The field of view stays along the axis
        that it is given for.
    technique, transmittance, majorant, lookup, absorption, roulette, gathering, background, probability,
    control
        Names from `clvol.planning.registry`. "auto" takes the scene's own choice, else follows fixed rules,
        so that the same seed gives the same bits. Technique "auto:pilot" has a short measured pilot choose
        technique, transmittance and majorant, where they are left at "auto". ``result.metadata["repeat"]``
        says what it chose.
    sampler, shadow_cache, light_choice, next_event, lanes
        Names from there too.
    majorant_scale
        Multiplies every bound of the density, for experiments. A factor below 1 is only for techniques and
        transmittances that stay unbiased there.
    step
        World length of a step of ray marching. The default is the edge of a voxel.
    aov
        Names from `clvol.planning.registry.AOVS` to add to ``result.aovs``. They are means per sample
        ("largest_weight": maxima).
    time_limit
        Seconds after which no new pass of samples is begun. Alone it replaces `spp`. Passes begun are
        finished, unless paths go on for more than 10 seconds (30 where no pass is finished yet).
    target_error
        Mean relative standard error (`Result.noise`) at which the render ends. A survey that is not in the
        picture judges it, and pixels get samples by their noise. `spp` then is the most on the mean.
    device
        Index or part of the name of an OpenCL device (see `clvol devices`).
    progress
        True for a progress bar, or a callable that receives `clvol.base.progress.Progress` records.
    samples
        (first, count): render only these of the samples. Results of disjoint ranges `merge`.
    pool
        Paths in flight, for measurements. The picture does not depend on it.
    profile
        Find out where the time goes: ``result.profile``.

    Returns
    -------
    Result
        The picture and what is known of it. Ctrl-C finishes the paths in flight and returns the picture so
        far, with ``stats["interrupted"]`` set. A second Ctrl-C does not wait for them and keeps the samples
        that every pixel has. A third raises KeyboardInterrupt.

    Raises
    ------
    OptionError, SceneError, VolumeError, DeviceError
        A choice, sensor, size, scene, volume or device that won't do.
    RenderError
        The render was to end, and no pass of samples ever did.
    """
    given = dict(locals())
    asked = {family: given[family] for family in registry.FAMILIES}
    _check_scene("render", scene)
    scene = viewed(scene, sensor, size)
    for family, name in asked.items():
        registry.check_choice(family, name, pilot=True)
    piloted = asked["technique"] == registry.PILOT
    if piloted:
        asked["technique"] = "auto"
    choices = Choices.for_scene(
        scene, asked, majorant_scale=majorant_scale, step=step, target_error=target_error, aov=aov
    )
    if piloted:
        choices = choices.but(technique="auto")  # the scene's own technique too is put to the test
    if target_error is not None and samples is not None:
        raise OptionError("target_error and samples exclude each other", hint="spp says how many at most")
    first, count = _sample_range(scene, spp, time_limit, samples)
    seed = check_seed(scene.seed if seed is None else seed)
    bar = RichProgress() if progress is True else nullcontext(progress or None)
    profiler = Profiler() if profile else None
    started = time.perf_counter()
    with timed(profiler, "plan"):
        planned = Plan.of(scene, choices)
    spent = time.perf_counter() - started
    with timed(profiler, "device"):
        opened = open_device(device)
    if piloted:
        with bar as callback, timed(profiler, "pilot"):
            choices, found, options = _piloted(opened, scene, choices, seed, count, time_limit, callback)
        planned = planned.having(choices, dict.fromkeys(found.names, "chosen by the pilot"))
    session = Session.for_plan(opened, scene, planned, seed, pool, spent, profiler)
    session.describe()
    session.warn(asked)
    with interruptible() as interrupt:
        with bar as callback, timed(profiler, RENDER):
            interrupt.heed(patience=2)
            if target_error is None:
                done = session.run(first, count, time_limit, callback, interrupt.urgency)
            else:
                done = TargetRender(session, target_error, spp).run(time_limit, callback, interrupt.urgency)
            interrupt.keep()
        with timed(profiler, "picture"):
            result = make_result(session, first, done)
        result.stats["interrupted"] = interrupt.asked()
    result.profile = profiler.profile(result) if profiler else None
    if target_error is not None:
        result.metadata["target_error"] = target_error
    if piloted:
        if target_error is not None:
            extent: dict[str, Any] = {"spp": spp, "time": time_limit}
        else:  # a time limit is repeated by the samples it was enough for
            extent = {"samples": f"{first},{done}"} if first else {"spp": done}
        extent |= {"sensor": sensor, "size": "x".join(map(str, size)) if size is not None else None}
        _say_how_to_repeat(result, scene, found, options | extent | {"seed": seed, "device": device})
    return result


def plan(scene: Scene, **choices: Any) -> Plan:
    """Say what `render` would do for a scene, without a device and before anything is built.

    Parameters
    ----------
    scene : from `load_file` or `load_dict`.
    choices : technique, transmittance, majorant, lookup, absorption, roulette, gathering, background,
        probability, control, sampler, shadow_cache, light_choice, next_event, lanes, majorant_scale, step,
        target_error, aov, as for `render`.

    Returns
    -------
    Plan.  Printed it says the choices with their reasons, what the scene was found to use, and what is
    compiled.  A majorant left at auto is weighed when the volumes are prepared.

    Raises
    ------
    OptionError : a choice that won't do.  What depends on the volumes, as a step that is too fine, `render`
        refuses.  "auto:pilot" is refused: what a pilot chooses is not known before it has rendered.
    TypeError : a keyword that is no choice.
    """
    _check_scene("plan", scene)
    for name in choices:
        if name not in registry.FAMILIES and name not in NUMBERS:
            known = ", ".join((*registry.FAMILIES, *NUMBERS))
            raise TypeError(f"plan() takes the choices of a render ({known}), not {name!r}")
    if choices.get("technique") == registry.PILOT:
        hint = "plan the technique that it chose: the metadata of its render say which"
        raise OptionError("what a pilot chooses is not known before it has rendered", hint=hint)
    names = {family: choices.pop(family, "auto") for family in registry.FAMILIES}
    for family, name in names.items():
        registry.check_choice(family, name)
    return Plan.of(scene, Choices.for_scene(scene, names, **choices))


def _check_scene(function: str, scene: object) -> None:
    if not isinstance(scene, Scene):
        raise OptionError(
            f"{function} takes a Scene, not {type(scene).__name__}",
            hint="make one with load_file or load_dict",
        )


def _say_how_to_repeat(result: Result, scene: Scene, found: Found, options: dict[str, Any]) -> None:
    """What the pilot chose, and the command that renders the same without it."""
    from clvol.lab.repeat import repeat_command

    repeat = repeat_command(scene, found.options, options)
    log.info("repeat with: %s", repeat)
    result.metadata |= {"pilot": found.options, "pilot_reason": found.reason, "repeat": repeat}


def _piloted(
    device: Device,
    scene: Scene,
    choices: Choices,
    seed: int,
    count: int,
    time_limit: float | None,
    callback: ProgressCallback | None,
) -> tuple[Choices, Found, dict[str, Any]]:
    """What a pilot makes of `choices`, what it found, and the options that were given beside it."""
    from clvol.lab.pilot import pilot

    started = time.perf_counter()

    def tell(done: int, total: int) -> None:
        if callback is not None:
            callback(Progress(done, total, time.perf_counter() - started, what="pilot"))

    even = choices.but(target_error=None)  # its trials give every pixel as many samples
    found = pilot(device, scene, even, seed=seed, spp=count, time_limit=time_limit, tell=tell)
    log.info("pilot: %s; %s", ", ".join(f"{k} {v}" for k, v in found.names.items()), found.reason)
    given: dict[str, Any] = {f: n for f, n in choices.names.items() if n != "auto" and f not in found.names}
    if choices.majorant_scale != 1:
        given["majorant_scale"] = choices.majorant_scale
    for name in ("step", "target_error", "aov"):
        given[name] = getattr(choices, name)
    return choices.but(**found.names), found, given


def _sample_range(
    scene: Scene, spp: int | None, time_limit: float | None, samples: tuple[int, int] | None
) -> tuple[int, int]:
    """First sample and how many; a time limit alone sets no end."""
    if samples is not None and spp is not None:
        raise OptionError("spp and samples exclude each other", hint="samples=(first, count) says both")
    if time_limit is not None and time_limit != math.inf:
        positive("time limit ", time_limit, " of seconds")
    if samples is not None:
        if not isinstance(samples, tuple | list) or len(samples) != 2:
            raise OptionError(f"samples={shown(samples)} is not a pair", hint="give (first, count)")
        first, count = samples
    elif time_limit is not None and spp is None:
        first, count = 0, MAX_SAMPLES
    else:
        first, count = 0, scene.spp if spp is None else spp
    try:
        first, count = operator.index(first), operator.index(count)
    except TypeError:
        given = f"not {shown(first)} and {shown(count)}"
        raise OptionError("numbers of samples must be whole", hint=given) from None
    if first < 0 or count < 1 or first + count > MAX_SAMPLES:
        raise OptionError(
            f"cannot render {count} samples per pixel from sample {first} on",
            hint=f"give at least 1 sample, and at most {MAX_SAMPLES} in all",
        )
    return first, count
