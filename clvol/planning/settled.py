"""What a plan learns after it is made: from the volumes, once they are prepared, and from the device."""

from __future__ import annotations

from dataclasses import dataclass

FAR_APART = 1e4
"""Ratio of two channels' largest extinctions in a medium beyond which one path does not serve both.  Much of
what the thin channel scatters lies deeper than the dense ones reach, where a path that follows all collides
by chance only.  In a cube of optical depths 100, 50 and 100 r under a sun, six analytic renders of 2,048
samples fell short of the thin channel by 11, 20, 57 and 81 % at r = 1e-3, 1e-4, 1e-5 and 1e-6, and said 4,
12, 12 and 3 %."""


THIN = 1.0
"""Optical depth across a medium up to which what camera rays meet is most of the noise, and worth twice as
many look-ups."""


@dataclass(frozen=True)
class Settled:
    """What only the volumes show.

    Parameters
    ----------
    majorant : the kind that is walked, "none" where no medium is heterogeneous.
    costs : expected cost per ray of each kind that was weighed for "auto".
    channels_apart : ratio of two channels' largest extinctions, in the medium where it is largest.
    top_trees : some volume's top grid is a tree.
    depth : optical depth across the medium, on the mean, where there is one; about.
    tree_grid : the majorant is a grid whose cells are found through a tree.
    """

    majorant: str = "none"
    costs: tuple[tuple[str, float], ...] = ()
    channels_apart: float = 1.0
    top_trees: bool = False
    tree_grid: bool = False
    depth: float = float("inf")

    @property
    def reason(self) -> str:
        """Why the majorant, where it was weighed."""
        least = min((cost for _, cost in self.costs), default=0.0) or 1.0
        relative = ", ".join(f"{name} {cost / least:.2f}" for name, cost in self.costs)
        return f"auto: expected cost per ray relative to it: {relative}"


@dataclass(frozen=True)
class Tuning:
    """What the kind of device decides.

    Parameters
    ----------
    local_size : work-items of a group.  group_slots : path slots of a group.
    lanes : paths that a work-item walks at once where that is left to the device; 0: one after the other.
    known : a device has been asked; the sizes are a guess before.
    """

    local_size: int = 1
    group_slots: int = 256
    lanes: int = 0
    known: bool = True
