"""Renders that go on where a picture ended: from what, and with which samples."""

from __future__ import annotations

import os
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from clvol.base.output_files import check_file, check_spares
from clvol.errors import OptionError, either, option
from clvol.picture.estimate import Uneven
from clvol.picture.loading import load_result
from clvol.picture.parts import differences
from clvol.picture.result import Result
from clvol.rendering.checkpoint import Checkpoint, Saved, check_count, is_checkpoint, read_checkpoint
from clvol.rendering.outcome import metadata_of, picture_names
from clvol.rendering.session import MAX_SAMPLES

if TYPE_CHECKING:
    from collections.abc import Mapping
    from os import PathLike

    from clvol.rendering.session import Session
    from clvol.scene.records import Scene

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


@dataclass(frozen=True)
class Before:
    """What is known of a picture that a render goes on from: its pixels, the pictures beside it, metadata."""

    size: tuple[int, int]
    pictures: list[str]
    metadata: Mapping[str, Any]

    @classmethod
    def of(cls, result: Result) -> Before:
        """Of a picture."""
        height, width = result.image.shape[:2]
        return cls((width, height), list(result.aovs), result.metadata)

    @classmethod
    def saved(cls, saved: Saved, session: Session) -> Before:
        """Of a checkpoint, whose size its film tells."""
        return cls(session.prepared.scene.film.window[2:], saved.pictures, saved.metadata)


def checkpoint_of(
    given: Mapping[str, Any], scene: Scene, first: int, count: int
) -> tuple[Checkpoint | None, Saved | None]:
    """Where checkpoints go, and the one that is to `resume` or there: its render goes on.

    OptionError for what won't do.
    """
    path, source = given["checkpoint"], given["resume"] if is_checkpoint(given["resume"]) else None
    if path is not None:
        check_file(path)
        check_spares(path, scene.files)
        if os.path.lexists(path):
            if source is not None and os.path.realpath(path) != os.path.realpath(source):
                what = f"is there, and so is {source}: the render can go on from one of them"
                raise OptionError(what, str(path), f"leave {option('resume')} out, or remove the file")
            source = path
    saved = None if source is None else read_checkpoint(source)
    if saved is not None:
        check_count(saved, first, count)
    if path is None:
        return None, saved
    written = saved.done if saved is not None and source == path else 0
    return Checkpoint(path, given["checkpoint_every"], written), saved


def check_same(before: Before, session: Session) -> None:
    """OptionError, with the reason, where a session would render another picture's samples."""
    planned = metadata_of(session, 0, np.ones(1, np.int64))
    size = session.prepared.scene.film.window[2:]
    if before.size != size:
        had = "{} x {}".format(*before.size)
        raise OptionError(f"cannot go on from a picture of {had} pixels with one of {size[0]} x {size[1]}")
    names, had_names = picture_names(session.plan), before.pictures
    if set(names) != set(had_names):
        what = f"cannot go on from a picture with {', '.join(had_names)}, with one with {', '.join(names)}"
        raise OptionError(what, hint="ask for the same aov, or render anew")
    found = differences(before.metadata, planned)
    for key in sorted(found, key=lambda key: (key not in _FIRST, key)):
        theirs, ours = found[key]
        if key == "digest":
            values = either("values of its defaults", "-D values")
            source = before.metadata.get("scene") or "a scene from Python"
            raise OptionError(
                f"cannot go on from a picture of another scene: that of {source} is not this one",
                hint=f"the scene, its files, {values}, the sensor or its size changed: render it anew",
            )
        what = f"cannot go on from a picture of another {key}: {theirs!r}, not {ours!r}"
        instead = "" if theirs is None else f"give {option(key, theirs)}, or "
        raise OptionError(what, hint=f"{instead}render anew")
