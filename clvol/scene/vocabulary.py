"""Names of Mitsuba's vocabulary that this version does not render: errors tell them from typing mistakes.

What is supported is not listed here: the plugin tables and the parameters that the readers ask for say it.
"""

from __future__ import annotations

from collections.abc import Iterable
from difflib import get_close_matches

LATER: dict[str, tuple[str, ...]] = {
    "integrator": ("direct", "aov", "depth", "ptracer"),
    "sensor": ("orthographic", "radiancemeter", "irradiancemeter", "distant", "batch"),
    "film": ("specfilm",),
    "sampler": ("stratified", "multijitter", "orthogonal", "ldsampler"),
    "shape": (
        *("serialized", "mesh", "instance", "shapegroup", "bsplinecurve", "linearcurve", "sdfgrid"),
        *("ellipsoids", "heightfield", "merge"),
    ),
    "bsdf": ("principled", "bumpmap", "normalmap", "blendbsdf"),
    "phase": ("sggx", "tabphase"),
    "emitter": ("projector", "directionalarea", "sunsky"),
    "texture": ("mesh_attribute", "volume", "uniform", "srgb", "d65", "blackbody"),
}
"""Kind -> plugins known by name and not supported in this version."""


def did_you_mean(name: str, candidates: Iterable[str]) -> str:
    """ "did you mean 'x'?" when a candidate is close to `name`, else an empty string."""
    close = get_close_matches(name, list(candidates), n=1, cutoff=0.6)
    return f"did you mean '{close[0]}'?" if close else ""


def listed(names: Iterable[str]) -> str:
    """Names for a message, in order, or "none"."""
    return ", ".join(names) or "none"


def join_hints(*hints: str) -> str:
    """The hints that are not empty, as one."""
    return " ".join(hint for hint in hints if hint)
