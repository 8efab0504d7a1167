"""Which choices a scene has a use for, and what is to be said of those that it has none for."""

from __future__ import annotations

from typing import TYPE_CHECKING

from clvol.errors import Told, either, option
from clvol.planning import registry
from clvol.planning.lanes import against
from clvol.planning.names import Names

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping

    from clvol.planning.decisions import Decisions


def used_names(plan: Decisions) -> Names:
    """The choices in force: "none" where the scene has no use for a family, "analytic" for closed forms."""
    features, chosen = plan.features, plan.chosen
    walks = features.heterogeneous
    analytic = "analytic" if features.homogeneous else "none"
    interpolates = features.trilinear or not features.nearest
    on_walks = walks and plan.weighted and plan.extinction == 3
    absorbed = features.scattering and features.chromatic_albedo and chosen["absorption"] == "sample"
    roulette = chosen["roulette"] if features.reflecting else "depth"
    used = {
        "technique": chosen["technique"] if walks else analytic,
        "transmittance": (chosen["transmittance"] if walks else analytic) if plan.nee else "none",
        "majorant": chosen["majorant"] if plan.walks_majorants else "none",
        "lookup": chosen["lookup"] if walks and interpolates else "none",
        "absorption": chosen["absorption"] if features.media and features.scattering else "none",
        "gathering": chosen["gathering"] if plan.gathers_on_flights else "none",
        "roulette": roulette if features.scattering or features.reflecting else "none",
        "background": chosen["background"] if plan.may_expect_background else "none",
        "probability": chosen["probability"] if plan.spectrum == 3 and (on_walks or absorbed) else "none",
        "control": chosen["control"] if plan.needs_residuals else "none",
        "sampler": chosen["sampler"],
        "shadow_cache": chosen["shadow_cache"] if plan.nee and walks else "none",
        "light_choice": chosen["light_choice"] if plan.nee and features.sampled_emitters > 1 else "none",
        "next_event": ("control" if plan.direction_control else "plain")
        if plan.nee and features.scattering
        else "none",
        "lamp_edges": chosen["lamp_edges"] if plan.may_refine_lamp_edges else "none",
        "lanes": chosen["lanes"] if "" in against(plan).values() else "none",
    }
    return Names(used)


def _entries(plan: Decisions) -> list[tuple[str, str, registry.Choice]]:
    """Family, name and the registry's entry of every choice in force."""
    used = ((f, name, registry.FAMILIES[f].get(name)) for f, name in used_names(plan).items())
    return [(family, name, choice) for family, name, choice in used if choice is not None]


def biased_choices(plan: Decisions) -> list[str]:
    """The choices in force whose pictures are biased, as "family name"."""
    return [f"{family} {name}" for family, name, choice in _entries(plan) if choice.biased]


def need_bound(plan: Decisions) -> bool:
    """Whether a choice in force is right only where majorants bound the density."""
    return any(choice.needs_bound for _, _, choice in _entries(plan))


def reasons(plan: Decisions) -> dict[str, str]:
    """Why each choice is in force, or none is, by family."""
    features, used = plan.features, used_names(plan)
    closed = "closed forms: all media are homogeneous"
    without = {
        "technique": closed if features.media else "there are no media",
        "transmittance": closed if plan.nee else "no light is sampled: nothing scatters to one that could be",
        "majorant": "nothing walks majorant cells",
        "lookup": "samples are not interpolated" if features.heterogeneous else "no density is looked up",
        "absorption": "no medium scatters",
        "gathering": "no exact flight meets emission",
        "roulette": "no surface scatters" if features.scattering else "nothing scatters",
        "background": "only delta tracking through one medium, without surfaces or glow, expects it",
        "probability": "no path chooses between events by weights of several channels",
        "control": "only residual-ratio subtracts one",
        "sampler": "",
        "shadow_cache": "no shadow ray passes a heterogeneous medium",
        "light_choice": "there is one light at most to sample",
        "next_event": "a phase function by table or of flakes has no closed form for the control"
        if {"TABPHASE", "SGGX"} & {*features.phases} and used["next_event"] == "plain"
        else "no light is sampled in media",
        "lamp_edges": _no_lamp_edges(plan),
        "lanes": "; ".join(dict.fromkeys(against(plan).values())) or "no walk goes from look-up to look-up",
    }
    found = {}
    for family, name in used.items():
        meant = name == plan.chosen[family] and not (family == "majorant" and name == "none")
        found[family] = plan.reasons[family] if meant else without[family]
    return found


def _no_lamp_edges(plan: Decisions) -> str:
    """Why no edges of lamps are refined."""
    f = plan.features
    hurdles = {
        "no surface is a lamp": not f.area,
        "the camera sees through lamps": f.hide_emitters,
        "the sensor has no picture to see edges in": f.meter,
        "the camera may be inside a medium": f.camera_inside,
        "the pixel filter has negative parts": f.signed_filter,
        "the picture shows distances": f.shows_depth,
        "media glow, which may be as bright as a lamp": f.emission or f.glow,
    }
    return next((reason for reason, holds in hurdles.items() if holds), "")


def _instead(plan: Decisions, family: str, used: str) -> str:
    """What is to be said of a choice that was made, and is not in force as it stands."""
    if used == "none":
        return f" is not used: nothing in this render needs {'an' if family[0] in 'aeiou' else 'a'} {family}"
    if family == "transmittance":
        return ": shadow rays, whose transmittance is analytic here"
    if plan.features.chromatic_extinction and plan.tracker.all_channels:
        return ": one path follows all channels, however far apart; its flights are analytic here"
    if family == "roulette":
        return f" is not used: it is for surfaces that scatter, and there are none; {used} is"
    return f" is not used: the scene's media need only the {used} rule"


def warnings(plan: Decisions, asked: Mapping[str, str]) -> Iterator[Told]:
    """What a user should hear of: own choices that are not used, a picture left black, biased or too noisy.

    Parameters
    ----------
    asked : names by family that the caller gave, "auto" included.
    """
    yield from map(Told, _warnings(plan, asked))


def _warnings(plan: Decisions, asked: Mapping[str, str]) -> Iterator[str]:
    used, features = used_names(plan), plan.features
    for family, value in asked.items():
        if family == "lanes":
            continue  # where no walk goes in lanes, numbers are drawn in them: the same as one by one
        if value not in ("auto", used[family]):
            asked_for = either(f"{family} {value}", f"{registry.option(family)} {value}")
            yield f"{asked_for}{_instead(plan, family, used[family])}"
    if plan.choices.majorant_scale != 1 and used["majorant"] == "none":
        yield f"{option('majorant_scale')} is not used: nothing in this render walks a majorant"
    if not (features.emitters or features.emission or features.glow or features.shows_depth):
        yield "the scene has no emitter: its picture is black"
    if features.alpha and plan.opaque:
        yield (
            "alpha is 1 everywhere, since the environment is seen: hide_emitters, or "
            f"{option('background', 'transparent')}, leaves it out"
        )
    if plan.settled is not None and plan.mixes_far_channels:
        yield (
            f"extinctions of the channels differ by 1 : {plan.settled.channels_apart:.2g}, and technique "
            f"{plan.chosen['technique']} follows them with one path: most of what the thinnest scatters may "
            "never be sampled, nor the error show it; technique auto or delta has a path for each channel"
        )
    for what in biased_choices(plan):
        yield f"{what} is BIASED: the picture's mean is off by an unknown amount"
