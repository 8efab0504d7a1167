"""Renders that go on where a picture ended: from what, and with which samples."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from clvol.errors import OptionError, either, option
from clvol.picture.estimate import Uneven
from clvol.picture.loading import load_result
from clvol.picture.merging import differences
from clvol.picture.result import Result
from clvol.rendering.outcome import metadata_of, picture_names
from clvol.rendering.session import MAX_SAMPLES

if TYPE_CHECKING:
    from os import PathLike

    from clvol.rendering.session import Session

_FIRST = ("seed", "digest", "technique", "transmittance")
"""Differences that others follow from."""


def resumable(given: Result | str | PathLike[str]) -> Result:
    """The picture to go on from; OptionError where none can go on from it."""
    result = given if isinstance(given, Result) else load_result(given)
    if isinstance(result.estimate, Uneven):
        reason, hint = result.estimate.reason, result.estimate.hint
        raise OptionError(f"cannot go on from this picture: {reason}", hint=hint)
    return result


def what_is_left(result: Result, total: int) -> tuple[int, int]:
    """First sample and how many of `total` a picture lacks, from its last one on; (first, 0) for none."""
    first = sum(result.ranges[-1])
    return first, min(max(total - result.samples[1], 0), MAX_SAMPLES - first)


def check_same(result: Result, session: Session) -> None:
    """OptionError, with the reason, where a session would render another picture's samples."""
    planned = metadata_of(session, 0, np.ones(1, np.int64))
    size = session.prepared.scene.film.window[2:]
    if result.image.shape[1::-1] != size:
        had = "{} x {}".format(*result.image.shape[1::-1])
        raise OptionError(f"cannot go on from a picture of {had} pixels with one of {size[0]} x {size[1]}")
    names, had_names = picture_names(session.plan), list(result.aovs)
    if set(names) != set(had_names):
        what = f"cannot go on from a picture with {', '.join(had_names)}, with one with {', '.join(names)}"
        raise OptionError(what, hint="ask for the same aov, or render anew")
    found = differences(result.metadata, planned)
    for key in sorted(found, key=lambda key: (key not in _FIRST, key)):
        theirs, ours = found[key]
        if key == "digest":
            values = either("values of its defaults", "-D values")
            source = result.metadata.get("scene") or "a scene from Python"
            raise OptionError(
                f"cannot go on from a picture of another scene: that of {source} is not this one",
                hint=f"the scene, its files, {values} or the sensor changed: render it anew",
            )
        what = f"cannot go on from a picture of another {key}: {theirs!r}, not {ours!r}"
        instead = "" if theirs is None else f"give {option(key, theirs)}, or "
        raise OptionError(what, hint=f"{instead}render anew")
