"""Writes the numbers that paths decide by, as bytes, for tests of random numbers.

Over neighbouring samples of neighbouring pixels, as a render reads them:
`python tools/random_numbers.py | dieharder -g 200 -a`.
"""

from __future__ import annotations

import sys

import click
import numpy as np

from clvol.device.device import open_device
from clvol.planning.choices import Choices
from clvol.rendering.scene_kernels import SceneKernels
from clvol.scene.loader import load_dict

BLOCKS = 1 << 18
SAMPLES = 64
TEXT = """#include "core/sampler.h"
__kernel void numbers(CLVOL_ARGUMENTS, __global uint *out, uint first, uint count)
{
    const Scene scene_ = CLVOL_SCENE;
    const uint i = get_global_id(0);
    if (i >= count)
        return;
    SampleKey key;
    key.pixel = (first + i) / %du, key.sample = (first + i) %% %du, key.bounce = 1u;
    vstore4(decision_block(&scene_, key, BLOCK_DIRECTION, 0u), i, out);
}
"""
SCENE = {
    "type": "scene",
    "sensor": {"type": "perspective"},
    "sky": {"type": "constant"},
    "ball": {"type": "sphere"},
}


@click.command()
@click.option("--seed", default=0, show_default=True)
@click.option("--megabytes", type=int, help="So many, or without end.")
def main(seed: int, megabytes: int | None) -> None:
    """Write the numbers of decisions as bytes to standard output."""
    kernels = SceneKernels.open(open_device(None), load_dict(SCENE), Choices(sampler="independent"))
    kernels.upload(seed)
    out = np.zeros((BLOCKS, 4), np.uint32)
    limit = None if megabytes is None else megabytes * 2**20
    written = 0
    while limit is None or written < limit:
        first = np.uint32(written // 16 % 2**32)
        kernels.run_unit(
            "numbers", TEXT % (SAMPLES, SAMPLES), BLOCKS, [], [out], [first, np.uint32(BLOCKS)], {}, None
        )
        try:
            sys.stdout.buffer.write(out.tobytes())
        except BrokenPipeError:
            return
        written += out.nbytes


if __name__ == "__main__":
    main()
