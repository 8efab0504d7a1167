"""OpenCL devices: listing them, choosing one, and the context everything else is handed."""

from __future__ import annotations

import os
import shutil
import subprocess
from dataclasses import dataclass, field
from functools import cache, cached_property
from typing import TYPE_CHECKING

import pyopencl as cl

from clvol.device import kernel_cache
from clvol.device.driver import driver_errors
from clvol.device.memory import DeviceMemory
from clvol.errors import DeviceError, shown

if TYPE_CHECKING:
    from collections.abc import Callable, Hashable, Sequence

_KINDS = ("GPU", "ACCELERATOR", "CPU")
_POCL = "Portable Computing Language"
_LINKER_SECONDS = 30


@dataclass(frozen=True)
class DeviceInfo:
    """One OpenCL device; memory in bytes."""

    index: int
    platform: str
    name: str
    version: str
    kind: str
    compute_units: int
    global_memory: int

    def matches(self, pattern: str) -> bool:
        """Whether `pattern` is the index, or part of the platform's or device's name (any case)."""
        text = f"{self.platform} {self.name} {self.kind}".lower()
        return (pattern.isdecimal() and int(pattern) == self.index) or pattern.lower() in text


@dataclass(frozen=True, eq=False)
class Device:
    """An opened device: context and in-order profiling queue."""

    info: DeviceInfo
    context: cl.Context
    queue: cl.CommandQueue
    programs: dict[Hashable, cl.Program] = field(default_factory=dict)
    """Built programs by source and options: a second render with the same choices builds nothing."""
    building: dict[Hashable, Callable[[], None]] = field(default_factory=dict)
    """What other processes build (clvol.device.side_builds), likewise, and how to wait for each."""
    samples: dict[str, int] = field(default_factory=dict)
    """By source: how many were rendered by programs that are not optimised (clvol.device.quick)."""

    @cached_property
    def is_cpu(self) -> bool:
        """Whether it renders on a processor, whose threads this process counts as its own."""
        return self.info.kind == "CPU"

    @property
    def is_pocl(self) -> bool:
        """Whether PoCL runs it, on the processor."""
        return self.is_cpu and _POCL in self.info.platform

    @property
    def description(self) -> str:
        """Name and platform, as users see them."""
        return f"{self.info.name} ({self.info.platform})"

    @cached_property
    def memory(self) -> DeviceMemory:
        """Where buffers are made."""
        device = self.queue.device
        return DeviceMemory(
            self.context,
            self.description,
            total=int(device.global_mem_size),
            largest=int(device.max_mem_alloc_size),
            shared=bool(device.host_unified_memory),
        )


@dataclass(eq=False)
class _Drivers:
    """Every device there is, and what drivers said that have none."""

    devices: list[tuple[DeviceInfo, cl.Device]]
    failures: list[str]


_in_use_by: int | None = None
"""The process that first asked a driver for its devices."""


def _refuse_after_fork() -> None:
    """Drivers' threads do not come along into a forked process, which then waits for them for ever."""
    if _in_use_by not in (None, os.getpid()):
        raise DeviceError(
            "OpenCL was in use before this process was forked from its parent, and would hang in it",
            hint='start workers with multiprocessing.get_context("spawn"), or before anything is rendered',
        )


def _found() -> _Drivers:
    global _in_use_by
    _refuse_after_fork()
    _in_use_by = os.getpid()
    kernel_cache.kernel_folder()  # PoCL reads its variable when it is first asked
    drivers = _Drivers([], [])
    try:
        platforms = cl.get_platforms()
    except cl.Error as error:
        platforms = []
        if error.code != cl.status_code.PLATFORM_NOT_FOUND_KHR:
            drivers.failures.append(str(error))
    for platform in platforms:
        try:
            devices = platform.get_devices()
        except cl.Error as error:
            devices = []
            if error.code != cl.status_code.DEVICE_NOT_FOUND:
                drivers.failures.append(f"{platform.name.strip()}: {error}")
        for device in devices:
            kind = next((name for name in _KINDS if device.type & getattr(cl.device_type, name)), "CUSTOM")
            info = DeviceInfo(
                len(drivers.devices),
                platform.name.strip(),
                device.name.strip(),
                device.version.strip(),
                kind,
                device.max_compute_units,
                device.global_mem_size,
            )
            drivers.devices.append((info, device))
    return drivers


def list_devices() -> list[DeviceInfo]:
    """Every OpenCL device of this machine, in the order `--device` numbers them; DeviceError for none."""
    return [info for info, _ in _usable()]


def _usable() -> list[tuple[DeviceInfo, cl.Device]]:
    """Every device; DeviceError with the drivers' reasons where there is none."""
    drivers = _found()
    if not drivers.devices and drivers.failures:
        raise DeviceError(f"no OpenCL device can be used: {'; '.join(drivers.failures)}")
    if not drivers.devices:
        raise DeviceError(
            "no OpenCL device found",
            hint="`pip install pocl-binary-distribution` (Linux x86-64), or install your vendor's driver",
        )
    return drivers.devices


ALL = "all"
"""Instead of a device: every one there is."""


def names_several(given: object) -> bool:
    """Whether this, instead of a device, stands for any number of them: a list, or "all"."""
    return isinstance(given, list | tuple) or (isinstance(given, str) and given == ALL)


def open_devices(given: Sequence[str | int] | str) -> list[Device]:
    """Open the devices of a list, each as `open_device` takes it, or "all"; none of them twice.

    Raises DeviceError where there is none, or one that is in the list is not there.
    """
    if isinstance(given, str) and given == ALL:
        return [_open(info.index) for info, _ in _usable()]
    if not given:
        raise DeviceError("the list of devices is empty", hint=f'name some, or "{ALL}"')
    opened = [open_device(pattern) for pattern in given]  # type: ignore[arg-type]
    again = next((device for n, device in enumerate(opened) if device in opened[:n]), None)
    if again is not None:
        raise DeviceError(f"{again.info.index}, {again.description}, is listed twice")
    return opened


def open_device(pattern: str | None = None) -> Device:
    """Open the device that `pattern` selects: an index, or part of a platform's or device's name.

    Without a pattern, the variable CLVOL_DEVICE, then the first GPU, then the first device.
    Raises DeviceError where there is none.
    """
    found = _usable()
    pattern = pattern if pattern is not None else os.environ.get("CLVOL_DEVICE", "")
    if not isinstance(pattern, str | int) or isinstance(pattern, bool):
        raise DeviceError(f"a device is a number or part of a name, not {shown(pattern)}")
    if pattern != "":
        chosen = [pair for pair in found if pair[0].matches(str(pattern))]
        if not chosen:
            names = "; ".join(f"{info.index}: {info.name} ({info.platform})" for info, _ in found)
            raise DeviceError(f"no OpenCL device matches {shown(pattern)}", hint=f"there are: {names}")
    else:
        chosen = [pair for pair in found if pair[0].kind == "GPU"] or found
    return _open(chosen[0][0].index)


@cache
def _open(index: int) -> Device:
    """One context and queue per device and process."""
    info, device = _found().devices[index]
    kernel_cache.open_call_cache()
    if _POCL in info.platform:
        _prepare_pocl()
    with driver_errors(info.name):
        context = cl.Context([device])
        queue = cl.CommandQueue(context, properties=cl.command_queue_properties.PROFILING_ENABLE)
    return Device(info, context, queue)


def _prepare_pocl() -> None:
    """See to what PoCL needs to build kernels, since it ends the process where that is missing."""
    os.environ.setdefault("PATH", os.defpath)  # where it looks for the linker
    linker = shutil.which("ld")
    if linker is None:
        raise DeviceError("PoCL needs the linker `ld` to build kernels", hint="install binutils")
    try:
        subprocess.run([linker, "--version"], capture_output=True, check=True, timeout=_LINKER_SECONDS)
    except (OSError, subprocess.SubprocessError) as error:
        raise DeviceError(
            f"PoCL needs the linker `ld` to build kernels, and {linker} does not run ({error})",
            hint="reinstall binutils, or put another ld first on PATH",
        ) from None
    kernel_cache.check(kernel_cache.kernel_folder())
