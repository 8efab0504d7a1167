"""Phase functions, and how a mixture of any depth becomes a list of weighted lobes."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from clvol.scene.records import BlendPhase, Phase, PhaseFunction

if TYPE_CHECKING:
    from clvol.scene.reader import Reader

MAX_LOBES = 64
"""Most phase functions that a mixture may hold, counted with repetition: more than any scene has, and
few enough that mixtures of mixtures cannot double without end."""


def isotropic(reader: Reader) -> Phase:
    """The `isotropic` phase function."""
    return Phase()


def hg(reader: Reader) -> Phase:
    """The Henyey-Greenstein phase function of mean cosine `g`, -1 < g < 1."""
    return Phase("hg", reader.number("g", 0.8, minimum=-1.0, maximum=1.0, open_interval=True))


def rayleigh(reader: Reader) -> Phase:
    """The `rayleigh` phase function, 3 (1 + cos²) / 16 pi."""
    return Phase("rayleigh")


def blendphase(reader: Reader) -> BlendPhase:
    """The `blendphase` plugin: two phase functions, in the order given, the second of share `weight`."""
    if not reader.has("weight"):
        reader.fail("a blendphase needs a weight", hint="the share of the second phase function, 0 to 1")
    if not reader.is_value("weight"):
        reader.fail(
            "the weight of a blendphase cannot vary in space",
            "weight",
            "give a number from 0 to 1",
        )
    weight = reader.number("weight", 0.5, minimum=0.0, maximum=1.0)
    found = reader.children("phase")
    if len(found) != 2:
        where = found[2][0] if len(found) > 2 else ""
        reader.fail(f"a blendphase takes two phase functions, got {len(found)}", where)
    blend = BlendPhase(weight, *(reader.build(node) for _, node in found))
    if _leaves(blend) > MAX_LOBES:
        reader.fail(f"a mixture takes at most {MAX_LOBES} phase functions, got {_leaves(blend)}")
    return blend


def _leaves(phase: PhaseFunction) -> int:
    return _leaves(phase.first) + _leaves(phase.second) if isinstance(phase, BlendPhase) else 1


def phase_lobes(phase: PhaseFunction) -> list[tuple[Phase, float]]:
    """The different phase functions that a mixture consists of, and their shares, the smallest first.

    Shares that are 0 as floats are left out; the rest are floats (float32) that add up to 1 within
    rounding.  In this order the rarest lobe is chosen by the smallest random numbers, which resolve best.
    """
    shares: dict[Phase, float] = {}
    _collect(phase, 1.0, shares)
    lobes = [(lobe, float(np.float32(share))) for lobe, share in shares.items()]
    return sorted((pair for pair in lobes if pair[1] > 0), key=lambda pair: pair[1])


def _collect(phase: PhaseFunction, share: float, shares: dict[Phase, float]) -> None:
    if isinstance(phase, BlendPhase):
        _collect(phase.first, share * (1.0 - phase.weight), shares)
        _collect(phase.second, share * phase.weight, shares)
    else:
        shares[phase] = shares.get(phase, 0.0) + share
