"""What a picture is spread over, whether devices or machines."""

from __future__ import annotations

from typing import TYPE_CHECKING, Protocol, TypeVar

if TYPE_CHECKING:
    from clvol.cluster.job import About
    from clvol.picture.parts import Part

Handle = TypeVar("Handle")
"""Stands for sums that are, or will be, with some worker."""


class Workers(Protocol[Handle]):
    """Render ranges of one job, and add their sums."""

    def room(self, left: int) -> int:
        """How many ranges may be handed out now, of `left` that are."""

    def idle(self) -> bool:
        """Whether some worker has nothing to do, and could do what another has begun."""

    def render(self, first: int, count: int, seed: int) -> Handle:
        """Hand out a range of the samples of a seed."""

    def add(self, handles: list[Handle]) -> Handle:
        """Add sums, in this order."""

    def wait(self, seconds: float) -> list[Handle]:
        """Ranges that came to an end meanwhile."""

    def is_there(self, handle: Handle) -> bool:
        """Whether the sums are there, or will be, and not lost.  Raises clvol.Error for faults."""

    def samples(self, handle: Handle) -> int:
        """Samples of a pixel in the sums of a range, which may have been ended early; 0 for none."""

    def part(self, handle: Handle) -> Part | None:
        """The sums; None where they are lost."""

    def about(self) -> About | None:
        """What a worker said of the job; None as long as none has."""

    def hurry(self, level: int, handle: Handle | None = None) -> None:
        """Ask for an end, of one range or of all, as `Wavefront.passes` takes it."""

    def close(self) -> None:
        """Give up what is not done, and free what the job takes."""
