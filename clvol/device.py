"""OpenCL devices: listing them, choosing one, and the context everything else is handed."""

from __future__ import annotations

import os
import shutil
from dataclasses import dataclass, field
from functools import cache, cached_property

import pyopencl as cl

from clvol.errors import DeviceError

_KINDS = ("GPU", "ACCELERATOR", "CPU")


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
        return (pattern.isdigit() and int(pattern) == self.index) or pattern.lower() in text


@dataclass(frozen=True, eq=False)
class Device:
    """An opened device: context and in-order profiling queue."""

    info: DeviceInfo
    context: cl.Context
    queue: cl.CommandQueue
    programs: dict[str, cl.Program] = field(default_factory=dict)
    """Built programs by source: a second render with the same features and choices builds nothing."""

    @cached_property
    def is_cpu(self) -> bool:
        return self.info.kind == "CPU"

    @property
    def description(self) -> str:
        return f"{self.info.name} ({self.info.platform})"

    def allocate(self, size: int, what: str, hint: str) -> cl.Buffer:
        """An uninitialised buffer of `size` bytes; DeviceError where the device has no room for `what`."""
        limit = int(self.queue.device.max_mem_alloc_size)
        if size > limit:
            sizes = f"a buffer of {size / 2**20:.0f} MiB, where {limit / 2**20:.0f} are allowed"
            raise DeviceError(f"{what} needs {sizes} on {self.description}", hint=hint)
        try:
            return cl.Buffer(self.context, cl.mem_flags.READ_WRITE, max(size, 4))
        except cl.Error as error:
            raise DeviceError(
                f"{self.description} has no {size / 2**20:.0f} MiB for {what}", hint=hint
            ) from error


def _found() -> list[tuple[DeviceInfo, cl.Device]]:
    try:
        platforms = cl.get_platforms()
    except cl.Error:
        platforms = []
    found = []
    for platform in platforms:
        try:
            devices = platform.get_devices()
        except cl.Error:
            continue
        for device in devices:
            kind = next((name for name in _KINDS if device.type & getattr(cl.device_type, name)), "CUSTOM")
            info = DeviceInfo(
                len(found),
                platform.name.strip(),
                device.name.strip(),
                device.version.strip(),
                kind,
                device.max_compute_units,
                device.global_mem_size,
            )
            found.append((info, device))
    return found


def list_devices() -> list[DeviceInfo]:
    """Every OpenCL device of this machine, in the order `--device` numbers them."""
    return [info for info, _ in _found()]


def open_device(pattern: str | None = None) -> Device:
    """Open the device that `pattern` selects: an index, or part of a platform's or device's name.

    Without a pattern, the variable CLVOL_DEVICE, then the first GPU, then the first device.
    Raises DeviceError where there is none.
    """
    found = _found()
    if not found:
        raise DeviceError(
            "no OpenCL device found",
            hint="`pip install pocl-binary-distribution` (Linux x86-64), or install your vendor's driver",
        )
    pattern = pattern if pattern is not None else os.environ.get("CLVOL_DEVICE")
    if pattern:
        chosen = [pair for pair in found if pair[0].matches(str(pattern))]
        if not chosen:
            names = "; ".join(f"{info.index}: {info.name} ({info.platform})" for info, _ in found)
            raise DeviceError(f"no OpenCL device matches {pattern!r}", hint=f"there are: {names}")
    else:
        chosen = [pair for pair in found if pair[0].kind == "GPU"] or found
    return _open(chosen[0][0].index)


@cache
def _open(index: int) -> Device:
    """One context and queue per device and process."""
    info, device = _found()[index]
    if "Portable Computing Language" in info.platform and shutil.which("ld") is None:
        raise DeviceError("PoCL needs the linker `ld` to build kernels", hint="install binutils")
    context = cl.Context([device])
    queue = cl.CommandQueue(context, properties=cl.command_queue_properties.PROFILING_ENABLE)
    return Device(info, context, queue)
