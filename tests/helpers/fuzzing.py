"""Damaged files, thousands of them, read in a process of its own with little memory and little time.

`python tests/helpers/fuzzing.py NAME,… COUNT SEED` prints, as JSON, what became of COUNT files of each format
of fuzz_seeds.py.  A file that crashes the process, takes over ten seconds, needs more than `MEMORY` or ends
in anything but a picture, a scene, a grid or one of clvol's errors is left in the folder --keep names.
"""

from __future__ import annotations

import argparse
import faulthandler
import io
import json
import logging
import random
import resource
import string
import struct
import sys
import tempfile
import time
import traceback
import zipfile
import zlib
from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from collections.abc import Callable

SECONDS = 10
"""That reading a file may take."""
MEMORY = 256 << 20
"""Bytes of address space that a process may take beside what it has once all modules are loaded."""
LONGEST = 3000
"""Characters of a line of an error at most; only a list of a scene's faults has several."""
ODD = (
    0,
    1,
    2,
    0x7F,
    0x80,
    0xFF,
    0x7FFF,
    0x8000,
    0xFFFF,
    0x7FFFFFFF,
    0x80000000,
    0xFFFFFFFF,
    1 << 40,
    1 << 63,
)
WORDS = (
    *(b"-1", b"0", b"1e99", b"1e-320", b"nan", b"inf", b"-inf", b"99999999999999999999", b"0x10", b"1/0"),
    *(
        b"$w",
        b"${w}",
        b"&amp;",
        b"<",
        b">",
        b'"',
        b"[",
        b"]",
        b"#",
        b"\0",
        b"\xff\xfe",
        b"\xc3\xa9",
        b"../..",
    ),
    *(b"1" * 400, b" " * 100, b"(" * 200, b"true", b"null", b"{}", b"\n", b","),
)


def damaged(data: bytes, rng: random.Random, others: list[bytes]) -> bytes:
    """A file with one to four faults: bytes, numbers, words, cuts, parts twice, parts of another file."""
    inside = rng.random()
    if inside < 0.3 and (packed := _inside(data, rng, others)) is not None:
        return packed
    broken = bytearray(data)
    for _ in range(rng.choice((1, 1, 1, 2, 4))):
        rng.choice(FAULTS)(broken, rng, others)
    return bytes(broken)


def _place(broken: bytearray, rng: random.Random) -> int:
    """Often in the first bytes, where sizes are."""
    return rng.randrange(min(len(broken), rng.choice((32, 256, 1 << 30))) or 1)


def _flip(broken: bytearray, rng: random.Random, _others: list[bytes]) -> None:
    if broken:
        broken[_place(broken, rng)] ^= rng.randrange(1, 256)


def _number(broken: bytearray, rng: random.Random, _others: list[bytes]) -> None:
    """A count that is huge, negative or 0, of either order of bytes."""
    size, order = rng.choice((1, 2, 4, 8)), rng.choice("<>")
    value = (rng.choice(ODD) + rng.randrange(-1, 2)) % (1 << 8 * size)
    at = _place(broken, rng)
    broken[at : at + size] = struct.pack(f"{order}{'?BH?I???Q'[size]}", value)


def _word(broken: bytearray, rng: random.Random, _others: list[bytes]) -> None:
    """A word of text, or a number there, becomes another."""
    at = _place(broken, rng)
    kind = string.digits.encode() + b".-+e" if rng.random() < 0.6 else string.ascii_letters.encode()
    while at < len(broken) and broken[at] not in kind:
        at += 1
    end = at
    while end < len(broken) and broken[end] in kind:
        end += 1
    broken[at:end] = rng.choice(WORDS)


def _cut(broken: bytearray, rng: random.Random, _others: list[bytes]) -> None:
    del broken[rng.randrange(len(broken) + 1) :]


def _drop(broken: bytearray, rng: random.Random, _others: list[bytes]) -> None:
    at = _place(broken, rng)
    del broken[at : at + rng.choice((1, 2, 4, 8, 40, 400))]


def _twice(broken: bytearray, rng: random.Random, _others: list[bytes]) -> None:
    at = _place(broken, rng)
    part = bytes(broken[at : at + rng.choice((1, 8, 64, 512))])
    broken[at:at] = part * rng.choice((1, 1, 2, 50))


def _splice(broken: bytearray, rng: random.Random, others: list[bytes]) -> None:
    other = rng.choice(others)
    at, size = rng.randrange(len(other)), rng.choice((4, 16, 128, 1 << 30))
    here = _place(broken, rng)
    broken[here : here + size] = other[at : at + size]


FAULTS: tuple[Callable[[bytearray, random.Random, list[bytes]], None], ...] = (
    *(_flip, _flip, _number, _number, _word, _word),
    *(_cut, _drop, _twice, _splice),
)


def _inside(data: bytes, rng: random.Random, others: list[bytes]) -> bytes | None:
    """With faults in what is packed, packed again so that check sums are right; None where nothing is."""
    if data[:2] == b"PK":
        return _rezipped(data, rng, others)
    if data[:2] == b"\x1c\x04":
        header, body = data[:4], zlib.decompressobj().decompress(data[4:])
        return header + zlib.compress(damaged(body, rng, [body]), 1)
    return None


def _rezipped(data: bytes, rng: random.Random, others: list[bytes]) -> bytes:
    target = io.BytesIO()
    with zipfile.ZipFile(io.BytesIO(data)) as parts, zipfile.ZipFile(target, "w") as packed:
        chosen = rng.choice(parts.namelist())
        for name in parts.namelist():
            body = parts.read(name)
            if name == chosen:
                body = damaged(body, rng, [body])
            name = rng.choice(("a.npy", "../a.npy", "a", name * 20)) if rng.random() < 0.05 else name
            packed.writestr(name, body, rng.choice((zipfile.ZIP_STORED, zipfile.ZIP_DEFLATED)))
    return target.getvalue()


def fault_of(read: Callable[[Path], object], path: Path, error_type: type[Exception]) -> tuple[str, bool]:
    """What is wrong with how a file was read ("" for nothing), and whether it was refused."""
    faulthandler.dump_traceback_later(SECONDS, exit=True)
    try:
        read(path)
    except error_type as error:
        message = str(error)
        lines = message.split("\n") if getattr(error, "whole", False) else [message]
        if not all(map(str.isprintable, lines)):
            return f"a message that does not print: {message!r}", True
        longest = max(map(len, lines))
        return (f"a message of {longest} characters" if longest > LONGEST else ""), True
    except BaseException:
        return traceback.format_exc(limit=-6), False
    finally:
        faulthandler.cancel_dump_traceback_later()
    return "", False


def limit_memory() -> None:
    """From now on this process may take `MEMORY` more."""
    status = Path("/proc/self/status").read_text()
    used = 1024 * int(next(line for line in status.splitlines() if line.startswith("VmSize:")).split()[1])
    resource.setrlimit(resource.RLIMIT_AS, (used + MEMORY, resource.RLIM_INFINITY))


def fuzzed(name: str, count: int, seed: int, folder: Path, keep: Path | None = None) -> dict[str, object]:
    """What became of a format's bombs and of `count` damaged files: numbers, and faults by trial.

    This process has little memory from now on.
    """
    from fuzz_seeds import BOMBS, FORMATS

    from clvol.errors import Error

    kind, rng = FORMATS[name], random.Random(f"{name} {seed}")
    seeds = kind.seeds(folder)
    path = folder / (name if name[0] != "." else f"file{name}")
    for whole in seeds:
        path.write_bytes(whole)
        kind.read(path)
    bombs = list(BOMBS[name](MEMORY)) if name in BOMBS else []
    limit_memory()
    refused, faults, slowest = 0, [], 0.0
    for trial in range(-len(bombs), count):
        data = bombs[trial] if trial < 0 else damaged(rng.choice(seeds), rng, seeds)
        path.write_bytes(data)
        if keep:
            (keep / "last").write_bytes(data)
        began = time.perf_counter()
        fault, was_refused = fault_of(kind.read, path, Error)
        slowest = max(slowest, time.perf_counter() - began)
        refused += was_refused and trial >= 0
        if trial < 0 and not was_refused:
            fault = fault or "a bomb is no error"
        if fault:
            faults.append((trial, fault))
            if keep:
                (keep / f"{trial}-{path.name}").write_bytes(data)
    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss >> 10
    return {"files": count, "refused": refused, "faults": faults, "slowest": slowest, "peak_mib": peak}


def main() -> None:
    """Read damaged files, and print what became of them."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("names")
    parser.add_argument("count", type=int)
    parser.add_argument("seed", type=int)
    parser.add_argument("--keep", type=Path)
    given = parser.parse_args()
    from fuzz_seeds import FORMATS

    logging.getLogger("clvol").addHandler(logging.NullHandler())
    said = {}
    memory = Path("/dev/shm")
    with tempfile.TemporaryDirectory(dir=memory if memory.is_dir() else None) as folder:
        for name in FORMATS if given.names == "all" else given.names.split(","):
            print(f"# {name}", file=sys.stderr, flush=True)
            started = time.process_time()
            said[name] = fuzzed(name, given.count, given.seed, Path(folder), given.keep)
            said[name]["seconds"] = round(time.process_time() - started, 2)
    print(json.dumps(said))


if __name__ == "__main__":
    main()
