"""A program of its own: builds the kernels that it is sent, so that PoCL's cache has them (side_builds.py).

It reads jobs from standard input, a JSON object a line, and answers each with a line once it is done.  It
ends when its input does, or when it is killed.  It imports nothing of clvol, and starts the sooner.
"""

import json
import sys
from typing import Any

import numpy as np
import pyopencl as cl

_MOST = 1 << 17
"""Work-items of a launch: more than what PoCL calls a small number."""
_BYTES = 64 * _MOST
"""Of the buffer that stands for all.  A work-item that finds only zeros looks at one line of it."""


def main() -> None:
    """Do jobs until there are no more."""
    device: cl.Device | None = None
    for line in sys.stdin:
        job = json.loads(line)
        if device is None:
            device = cl.get_platforms()[job["platform"]].get_devices()[job["device"]]
            queue = cl.CommandQueue(cl.Context([device]))
        build(queue, **job["unit"])
        print("done", flush=True)


def build(
    queue: cl.CommandQueue, source: str, options: list[str], launches: list[tuple[str, int, int]]
) -> None:
    """Build a program, and launch its kernels over zeros: with its first launch one is compiled to the end.

    PoCL compiles for the size of a group, and once for small numbers of them and once for others.
    """
    program = cl.Program(queue.context, source).build(options=list(options))
    arguments: list[Any] = [_zeros(queue.context), np.uint32(0)]
    for name, size, group in launches:
        kernel = cl.Kernel(program, name)
        for number in range(kernel.num_args):
            _set_either(kernel, number, arguments)
        cl.enqueue_nd_range_kernel(queue, kernel, (min(size, _MOST),), (group,)).wait()


def _zeros(context: cl.Context) -> cl.Buffer:
    flags = cl.mem_flags.READ_WRITE | cl.mem_flags.COPY_HOST_PTR
    return cl.Buffer(context, flags, hostbuf=np.zeros(_BYTES, np.uint8))


def _set_either(kernel: cl.Kernel, number: int, values: list[Any]) -> None:
    """Set an argument to a buffer or a number, whichever it is: they differ in size."""
    *others, last = values
    for value in others:
        try:
            kernel.set_arg(number, value)
            return
        except cl.Error:
            continue
    kernel.set_arg(number, last)


if __name__ == "__main__":
    main()
