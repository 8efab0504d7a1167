"""Bounded reading of OpenVDB bytes: a cursor that stays in the file, blocks that keep to their size."""

from __future__ import annotations

import os
import struct
import zlib
from contextlib import contextmanager
from typing import TYPE_CHECKING, Any, NoReturn

import blosc
from blosc.blosc_extension import error as BloscError  # noqa: N812

from clvol.errors import VolumeError
from clvol.volumes.files import TRUNCATED, open_binary

if TYPE_CHECKING:
    from collections.abc import Iterator
    from io import BufferedReader

ZIP, ACTIVE_MASK, BLOSC = 1, 2, 4
BLOSC_FORMAT = 2
BLOSC_HEADER = struct.Struct("<BBBBIII")
# Bytes read at once: many nodes, and little beside what their values take.
WINDOW = 1 << 18


class VdbStream:
    """A cursor over a file's bytes, of which a window is in memory; every read past its end is a VolumeError.

    The file is read rather than mapped: one that another program cuts short meanwhile ends in an error
    then, a map of it in a signal that kills the process.
    `where` names the file, and the grid once it is known, in the errors.
    """

    def __init__(self, file: BufferedReader, where: str) -> None:
        self.file, self.where = file, where
        self.pos, self.end = 0, file.seek(0, os.SEEK_END)
        self._window, self._first = b"", 0

    def fail(self, what: str, hint: str = TRUNCATED) -> NoReturn:
        """Raise a VolumeError for this file."""
        raise VolumeError(what, self.where, hint)

    def require(self, count: int) -> None:
        """Check that `count` more bytes exist."""
        if not 0 <= count <= self.end - self.pos:
            self.fail(f"{count} bytes are needed at byte {self.pos} of {self.end}")

    def seek(self, pos: int) -> None:
        """Move to an absolute byte position inside the file."""
        if not 0 <= pos <= self.end:
            self.fail(f"byte {pos} is pointed to in a file of {self.end} bytes")
        self.pos = pos

    def skip(self, count: int) -> None:
        """Step over `count` bytes."""
        self.require(count)
        self.pos += count

    def take(self, count: int) -> bytes:
        """The next `count` bytes."""
        at = self._locate(count)
        self.pos += count
        return self._window[at : at + count]

    def unpack(self, layout: str) -> tuple[Any, ...]:
        """The next values, by a `struct` layout (little-endian as OpenVDB writes)."""
        size = struct.calcsize(layout)
        at = self._locate(size)
        self.pos += size
        return struct.unpack_from(layout, self._window, at)

    def _locate(self, count: int) -> int:
        """Where in the window the next `count` bytes are, which is moved to hold them."""
        self.require(count)
        at = self.pos - self._first
        if 0 <= at <= len(self._window) - count:
            return at
        self.file.seek(self.pos)
        self._window, self._first = self.file.read(min(max(count, WINDOW), self.end - self.pos)), self.pos
        if len(self._window) < count:
            self.fail(f"{count} bytes at byte {self.pos} are gone since it was opened")
        return 0

    def string(self) -> str:
        """A string after its 32-bit length; bytes that are not UTF-8 are replaced."""
        (length,) = self.unpack("<I")
        return self.take(length).decode("utf-8", errors="replace")

    def block(self, nbytes: int, compression: int) -> bytes:
        """A block of values: `nbytes` bytes once decompressed.

        A compressed block starts with its size as int64; a size n ≤ 0 means −n raw bytes follow.
        """
        if not compression & (ZIP | BLOSC):
            return self.take(nbytes)
        (size,) = self.unpack("<q")
        if size <= 0:
            if size != -nbytes:
                self.fail(f"a block of {nbytes} bytes says that it holds {-size}")
            return self.take(nbytes)
        if size > 2 * nbytes + 1024:
            self.fail(f"a block of {nbytes} bytes says that it takes {size} bytes compressed")
        payload = self.take(size)
        try:
            return (decompress_blosc if compression & BLOSC else decompress_zip)(payload, nbytes)
        except ValueError as error:
            self.fail(f"a compressed block ending at byte {self.pos} is damaged ({error})")


def decompress_zip(payload: bytes, nbytes: int) -> bytes:
    """Inflate to exactly `nbytes` bytes, never holding more; ValueError otherwise."""
    inflater = zlib.decompressobj()
    try:
        values = inflater.decompress(payload, nbytes + 1)
    except zlib.error as error:
        raise ValueError(f"zlib: {error}") from None
    if len(values) != nbytes or not inflater.eof:
        raise ValueError(f"zlib: not {nbytes} bytes")
    return values


def decompress_blosc(payload: bytes, nbytes: int) -> bytes:
    """Decompress one blosc chunk to exactly `nbytes` bytes; ValueError otherwise.

    The sizes in the chunk's header decide what the C library allocates and where it reads, so they
    are compared with what the tree says before it sees the chunk.
    """
    if len(payload) < BLOSC_HEADER.size:
        raise ValueError("blosc: no header")
    version, _, _, type_size, uncompressed, block_size, compressed = BLOSC_HEADER.unpack_from(payload)
    if version != BLOSC_FORMAT or type_size == 0:
        raise ValueError(f"blosc: format {version}, type size {type_size}")
    if uncompressed != nbytes or compressed != len(payload):
        raise ValueError(f"blosc: {uncompressed} bytes in {compressed}, not {nbytes} in {len(payload)}")
    if nbytes == 0:
        return b""
    if not 0 < block_size <= nbytes:
        raise ValueError(f"blosc: blocks of {block_size} bytes")
    try:
        values: bytes = blosc.decompress(payload)
    except BloscError as error:
        raise ValueError(f"blosc: {error}") from None
    if len(values) != nbytes:
        raise ValueError(f"blosc: {len(values)} bytes, not {nbytes}")
    return values


@contextmanager
def open_vdb(path: str | os.PathLike[str]) -> Iterator[VdbStream]:
    """A stream over the file, closed at the end."""
    with open_binary(path) as file:
        yield VdbStream(file, str(path))
