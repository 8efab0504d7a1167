"""Checkpoints: what a render has so far, on the disk, so that another process goes on to the same bits.

A file has the sums of the film as the device keeps them, pairs of floats, and in JSON what they are sums of.
It is an uncompressed .npz, written beside the one it replaces and synced before it takes its name.
"""

from __future__ import annotations

import json
import logging
import struct
import time
import tokenize
import zipfile
import zlib
from dataclasses import dataclass
from os import PathLike
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from clvol.base.files import open_regular
from clvol.base.output_files import replacing
from clvol.device.driver import driver_errors
from clvol.errors import OptionError, option
from clvol.rendering.outcome import metadata_of, picture_names

if TYPE_CHECKING:
    from clvol.rendering.session import Session

log = logging.getLogger("clvol")

FORMAT = 2
_ABOUT = "about"
_ARCHIVE = b"PK\x03\x04"
_HINT = "give another name, or remove the file to begin anew"
_DAMAGE = (
    *(OSError, EOFError, LookupError, TypeError, ValueError, AttributeError, MemoryError, SyntaxError),
    *(ArithmeticError, RuntimeError, struct.error, zlib.error, zipfile.BadZipFile, tokenize.TokenError),
)
"""What NumPy and zipfile raise for files that are none."""
_LARGEST_SHARE = 0.05
"""Of the time that writing may take: then checkpoints are further apart than asked for."""


@dataclass(frozen=True, eq=False)
class Saved:
    """A checkpoint that was read.

    Parameters
    ----------
    first, done : samples of each pixel.
    pictures : names of those that the film makes beside the image.
    metadata : of the picture so far.
    spent : seconds, launches and waves, what stages handled, and statistics of slots.
    buffers : of the film, uint8, by name.
    """

    path: str
    first: int
    done: int
    pictures: list[str]
    metadata: dict[str, Any]
    spent: dict[str, Any]
    buffers: dict[str, np.ndarray]

    def put_back(self, session: Session) -> None:
        """Make the session's film what it was; OptionError where it is none of this film."""
        wavefront = session.wavefront
        if wavefront.film.sizes != {name: array.nbytes for name, array in self.buffers.items()}:
            raise OptionError("its film is not that of this render", self.path, _HINT)
        if self.metadata.get("device") != session.device.description:
            log.warning(
                "%s was written on %s: on another device the picture is as right, with other bits",
                self.path,
                self.metadata.get("device"),
            )
        try:
            session.earlier = float(self.spent["seconds"])
            with driver_errors(session.device.description):
                wavefront.take_up(self.buffers, self.spent)
        except (KeyError, TypeError, ValueError, AttributeError, ArithmeticError) as error:
            raise OptionError(f"is damaged ({error!r})", self.path, _HINT) from None


class Checkpoint:
    """Where, and how often, a render leaves what it has.

    Parameters
    ----------
    path : the file.
    every : seconds from one checkpoint to the next.
    written : samples of each pixel that the file has.
    """

    def __init__(self, path: str | PathLike[str], every: float, written: int = 0) -> None:
        self.path, self.every, self.written = path, every, written
        self._due = time.perf_counter() + every

    def offer(self, session: Session, first: int, done: int, last: bool = False) -> None:
        """Write the file if it is time to, or this is the last chance; a disk that is full ends no render."""
        started = time.perf_counter()
        if done == self.written or not (last or started >= self._due):
            return
        try:
            write_checkpoint(self.path, session, first, done)
            self.written = done
        except OptionError as error:
            log.warning("no checkpoint: %s", error)
        now = time.perf_counter()
        self._due = now + max(self.every, (now - started) / _LARGEST_SHARE)


def write_checkpoint(path: str | PathLike[str], session: Session, first: int, done: int) -> None:
    """The session's film, which has the samples `first` to `first + done`, as a file, whole or not at all."""
    with driver_errors(session.device.description):
        spent, buffers = session.wavefront.spent(), session.wavefront.film.contents()
    about = {
        "format": FORMAT,
        "first": first,
        "done": done,
        "pictures": picture_names(session.plan),
        "metadata": metadata_of(session, first, np.full(1, done)),
        "spent": {"seconds": session.seconds, **spent},
    }
    text = np.frombuffer(json.dumps(about).encode(), np.uint8)
    with replacing(path) as file:
        np.savez(file, allow_pickle=False, **{_ABOUT: text}, **buffers)


def is_checkpoint(given: object) -> bool:
    """Whether what a render is to go on from is a checkpoint by its bytes, or no picture by its name."""
    if not isinstance(given, str | PathLike):
        return False
    try:
        with open_regular(given, OptionError, "checkpoint") as file:
            archive = file.read(len(_ARCHIVE)) == _ARCHIVE
    except OptionError:  # said when it is read
        archive = False
    return archive or Path(given).suffix.lower() != ".exr"


def read_checkpoint(path: str | PathLike[str]) -> Saved:
    """A checkpoint of `write_checkpoint`; OptionError, with the reason, for any other file."""
    name = str(path)
    with open_regular(name, OptionError, "checkpoint") as file:
        try:
            with zipfile.ZipFile(file) as parts:
                packed = any(one.compress_type != zipfile.ZIP_STORED for one in parts.infolist())
            if packed:
                raise ValueError("compressed")
            file.seek(0)
            with np.load(file, allow_pickle=False) as arrays:
                found = {key: np.asarray(arrays[key]) for key in arrays.files}
            return _saved(name, found)
        except _DAMAGE as error:
            raise OptionError(f"is no checkpoint of clvol, or is damaged ({error})", name, _HINT) from None


def _saved(name: str, found: dict[str, np.ndarray]) -> Saved:
    about = json.loads(found.pop(_ABOUT).tobytes())
    if about["format"] != FORMAT:
        raise ValueError(f"format {about['format']!r}, not {FORMAT}")
    first, done, metadata, spent = (about[key] for key in ("first", "done", "metadata", "spent"))
    whole = all(isinstance(n, int) and 0 <= n < 2**32 for n in (first, done))
    whole = whole and all(isinstance(picture, str) for picture in about["pictures"])
    if not (whole and isinstance(metadata, dict) and isinstance(spent, dict)):
        raise ValueError("what it says of itself makes no sense")
    if any(array.dtype != np.uint8 or array.ndim != 1 for array in found.values()):
        raise ValueError("no film")
    return Saved(name, first, done, list(about["pictures"]), metadata, spent, found)


def check_count(saved: Saved, first: int, count: int) -> None:
    """OptionError where a checkpoint has not the first of the samples that are asked for."""
    if saved.first != first or saved.done > count:
        has = f"samples {saved.first} to {saved.first + saved.done - 1}"
        raise OptionError(
            f"has {has} of each pixel, and {count} from {first} on are asked for",
            saved.path,
            f"give a greater {option('spp')}, {_HINT}",
        )
