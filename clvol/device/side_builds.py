"""Kernels of PoCL are built side by side, in this process and others.

PoCL builds one kernel at a time in a process, in however many threads and contexts it is asked.  What it
builds lies in its cache, and another process that asks for the same finds it there.  Nothing depends on the
workers but time: what they did not build is built when it is needed, and then said what is wrong with it.
"""

from __future__ import annotations

import json
import logging
import os
import subprocess
import sys
import threading
from collections import deque
from contextlib import suppress
from dataclasses import asdict, dataclass
from functools import partial
from hashlib import blake2b
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple, Self

import pyopencl as cl

from clvol.device import build_worker, kernel_cache

if TYPE_CHECKING:
    from collections.abc import Hashable, Iterable

    from clvol.device.device import Device

log = logging.getLogger("clvol")
VARIABLE = "CLVOL_BUILD_PROCESSES"
"""Environment variable: the most processes that build kernels, this one among them."""
WORTH_IT = 3
"""Kernels that are missing from which on processes are started: each takes a third of a second to do so."""
INDEX = "clvol-built"
"""A file in PoCL's cache with the keys of kernels that are in it, a line each."""
_GLANCE = 0.1
"""Seconds after which a wait sees whether the processes are still there."""
_SMALL = 0xFFFF
"""Work-items from which on PoCL compiles a kernel anew, for large numbers of them."""


class Launch(NamedTuple):
    """A launch that a kernel is built for: its name, and work-items in all and of a group."""

    name: str
    size: int
    group: int


@dataclass(frozen=True)
class Unit:
    """A program with its options, and what is launched of it."""

    source: str
    options: tuple[str, ...]
    launches: tuple[Launch, ...]

    @property
    def program(self) -> tuple[str, tuple[str, ...]]:
        """Tells its program from others, wherever it is launched."""
        return self.source, self.options

    def key(self, driver: str) -> str:
        """Names what `driver` builds of it."""
        launches = [f"{launch.name} {launch.group} {launch.size < _SMALL}" for launch in self.launches]
        parts = [driver, *self.options, *launches, self.source]
        return blake2b("\n".join(parts).encode(), digest_size=12).hexdigest()


class SideBuilds:
    """Processes that build those of `units` that PoCL's cache lacks, as long as the block runs.

    This process builds as well whenever it waits for one.  There are no others where the cache has all
    units, on other devices, and where there is but one core.
    """

    def __init__(self, device: Device, units: Iterable[Unit]) -> None:
        self._device, self._index = device, _index(device)
        new = [unit for unit in units if unit.program not in device.programs] if self._index else []
        known = _known(self._index) if new else set()
        driver = _driver(device)
        self._missing = {unit: key for unit in new if (key := unit.key(driver)) not in known}
        self._jobs = deque(sorted(self._missing, key=lambda unit: -len(unit.source)))
        self._built: dict[Hashable, threading.Event] = {}
        self._threads: list[threading.Thread] = []
        self.processes: list[subprocess.Popen[str]] = []
        others = min(len(self._missing), _most(device)) - 1
        if len(self._missing) >= WORTH_IT and others > 0:
            self._built = {unit.program: threading.Event() for unit in self._missing}
            device.building.update({program: partial(self.wait, program) for program in self._built})
            try:
                self._start(device, others)
            except BaseException:
                self.__exit__()
                raise

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        """Leave no process behind, whatever happened."""
        self._jobs.clear()
        for program in self._built:
            self._device.building.pop(program, None)
        for process in self.processes:
            process.kill()
        for process in self.processes:
            process.wait()
        for thread in self._threads:
            thread.join()
        for process in self.processes:
            for pipe in (process.stdin, process.stdout):
                with suppress(OSError):  # of what was not read any more
                    if pipe:
                        pipe.close()

    def wait(self, program: Hashable) -> None:
        """Return once a unit's program is built or given up.  Until then this process builds what is left."""
        built = self._built[program]
        while not built.is_set() and (unit := self._next()):
            with suppress(cl.Error):  # said when the program is needed
                build_worker.build(self._device.queue, **asdict(unit))
            self._built[unit.program].set()
        while not built.wait(_GLANCE) and any(thread.is_alive() for thread in self._threads):
            pass

    def _next(self) -> Unit | None:
        """The largest unit that nobody has begun."""
        try:
            return self._jobs.popleft()
        except IndexError:
            return None

    def remember(self) -> None:
        """Note that PoCL's cache has all units."""
        if self._index and self._missing:
            try:
                with self._index.open("a") as file:
                    file.writelines(f"{key}\n" for key in self._missing.values())
            except OSError as error:
                log.debug("%s cannot be written: %s", self._index, error)

    def _start(self, device: Device, count: int) -> None:
        platform = device.queue.device.platform
        place = {
            "platform": cl.get_platforms().index(platform),
            "device": platform.get_devices().index(device.queue.device),
        }
        environment = os.environ | {"PYTHONPATH": os.pathsep.join(filter(None, sys.path))}
        for _ in range(count):
            process = subprocess.Popen(
                [sys.executable, "-P", build_worker.__file__],
                stdin=subprocess.PIPE,
                stdout=subprocess.PIPE,
                stderr=subprocess.DEVNULL,
                text=True,
                env=environment,
                start_new_session=True,  # a terminal's Ctrl-C is this process's to handle
            )
            self.processes.append(process)
            self._threads.append(threading.Thread(target=self._serve, args=(process, place), daemon=True))
            self._threads[-1].start()

    def _serve(self, process: subprocess.Popen[str], place: dict[str, int]) -> None:
        """Hand a process one unit after the other, until it ends."""
        while unit := self._next():
            done = _ask(process, place | {"unit": asdict(unit)})
            self._built[unit.program].set()
            if not done:
                log.debug("a process that builds kernels ended at %s", unit.launches)
                return


def _ask(process: subprocess.Popen[str], job: dict[str, object]) -> bool:
    """Have a process do a job; whether it did."""
    assert process.stdin
    assert process.stdout
    try:
        process.stdin.write(json.dumps(job) + "\n")
        process.stdin.flush()
        return bool(process.stdout.readline())
    except OSError:
        return False


def in_cache(device: Device, units: Iterable[Unit]) -> set[Unit]:
    """Those that this process has built, or that PoCL's cache has."""
    known, driver = _known(_index(device)), _driver(device)
    return {unit for unit in units if unit.program in device.programs or unit.key(driver) in known}


def _driver(device: Device) -> str:
    return f"{device.description} {device.queue.device.driver_version}"


def _index(device: Device) -> Path | None:
    """The index of PoCL's cache; None on devices of others."""
    folder = kernel_cache.kernel_folder().path
    return folder / INDEX if folder and device.is_pocl else None


def _known(index: Path | None) -> set[str]:
    try:
        return set(index.read_text().split()) if index else set()
    except (OSError, UnicodeDecodeError):
        return set()


def _most(device: Device) -> int:
    """How many processes may build: one for each thread of the device, where this Python can start more."""
    given = os.environ.get(VARIABLE, "")
    most = int(given) if given.isdecimal() else device.info.compute_units
    return most if "python" in Path(sys.executable or "").name.lower() else 0
