"""Every choice a user has, with one line on what it is and the header that implements it.

The command line, the error messages and the kernels' composition all read these tables.  Adding a
technique is one header in cl/ and one line here.
"""

from __future__ import annotations

import difflib
from dataclasses import dataclass

from clvol.errors import OptionError


@dataclass(frozen=True)
class Choice:
    """One legal value: `summary` for the user, `header` under cl/ where it has one."""

    summary: str
    header: str = ""


TECHNIQUES = {
    "delta": Choice(
        "Woodcock tracking: exact free flights by rejection against the majorant", "tracking/delta.h"
    ),
}
TRANSMITTANCES = {
    "ratio": Choice("ratio tracking: product of null-collision probabilities", "tracking/ratio.h"),
    "none": Choice("no next-event estimation: environments are found by scattering alone"),
}
MAJORANTS = {
    "global": Choice("one bound for the whole medium", "majorant/global.h"),
    "grid": Choice("a bound per cell of a uniform grid", "majorant/grid.h"),
    "kdtree": Choice("a bound per leaf of an adaptive tree", "majorant/kdtree.h"),
}
LOOKUPS = {
    "exact": Choice("the volume's own filter: trilinear or nearest"),
}
ABSORPTIONS = {
    "sample": Choice("a collision absorbs the path with probability sigma_a / sigma_t"),
    "weight": Choice("a collision multiplies the path's weight by the albedo"),
    "mixed": Choice("by weight while the path's weight is above 1/2, sampled below"),
}

FAMILIES = {
    "technique": TECHNIQUES,
    "transmittance": TRANSMITTANCES,
    "majorant": MAJORANTS,
    "lookup": LOOKUPS,
    "absorption": ABSORPTIONS,
}


def check_choice(family: str, value: str) -> str:
    """Return `value` if it is "auto" or a legal choice of `family`, else raise OptionError listing them."""
    choices = ["auto", *FAMILIES[family]]
    if value in choices:
        return value
    close = difflib.get_close_matches(str(value), choices, n=1)
    guess = f"did you mean {close[0]!r}? " if close else ""
    raise OptionError(f"unknown {family} {value!r}", hint=f"{guess}choose one of {', '.join(choices)}")
