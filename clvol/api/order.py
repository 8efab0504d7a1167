"""What a caller asked of a render: checked at once, planned, and opened on a device."""

from __future__ import annotations

import logging
import time
from dataclasses import dataclass
from functools import partial
from typing import TYPE_CHECKING, Any

from clvol.api.extent import check_alone, sample_range
from clvol.api.rescue import rescued
from clvol.api.resuming import Before, check_same, checkpoint_of, resumable, what_is_left
from clvol.api.sharing import check_spread, is_spread
from clvol.base.arguments import check_seed, flag
from clvol.base.progress import Glance, Progress
from clvol.cluster.link import check_client
from clvol.device.device import open_device
from clvol.device.driver import driver_errors
from clvol.errors import DeviceError, OptionError, RenderError
from clvol.picture.denoising import FEATURES, need_denoiser
from clvol.picture.merging import merge
from clvol.planning import registry
from clvol.planning.choices import Choices
from clvol.planning.plan import Plan
from clvol.rendering.adaptive import TargetRender
from clvol.rendering.checkpoint import is_checkpoint
from clvol.rendering.outcome import make_result
from clvol.rendering.profiler import timed
from clvol.rendering.session import MAX_SAMPLES, Session
from clvol.scene.records import Batch, Scene
from clvol.scene.views import View, parts_of, viewed

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator, Mapping

    from clvol.base.progress import ProgressCallback
    from clvol.device.device import Device
    from clvol.lab.pilot import Found
    from clvol.picture.result import Result
    from clvol.rendering.checkpoint import Checkpoint, Saved
    from clvol.rendering.profiler import Profiler

log = logging.getLogger("clvol")


@dataclass(frozen=True, eq=False)
class Order:
    """What to render, and how.

    Parameters
    ----------
    asked : names by family, as they were given.
    choices : of them, and of the scene's own.
    piloted : a pilot is to choose technique, transmittance and majorant.
    first, count : samples of each pixel; `spp` is what was given instead.
    transparent : the background was asked to be so.
    denoise : its results get their layer `denoised`.
    spread : it is rendered in ranges of samples, that are added: by several devices or workers of a `client`,
        or by one device where it is several pictures side by side.
    """

    scene: Scene
    asked: dict[str, str]
    choices: Choices
    piloted: bool
    first: int
    count: int
    spp: int | None
    seed: int
    time_limit: float | None
    sensor: View | None
    size: tuple[int, int] | None
    transparent: bool
    denoise: bool
    device: Any
    client: Any
    spread: bool
    pool: int | None
    resumed: Result | None
    checkpoint: Checkpoint | None
    saved: Saved | None

    @classmethod
    def of(cls, function: str, scene: object, given: Mapping[str, Any]) -> Order:
        """Check what `function` was given: a scene, and the options of `clvol.render` by name.

        Raises
        ------
        OptionError, SceneError
            Something that won't do, as far as can be told without a device.
        """
        check_alone(given)
        scene = viewed(check_scene(function, scene), given["sensor"], given["size"], given["background"])
        if batch := isinstance(scene.sensor, Batch):
            check_spread(given, batch)
        asked = {family: given[family] for family in registry.FAMILIES}
        transparent = asked["background"] == registry.TRANSPARENT
        if transparent:
            asked["background"] = "auto"
        piloted = asked["technique"] == registry.PILOT
        if piloted:
            asked["technique"] = "auto"
        numbers = {name: given[name] for name in ("majorant_scale", "step", "target_error", "aov")}
        choices = Choices.for_scene(scene, asked, **numbers)
        if piloted:
            choices = choices.but(technique="auto")  # the scene's own technique too is put to the test
        denoise = _denoises(given["denoise"])
        spp, time_limit = given["spp"], given["time_limit"]
        first, count = sample_range(scene.spp, spp, time_limit, given["samples"])
        resumed = None
        if given["resume"] is not None and not is_checkpoint(given["resume"]):
            resumed = resumable(given["resume"])
            first, count = what_is_left(resumed, count)
        seed = check_seed(scene.seed if given["seed"] is None else given["seed"])
        checkpoint, saved = checkpoint_of(given, scene, first, count)
        return cls(
            scene=scene,
            asked=asked,
            choices=choices,
            piloted=piloted,
            first=first,
            count=count,
            spp=spp,
            seed=seed,
            time_limit=time_limit,
            sensor=given["sensor"],
            size=given["size"],
            transparent=transparent,
            denoise=denoise,
            device=given["device"],
            client=None if given["client"] is None else check_client(given["client"]),
            spread=batch or is_spread(given),
            pool=given["pool"],
            resumed=resumed,
            checkpoint=checkpoint,
            saved=saved,
        )

    def planned(self) -> Plan:
        """What is to be done, as far as it is known without a device and a pilot."""
        plan = Plan.of(parts_of(self.scene)[0], self.choices)
        if self.denoise and plan.guides_denoiser:
            plan = plan.having(self.choices.but(aov=tuple(dict.fromkeys((*self.choices.aov, *FEATURES)))))
        return plan

    def open(self, callback: ProgressCallback | None, profiler: Profiler | None = None) -> Opened:
        """Plan it, and make it ready on the device; `callback` is told of a pilot."""
        started = time.perf_counter()
        with timed(profiler, "plan"):
            plan = self.planned()
        spent = time.perf_counter() - started
        with timed(profiler, "device"):
            device = open_device(self.device)
        found = None
        if self.piloted:
            with timed(profiler, "pilot"):
                found = self._pilot(device, callback)
            log.info("pilot: %s; %s", ", ".join(f"{k} {v}" for k, v in found.names.items()), found.reason)
            reasons = dict.fromkeys(found.names, "chosen by the pilot")
            plan = plan.having(plan.choices.but(**found.names), reasons)
        bounded = self.time_limit is None and plan.choices.target_error is None
        spp = self.count if bounded else None
        session = Session.for_plan(device, self.scene, plan, self.seed, self.pool, spent, profiler, spp)
        if self.resumed is not None:
            check_same(Before.of(self.resumed), session)
        if self.saved is not None:
            check_same(Before.saved(self.saved, session), session)
            self.saved.put_back(session)
            log.info("%s has %d samples of each pixel", self.saved.path, self.saved.done)
        session.describe()
        session.warn(self.asked)
        return Opened(self, session, found)

    def _pilot(self, device: Device, callback: ProgressCallback | None) -> Found:
        """What a pilot makes of the choices."""
        from clvol.lab.pilot import pilot

        started = time.perf_counter()

        def tell(done: int, total: int) -> None:
            if callback is not None:
                callback(Progress(done, total, time.perf_counter() - started, what="pilot"))

        even = self.choices.but(target_error=None)  # its trials give every pixel as many samples
        return pilot(
            device,
            self.scene,
            even,
            seed=self.seed,
            spp=self.count,
            time_limit=self.time_limit,
            tell=tell,
        )


@dataclass(eq=False)
class Opened:
    """An order on its device; `found`: what a pilot chose."""

    order: Order
    session: Session
    found: Found | None

    def steps(self, callback: ProgressCallback | None, urgency: Callable[[], int]) -> Iterator[int]:
        """Render, and stop wherever the picture has more samples: at how many of each pixel, on the mean."""
        done = 0
        try:
            for done in self._steps(callback, urgency):
                yield done
        except DeviceError as error:
            order, picture = self.order, partial(self.result, done, final=False)
            raise rescued(error, self.session, order.checkpoint, order.first, done, picture) from error

    def _steps(self, callback: ProgressCallback | None, urgency: Callable[[], int]) -> Iterator[int]:
        order, session, target = self.order, self.session, self.order.choices.target_error
        if target is not None:
            render = TargetRender(session, target, order.spp)
            with driver_errors(session.device.description):
                yield from render.steps(order.time_limit, callback, urgency)
            return
        had = 0 if order.resumed is None else order.resumed.samples[1]
        total = had + order.count if order.first + order.count < MAX_SAMPLES else None
        for done in self._done(urgency):
            if callback is not None:
                with Glance(partial(self.result, done, final=False), callback) as glance:
                    so_far = had + done, total, session.seconds, order.time_limit
                    callback(Progress(*so_far, glance=glance))
            yield done

    def _done(self, urgency: Callable[[], int]) -> Iterator[int]:
        """Render what the film has from no checkpoint, and leave checkpoints: how many samples are done."""
        order, session = self.order, self.session
        done = had = 0 if order.saved is None else order.saved.done
        if had == order.count:
            session.seconds = session.earlier
            yield had
            return
        try:
            for more in session.passes(order.first + had, order.count - had, order.time_limit, urgency):
                done = had + more
                if order.checkpoint is not None:
                    order.checkpoint.offer(session, order.first, done)
                yield done
        except RenderError:  # ended before anything new was finished
            if not had or done > had:
                raise
            yield had
        if order.checkpoint is not None:
            order.checkpoint.offer(session, order.first, done, last=True)

    def result(self, done: int, final: bool = True) -> Result:
        """The picture at so many samples, and those that it goes on from."""
        order = self.order
        result = make_result(self.session, order.first, done, final)
        if order.choices.target_error is not None:
            result.metadata["target_error"] = order.choices.target_error
        if self.found is not None:
            from clvol.lab.repeat import repeat_command

            repeat = repeat_command(order.scene, self.found.options, self._other_options(done))
            result.metadata |= {
                "pilot": self.found.options,
                "pilot_reason": self.found.reason,
                "repeat": repeat,
            }
            if final:
                log.info("repeat with: %s", repeat)
        if order.resumed is not None:
            result = merge([order.resumed, result])
        return result.denoise() if order.denoise else result

    def _other_options(self, done: int) -> dict[str, Any]:
        """What was asked for beside what the pilot chose, as options of the command line."""
        order, choices = self.order, self.order.choices
        assert self.found is not None
        given: dict[str, Any] = {
            f: n for f, n in choices.names.items() if n != "auto" and f not in self.found.names
        }
        if choices.majorant_scale != 1:
            given["majorant_scale"] = choices.majorant_scale
        given |= {name: getattr(choices, name) for name in ("step", "target_error", "aov")}
        if choices.target_error is not None:
            given |= {"spp": order.spp, "time": order.time_limit}
        elif order.first:  # a time limit is repeated by the samples it was enough for
            given["samples"] = f"{order.first},{done}"
        else:
            given["spp"] = done
        if order.transparent:
            given["background"] = registry.TRANSPARENT
        size = None if order.size is None else "x".join(map(str, order.size))
        sensor = order.sensor if isinstance(order.sensor, int) else None
        return given | {"sensor": sensor, "size": size, "seed": order.seed, "device": order.device}


def _denoises(asked: bool) -> bool:
    """Whether results are denoised; OptionError where they cannot be."""
    if flag("denoise", asked):
        need_denoiser()
    return bool(asked)


def check_scene(function: str, scene: object) -> Scene:
    """`scene` if it is one; OptionError, which names the function, otherwise."""
    if not isinstance(scene, Scene):
        raise OptionError(
            f"{function} takes a Scene, not {type(scene).__name__}",
            hint="make one with load_file or load_dict",
        )
    return scene
