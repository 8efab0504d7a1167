"""What the cells of a majorant have to carry."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Literal

if TYPE_CHECKING:
    from clvol.accel.controls import Control, ResidualControl


@dataclass(frozen=True)
class MajorantNeeds:
    """What tracking needs to know of each majorant cell.

    Parameters
    ----------
    majorant : "global", "grid", "kdtree", or "auto" for the one of least expected cost.
    control : "none", "min" or "fitted", what the technique's decomposition subtracts.
    residual : "none", "mean", "min" or "max", the control of residual ratio tracking.
    scale : multiplies every bound, for experiments.
    in_lanes : walks may go in lanes, in which cells cost more beside look-ups.
    """

    majorant: str = "auto"
    control: Control = "none"
    residual: Literal["none"] | ResidualControl = "none"
    scale: float = 1.0
    in_lanes: bool = False

    @property
    def means(self) -> bool:
        """Whether the means of cells are wanted, which takes another pass over the volume."""
        return self.control == "fitted" or self.residual == "mean"
