"""A picture of which every bit is looked at, also by processes of their own."""

import hashlib

import numpy as np
from pictures import box, gridded, hg, homogeneous, picture, volume

import clvol
from clvol.scene.records import ConstantEmitter, DirectionalEmitter

SPP = 1300
"""With 8 x 8 pixels a pass holds 512 samples of each: two passes and a rest (more on a GPU, less often)."""


def scene():
    """Overlapping media, one of them a grid, and two kinds of light."""
    values = np.random.default_rng(3).uniform(0, 1, (7, 6, 5)) ** 3
    cube = (0, 0, 0), (1, 1, 1)
    return picture(
        [
            box(*cube, gridded(volume(values, *cube, "nearest"), 0.9, hg(0.6), scale=12.0)),
            box((0.5, 0.2, 0.1), (1.3, 0.9, 0.8), homogeneous(1.5, 0.9, hg(0.3))),
        ],
        [ConstantEmitter((0.8,)), DirectionalEmitter((2.0,), (0.0, -1.0, 0.0))],
        (0.5, 0.6, -2.0),
        (0.6, 0.5, 0.5),
        20.0,
        (8, 8),
    )


def rendered(described, **options):
    """With the sampler that users get, where none is given."""
    return clvol.render(described, **{"sampler": "joint"} | options)


def digest(result):
    """Hash of every bit a render answers for."""
    arrays = (result.image, result.variance, result.estimate.sums, result.aovs["lookups"])
    return hashlib.sha256(b"".join(np.ascontiguousarray(a).tobytes() for a in arrays)).hexdigest()
