"""Media so dense that single precision cannot tell where in a mean free path a path is."""

from __future__ import annotations

import logging
from typing import TYPE_CHECKING

import numpy as np

from clvol.scene.boundaries import Boundaries, entry_bounds
from clvol.scene.medium_facts import Matter, scatters
from clvol.tables.apart import peak_extinction

if TYPE_CHECKING:
    from collections.abc import Sequence

    from clvol.scene import records
    from clvol.tables.volumes import PreparedVolume

log = logging.getLogger("clvol")

APART = 2.0**-23
"""Distance of neighbouring floats, as a share of the largest that stand so close."""
UNSEEN = 1e-3
"""Relative error of scattered light that is not worth a word."""


def scattering_error(sigma_t: float, coordinate: float) -> float:
    """Relative error of the light that a medium scatters near its boundary, from places that are rounded.

    Where a path collides is rounded to a multiple of d, APART times the largest coordinate.  Its way out,
    and so the optical depth of that, is off by something uniform in ± d/2, of variance d²/12.  On the mean
    the exponential of that is 1 + (sigma_t d)² / 24: to first order the errors cancel.

    Parameters
    ----------
    sigma_t : per unit of length.  coordinate : the largest that places in the medium have.
    """
    return (sigma_t * APART * coordinate) ** 2 / 24


def check_resolution(
    scene: records.Scene,
    found: Boundaries,
    centre: np.ndarray,
    radius: float,
    matter: Matter,
    volumes: Sequence[PreparedVolume],
) -> None:
    """Warn of media whose mean free paths are hardly longer than places are apart, so far from `centre`."""
    for entry, (lower, upper), number in zip(
        found.entries, entry_bounds(scene, found), matter.of_entry, strict=True
    ):
        if not scatters(entry.medium):
            continue
        role = matter.roles[number].get("sigma_t")
        sigma_t = peak_extinction(entry.medium, None if role is None else volumes[role]).max()
        coordinate = min(radius, float(np.abs([lower - centre, upper - centre]).max()))
        error = scattering_error(sigma_t, coordinate)
        if error > UNSEEN:
            log.warning(
                "%s: its mean free path is %.2g where it is densest, and so far from the scene's centre "
                "places are %.2g apart: light scattered there is off by some %s; at %.2g of its density it "
                "looks as solid, and is right; or bring what else is in the scene closer",
                entry.medium.name or "the medium",
                1 / sigma_t,
                APART * coordinate,
                "100 % or more" if error > 1 else f"{100 * error:.2g} %",
                np.sqrt(UNSEEN / error),
            )
