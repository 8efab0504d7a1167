"""Volumes of a sequence: what all of its frames share, so that nothing jumps from one to the next."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np

from clvol.errors import Error
from clvol.staging.coarse import extremes
from clvol.staging.fixed import Fixed
from clvol.staging.medium import Grids, Scales, choose_scales
from clvol.staging.options import checked
from clvol.staging.source import Source
from clvol.staging.stage import measured_rays, settle

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping, Sequence

SURVEYED = 32
"""Frames that are looked at for the framing, evenly spread over the sequence, the first and last too."""
MEASURED = 7
"""Frames of these that are looked at again for the scales, of which the median is taken."""


def survey(
    names: Sequence[str],
    given: Mapping[str, Any],
    size: tuple[int, int],
    tell: Callable[[], None] = lambda: None,
) -> Fixed:
    """What the frames of a sequence share.

    Framed is what any of them shows.  Scales are medians over frames, and the greatest temperature is that of
    all.  Frames that cannot be read, which their own render will say, and empty ones do not count.

    Parameters
    ----------
    names : files of the frames, those that are not rendered too, so that parts of a sequence match.
    given, size : as `clvol.staging.stage.stage` takes them.
    tell : is called after each frame that was looked at.

    Raises
    ------
    Error : what is wrong with the first frame, where none can be read; an option that won't do.
    """
    checked(given)
    seen: list[tuple[str, Fixed]] = []
    empty: Fixed | None = None
    failure: Error | None = None
    for name in spread(names, SURVEYED):
        try:
            source, options = Source.of(name), checked(given)
            grids = Grids.of(source, options, of_sequence=True)
            found = Fixed.of(source, grids, options)
        except Error as error:
            failure = failure or error
        else:
            if grids.density.empty or grids.density.peak <= 0:
                empty = empty or found
            else:
                seen.append((name, found))
        tell()
    if not seen:
        if empty is not None:
            return replace(empty, scales=Scales(1.0, 1.0, 1.0))
        assert failure is not None
        raise failure
    return _scaled(_together([found for _, found in seen]), [name for name, _ in seen], given, size, tell)


def spread(names: Sequence[str], most: int) -> list[str]:
    """At most so many of the names, evenly spread."""
    places = np.unique(np.linspace(0, len(names) - 1, min(most, len(names))).round().astype(int))
    return [names[place] for place in places]


def _together(found: Sequence[Fixed]) -> Fixed:
    points = np.concatenate([one.points for one in found])
    return Fixed(
        extremes(points),
        found[0].up,
        any(one.burns for one in found),
        any(one.flames for one in found),
        max(one.peak for one in found),
        limits=_joined([one.limits for one in found if one.limits is not None]),
    )


def _joined(limits: Sequence[tuple[float, float]]) -> tuple[float, float] | None:
    if not limits:
        return None
    return min(low for low, _ in limits), max(high for _, high in limits)


def _scaled(
    fixed: Fixed,
    names: Sequence[str],
    given: Mapping[str, Any],
    size: tuple[int, int],
    tell: Callable[[], None],
) -> Fixed:
    """With the scales that are the medians of some frames."""
    scales = []
    for name in spread(names, MEASURED):
        options = checked(given)
        grids = Grids.of(Source.of(name), options).between(fixed.limits, options.transfer)
        settle(options, fixed)
        if fixed.flames and grids.flame is None:
            grids = grids.dark()
        rays = measured_rays(fixed, options, size)
        scales.append((choose_scales(grids, options, rays, fixed.peak), grids.burns))
        tell()
    glowing = [one for one, burns in scales if burns] or [one for one, _ in scales]
    density = float(np.median([one.density for one, _ in scales]))
    emission = float(np.median([one.emission for one in glowing]))
    return replace(fixed, scales=replace(glowing[0], density=density, emission=emission))
