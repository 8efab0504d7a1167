"""What drivers say went wrong on a device, as errors that say what to do."""

from __future__ import annotations

from contextlib import contextmanager
from typing import TYPE_CHECKING, Any

import pyopencl as cl

from clvol.errors import DeviceError

if TYPE_CHECKING:
    from collections.abc import Iterator

_SMALLER = "render fewer pixels or a volume of lower resolution, or choose a device with more memory"
_FULL = "ran out of memory", _SMALLER
_SPENT = "ran out of memory, or a kernel ran for longer than it may", _SMALLER
_LOST = "was lost", "render again once it is there: the system's log may say why"
_SAID = {
    **dict.fromkeys(("MEM_OBJECT_ALLOCATION_FAILURE", "OUT_OF_HOST_MEMORY"), _FULL),
    "OUT_OF_RESOURCES": _SPENT,
    **dict.fromkeys(("DEVICE_NOT_AVAILABLE", "INVALID_CONTEXT", "INVALID_COMMAND_QUEUE"), _LOST),
}
"""What to say of a status code and what to do, by its name."""


def _status(code: int) -> str:
    names: Any = cl.status_code
    return str(names.to_string(code, "code %d"))


@contextmanager
def driver_errors(name: str) -> Iterator[None]:
    """Within the block what the driver of the device `name` raises becomes a DeviceError."""
    try:
        yield
    except cl.Error as error:
        code = _status(error.code)
        what, hint = _SAID.get(code, ("failed", "render again, or choose another device"))
        raise DeviceError(f"{name} {what} ({code} in {error.routine or 'OpenCL'})", hint=hint) from error
