"""What a render has when its device fails: kept on the disk, and where is said with what went wrong."""

from __future__ import annotations

import secrets
from contextlib import suppress
from typing import TYPE_CHECKING

from clvol.base.output_files import kept_elsewhere, write_file
from clvol.errors import DeviceError, Error, option

if TYPE_CHECKING:
    from collections.abc import Callable

    from clvol.picture.result import Result
    from clvol.rendering.checkpoint import Checkpoint
    from clvol.rendering.session import Session


def rescued(
    error: DeviceError,
    session: Session,
    checkpoint: Checkpoint | None,
    first: int,
    done: int,
    picture: Callable[[], Result],
) -> DeviceError:
    """The error, which says where the `done` samples of each pixel are now: in the checkpoint or a picture.

    A device that is lost gives nothing back: then there is what was written before.

    Parameters
    ----------
    error, session : what failed.
    checkpoint : of its render.
    first : number of its first sample.
    picture : makes the picture of what is done.
    """
    if checkpoint is not None:
        with suppress(DeviceError):
            checkpoint.offer(session, first, done, last=True)
        if checkpoint.written:
            return _going_on(error, str(checkpoint.path), checkpoint.written)
    name = f"clvol-{secrets.token_hex(4)}.exr"
    with suppress(Error, OSError, MemoryError):
        data = picture().encode(".exr") if done else b""
        kept = kept_elsewhere(None, name, lambda place: write_file(place, data)) if done else None
        if kept is not None:
            return _going_on(error, str(kept), done)
    return error


def _going_on(error: DeviceError, path: str, done: int) -> DeviceError:
    kept = f"{path} has {done} samples of each pixel, and {option('resume')} goes on from it"
    return DeviceError(error.what, error.where, f"{error.hint}; {kept}")
