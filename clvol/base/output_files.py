"""Files that clvol writes: checked before the work, whole or not at all, kept elsewhere where they must be.

A file is written beside the one it replaces, synced and closed, and then takes its name, so that whatever
fails (a full disk first of all) leaves the earlier one as it was.
"""

from __future__ import annotations

import errno
import os
import secrets
import stat
import tempfile
from contextlib import contextmanager, suppress
from os import PathLike
from pathlib import Path
from typing import TYPE_CHECKING, BinaryIO

from clvol.base.files import other_kind
from clvol.base.memory import format_bytes
from clvol.errors import OptionError, shown

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Iterator, Sequence

StrPath = str | PathLike[str]
_NO_SYNC = (errno.EINVAL, errno.ENOSYS, errno.ENOTSUP)
"""What file systems answer that cannot sync."""


def output_suffix(path: StrPath, suffixes: Sequence[str]) -> str:
    """Lower-case suffix of the path; OptionError where it is none of `suffixes`."""
    if not isinstance(path, str | PathLike):
        raise OptionError(f"a file's name is wanted, not {shown(path)}")
    suffix = Path(path).suffix.lower()
    if suffix not in suffixes:
        raise OptionError(
            f"unknown format '{suffix}'" if suffix else "no format",
            where=str(path),
            hint=f"name the file {' or '.join(filter(None, (', '.join(suffixes[:-1]), suffixes[-1])))}",
        )
    return suffix


def check_file(path: StrPath) -> None:
    """Raise OptionError now for a path that `replacing` could not write after long work."""
    where, target = str(path), real(path)
    if kind := other_kind(target):
        raise OptionError(f"is {kind}, not a file", where, "give another name")
    if target.exists() and not os.access(target, os.W_OK):
        raise OptionError("is write-protected", where, "give another name, or chmod it")
    check_room(target.parent, where)


def check_spares(path: StrPath, read: Iterable[StrPath]) -> None:
    """Raise OptionError where the file would take the place of one that was `read`, whatever the links."""
    target = real(path)
    if any(os.path.realpath(name) == str(target) for name in read):
        raise OptionError("would replace a file of the scene", str(path), "give another name")


def check_room(folder: Path, where: str, size: int = 0) -> None:
    """Raise OptionError, at `where`, if no file of `size` bytes could be written in the folder."""
    if not folder.is_dir():
        raise OptionError(f"no such folder '{folder}'", where, "make it first")
    try:  # the only sure way to know: quotas and limits count too
        with tempfile.TemporaryFile(dir=folder) as file:
            if size:
                os.posix_fallocate(file.fileno(), 0, size)
    except OSError as error:
        room = f" {format_bytes(size)}" if size else ""
        raise OptionError(
            f"cannot write{room} to '{folder}': {error.strerror}", where, "choose another folder"
        ) from None


def real(path: StrPath) -> Path:
    """The path without symbolic links, which are followed, not replaced; OptionError if it cannot be one."""
    try:
        target = Path(os.path.realpath(path))
        with suppress(FileNotFoundError):
            target.lstat()
    except (OSError, ValueError) as error:  # too long, a loop of links, not in a folder, with a NUL
        reason = getattr(error, "strerror", error)
        raise OptionError(f"cannot be written: {reason}", str(path), "give another name") from None
    if target.is_symlink():
        raise OptionError("is a loop of symbolic links", str(path))
    return target


@contextmanager
def replacing(path: StrPath) -> Iterator[BinaryIO]:
    """A new file, open for writing bytes, that takes place and mode of `path` once the block is through.

    OptionError where that fails, with the earlier file as it was and nothing left beside it.
    """
    check_file(path)
    target = real(path)
    temporary = target.with_name(f".clvol-{secrets.token_hex(4)}")
    try:
        with new_file(temporary) as file:
            _take_mode(file, target)
            yield file
        os.replace(temporary, target)
        sync_folder(target.parent)
    except OSError as error:
        raise OptionError(f"cannot be written: {error.strerror or error}", where=str(path)) from error
    finally:
        with suppress(OSError):
            temporary.unlink(missing_ok=True)


def write_file(path: StrPath, data: bytes) -> None:
    """`data` as the whole file; as `replacing`."""
    with replacing(path) as file:
        file.write(data)


@contextmanager
def new_file(path: Path) -> Iterator[BinaryIO]:
    """A file that was not there, open for writing; on the disk and closed after the block, else OSError."""
    with open(path, "xb") as file:
        yield file
        file.flush()
        try:
            os.fsync(file.fileno())
        except OSError as error:
            if error.errno not in _NO_SYNC:
                raise


def kept_elsewhere(beside: StrPath | None, name: str, write: Callable[[Path], None]) -> Path | None:
    """Where `write` succeeded in leaving what could not be written as `beside`; None if nowhere.

    Tried are the same folder, if there is such, that for temporary files, the user's, and memory; `name` is
    unlike any other, and `write` leaves nothing where it fails, with OSError or OptionError.
    """
    for folder in _refuges(beside):
        path = folder / name
        try:
            write(path)
        except (OSError, OptionError):
            continue
        return path
    return None


def _refuges(beside: StrPath | None) -> Iterator[Path]:
    if beside is not None:
        yield Path(os.path.realpath(beside)).parent
    with suppress(OSError):  # there may be none that can be written to
        yield Path(tempfile.gettempdir())
    with suppress(RuntimeError):  # nor a home
        yield Path.home()
    yield Path("/dev/shm")


def _take_mode(file: BinaryIO, target: Path) -> None:
    """Mode and owner of an earlier file, where the file system has them; else those of any new file."""
    try:
        earlier = target.stat()
    except FileNotFoundError:
        return
    with suppress(OSError):
        os.fchown(file.fileno(), earlier.st_uid, earlier.st_gid)
    with suppress(OSError):
        os.fchmod(file.fileno(), stat.S_IMODE(earlier.st_mode))


def sync_folder(folder: Path) -> None:
    """Put the new names of its files on the disk too, where the file system can."""
    with suppress(OSError):
        descriptor = os.open(folder, os.O_RDONLY)
        try:
            os.fsync(descriptor)
        finally:
            os.close(descriptor)
