"""Pictures that took the same time, and what each differs by from the reference."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np

from clvol.lab.comparison.flip import flip_error, has_flip
from clvol.lab.comparison.relative import level
from clvol.picture.image_io import shown_pixels
from clvol.picture.view_transform import View

if TYPE_CHECKING:
    from clvol.lab.comparison.entrants import Render
    from clvol.lab.comparison.reference import Reference


@dataclass(frozen=True, eq=False)
class EqualTime:
    """One render as long as those of the other combinations.

    Attributes
    ----------
    render
        Its image, samples a pixel and seconds.
    relrmse
        Root of the mean relative squared error, without that of the reference.
    error
        Error of each pixel, relative, float64 (height, width).
    truth
        The reference's image.
    """

    render: Render
    relrmse: float
    error: np.ndarray
    truth: np.ndarray

    @cached_property
    def flip(self) -> np.ndarray | None:
        """FLIP error of each pixel, float32 (height, width); None where it is not installed."""
        return flip_error(display(self.truth), display(self.render.image)) if has_flip() else None

    @property
    def mean_flip(self) -> float:
        """Mean of the FLIP errors; nan where there are none."""
        return math.nan if self.flip is None else float(self.flip.mean(dtype=np.float64))


def equal_time(render: Render, reference: Reference, weight: np.ndarray) -> EqualTime:
    """What a render differs by; `weight` makes a squared error relative."""
    difference = render.image.astype(np.float64) - reference.image
    square = float(((difference**2 - reference.variance) * weight).mean())
    error = np.sqrt((difference**2).mean(axis=-1)) / level(reference.image)
    return EqualTime(render, math.sqrt(max(square, 0.0)), error, reference.image)


def display(image: np.ndarray) -> np.ndarray:
    """Linear radiance as results are shown, 0 to 1; what is not finite in magenta."""
    return shown_pixels(image, None, View().resolved())
