"""How many samples a target error takes, where ranges of all pixels are shared.

As in `clvol.rendering.adaptive`, a survey with a seed of its own tells, whose samples are not in the picture.
But every pixel gets as many samples as the others: ranges then add, and bits do not depend on who did what.
"""

from __future__ import annotations

import logging
import math
from dataclasses import dataclass

import numpy as np

from clvol.rendering.adaptive import (
    BLIND,
    LEAST,
    SURVEY_GROWTH,
    SURVEY_SEED,
    SURVEY_SHARE,
    chunks,
    powers_of_two,
)

log = logging.getLogger("clvol")


def survey_seed(seed: int) -> int:
    """Of the survey of a picture."""
    return (seed + SURVEY_SEED) % 2**64


@dataclass(frozen=True)
class Need:
    """What a survey so far says.

    Parameters
    ----------
    picture : samples of a pixel that the picture is to have.
    survey : that the survey is to have before that is known well enough; 0 if it is.
    """

    picture: int
    survey: int

    @classmethod
    def of(cls, target: float, most: int | None, count: int, noise: float, low_discrepancy: bool) -> Need:
        """After `count` samples of the survey, whose relative error is `noise`; before it with a count of 0.

        most : samples that the picture may have.
        """
        limit = math.inf if most is None else most
        rounded = powers_of_two if low_discrepancy else chunks
        if count == 0:
            return cls(0, LEAST)
        if not math.isfinite(noise):
            if count >= min(BLIND, limit):
                log.warning(
                    "the survey of the target error saw no light in %d samples a pixel: none gets over %d",
                    count,
                    LEAST,
                )
                return cls(int(min(LEAST, limit)), 0)
            return cls(0, SURVEY_GROWTH * count)
        wanted = int(rounded(np.asarray(max(count * (noise / target) ** 2, LEAST))))
        wanted = int(min(wanted, limit))
        if wanted <= SURVEY_SHARE * count:
            return cls(wanted, 0)
        return cls(wanted, int(rounded(np.clip(wanted / SURVEY_SHARE, 2 * count, SURVEY_GROWTH * count))))
