"""Every choice a user has, with one line on what it is and the header that implements it.

The command line, the error messages and the kernels' composition all read these tables.  Adding a
technique is one header in cl/ and one line here.
"""

from __future__ import annotations

import difflib
from dataclasses import dataclass
from typing import TYPE_CHECKING

from clvol.errors import OptionError, shown
from clvol.layout import COUNTS

if TYPE_CHECKING:
    from collections.abc import Sequence

    from clvol.accel.controls import Control


@dataclass(frozen=True)
class Choice:
    """One legal value: `summary` for the user, `header` under cl/ where it has one, and what else it needs.

    all_channels : a path follows every channel at once; else one, where channels are attenuated differently.
    weighted : its walks change the path's weight.
    needs_bound : it is right only where the majorant bounds sigma_t, so that majorant_scale < 1 is refused.
    control : what each majorant cell must carry beside its bound: "min" of the density, or "fitted".
    walks_majorant : it walks majorant cells at all.
    linear : it uses the density of a look-up once and linearly, so that a stochastic look-up may replace it.
    interpolated : it integrates the interpolant of the samples, which a transfer function changes.
    biased : its pictures are labelled as biased.
    low_discrepancy : a pixel's samples depend on each other, and are dealt to parts that tell their error.
    in_lanes : walks by it may go side by side, too (clvol.planning.lanes).
    """

    summary: str
    header: str = ""
    all_channels: bool = False
    weighted: bool = False
    needs_bound: bool = False
    control: Control = "none"
    walks_majorant: bool = True
    linear: bool = True
    interpolated: bool = False
    biased: bool = False
    low_discrepancy: bool = False
    in_lanes: bool = False


TECHNIQUES = {
    "delta": Choice(
        "Woodcock tracking: exact free flights by rejection against the majorant",
        "tracking/delta.h",
        needs_bound=True,
        in_lanes=True,
    ),
    "weighted-delta": Choice(
        "delta tracking with weights: right for any majorant", "tracking/weighted.h", weighted=True
    ),
    "decomposition": Choice(
        "a constant control in each majorant cell, found without look-ups, and delta tracking of the rest",
        "tracking/decomposition.h",
        needs_bound=True,
        control="min",
    ),
    "weighted-decomposition": Choice(
        "decomposition with weights: controls a little above the least density, right for any majorant",
        "tracking/weighted_decomposition.h",
        weighted=True,
        control="fitted",
    ),
    "spectral": Choice(
        "weighted delta tracking of all channels at once",
        "tracking/weighted.h",
        all_channels=True,
        weighted=True,
    ),
    "spectral-decomposition": Choice(
        "weighted decomposition of all channels at once",
        "tracking/weighted_decomposition.h",
        all_channels=True,
        weighted=True,
        control="fitted",
    ),
    "regular": Choice(
        "exact flights, by inverting the optical depth voxel by voxel; all channels at once",
        "tracking/regular.h",
        all_channels=True,
        linear=False,
        interpolated=True,
    ),
    "marching": Choice(
        "BIASED baseline: fixed steps (--step) of constant density",
        "tracking/marching.h",
        walks_majorant=False,
        linear=False,
        biased=True,
    ),
}
TRANSMITTANCES = {
    "delta": Choice(
        "all or nothing, by delta tracking",
        "tracking/delta_transmittance.h",
        needs_bound=True,
        in_lanes=True,
    ),
    "ratio": Choice(
        "ratio tracking: product of null-collision probabilities", "tracking/ratio.h", in_lanes=True
    ),
    "residual-ratio": Choice(
        "exact transmittance of a control in each majorant cell (--control), ratio tracking of the rest",
        "tracking/residual_ratio.h",
    ),
    "regular": Choice(
        "exact, voxel by voxel, without variance",
        "tracking/regular_transmittance.h",
        linear=False,
        interpolated=True,
    ),
    "power-series": Choice(
        "power series of exp, its factors from combs of look-ups", "tracking/power_series.h"
    ),
    "marching": Choice(
        "BIASED baseline: fixed steps (--step) of constant density",
        "tracking/marching_transmittance.h",
        walks_majorant=False,
        linear=False,
        biased=True,
    ),
    "none": Choice(
        "no next-event estimation: environments are found by scattering alone", walks_majorant=False
    ),
}
MAJORANTS = {
    "global": Choice("one bound for the whole medium", "majorant/global.h", in_lanes=True),
    "grid": Choice("a bound per cell of a uniform grid", "majorant/grid.h", in_lanes=True),
    "kdtree": Choice("a bound per leaf of an adaptive tree", "majorant/kdtree.h"),
}
LOOKUPS = {
    "exact": Choice("the volume's own filter: trilinear or nearest", "density/exact.h"),
    "stochastic": Choice(
        "one sample drawn by the trilinear weights instead of eight", "density/stochastic.h"
    ),
}
ABSORPTIONS = {
    "sample": Choice("a collision absorbs the path with probability sigma_a / sigma_t"),
    "weight": Choice("a collision multiplies the path's weight by the albedo"),
    "mixed": Choice("by weight while the path's weight is above 3/10, sampled below"),
}
ROULETTES = {
    "depth": Choice("from rr_depth scatterings on, a path survives with its weight as probability"),
    "weight": Choice("at surfaces before that too, with twice its weight where it weighs less than 1/2"),
}
PROBABILITIES = {
    "history": Choice("events in proportion to the mean of weight times coefficient: weights stay bounded"),
    "average": Choice("events in proportion to the mean coefficient of the channels"),
    "max": Choice("events in proportion to the largest coefficient of the channels"),
}
GATHERINGS = {
    "collision": Choice("at the collision"),
    "strata": Choice("at strata of the whole flight, the collision's among them: less noise, longer walks"),
}
BACKGROUNDS = {
    "sampled": Choice("a walk that gets through a medium sees what is behind, one that collides does not"),
    "expected": Choice(
        "by sums along walks that go on behind collisions: no noise of whether a path collides"
    ),
}
CONTROLS = {
    "mean": Choice("the mean density of each majorant cell, less where thick cells may have gaps"),
    "min": Choice("the least density of each majorant cell"),
    "max": Choice("the greatest density of each majorant cell, with the same limit"),
}
SAMPLERS = {
    "independent": Choice("every number independent of all others", "core/independent.h"),
    "sobol": Choice(
        "Owen-scrambled Sobol' sequences, four for each pixel: samples that cover every decision evenly",
        "core/sobol.h",
        low_discrepancy=True,
    ),
    "joint": Choice(
        "one Owen-scrambled Sobol' sequence for each pixel, in four parts: more even, errors often overrated",
        "core/sobol.h",
        low_discrepancy=True,
    ),
}
SHADOW_CACHES = {
    "on": Choice("a coarse transmittance to every light says which shadow rays are worth tracing"),
    "off": Choice("every shadow ray is traced"),
}
LIGHT_CHOICES = {
    "contribution": Choice("by what each light is expected to bring to the point, power and a uniform share"),
    "power": Choice("by the power of each light"),
}
LAMP_EDGES = {
    "refined": Choice("many more camera rays than samples find how much of a lamp a pixel on its edge sees"),
    "sampled": Choice("the samples alone do"),
}
NEXT_EVENTS = {
    "plain": Choice("light times phase function times transmittance"),
    "control": Choice("with a control variate of zero mean, that knows where the path goes on"),
}
LANES = {
    "off": Choice("a work-item walks one path after the other"),
    "4": Choice("a work-item walks 4 paths side by side"),
    "8": Choice("a work-item walks 8 paths side by side"),
    "16": Choice("a work-item walks 16 paths side by side"),
}

FAMILIES = {
    "technique": TECHNIQUES,
    "transmittance": TRANSMITTANCES,
    "majorant": MAJORANTS,
    "lookup": LOOKUPS,
    "absorption": ABSORPTIONS,
    "gathering": GATHERINGS,
    "roulette": ROULETTES,
    "background": BACKGROUNDS,
    "probability": PROBABILITIES,
    "control": CONTROLS,
    "sampler": SAMPLERS,
    "shadow_cache": SHADOW_CACHES,
    "light_choice": LIGHT_CHOICES,
    "next_event": NEXT_EVENTS,
    "lamp_edges": LAMP_EDGES,
    "lanes": LANES,
}
FAMILY_PURPOSE = {
    "technique": "How collisions are sampled.",
    "transmittance": "How transmittance is estimated.",
    "majorant": "What bounds the extinction.",
    "lookup": "How the density is looked up.",
    "absorption": "How absorption is treated.",
    "gathering": "Where exact flights gather emission.",
    "roulette": "When paths that carry little are ended.",
    "background": "How light from behind a medium is weighed.",
    "probability": "How a spectral technique chooses events.",
    "control": "What residual-ratio subtracts.",
    "sampler": "How the samples of a pixel are drawn.",
    "shadow_cache": "Whether shadow rays and lights are chosen by a cache of transmittances.",
    "light_choice": "How next-event estimation picks a light.",
    "next_event": "How next-event estimation in media weighs its light.",
    "lamp_edges": "How the edges of lamps that the camera sees are found.",
    "lanes": "How many paths a work-item walks at once.",
}

FIRST_HIT = {
    "depth": "distance from the camera to the first scattering, at a surface or in a medium",
    "normal": "shading normal there, 0 in media",
    "albedo": "reflectance or single-scattering albedo there",
    "position": "that point in the world",
}
"""What camera paths first meet; 0 for a path that meets nothing.  Their channels: `layout.FIRST_HIT`."""
AOVS = (
    COUNTS
    | {
        "null": "null collisions",
        "largest_weight": "largest absolute path weight",
        "variance": "variance of a sample, mean over the channels",
        "efficiency": "1 / (variance · seconds), seconds dealt out by look-ups and cells",
    }
    | FIRST_HIT
)
"""Pictures that may be asked for beside the image; what walks count, per path, comes first."""


def option(family: str) -> str:
    """How the command line spells a family."""
    return f"--{family.replace('_', '-')}"


PILOT = "auto:pilot"
"""The technique that has a measured pilot choose technique, transmittance and majorant."""


TRANSPARENT = "transparent"
"""The background that is not there (`clvol.scene.views.before`)."""
INSTEAD = {
    "technique": {PILOT: "measures, then picks the technique, transmittance and majorant left at auto"},
    "background": {TRANSPARENT: "no environment is seen, and the picture has alpha"},
}
"""What a user may ask a render for instead of a choice, by family; with what it does."""


def automatic(family: str) -> list[str]:
    """What a user may say instead of a choice of `family`."""
    return ["auto", *INSTEAD.get(family, ())]


def check_choice(family: str, value: str, pilot: bool = False) -> str:
    """Return `value` if it is "auto" or a legal choice of `family`, else raise OptionError listing them.

    `pilot`: `PILOT` is one too, where a render chooses.
    """
    choices = [*(automatic(family) if pilot else ["auto"]), *FAMILIES[family]]
    if isinstance(value, str) and value in choices:
        return value
    raise OptionError(f"unknown {family} {shown(value)}", hint=choose_among(choices, value))


def choose_among(choices: Sequence[str], given: object = None) -> str:
    """The hint that lists choices, and the one that a wrong name comes near to."""
    close = difflib.get_close_matches(given[:64], choices, n=1) if isinstance(given, str) else []
    guess = f"did you mean {close[0]!r}? " if close else ""
    return f"{guess}choose one of {', '.join(choices)}"
