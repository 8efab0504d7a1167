"""What a worker needs to render any range of a picture, and the worker's own side of it."""

from __future__ import annotations

import threading
import time
import uuid
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

from clvol.device.device import open_device
from clvol.errors import OptionError, RenderError, Told
from clvol.picture.beside import beside
from clvol.picture.parts import Part
from clvol.planning.in_force import warnings
from clvol.planning.plan import Plan
from clvol.rendering.doubts import Expected
from clvol.rendering.outcome import make_result
from clvol.rendering.residence import staying
from clvol.rendering.session import Session
from clvol.scene.digest import scene_digest
from clvol.scene.views import parts_of
from clvol.version import __version__

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping

    from clvol.device.device import Device
    from clvol.planning.choices import Choices
    from clvol.scene.records import Scene


class Stopped(RenderError):  # noqa: N818
    """A range that was given up before any of its samples was done."""


class UnfitError(OptionError):
    """A worker that can render nothing of what it is asked for."""


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


def seed_of_part(seed: int, number: int) -> int:
    """Of the picture with that number, of those side by side: the first has the seed itself."""
    return (seed + number * _PART_SEED) % 2**64


class Renderer:
    """A job on one device, ready: one range at a time.

    Opening takes what the scene needs on the device, until the object is gone.  Pictures that stand side by
    side have a session each, which share what the scene takes.
    """

    def __init__(self, job: Job, device: Device | None = None) -> None:
        with _opening, staying(job.scene):  # what is worked out of a scene is kept with it, for all devices
            self.job, self._begun = job, False
            device = device or open_device(job.device)
            pictures = parts_of(job.scene)
            self._sessions = [
                Session.for_plan(
                    *(device, one, Plan.of(one, job.choices), job.seed, job.pool),
                    spp=job.spp,
                    sharing=len(pictures) - n,
                )
                for n, one in enumerate(pictures)
            ]

    def about(self) -> About:
        """What it does, in words."""
        session, more = self._sessions[0], len(self._sessions) - 1
        plans = [one.plan for one in self._sessions]
        said = dict.fromkeys(Told(line) for plan in plans for line in warnings(plan, self.job.asked))
        lines = [*session.plan.describe(), *([f"and {more} more pictures beside this one"] if more else [])]
        return About(session.device.description, tuple(lines), tuple(said), Expected.of(session))

    def part(self, first: int, count: int, seed: int, urgency: Callable[[], int]) -> Part:
        """The sums of `count` samples of a seed from `first` on; of fewer where an end is asked for.

        Raises `Stopped` where it is asked for before the first is done.
        """
        if urgency() > (not self._begun):  # at least one is, or there might be no picture
            raise Stopped("was to end before it began")
        self._begun = True
        for number, session in enumerate(self._sessions):
            session.restart(seed_of_part(seed, number))
        try:
            run = self._side_by_side if len(self._sessions) > 1 else self._sessions[0].run
            done = run(first, count, None, urgency)
        except (KeyboardInterrupt, RenderError):
            if not urgency():
                raise
            raise Stopped("was to end before its first samples did") from None
        parts = [Part.of(make_result(session, first, done, final=False)) for session in self._sessions]
        for session in self._sessions:
            session.setup_seconds = session.kernel_seconds = session.earlier = 0.0  # the first range has them
            session.uploaded = session.built = 0
        about = {"digest": scene_digest(self.job.scene), "seed": seed}
        return beside(parts, about) if len(parts) > 1 else parts[0]

    def _side_by_side(self, first: int, count: int, _limit: None, urgency: Callable[[], int]) -> int:
        """Render as `Session.run` does, every picture the same samples: in rounds, which end together."""
        done, step = 0, 1
        while done < count and not (done and urgency()):
            step, started = min(step, count - done), time.perf_counter()
            for session in self._sessions:
                if session.run(first + done, step, None, lambda: 3 if urgency() > 2 else 0) < step:
                    raise KeyboardInterrupt
                session.earlier = session.seconds
            done += step
            step *= 2 if time.perf_counter() - started < _ROUND_SECONDS / 2 else 1
        return done


_PART_SEED = 0xD1B54A32D192ED03
"""Between seeds of pictures side by side: their noise is independent."""
_ROUND_SECONDS = 0.5
"""About how long all pictures render before the first goes on."""
_opening = threading.Lock()
