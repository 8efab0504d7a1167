"""The bytes of a NanoVDB grid, whose nodes point at each other, unpacked as they are asked for.

A file keeps them as they are, or in chunks of zlib or blosc that may hold a gigabyte each.  What is asked for
in rising order is unpacked once; a step back begins anew.  So memory is a window's, whatever the codec.
"""

from __future__ import annotations

import struct
import zlib
from itertools import pairwise
from typing import TYPE_CHECKING, NoReturn

import numpy as np

from clvol.volumes.vdb_stream import BLOSC_FORMAT, BLOSC_HEADER, decompress_blosc

if TYPE_CHECKING:
    from collections.abc import Iterator

    from clvol.volumes.vdb_stream import VdbStream

NONE, ZIP, BLOSC = range(3)
CODEC_NAMES = {NONE: (), ZIP: ("zip",), BLOSC: ("blosc",)}
# Bytes read, or unpacked, at once.
PIECE = 1 << 20
# Neither codec can do better: a grid that claims more is a bomb or damaged.
MOST_RATIO = 1032
# The flag of a blosc chunk that is stored as it is.
BLOSC_STORED = 2
# Bytes of a block of a chunk of blosc: NanoVDB's are 2¹⁸, blosc's own choice is a few times that.
MOST_BLOCK = 1 << 26


class GridBytes:
    """A grid of `size` bytes in the `packed` bytes of the file from `start` on.

    before : bytes of other grids that are packed with it and come first.

    Reading beyond its end, or what its chunks do not hold, is a VolumeError.
    """

    def __init__(
        self, stream: VdbStream, codec: int, start: int, packed: int, size: int, before: int = 0
    ) -> None:
        self.stream, self.codec, self.start, self.size, self.before = stream, codec, start, size, before
        self.end = start + packed
        self._pieces: Iterator[bytes] = iter(())
        self._held = bytearray()  # bytes in memory, and where they are in what is packed
        self._first = before + size + 1

    def fail(self, what: str) -> NoReturn:
        """Raise a VolumeError for this file."""
        self.stream.fail(what)

    def release(self) -> None:
        """Let go of what is in memory."""
        self._pieces, self._held, self._first = iter(()), bytearray(), self.before + self.size + 1

    def take(self, offset: int, count: int) -> bytes:
        """Bytes `offset` to `offset + count` of the grid."""
        if not 0 <= offset <= self.size - count:
            self.fail(f"byte {offset + count} is pointed to in a grid of {self.size} bytes")
        offset += self.before
        if self.codec == NONE:
            self.stream.seek(self.start + offset)
            return self.stream.take(count)
        if offset < self._first:
            self._pieces, self._held, self._first = self._unpacked(), bytearray(), 0
        while offset + count > self._first + len(self._held):
            piece = next(self._pieces, b"")
            if not piece:
                there = self._first + len(self._held)
                self.fail(f"its data unpacks to {there} of {self.before + self.size} bytes")
            if self._first + len(self._held) <= offset:
                self._first += len(self._held)
                self._held.clear()
            self._held += piece
        at = offset - self._first
        found = bytes(self._held[at : at + count])
        if at >= PIECE:
            del self._held[:at]
            self._first += at
        return found

    def records(self, offsets: np.ndarray, size: int) -> np.ndarray:
        """The `size` bytes at each of the rising offsets, uint8 (n, size); neighbours are read together."""
        ends = np.flatnonzero(np.diff(offsets) != size) + 1
        runs = np.split(offsets, ends)
        parts = [self.take(int(run[0]), size * len(run)) for run in runs if len(run)]
        return np.frombuffer(b"".join(parts), np.uint8).reshape(-1, size)

    def _unpacked(self) -> Iterator[bytes]:
        """All the grid's bytes, a piece at a time."""
        unpack = self._inflated if self.codec == ZIP else self._unblosced
        at = self.start
        while at < self.end:
            self.stream.seek(at)
            (packed,) = self.stream.unpack("<Q")
            at += 8
            if packed > self.end - at:
                self.fail(f"a chunk says that it takes {packed} bytes, {self.end - at} are left")
            yield from unpack(at, packed)
            at += packed

    def _inflated(self, at: int, packed: int) -> Iterator[bytes]:
        inflater = zlib.decompressobj()
        end, rest = at + packed, b""
        while not inflater.eof:
            if not rest:
                if at == end:
                    self.fail("a compressed chunk ends early")
                self.stream.seek(at)
                rest = self.stream.take(min(PIECE, end - at))
                at += len(rest)
            try:
                piece = inflater.decompress(rest, PIECE)
            except zlib.error as error:
                self.fail(f"a compressed chunk is damaged (zlib: {error})")
            rest = inflater.unconsumed_tail
            if piece:
                yield piece

    def _unblosced(self, at: int, packed: int) -> Iterator[bytes]:
        """The blocks of a chunk, some at a time: each is compressed by itself."""
        if packed < BLOSC_HEADER.size:
            self.fail("a compressed chunk is damaged (blosc: no header)")
        self.stream.seek(at)
        header = self.stream.take(BLOSC_HEADER.size)
        version, _, flags, type_size, count, block, told = BLOSC_HEADER.unpack(header)
        if (
            version != BLOSC_FORMAT
            or type_size == 0
            or told != packed
            or not 0 < block <= min(count, MOST_BLOCK)
        ):
            self.fail(
                f"a compressed chunk is damaged (blosc: format {version}, {told} of {packed} bytes,"
                f" blocks of {block})"
            )
        body = at + BLOSC_HEADER.size
        if flags & BLOSC_STORED:
            if packed != BLOSC_HEADER.size + count:
                self.fail("a compressed chunk is damaged (blosc: it is stored, in another size)")
            yield from self._stored(body, count)
            return
        blocks = -(-count // block)
        if 4 * blocks > packed - BLOSC_HEADER.size:
            self.fail("a compressed chunk is damaged (blosc: its blocks do not fit)")
        self.stream.seek(body)
        starts = np.frombuffer(self.stream.take(4 * blocks), "<i4").astype(np.int64)
        ordered = np.append(np.sort(starts), packed)
        if ordered[0] < BLOSC_HEADER.size + 4 * blocks or ordered[-2] > packed:
            self.fail("a compressed chunk is damaged (blosc: its blocks lie elsewhere)")
        ends = ordered[np.searchsorted(ordered, starts, side="right")]
        firsts = list(range(0, blocks, max(1, PIECE // block)))
        if len(firsts) > 1 and firsts[-1] == blocks - 1 and count % block:
            firsts.pop()  # blosc packs a last block that is shorter in another way than one that is whole
        for first, stop in pairwise([*firsts, blocks]):
            chosen = slice(first, stop)
            size = min(count, block * stop) - block * first
            yield self._blocks(at, header[:4], starts[chosen], ends[chosen], (block, size))

    def _stored(self, at: int, count: int) -> Iterator[bytes]:
        for first in range(0, count, PIECE):
            self.stream.seek(at + first)
            yield self.stream.take(min(PIECE, count - first))

    def _blocks(
        self, at: int, kind: bytes, starts: np.ndarray, ends: np.ndarray, sizes: tuple[int, int]
    ) -> bytes:
        """Blocks of a chunk, unpacked: a chunk is made of them alone, with a header of its own."""
        parts = []
        for start, end in zip(starts.tolist(), ends.tolist(), strict=True):
            self.stream.seek(at + start)
            parts.append(self.stream.take(end - start))
        head = BLOSC_HEADER.size + 4 * len(parts)
        places = head + np.cumsum([0, *map(len, parts)])
        block, size = sizes
        header = kind + struct.pack("<3I", size, min(block, size), int(places[-1]))
        chunk = header + places[:-1].astype("<i4").tobytes() + b"".join(parts)
        try:
            return decompress_blosc(chunk, size)
        except ValueError as error:
            self.fail(f"a compressed chunk is damaged ({error})")
