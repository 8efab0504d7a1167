"""Kernels of PoCL are built side by side, in processes of their own.

PoCL builds one kernel at a time in a process, in however many threads and contexts it is asked.  What it
builds lies in its cache, and another process that asks for the same finds it there.  Nothing depends on the
workers but time: what they did not build, this process builds, and says what is wrong with it.
"""

from __future__ import annotations

import json
import logging
import os
import subprocess
import sys
import threading
from collections import deque
from dataclasses import asdict, dataclass
from hashlib import blake2b
from pathlib import Path
from typing import TYPE_CHECKING, Self

import pyopencl as cl

from clvol.device import build_worker, kernel_cache

if TYPE_CHECKING:
    from collections.abc import Iterable

    from clvol.device.device import Device

log = logging.getLogger("clvol")
VARIABLE = "CLVOL_BUILD_PROCESSES"
"""Environment variable: the most processes that build kernels; below 2 none but this one does."""
WORTH_IT = 3
"""Kernels that are missing from which on processes are started: each takes a third of a second to do so."""
INDEX = "clvol-built"
"""A file in PoCL's cache with the keys of kernels that are in it, a line each."""
_GLANCE = 0.1
"""Seconds after which a wait sees whether the processes are still there."""
_SMALL = 0xFFFF
"""Work-items from which on PoCL compiles a kernel anew, for large numbers of them."""


@dataclass(frozen=True)
class Unit:
    """A kernel, and the launch that it is built for.

    source, options : its program.  name : of the kernel.  size, group : work-items in all and of a group.
    """

    source: str
    options: tuple[str, ...]
    name: str
    size: int
    group: int

    def key(self, driver: str) -> str:
        """Names what `driver` builds of it."""
        parts = [driver, *self.options, self.name, str(self.group), str(self.size < _SMALL), self.source]
        return blake2b("\n".join(parts).encode(), digest_size=12).hexdigest()


class SideBuilds:
    """Processes that build those of `units` that PoCL's cache lacks, as long as the block runs.

    There are none where the cache has them all, on other devices, and where there is but one core.
    """

    def __init__(self, device: Device, units: Iterable[Unit]) -> None:
        self._index = _index(device)
        new = [unit for unit in units if unit.source not in device.programs] if self._index else []
        driver = f"{device.description} {device.queue.device.driver_version}"
        known = _known(self._index) if new else set()
        self._missing = {unit: key for unit in new if (key := unit.key(driver)) not in known}
        self._jobs = deque(sorted(self._missing, key=lambda unit: -len(unit.source)))
        self._built: dict[Unit, threading.Event] = {}
        self._threads: list[threading.Thread] = []
        self.processes: list[subprocess.Popen[str]] = []
        count = min(len(self._missing), _most(device))
        if len(self._missing) >= WORTH_IT and count > 1:
            self._built = {unit: threading.Event() for unit in self._missing}
            try:
                self._start(device, count)
            except BaseException:
                self.__exit__()
                raise

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        """Leave no process behind, whatever happened."""
        self._jobs.clear()
        for process in self.processes:
            process.kill()
        for process in self.processes:
            process.wait()
        for thread in self._threads:
            thread.join()

    def wait(self, unit: Unit) -> None:
        """Return once a process has built a unit or given up on it, at once where none is to."""
        built = self._built.get(unit)
        while built and not built.wait(_GLANCE) and any(thread.is_alive() for thread in self._threads):
            pass

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
        while True:
            try:
                unit = self._jobs.popleft()
            except IndexError:
                return
            done = _ask(process, place | {"kernel": asdict(unit)})
            self._built[unit].set()
            if not done:
                log.debug("a process that builds kernels ended at %s", unit.name)
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
    """How many processes may build: one per thread of the device, where this Python can start another."""
    given = os.environ.get(VARIABLE, "")
    most = int(given) if given.isdecimal() else device.info.compute_units
    return most if "python" in Path(sys.executable or "").name.lower() else 0
