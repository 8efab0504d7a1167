"""Bounded reading of OpenVDB bytes: a cursor that stays in the file, blocks that keep to their size."""

from __future__ import annotations

import mmap
import os
import struct
import zlib
from collections.abc import Iterator
from contextlib import contextmanager
from typing import NoReturn

import blosc
from blosc.blosc_extension import error as BloscError  # noqa: N812

from clvol.errors import VolumeError
from clvol.volumes.files import TRUNCATED, open_binary

ZIP, ACTIVE_MASK, BLOSC = 1, 2, 4
BLOSC_FORMAT = 2
BLOSC_HEADER = struct.Struct("<BBBBIII")


class VdbStream:
    """A cursor over `data` (bytes or a memory map); every read past its end is a VolumeError.

    `where` names the file, and the grid once it is known, in the errors.
    """

    def __init__(self, data: bytes | mmap.mmap, where: str) -> None:
        self.data, self.where = data, where
        self.pos, self.end = 0, len(data)

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
        pos = self.pos
        if not 0 <= count <= self.end - pos:
            self.require(count)
        self.pos = pos + count
        return self.data[pos : self.pos]

    def unpack(self, layout: str) -> tuple:
        """The next values, by a `struct` layout (little-endian as OpenVDB writes)."""
        size = struct.calcsize(layout)
        self.require(size)
        values = struct.unpack_from(layout, self.data, self.pos)
        self.pos += size
        return values

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
        values = blosc.decompress(payload)
    except BloscError as error:
        raise ValueError(f"blosc: {error}") from None
    if len(values) != nbytes:
        raise ValueError(f"blosc: {len(values)} bytes, not {nbytes}")
    return values


@contextmanager
def open_vdb(path: str | os.PathLike[str]) -> Iterator[VdbStream]:
    """A stream over the memory-mapped file, closed at the end."""
    with open_binary(path) as file:
        try:
            data = mmap.mmap(file.fileno(), 0, access=mmap.ACCESS_READ)
        except (OSError, ValueError) as error:
            raise VolumeError(f"cannot be mapped into memory ({error})", str(path)) from None
        with data:
            yield VdbStream(data, str(path))
