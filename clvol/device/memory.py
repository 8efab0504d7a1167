"""Memory that buffers may take, counted before anything is put into it.

Drivers reserve buffers without filling them: PoCL hands out more than the machine has, and the process dies
at the first launch that writes there.  So what is handed out is added up, and what would not fit is refused.
"""

from __future__ import annotations

import weakref

import numpy as np
import pyopencl as cl

from clvol.base.memory import available_memory
from clvol.errors import DeviceError

KEPT_FREE = 1 / 16
"""Share of the machine's free memory that buffers leave to everything else."""


class Buffer(cl.Buffer):
    """A buffer whose end can be watched, which pyopencl's own cannot."""


class DeviceMemory:
    """What the buffers of one context take, against what there is.

    Parameters
    ----------
    context : where buffers are made.  name : what messages call the device.
    total, largest : bytes of the device, and of the largest single buffer.
    shared : the device works in the machine's own memory, so that other programs and limits count.
    """

    def __init__(self, context: cl.Context, name: str, total: int, largest: int, shared: bool) -> None:
        self.context, self.name = context, name
        self.total, self.largest, self.shared = total, largest, shared
        self.taken = 0
        self.limit = total

    def allocate(self, size: int, what: str, hint: str) -> cl.Buffer:
        """An uninitialised buffer of `size` bytes; DeviceError where there is no room for `what`."""
        return self._make(size, what, hint)

    def upload(self, array: np.ndarray, what: str, hint: str = "") -> cl.Buffer:
        """A buffer with a copy of an array; DeviceError where there is no room for `what`."""
        array = np.ascontiguousarray(array)
        return self._make(array.nbytes, what, hint, array)

    def _make(self, size: int, what: str, hint: str, array: np.ndarray | None = None) -> cl.Buffer:
        if size > self.largest:
            sizes = f"a buffer of {_megabytes(size)}, where {_megabytes(self.largest)} are allowed"
            raise DeviceError(f"{what} needs {sizes} on {self.name}", hint=hint)
        self.require(size, what, hint)
        flags = cl.mem_flags.READ_WRITE | (0 if array is None else cl.mem_flags.COPY_HOST_PTR)
        try:
            buffer = Buffer(self.context, flags, 0 if array is not None else max(size, 4), hostbuf=array)
        except cl.Error as error:
            raise DeviceError(f"{self.name} has no {_megabytes(size)} for {what}", hint=hint) from error
        self.taken += size
        weakref.finalize(buffer, self._give_back, size).atexit = False
        return buffer

    def require(self, size: int, what: str, hint: str) -> None:
        """DeviceError unless `size` more bytes fit beside the buffers there are.

        The machine is asked while no buffer is out: later its free memory depends on how far they are filled.
        """
        self.room()
        if self.taken + size > self.limit:
            beside = f" beside {_megabytes(self.taken)} in use" if self.taken else ""
            raise DeviceError(
                f"{what} needs {_megabytes(size)}{beside}; {self.name} has {_megabytes(self.limit)} in all",
                hint=hint,
            )

    def room(self) -> int:
        """Bytes that fit beside the buffers there are."""
        if self.taken == 0:
            free = available_memory() if self.shared else None
            self.limit = self.total if free is None else int(free * (1 - KEPT_FREE))
        return self.limit - self.taken

    def _give_back(self, size: int) -> None:
        self.taken -= size


def _megabytes(size: int) -> str:
    return f"{size / 2**20:,.0f} MiB"
