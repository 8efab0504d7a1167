"""What a worker needs to render any range of a picture, and the worker's own side of it."""

from __future__ import annotations

import threading
import uuid
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

from clvol.device.device import open_device
from clvol.errors import RenderError, Told
from clvol.picture.parts import Part
from clvol.planning.in_force import warnings
from clvol.planning.plan import Plan
from clvol.rendering.doubts import Expected
from clvol.rendering.outcome import make_result
from clvol.rendering.session import Session
from clvol.version import __version__

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping

    from clvol.device.device import Device
    from clvol.planning.choices import Choices
    from clvol.scene.records import Scene


class Stopped(RenderError):  # noqa: N818
    """A range that was given up before any of its samples was done."""


@dataclass(frozen=True, eq=False)
class Job:
    """A picture to render ranges of.

    Parameters
    ----------
    asked : names by family that the caller gave, for warnings.
    device : of each worker, as `open_device` takes it.
    spp : how many samples of a pixel there will be at most; None where nobody knows.
    name : tells it from other jobs.
    version : of clvol, which every worker must have.
    """

    scene: Scene
    choices: Choices
    seed: int
    asked: Mapping[str, str]
    device: str | None = None
    pool: int | None = None
    spp: int | None = None
    name: str = field(default_factory=lambda: uuid.uuid4().hex)
    version: str = __version__

    @property
    def pixels(self) -> int:
        """Of the picture."""
        width, height = self.scene.film.window[2:]
        return width * height


@dataclass(frozen=True)
class About:
    """How a worker renders a job, for the log."""

    device: str
    plan: tuple[str, ...]
    warnings: tuple[Told, ...]
    expected: Expected


class Renderer:
    """A job on one device, ready: one range at a time.

    Opening takes what the scene needs on the device, until the object is gone.
    """

    def __init__(self, job: Job, device: Device | None = None) -> None:
        with _opening:  # what is worked out of a scene is kept with it, for all devices
            self.job, self._begun = job, False
            device = device or open_device(job.device)
            plan = Plan.of(job.scene, job.choices)
            self._session = Session.for_plan(device, job.scene, plan, job.seed, job.pool, spp=job.spp)

    def about(self) -> About:
        """What it does, in words."""
        session = self._session
        said = tuple(Told(line) for line in warnings(session.plan, self.job.asked))
        lines = tuple(session.plan.describe())
        return About(session.device.description, lines, said, Expected.of(session))

    def part(self, first: int, count: int, seed: int, urgency: Callable[[], int]) -> Part:
        """The sums of `count` samples of a seed from `first` on; of fewer where an end is asked for.

        Raises `Stopped` where it is asked for before the first is done.
        """
        if urgency() > (not self._begun):  # at least one is, or there might be no picture
            raise Stopped("was to end before it began")
        self._begun, session = True, self._session
        session.restart(seed)
        try:
            done = session.run(first, count, None, urgency)
        except (KeyboardInterrupt, RenderError):
            if not urgency():
                raise
            raise Stopped("was to end before its first samples did") from None
        part = Part.of(make_result(session, first, done, final=False))
        session.setup_seconds = session.kernel_seconds = 0.0  # which the first range has
        session.uploaded = session.built = 0
        return part


_opening = threading.Lock()
