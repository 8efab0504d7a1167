"""What `auto` comes to, by fixed rules, each with its reason: the same seed must give the same bits."""

from __future__ import annotations

from typing import TYPE_CHECKING

from clvol.planning.names import Names
from clvol.planning.registry import SAMPLERS

if TYPE_CHECKING:
    from collections.abc import Mapping

    from clvol.planning.features import Features

DEFAULT_SAMPLER = "joint"
OWN = "the scene's own"
"""The reason of a name that the scene's integrator gives."""
UNSETTLED = "auto"
"""The majorant of a plan until the volumes are prepared, which show what each kind would cost, and its lanes
until a device is known."""


def resolve(
    features: Features, asked: Mapping[str, str], own: Mapping[str, str] | None = None
) -> tuple[Names, Names]:
    """Every family's choice, and why.

    `auto` follows the rules that docs/choices.md states; the majorant stays at it until volumes are prepared.

    Parameters
    ----------
    asked : a name of every family, or "auto".
    own : the names that the scene's integrator gives, which are among those asked for.
    """
    rules = {
        "technique": _technique(features, asked),
        "transmittance": _transmittance(features),
        "majorant": (
            UNSETTLED,
            "chosen by expected cost once the volumes are prepared (clvol render -v shows it)",
        ),
        "lookup": ("exact", "the volume's own filter"),
        "absorption": ("mixed", "no path is absorbed that weighs much, none followed that weighs little"),
        "gathering": ("strata", "a point in each stratum of a flight has a fraction of one point's noise"),
        "roulette": _roulette(features),
        "background": ("expected", "walks that go on behind collisions take the noise of these away"),
        "probability": ("history", "weights stay bounded"),
        "control": ("mean", "leaves the least residual to estimate"),
        "shadow_cache": ("on", "shadow rays that would bring next to nothing are rarely traced"),
        "light_choice": ("contribution", "each light as often as it matters at the point"),
        "next_event": ("control", "the noise of a phase function's peak is less"),
        "lamp_edges": ("refined", "the edge of a lamp is noise that some more camera rays take away"),
        "sampler": (DEFAULT_SAMPLER, _SAMPLERS[DEFAULT_SAMPLER]),
        "lanes": (UNSETTLED, "16 on processors, off on others"),
    }
    names, reasons = {}, {}
    for family, rule in rules.items():
        names[family], reasons[family] = rule[0], f"auto: {rule[1]}"
        if asked[family] != "auto":
            names[family] = asked[family]
            reasons[family] = OWN if (own or {}).get(family) == asked[family] else "asked for"
    if not features.heterogeneous:
        names["majorant"] = "none"
    return Names(names), Names(reasons)


_SAMPLERS = {
    "joint": "all samples of a pixel together cover every decision evenly",
    "sobol": "samples that cover every decision evenly",
    "independent": "every number is independent of all others",
}


def _technique(features: Features, asked: Mapping[str, str]) -> tuple[str, str]:
    """Chromatic media, too, take delta, a path for each channel.

    Where collisions are light rather than scattering, exact flights are worth their look-ups: one
    low-discrepancy number places the whole flight (docs/techniques.md).
    """
    sampler = DEFAULT_SAMPLER if asked["sampler"] == "auto" else asked["sampler"]
    hurdles = {
        "nothing emits": not features.emission,
        "not every medium emits with an albedo of at most 0.5": not features.only_dark_emitters,
        "media may overlap": features.media_overlap,
        "channels are attenuated differently": features.chromatic_extinction,
        "samples are independent": not SAMPLERS[sampler].low_discrepancy,
        "densities are classified after they are interpolated": features.interpolated_transfers,
        "the extinction is that of microflakes, which differ from place to place": features.varied_areas,
        "look-ups are stochastic": asked["lookup"] == "stochastic",
    }
    against = [reason for reason, holds in hurdles.items() if holds]
    if not against:
        return (
            "regular",
            "collisions are the light, and one low-discrepancy number places a whole flight",
        )
    return "delta", f"regular would not pay: {against[0]}"


def _roulette(features: Features) -> tuple[str, str]:
    """Paths in media end by absorption; where a flame glows on exact flights, more ends doubled its noise."""
    if features.reflecting:
        return "weight", "what weighs little after a surface is not worth following for rr_depth scatterings"
    return "depth", "no surface scatters"


def _transmittance(features: Features) -> tuple[str, str]:
    """Scattering finds a constant sky as well as sampling it does, without the shadow ray."""
    if features.sampled_lights:
        return "ratio", f"lights to sample: {', '.join(features.sampled_lights)}"
    return "none", "scattered paths find a uniform sky by themselves" if features.constant else "no light"
