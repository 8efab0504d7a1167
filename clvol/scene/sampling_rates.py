"""Where the sampling rates of principled BSDFs leave a lobe out that no other one's samples stand for."""

from __future__ import annotations

from itertools import product
from typing import TYPE_CHECKING

import numpy as np

from clvol.scene.materials import Varied

if TYPE_CHECKING:
    from clvol.scene.materials import Principled, PrincipledThin, Texture


def solid_leaves_out(bsdf: Principled) -> bool:
    """Whether no path scatters by all that a solid does, somewhere: its main specular lobe is never sampled.

    That alone refracts; what it reflects the diffuse lobe and the clear coat find as well.
    """
    if bsdf.specular_rate > 0:
        return False
    metallic, transmits, coat = (_range(one) for one in (bsdf.metallic, bsdf.spec_trans, bsdf.clearcoat))
    if transmits[1] > 0 and metallic[0] < 1:
        return True
    diffuse = bsdf.diffuse_rate > 0 and metallic[1] < 1
    return not (diffuse or (bsdf.clearcoat_rate > 0 and coat[0] > 0))


def sheet_leaves_out(bsdf: PrincipledThin) -> bool:
    """The same of a sheet, of what it reflects or of what passes it."""
    for specular, transmits in product(_range(bsdf.spec_trans), _range(bsdf.diff_trans)):
        passes = transmits / 2
        sides = (
            ((specular, bsdf.specular_rate), ((1 - specular) * (1 - passes), bsdf.diffuse_rate)),
            (
                (specular, bsdf.specular_transmittance_rate),
                ((1 - specular) * passes, bsdf.diffuse_transmittance_rate),
            ),
        )
        for lobes in sides:
            if any(share > 0 for share, _ in lobes) and not any(share * rate > 0 for share, rate in lobes):
                return True
    return False


def _range(value: Texture) -> tuple[float, float]:
    """The least and the largest value; those of a texture may be any."""
    if isinstance(value, Varied):
        return 0.0, 1.0
    mean = float(np.mean(value))
    return mean, mean
