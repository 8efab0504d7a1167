"""`clvol.render`: from a scene and the user's choices to a Result; `clvol.plan`: to what it would do."""

from __future__ import annotations

import inspect
from contextlib import AbstractContextManager, nullcontext
from typing import TYPE_CHECKING, Any, overload

from clvol.api.order import Order, check_scene
from clvol.api.spreading import opened
from clvol.base.arguments import flag
from clvol.base.interrupts import interruptible
from clvol.base.notebook import progress_bar
from clvol.errors import OptionError, UnknownOptionError, shown
from clvol.picture.profile import RENDER
from clvol.planning import registry
from clvol.planning.choices import NUMBERS, Choices
from clvol.planning.plan import Plan
from clvol.rendering.profiler import Profiler, timed
from clvol.rendering.residence import staying
from clvol.scene.views import before, parts_of, viewed

if TYPE_CHECKING:
    from collections.abc import Sequence
    from os import PathLike

    from clvol.base.progress import ProgressCallback
    from clvol.picture.result import Result
    from clvol.scene.records import Scene
    from clvol.scene.views import View


@overload
def render(scene: Scene, *, sensor: list[View] | tuple[View, ...], **options: Any) -> list[Result]: ...


@overload
def render(scene: Scene, *, sensor: View | None = None, **options: Any) -> Result: ...


def render(  # type: ignore[misc]  # the options of several views are those of one
    scene: Scene,
    *,
    spp: int | None = None,
    seed: int | None = None,
    sensor: View | Sequence[View] | None = None,
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
    lamp_edges: str = "auto",
    lanes: str = "auto",
    majorant_scale: float = 1.0,
    step: float | None = None,
    aov: Sequence[str] = (),
    time_limit: float | None = None,
    target_error: float | None = None,
    denoise: bool = False,
    device: str | Sequence[str | int] | None = None,
    client: Any = None,
    progress: bool | ProgressCallback = False,
    samples: tuple[int, int] | None = None,
    resume: Result | str | PathLike[str] | None = None,
    checkpoint: str | PathLike[str] | None = None,
    checkpoint_every: float = 60.0,
    pool: int | None = None,
    profile: bool = False,
) -> Result | list[Result]:
    """Render a scene.

    Parameters
    ----------
    scene
        From `load_file` or `load_dict`.
    spp, seed
        Samples per pixel and 64-bit seed. They default to the scene's.
    sensor
        Which of the scene's sensors sees it, from 0; the numbers after them are those of sensors inside of a
        batch. The default is the first. Or a dict: a sensor as `load_dict` takes it; or without a "type" what
        is other than in the scene's sensor, by the names of `traverse`, as ``{"to_world": …}``. Or a list of
        these: the scene is built once for all views.
    size
        Pixels (width, height) instead of those of the scene's film. The field of view stays along the axis
        that it is given for.
    technique, transmittance, majorant, lookup, absorption, roulette, gathering, background, probability,
    control
        Names from `clvol.planning.registry`. "auto" takes the scene's own choice, else follows fixed rules,
        so that the same seed gives the same bits. Technique "auto:pilot" has a short measured pilot choose
        technique, transmittance and majorant, where they are left at "auto". ``result.metadata["repeat"]``
        says what it chose. Background "transparent" leaves out the environment behind all there is, which
        still lights it: ``result.alpha`` says how much of a pixel is covered.
    sampler, shadow_cache, light_choice, next_event, lamp_edges, lanes
        Names from there too.
    majorant_scale
        Multiplies every bound of the density, for experiments. A factor below 1 is only for techniques and
        transmittances that stay unbiased there.
    step
        World length of a step of ray marching. The default is the edge of a voxel.
    aov
        Names from `clvol.planning.registry.AOVS` to add to ``result.aovs``. They are means per sample
        ("largest_weight": maxima).
    denoise
        Add ``result.denoised``, to be looked at, by Open Image Denoise: the extra `denoise`.
    time_limit
        Seconds after which no new pass of samples is begun. Alone it replaces `spp`. Passes begun are
        finished, unless paths go on for more than 10 seconds (30 where no pass is finished yet).
    target_error
        Mean relative standard error (`Result.noise`) at which the render ends. A survey that is not in the
        picture judges it, and pixels get samples by their noise. `spp` then is the most on the mean.
    device
        Index or part of the name of an OpenCL device (see `clvol devices`). "all", or a list of these: ranges
        of samples are dealt out to several, by how fast they are; the bits are those of one of their kind
        that is given as a list.
    client
        A `distributed.Client`: the workers of a Dask cluster share the samples, with bits that do not depend
        on how many they are: those that `merge` makes of the same ranges. With a `target_error`
        every pixel then gets as many samples. Not with checkpoints, a pilot or a profile.
    progress
        True for a progress bar, in a terminal or a notebook; or a callable that receives
        `clvol.base.progress.Progress` records: how far the render is, its ``image`` so far, its ``noise``.
    samples
        (first, count): render only these of the samples. Results of disjoint ranges `merge`.
    resume
        A picture to go on from, of this scene and seed: a `Result`, or an .exr that has one. Its samples
        count towards `spp`, those that it lacks are rendered, and the result has all. Or a checkpoint's file:
        the result has the bits of a render that nothing ended.
    checkpoint, checkpoint_every
        A file that keeps what the render has, written anew every so many seconds and at the end. If it is
        there, of this scene, seed, choices and version of clvol, the render goes on from it, to the bits of
        one that nothing ended. Not with a `target_error`.
    pool
        Paths in flight, for measurements. The picture does not depend on it.
    profile
        Find out where the time goes: ``result.profile``.

    Returns
    -------
    Result, or a list of them where `sensor` is a list
        The picture and what is known of it. Ctrl-C finishes the paths in flight and returns the picture so
        far, with ``stats["interrupted"]`` set. A second Ctrl-C does not wait for them and keeps the samples
        that every pixel has. A third raises KeyboardInterrupt. A film that has no room on the device is
        rendered in bands of rows, to the same bits: ``metadata["bands"]`` says how many there were, and a
        pass is a round over all of them.

    Raises
    ------
    OptionError, SceneError, VolumeError, DeviceError
        A choice, sensor, size, scene, volume or device that won't do.
    RenderError
        The render was to end, and no pass of samples ever did.
    """
    given = dict(locals())
    if isinstance(sensor, list | tuple):
        return _views(**given)
    order = Order.of("render", scene, given)
    bar = _bar(progress)
    profiler = Profiler() if flag("profile", profile) else None
    with bar as callback, opened(order, callback, profiler) as render:
        if order.resumed is not None and not order.count:
            order.resumed.stats["interrupted"] = False
            return order.resumed
        with interruptible() as interrupt:
            interrupt.heed(patience=2)
            done = 0
            with timed(profiler, RENDER):
                for done in render.steps(callback, interrupt.urgency):  # noqa: B007
                    pass
                interrupt.keep()
            with timed(profiler, "picture"):
                result = render.result(done)
            result.stats["interrupted"] = interrupt.asked()
    result.profile = profiler.profile(result) if profiler else None
    return result


def defaults() -> dict[str, Any]:
    """The options of `render`, by name."""
    given = inspect.signature(render).parameters
    return {name: parameter.default for name, parameter in given.items() if name != "scene"}


def _bar(progress: object) -> AbstractContextManager[ProgressCallback | None]:
    """What shows progress, if anything; OptionError for what cannot."""
    if progress is None or isinstance(progress, bool):
        return progress_bar() if progress else nullcontext()
    if not callable(progress):
        hint = "give True, or a function that takes a record"
        raise OptionError(f"progress={shown(progress)} is no function", hint=hint)
    return nullcontext(progress)


def _views(scene: Scene, sensor: Sequence[View], **options: Any) -> list[Result]:
    """One view after the other, until one is ended early; all are looked at before the first is rendered."""
    check_scene("render", scene)
    if not sensor:
        raise OptionError("there is no view to render: the list of sensors is empty")
    for name in ("resume", "checkpoint"):
        if options[name] is not None:
            raise OptionError(f"{name} is of one picture", hint="render one view at a time")
    for one in sensor:
        viewed(scene, one, options["size"])
    found: list[Result] = []
    with interruptible(), staying(scene):
        for one in sensor:
            found.append(render(scene, sensor=one, **options))
            if found[-1].stats["interrupted"]:
                break
    return found


def plan(scene: Scene, **choices: Any) -> Plan:
    """Say what `render` would do for a scene, without a device and before anything is built.

    Parameters
    ----------
    scene : from `load_file` or `load_dict`.
    choices : technique, transmittance, majorant, lookup, absorption, roulette, gathering, background,
        probability, control, sampler, shadow_cache, light_choice, next_event, lamp_edges, lanes,
        majorant_scale, step, target_error, aov, as for `render`.

    Returns
    -------
    Plan.  Printed it says the choices with their reasons, what the scene was found to use, and what is
    compiled.  A majorant left at auto is weighed when the volumes are prepared.  Of a batch of sensors it is
    the first one's.

    Raises
    ------
    OptionError : a choice that won't do.  What depends on the volumes, as a step that is too fine, `render`
        refuses.  "auto:pilot" is refused: what a pilot chooses is not known before it has rendered.
    UnknownOptionError : a keyword that is no choice; a TypeError as well.
    """
    scene = check_scene("plan", scene)
    for name in choices:
        if name not in registry.FAMILIES and name not in NUMBERS:
            known = ", ".join((*registry.FAMILIES, *NUMBERS))
            raise UnknownOptionError(f"plan takes the choices of a render ({known}), not {name!r}")
    if choices.get("technique") == registry.PILOT:
        hint = "plan the technique that it chose: the metadata of its render say which"
        raise OptionError("what a pilot chooses is not known before it has rendered", hint=hint)
    names = {family: choices.pop(family, "auto") for family in registry.FAMILIES}
    if names["background"] == registry.TRANSPARENT:
        scene, names["background"] = before(scene, registry.TRANSPARENT), "auto"
    for family, name in names.items():
        registry.check_choice(family, name)
    return Plan.of(parts_of(scene)[0], Choices.for_scene(scene, names, **choices))
