"""Phase functions, and how a mixture of any depth becomes a list of weighted lobes."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from clvol.scene.medium import own_volume, sane
from clvol.scene.medium_facts import channels_of
from clvol.scene.records import BlendPhase, ConstVolume, GridVolume, Phase, PhaseFunction
from clvol.scene.texture import number_share
from clvol.volumes import check_finite

if TYPE_CHECKING:
    from clvol.scene.reader import Reader

MAX_LOBES = 64
"""Most phase functions that a mixture may hold, counted with repetition: more than any scene has, and
few enough that mixtures of mixtures cannot double without end."""


def isotropic(reader: Reader) -> Phase:
    """The `isotropic` phase function."""
    return Phase()


MOST_PEAKED = 0.999997
"""Largest |g|: single precision rounds it by up to 3e-8, a hundredth of what is left to 1."""


def hg(reader: Reader) -> Phase:
    """The Henyey-Greenstein phase function of mean cosine `g`, -1 < g < 1.

    Its peak is as high as 1 - |g| is small, of which single precision leaves nothing in the end.
    """
    g = reader.number("g", 0.8, minimum=-1.0, maximum=1.0, open_interval=True)
    if abs(g) > MOST_PEAKED:
        reader.fail(f"'g' of phase 'hg' must be at most {MOST_PEAKED} from 0, got {g!r}", "g")
    return Phase("hg", g)


def rayleigh(reader: Reader) -> Phase:
    """The `rayleigh` phase function, 3 (1 + cos²) / 16 pi."""
    return Phase("rayleigh")


def blendphase(reader: Reader) -> BlendPhase:
    """The `blendphase` plugin: two phase functions, in the order given, the second of share `weight`."""
    if not reader.has("weight"):
        reader.fail("a blendphase needs a weight", hint="the share of the second phase function, 0 to 1")
    weight = _weight(reader)
    found = reader.children("phase")
    if len(found) != 2:
        where = found[2][0] if len(found) > 2 else ""
        reader.fail(f"a blendphase takes two phase functions, got {len(found)}", where)
    blend = BlendPhase(weight, *(reader.build(node) for _, node in found))
    if len({id(lobe.flakes) for lobe in _all_lobes(blend) if isinstance(lobe.flakes, GridVolume)}) > 1:
        reader.unsupported("a mixture takes one sggx whose S differs from place to place")
    if _leaves(blend) > MAX_LOBES:
        reader.fail(f"a mixture takes at most {MAX_LOBES} phase functions, got {_leaves(blend)}")
    if sum(_varied(blend)) > 1:
        reader.unsupported("a mixture takes one weight that is a volume", "weight")
    return blend


def _weight(reader: Reader) -> float | GridVolume:
    """The `weight`: a number, which is cut to [0, 1] as Mitsuba does, or a volume of one channel."""
    if reader.is_value("weight"):
        return number_share(reader, "weight")
    volume = sane(reader, own_volume(reader, "weight", "a number or a volume of one channel"))
    if channels_of(volume) > 1:
        reader.fail("the weight of a blendphase must be a number or a volume of one channel", "weight")
    if isinstance(volume, ConstVolume):
        return min(max(volume.value[0], 0.0), 1.0)
    check_finite(volume.grid, "weight of phase 'blendphase'")
    return volume


def _varied(phase: PhaseFunction) -> list[bool]:
    """Of each mixture in it, whether its weight is a volume."""
    if not isinstance(phase, BlendPhase):
        return []
    return [isinstance(phase.weight, GridVolume), *_varied(phase.first), *_varied(phase.second)]


def _all_lobes(phase: PhaseFunction) -> list[Phase]:
    if isinstance(phase, BlendPhase):
        return [*_all_lobes(phase.first), *_all_lobes(phase.second)]
    return [phase]


def lobe_kind(phase: PhaseFunction, lobe: Phase) -> str:
    """What a lobe of a phase function is; in a mixture an sggx leaves the extinction alone, as in Mitsuba."""
    return "mixed_sggx" if lobe.kind == "sggx" and isinstance(phase, BlendPhase) else lobe.kind


def _leaves(phase: PhaseFunction) -> int:
    return _leaves(phase.first) + _leaves(phase.second) if isinstance(phase, BlendPhase) else 1


def phase_lobes(phase: PhaseFunction) -> list[tuple[Phase, float]]:
    """The different phase functions that a mixture consists of, and their shares, the smallest first.

    Shares that are 0 as floats are left out; the rest are floats (float32) that add up to 1 within
    rounding.  In this order the rarest lobe is chosen by the smallest random numbers, which resolve best.
    Where a weight is a volume, they are those for 0.
    """
    return [(lobe, share) for lobe, share, _ in varied_lobes(phase)]


def varied_lobes(phase: PhaseFunction) -> list[tuple[Phase, float, float]]:
    """The same with how much of the weight that is a volume each share has in addition."""
    shares: dict[Phase, tuple[float, float]] = {}
    _collect(phase, (1.0, 0.0), shares)
    lobes = [(lobe, float(np.float32(a)), float(np.float32(b))) for lobe, (a, b) in shares.items()]
    return sorted((one for one in lobes if one[1] or one[2]), key=lambda one: one[1] + one[2] / 2)


def _collect(
    phase: PhaseFunction, share: tuple[float, float], shares: dict[Phase, tuple[float, float]]
) -> None:
    """Adds up shares a + b w; only one mixture has a weight w that varies."""
    a, b = share
    if not isinstance(phase, BlendPhase):
        before = shares.get(phase, (0.0, 0.0))
        shares[phase] = before[0] + a, before[1] + b
    elif isinstance(phase.weight, float | int):
        _collect(phase.first, (a * (1.0 - phase.weight), b * (1.0 - phase.weight)), shares)
        _collect(phase.second, (a * phase.weight, b * phase.weight), shares)
    else:
        _collect(phase.first, (a, -a), shares)
        _collect(phase.second, (0.0, a), shares)
