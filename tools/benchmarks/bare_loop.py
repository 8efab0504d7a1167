"""The practical limit of tracking: random number, logarithm and gather in a loop without any control flow.

That is what a free flight with one look-up needs at the least.  Look-ups per CPU second of a render, as a
share of this loop's steps, say how much of the time goes into everything else: the other seven voxels, cells,
branches, memory that is waited for, scattering, and the wavefront.
"""

from __future__ import annotations

import time

import click
import numpy as np
import pyopencl as cl

from benchmarks.volumes import cloud
from clvol.device.device import open_device
from clvol.device.launch import run_kernel
from clvol.device.programs import build

VOXELS = 128
LANES = 8
ITEMS, STEPS, GROUP = 1 << 12, 1 << 11, 16
ROUNDS = 5
KERNEL = """
/* Eight streams of PCG (O'Neill 2014) side by side, a free flight's logarithm, and one voxel each. */
__kernel void bare_loop(__global const float *volume, __global float *sums, uint steps)
{
    const uint8 lane = (uint8)(0, 1, 2, 3, 4, 5, 6, 7);
    uint8 state = (lane + 8u * (uint)get_global_id(0)) * 2654435769u;
    float8 sum = 0.0f;
    for (uint step = 0; step < steps; ++step) {
        state = state * 747796405u + 2891336453u;
        uint8 word = ((state >> ((state >> 28) + 4u)) ^ state) * 277803737u;
        word ^= word >> 22;
        const float8 uniform_number = convert_float8(word >> 8) * 0x1p-24f + 0x1p-25f;
        const uint8 at = word & VOXELS;
        const float8 density = (float8)(volume[at.s0], volume[at.s1], volume[at.s2], volume[at.s3],
                                        volume[at.s4], volume[at.s5], volume[at.s6], volume[at.s7]);
        sum -= log(uniform_number) * density;
    }
    const float4 half_sum = sum.lo + sum.hi;
    sums[get_global_id(0)] = half_sum.x + half_sum.y + half_sum.z + half_sum.w;
}
"""


def steps_per_second(rounds: int = ROUNDS) -> float:
    """Steps of the loop that a CPU second is enough for, the most of several rounds."""
    device = open_device()
    program = build(device, f"#define VOXELS {VOXELS**3 - 1}u\n{KERNEL}", "bare_loop")
    kernel = cl.Kernel(program, "bare_loop")
    density, sums = cloud(VOXELS).ravel(), np.zeros(ITEMS, np.float32)
    resident = [device.memory.upload(density, "a volume", ""), device.memory.upload(sums, "sums", "")]
    best = 0.0
    for _ in range(rounds + 1):  # the first one builds
        cpu = time.process_time()
        event = run_kernel(device, kernel, ITEMS, resident, [], [], [np.uint32(STEPS)], GROUP)
        seconds = time.process_time() - cpu
        if not device.is_cpu:
            seconds = 1e-9 * (event.profile.end - event.profile.start)
        best = max(best, ITEMS * STEPS * LANES / seconds)
    return best


@click.command()
def main() -> None:
    """Print how many steps of the bare loop a CPU second is enough for."""
    click.echo(steps_per_second())


if __name__ == "__main__":
    main()
