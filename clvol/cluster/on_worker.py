"""What runs on the workers of a Dask cluster: a worker renders one range at a time."""

from __future__ import annotations

import threading
from typing import TYPE_CHECKING

from clvol.cluster.job import Renderer, Stopped, UnfitError
from clvol.errors import Error
from clvol.version import __version__

if TYPE_CHECKING:
    from clvol.cluster.job import About, Job
    from clvol.picture.parts import Part

turn = threading.Lock()
"""A worker renders one range at a time, with all of its device."""
_ready: dict[str, Renderer] = {}
"""The renderer of the last job, by the job's name."""
_LOOKING_SECONDS = 0.05
"""How often who waits for its turn looks whether it needs one."""
_levels: dict[str, int] = {}
"""How urgently ends were asked for: of jobs by their names, and of ranges by their keys."""


def _here() -> str:
    """How messages call the worker."""
    from distributed import get_worker

    return f"worker {get_worker().address}"


def check_version(version: str) -> None:
    """UnfitError where another version of clvol is here than asks."""
    if version != __version__:
        raise UnfitError(
            f"has clvol {__version__}, and {version} renders",
            hint=f"install the same on all: pip install 'clvol[cluster]=={version}'",
        )


def urgency_of(*names: str) -> int:
    """How urgently an end was asked for, of a job or of a task."""
    return max(_levels.get(name, 0) for name in names)


def task_key() -> str:
    """The key of the task that calls this."""
    from distributed import get_worker

    return str(get_worker().get_current_task())


def forget_jobs() -> None:
    """Free what earlier jobs have on the device; for whose turn it is."""
    _ready.clear()


def _renderer(job: Job) -> Renderer:
    check_version(job.version)
    if job.name not in _ready:
        forget_jobs()  # their memory is needed
        _ready[job.name] = Renderer(job)
    return _ready[job.name]


def told_from_here(error: Error) -> Error:
    """The same error, which says where it was."""
    where = f"{_here()}: {error.where}" if error.where else _here()
    return type(error)(error.what, where, error.hint)


def about(job: Job) -> About:
    """What the worker makes of a job; it waits for no range of that job, whose time limit waits for it."""
    while not turn.acquire(timeout=_LOOKING_SECONDS):
        if (ready := _ready.get(job.name)) is not None:
            return ready.about()
    try:
        return _renderer(job).about()
    except Error as error:
        raise told_from_here(error) from None
    finally:
        turn.release()


def part_of_range(job: Job, first: int, count: int, seed: int) -> Part:
    """The sums of a range, once it is this task's turn."""
    key = task_key()

    def urgency() -> int:
        return urgency_of(job.name, key)

    with turn:
        try:
            if urgency() > 1:
                raise Stopped("was to end before it began")
            return _renderer(job).part(first, count, seed, urgency)
        except Error as error:
            raise told_from_here(error) from None
        finally:
            forget_task(key)


def forget_task(key: str) -> None:
    """A task is done: an end that was asked of it counts no longer."""
    _levels.pop(key, None)


def samples(part: Part) -> int:
    """Of a pixel, in sums that stay where they are."""
    return part.samples


def hurry(name: str, level: int) -> None:
    """Ask for an end, of a job by its name or of a range by its key, also of one that has not come yet."""
    _levels[name] = level


def forget(name: str) -> None:
    """End what is left of a job, and free its device; where it renders, once it does not."""
    _levels[name] = 3

    def free() -> None:
        with turn:
            _ready.pop(name, None)

    threading.Thread(target=free, daemon=True).start()
