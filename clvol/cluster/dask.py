"""The workers of a Dask cluster: how ranges get there."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from clvol.cluster import on_worker
from clvol.cluster.job import Stopped
from clvol.cluster.link import Link, in_our_words
from clvol.errors import RenderError
from clvol.picture.parts import sum_of

if TYPE_CHECKING:
    from clvol.cluster.job import About, Job
    from clvol.picture.parts import Part

_MOST_LOSSES = 20
"""Times in a row that all workers that have the scene may go away before the render ends."""


class DaskWorkers(Link):
    """The workers that a `distributed.Client` knows.

    Raises OptionError for what is no client, or one that is closed.
    """

    def __init__(self, job: Job, client: Any) -> None:
        super().__init__(client, job.name)
        self.job = job
        self._scene: Any = None
        self._given: dict[str, Any] = {}  # the scene that each range was handed out with, by its key
        self._about: Any = None
        self._losses = 0

    def render(self, first: int, count: int, seed: int) -> Any:
        """Hand out a range."""
        if self._scene is None:
            self._scene = self.scatter(self.job, everywhere=True)
            self._about = self.submit(on_worker.about, self._scene, key="about", priority=20)
        key = f"{first}-{count}"
        future = self.hand_out(on_worker.part_of_range, self._scene, first, count, seed, key=key)
        self._given[future.key] = self._scene
        return future

    def add(self, handles: list[Any]) -> Any:
        """Have a worker add sums."""
        return self.submit(sum_of, handles, key="sum", priority=10)

    def is_there(self, handle: Any) -> bool:
        """Whether a worker has, or will have, the sums; raises what is wrong, in our words."""
        if handle.status == "finished":
            self._losses = 0
        if handle.status in ("finished", "pending"):
            return True
        if handle.status == "error":
            error = handle.exception()
            if isinstance(error, Stopped):
                return False
            raise in_our_words(error)
        self.check()
        if self._scene is not None and self._given.get(handle.key) is self._scene:
            self._losses += 1
            self._scene = None  # all that had it are gone
            if self._losses > _MOST_LOSSES:
                raise RenderError("all workers went away again and again, and what they had with them")
        return False

    def samples(self, handle: Any) -> int:
        """Samples of a pixel in the sums."""
        found: int = self.submit(on_worker.samples, handle, key="samples", priority=20).result()
        return found

    def part(self, handle: Any) -> Part | None:
        """The sums, brought here; None where they are lost."""
        from concurrent.futures import CancelledError

        try:
            part: Part = handle.result()
        except CancelledError:
            self.check()
            return None
        except Exception as error:
            raise in_our_words(error) from error
        return part

    def about(self) -> About | None:
        """What the first worker that was ready said."""
        if self._about is None or self._about.status == "pending":
            return None
        if self._about.status == "error":
            raise in_our_words(self._about.exception())
        found: About | None = self._about.result() if self._about.status == "finished" else None
        return found
