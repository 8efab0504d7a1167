"""How kernels are given their arguments, launched and read."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
import pyopencl as cl

if TYPE_CHECKING:
    from collections.abc import Iterable, Mapping, Sequence

    from clvol.device.device import Device

GROUP = 64
"""Work-items of a group, where a kernel has no wish of its own."""


def set_arguments(kernel: cl.Kernel, *values: Any) -> None:
    """Bind every argument of a kernel.

    One by one: pyopencl's own call for all goes through a cache in the user's home, which may be damaged.
    """
    for number, value in enumerate(values):
        kernel.set_arg(number, value)


def scene_arguments(
    names: Iterable[str],
    buffers: Mapping[str, cl.Buffer],
    slot_stride: int,
    unused: cl.Buffer | None = None,
) -> list[Any]:
    """What a kernel takes of the scene, by name (clvol.device.programs.arguments_of).

    unused
        Stands for buffers that are not there; None: KeyError.
    """
    found: list[Any] = []
    for name in names:
        if name == "slot_stride":
            found.append(np.uint32(slot_stride))
        else:
            found.append(buffers[name] if unused is None else buffers.get(name, unused))
    return found


def launch(device: Device, kernel: cl.Kernel, count: int, group: int = GROUP) -> cl.Event:
    """Queue a kernel for `count` work-items or, where they do not fill the last group, a few more."""
    return cl.enqueue_nd_range_kernel(device.queue, kernel, (whole(count, group),), (group,))


def whole(count: int, group: int = GROUP) -> int:
    """Work-items that a launch for `count` has: those of whole groups."""
    return -(-count // group) * group


def run_kernel(
    device: Device,
    kernel: cl.Kernel,
    count: int,
    resident: Sequence[Any],
    inputs: Sequence[np.ndarray],
    outputs: Sequence[np.ndarray],
    scalars: Sequence[Any] = (),
    group: int = GROUP,
    purpose: tuple[str, str] = ("the arrays of a kernel", ""),
) -> cl.Event:
    """Run a kernel once on arrays of the host.

    Parameters
    ----------
    resident
        Its first arguments: buffers that are on the device, and scalars.
    inputs, outputs
        Arrays, its next arguments.  All go in, and `outputs`, which are contiguous, come back in place.
    scalars
        NumPy scalars, its last arguments.
    purpose
        What the arrays are for, and what helps where there is no room for them.

    Returns
    -------
    pyopencl.Event
        The kernel has run.
    """
    buffers = [device.memory.upload(array, *purpose) for array in (*inputs, *outputs)]
    set_arguments(kernel, *resident, *buffers, *scalars)
    event = launch(device, kernel, count, group)
    for host, buffer in zip(outputs, buffers[len(inputs) :], strict=True):
        if host.size:
            cl.enqueue_copy(device.queue, host, buffer, is_blocking=True)
    event.wait()
    return event
