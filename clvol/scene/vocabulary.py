"""Names of Mitsuba's vocabulary that this version does not render: errors tell them from typing mistakes.

What is supported is not listed here: the plugin tables and the parameters that the readers ask for say it.
"""

from __future__ import annotations

import heapq
from difflib import get_close_matches
from typing import TYPE_CHECKING

from clvol.errors import shortened

if TYPE_CHECKING:
    from collections.abc import Iterable

MESH, GAUSSIANS = "take a mesh of it, as .ply", "take spheres, each with a to_world"
METAL, COAT = "take principled, or roughconductor", "a coat on diffuse, or principled with clearcoat"

LATER: dict[str, dict[str, str]] = {
    "integrator": {
        "stokes": "light is not polarized here",
        **dict.fromkeys(("volprim_rf_basic", "multichannel", "vrl", "vpl", "ao"), ""),
    },
    "film": {"specfilm": ""},
    "shape": {"sdfgrid": MESH, "heightfield": MESH, "ellipsoids": GAUSSIANS, "ellipsoidsmesh": GAUSSIANS},
    "bsdf": {
        **dict.fromkeys(("measured", "measured_polarized"), METAL),
        **dict.fromkeys(("hair", "pplastic", "polarizer", "retarder", "circular"), ""),
    },
}
"""Kind -> plugins known by name and not supported in this version, and what to do about that."""

OLDER: dict[str, dict[str, str]] = {
    "integrator": {"field": "take depth, or aov with what it shows"},
    "sensor": {
        "telecentric": "take orthographic, which has no lens",
        "perspective_rdist": "take perspective, which does not distort",
        **dict.fromkeys(("spherical", "fluencemeter"), ""),
    },
    "shape": {
        "hair": "take bsplinecurve, or linearcurve",
        "deformable": MESH,
    },
    "bsdf": {
        "phong": "take roughplastic, or roughconductor",
        "ward": "take roughconductor with alpha_u and alpha_v, or principled with anisotropic",
        "coating": f"take plastic, {COAT}",
        "roughcoating": f"take roughplastic, {COAT}",
        "roughdiffuse": "take diffuse",
        "difftrans": "take principledthin with diff_trans",
        "hk": "take a thin shape with a medium in it",
        "irawan": "",
    },
    "texture": {
        "scale": "scale the colour or the picture itself",
        "gridtexture": "take a bitmap, or checkerboard",
        **dict.fromkeys(("wireframe", "curvature"), ""),
    },
    "emitter": {"collimated": "take a spot of small cutoff_angle, or a small area light"},
    "phase": dict.fromkeys(("kkay", "microflake"), "take sggx"),
    "volume": {"hgridvolume": "take one gridvolume, or a sparse file, as .vdb", "volcache": ""},
}
"""The same of Mitsuba 0.6 that Mitsuba 3 has not either, beside those that are upgraded."""
KNOWN = ((LATER, " in this version"), (OLDER, ", and Mitsuba 3 has none"))
"""Both, and what is said of not being supported."""

VITAL = ("sigma_t", "values", "albedo", "emission", "temperature")
"""Parameters that a plugin is lost with, where they are given and cannot be read: it would be another."""


LONGEST_NAME = 64
"""Characters of a name beyond which it is not compared, and shown in part."""
MOST_COMPARED, MOST_LISTED = 500, 64


def did_you_mean(name: str, candidates: Iterable[str]) -> str:
    """The hint "did you mean 'x'?" when a candidate is close to `name`, else an empty string.

    Of very many candidates those that begin most like `name` are compared.
    """
    if len(name) > LONGEST_NAME:
        return ""
    short = [candidate for candidate in candidates if len(candidate) <= LONGEST_NAME]
    if len(short) > MOST_COMPARED:
        short = heapq.nlargest(MOST_COMPARED, short, key=lambda candidate: _shared_start(name, candidate))
    close = get_close_matches(name, short, n=1, cutoff=0.6)
    return f"did you mean '{close[0]}'?" if close else ""


def close_ones(name: str, candidates: Iterable[str]) -> str:
    """The hint "did you mean 'x', 'y' or 'z'?" of names in any case that are close, else an empty string."""
    if len(name) > LONGEST_NAME:
        return ""
    by_word: dict[str, list[str]] = {}
    for candidate in candidates:
        by_word.setdefault(candidate.lower(), []).append(candidate)
    words = get_close_matches(name.lower(), by_word, n=3, cutoff=0.6)
    close = [f"'{one}'" for word in words for one in by_word[word]]
    together = " or ".join([", ".join(close[:-1]), close[-1]] if close[1:] else close)
    return f"did you mean {together}?" if close else ""


def _shared_start(one: str, other: str) -> int:
    return next(
        (n for n, (a, b) in enumerate(zip(one, other, strict=False)) if a != b), min(len(one), len(other))
    )


def listed(names: Iterable[str], most: int = MOST_LISTED) -> str:
    """Names for a message, in order, or "none"; of very many the first ones, and how many more."""
    every = list(names)
    more = len(every) - most
    shown = [shortened(name, LONGEST_NAME) for name in every[:most]]
    return (", ".join(shown) or "none") + (f" and {more:,} more" if more > 0 else "")


def join_hints(*hints: str) -> str:
    """The hints that are not empty, as one."""
    return " ".join(hint for hint in hints if hint)
