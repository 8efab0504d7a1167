"""The folder in which PoCL keeps built kernels: one that it can write, and nothing in it that is cut short.

PoCL loads what it finds there unchecked, and ends the process where the disk is full, the folder cannot be
written or a file was cut short by a power failure: nothing that could be caught.  So this looks before: at
everything once since the machine was started, then at what is new.
"""

from __future__ import annotations

import atexit
import logging
import os
import re
import shutil
import sqlite3
import struct
import sys
import tempfile
import time
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import TYPE_CHECKING

from clvol.errors import DeviceError

if TYPE_CHECKING:
    from collections.abc import Iterator

log = logging.getLogger("clvol")
VARIABLE = "POCL_CACHE_DIR"
_HINT = f"let the variable {VARIABLE} name a folder that can be written"
ROOM = 16 << 20
"""Bytes that must be free: a scene's kernels take one or two million."""
STAMP = "clvol-checked"
"""A file in the folder.  It holds the start of the machine in which all programs older than it were whole."""
_BOOT = Path("/proc/sys/kernel/random/boot_id")
_CLOCKS = 10.0
"""Seconds by which the clocks of file systems may differ from this machine's."""

# A program's folder is named by the half bytes of a hash as letters, the first two a folder of their own.
_PAIR, _REST = re.compile("[A-P]{2}"), re.compile("[A-P]{30,}")
_ELF64, _BITCODE = b"\x7fELF\x02", b"BC\xc0\xde"


@dataclass(frozen=True)
class KernelFolder:
    """Where PoCL keeps kernels, None for nowhere; and the reason, where that is not its own choice."""

    path: Path | None
    reason: str = ""


@cache
def kernel_folder() -> KernelFolder:
    """Decide, once per process and before PoCL is asked for anything, where it keeps kernels.

    That is the folder it would take by itself, else a temporary one that is removed with the process.
    """
    usual = _usual_folder()
    reason = unusable(usual)
    if not reason:
        os.environ[VARIABLE] = str(usual)
        return KernelFolder(usual)
    place = Path(tempfile.gettempdir())
    if also := unusable(place):
        return KernelFolder(None, f"{reason}; {also}")
    path = _folder_of_process()
    os.environ[VARIABLE] = path
    return KernelFolder(Path(path), reason)


def _folder_of_process() -> str:
    """A folder that is removed when this process, not one forked from it, ends."""
    path, process = tempfile.mkdtemp(prefix="clvol-kernels-"), os.getpid()

    def remove() -> None:
        if os.getpid() == process:
            shutil.rmtree(path, ignore_errors=True)

    atexit.register(remove)
    return path


def _usual_folder() -> Path:
    """PoCL's own choice; without a home, that of the user's entry in the system."""
    if folder := os.environ.get(VARIABLE):
        return Path(folder)
    return _cache_home() / "pocl" / "kcache"


def _cache_home() -> Path:
    return Path(os.environ.get("XDG_CACHE_HOME") or os.path.expanduser("~/.cache"))


def unusable(folder: Path) -> str:
    """Why kernels cannot be kept in `folder`, which is made where it is missing; "" where they can."""
    try:
        folder.mkdir(parents=True, exist_ok=True)
        with tempfile.TemporaryFile(dir=folder):
            pass
        room = shutil.disk_usage(folder).free
        runs = not os.statvfs(folder).f_flag & getattr(os, "ST_NOEXEC", 0)
    except (OSError, ValueError) as error:
        return f"{folder} cannot be written ({getattr(error, 'strerror', None) or error})"
    if room < ROOM:
        return f"{folder} has {room / 2**20:.1f} MiB free"
    return "" if runs else f"no program in {folder} may run (it is mounted noexec)"


def open_call_cache() -> None:
    """Let pyopencl open its cache of how kernels are called: in a temporary place where it cannot in its own.

    It does so with its first kernel, and fails there without a home to write to, or with a damaged file.
    """
    if not unusable(_cache_home() / "pytools"):
        try:
            import pyopencl.invoker

            return
        except (OSError, sqlite3.Error) as error:
            log.debug("pyopencl's cache is damaged: %s", error)
    before = os.environ.get("XDG_CACHE_HOME")
    os.environ["XDG_CACHE_HOME"] = _folder_of_process()
    try:
        import pyopencl.invoker  # noqa: F401
    finally:
        if before is None:
            del os.environ["XDG_CACHE_HOME"]
        else:
            os.environ["XDG_CACHE_HOME"] = before


def check(folder: KernelFolder) -> None:
    """Say where kernels are kept if that is not as usual, and remove those that are cut short.

    Raises DeviceError where they can be kept nowhere.
    """
    if folder.path is None:
        raise DeviceError(f"PoCL has no folder for the kernels it builds: {folder.reason}", hint=_HINT)
    if folder.reason:
        log.warning("kernels are built anew each time: %s; %s", folder.reason, _HINT)
    if removed := remove_broken(folder.path):
        log.warning(
            "programs in PoCL's cache %s that were cut short, as by a power failure, and are built anew: %d",
            folder.path,
            removed,
        )


def remove_broken(folder: Path) -> int:
    """Remove the programs in PoCL's cache of which a file is not whole; how many there were.

    PoCL renames files that are finished, so that only a loss of power cuts them short.  What was whole since
    the machine was started is not looked at again: a cache may hold thousands of programs.
    """
    began, boot = time.time() - _CLOCKS, _boot()
    since = _checked(folder, boot)
    programs = list(_programs(folder, since))
    broken = [program for program in programs if not _is_program_whole(program)]
    for program in broken:
        shutil.rmtree(program, ignore_errors=True)
    if boot and (programs or since == 0):
        _stamp(folder, boot, began)
    return len(broken)


def _boot() -> str:
    """Names this start of the machine; "" where the system does not tell."""
    try:
        return _BOOT.read_text().strip()
    except OSError:
        return ""


def _checked(folder: Path, boot: str) -> float:
    """When the folder was looked at since the machine was started; 0 for never."""
    try:
        stamp = folder / STAMP
        return stamp.stat().st_mtime if boot and stamp.read_text() == boot else 0.0
    except (OSError, ValueError):
        return 0.0


def _stamp(folder: Path, boot: str, when: float) -> None:
    """Note that everything older than `when` is whole; nothing where it cannot be written."""
    try:
        (folder / STAMP).write_text(boot)
        os.utime(folder / STAMP, (when, when))
    except OSError as error:
        log.debug("%s cannot be stamped: %s", folder, error)


def _is_program_whole(program: str) -> bool:
    try:
        return all(map(is_whole, _files(program)))
    except OSError:  # removed by another process in the meantime
        return True


def _programs(folder: Path, since: float) -> Iterator[str]:
    """The folder of each program in the cache that is as new as `since`, and of nothing else there."""
    for pair in _folders(folder, _PAIR, since):
        yield from _folders(pair, _REST, since)


def _folders(parent: Path | str, name: re.Pattern[str], since: float) -> list[str]:
    try:
        found = [entry for entry in os.scandir(parent) if name.fullmatch(entry.name) and entry.is_dir()]
        return [entry.path for entry in found if since == 0 or entry.stat().st_mtime >= since]
    except OSError:  # gone in the meantime, or not ours to read
        return []


def _files(folder: str) -> Iterator[str]:
    for entry in os.scandir(folder):
        if entry.name.endswith((".so", ".bc")):
            yield entry.path
        elif entry.is_dir(follow_symlinks=False):
            yield from _files(entry.path)


def is_whole(path: str) -> bool:
    """Whether a program's file, a library (.so) or LLVM's bitcode (.bc), is as long as its headers say.

    Libraries of another kind than 64-bit ELF, as other systems have them, are taken for whole if not empty.
    """
    try:
        file = os.open(path, os.O_RDONLY | getattr(os, "O_CLOEXEC", 0))
    except OSError:
        return False
    try:
        size = os.fstat(file).st_size
        return _whole_bitcode(file, size) if path.endswith(".bc") else _whole_library(file, size)
    except OSError:
        return False
    finally:
        os.close(file)


def _whole_library(file: int, size: int) -> bool:
    """The linker puts the table of sections last; an entry of zeros at its end was never written."""
    head = os.pread(file, 64, 0)
    if not head.startswith(_ELF64):
        return size > 0 and not sys.platform.startswith("linux")
    if len(head) < 64:
        return False
    (sections,) = struct.unpack_from("<Q", head, 0x28)
    entry, count = struct.unpack_from("<HH", head, 0x3A)
    end = sections + entry * count
    return count > 0 and end <= size and any(os.pread(file, entry, end - entry))


def _whole_bitcode(file: int, size: int) -> bool:
    """Whether the outer blocks, each with its length in words, end where the file does.

    "LLVM Bitcode File Format", section "Blocks": a word with abbreviation 1, the block's number and its
    width of abbreviations, then the length.
    """
    at = len(_BITCODE)
    if os.pread(file, at, 0) != _BITCODE or size == at:
        return False
    while at + 8 <= size:
        start, words = struct.unpack("<II", os.pread(file, 8, at))
        if start & 3 != 1:
            return False
        at += 8 + 4 * words
    return at == size
