"""From what a user asks for to what is done: `auto` by fixed rules, and combinations that cannot be right.

Every refusal is one sentence on why, and one on what to use.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field

from clvol.base.arguments import positive
from clvol.errors import OptionError, shown
from clvol.planning import registry
from clvol.planning.features import Features
from clvol.scene.records import Scene
from clvol.tables.prepare import MajorantNeeds, PreparedScene, prepare


@dataclass(frozen=True)
class Choices:
    """Everything a user may choose about how a picture is estimated.

    Parameters
    ----------
    technique, transmittance, majorant, lookup, absorption, probability, control, sampler : names of
        `clvol.planning.registry`, or "auto".
    majorant_scale : multiplies every bound, for experiments.
    step : world length of a marching step; None takes the edge of a voxel.
    target_error : mean relative standard error at which the render ends; samples go where the error is.
    aov : names of `registry.AOVS` to return as pictures; look-ups always are.
    """

    technique: str = "auto"
    transmittance: str = "auto"
    majorant: str = "auto"
    lookup: str = "auto"
    absorption: str = "auto"
    probability: str = "auto"
    control: str = "auto"
    sampler: str = "auto"
    majorant_scale: float = 1.0
    step: float | None = None
    target_error: float | None = None
    aov: tuple[str, ...] = field(default=())

    def __post_init__(self) -> None:
        for family in registry.FAMILIES:
            registry.check_choice(family, getattr(self, family))
        object.__setattr__(self, "aov", _aovs(self.aov))
        positive("majorant_scale=", self.majorant_scale)
        for name in ("step", "target_error"):
            if getattr(self, name) is not None:
                positive(f"{name}=", getattr(self, name))

    @property
    def names(self) -> dict[str, str]:
        """The registry's choices, by family."""
        return {family: getattr(self, family) for family in registry.FAMILIES}


def _aovs(names: str | Iterable[str]) -> tuple[str, ...]:
    names = (names,) if isinstance(names, str) else names
    if not isinstance(names, Iterable):
        raise OptionError(
            f"aov={shown(names)} is not a list of names", hint=f"choose among {', '.join(registry.AOVS)}"
        )
    for name in names:
        if not isinstance(name, str) or name not in registry.AOVS:
            raise OptionError(f"unknown aov {shown(name)}", hint=f"choose among {', '.join(registry.AOVS)}")
    return tuple(dict.fromkeys(names))


MOST_STEPS = 1e5
"""Marching steps across the scene beyond which a step is taken for a mistake."""


def prepare_for(scene: Scene, choices: Choices) -> PreparedScene:
    """Prepare a scene for what `choices` need of it; OptionError for a combination that cannot be right."""
    features = Features.from_scene(scene)
    resolved = resolve(features, choices.names)
    refuse_impossible(features, choices, resolved)
    prepared = prepare(scene, majorant_needs(choices, resolved))
    if choices.step is not None and 2 * prepared.radius / choices.step > MOST_STEPS:
        across = 2 * prepared.radius / choices.step
        raise OptionError(
            f"step {choices.step:g} is too fine: {across:.2g} steps across the scene",
            hint=f"give at least {2 * prepared.radius / MOST_STEPS:.2g}",
        )
    return prepared


DEFAULT_SAMPLER = "sobol"


def resolve(features: Features, asked: Mapping[str, str]) -> dict[str, str]:
    """Every family's choice but the majorant's, which `prepare` weighs by its cost; `auto` follows the rules
    that docs/choices.md states."""
    rules = {
        "technique": _technique(features, asked),
        "transmittance": _transmittance(features),
        "lookup": "exact",
        "absorption": "mixed",
        "probability": "history",
        "control": "mean",
        "sampler": DEFAULT_SAMPLER,
    }
    return {family: asked[family] if asked[family] != "auto" else rule for family, rule in rules.items()}


def _technique(features: Features, asked: Mapping[str, str]) -> str:
    """Chromatic media, too, take delta, a path for each channel.  Where collisions are light rather than
    scattering, exact flights are worth their look-ups: one low-discrepancy number places the whole flight
    (docs/techniques.md)."""
    glows = features.dark_emission and not features.media_overlap and not features.chromatic_extinction
    sobol = asked["sampler"] == "sobol" or (asked["sampler"] == "auto" and DEFAULT_SAMPLER == "sobol")
    return "regular" if glows and sobol and asked["lookup"] != "stochastic" else "delta"


def _transmittance(features: Features) -> str:
    """Scattering finds a constant sky as well as sampling it does, without the shadow ray."""
    lights = features.envmap or features.directional or features.near_lights
    return "ratio" if lights else "none"


def majorant_needs(choices: Choices, resolved: Mapping[str, str]) -> MajorantNeeds:
    """What the cells of the majorant have to carry."""
    residual = resolved["transmittance"] == "residual-ratio"
    return MajorantNeeds(
        choices.majorant,
        registry.TECHNIQUES[resolved["technique"]].control,
        resolved["control"] if residual else "none",
        choices.majorant_scale,
    )


def refuse_impossible(features: Features, choices: Choices, resolved: Mapping[str, str]) -> None:
    """Raise OptionError for a combination that cannot be right, saying why and what to use."""
    technique, transmittance = resolved["technique"], resolved["transmittance"]
    tracker, estimator = registry.TECHNIQUES[technique], registry.TRANSMITTANCES[transmittance]
    if transmittance == "none" and (features.directional or features.point_lights or features.spot):
        raise OptionError(
            "transmittance 'none' cannot render point, spot and directional lights",
            hint="only next-event estimation reaches them: use ratio",
        )
    marches = features.heterogeneous and (tracker.biased or estimator.biased)
    if choices.step is not None and not marches:
        raise OptionError(
            "step is for ray marching, and nothing marches here",
            hint="choose technique or transmittance marching",
        )
    if not features.heterogeneous:
        return  # closed forms take the place of every technique and transmittance
    used = [("technique", technique, tracker, "weighted-delta")]
    if features.samples_lights and features.scattering:
        used.append(("transmittance", transmittance, estimator, "ratio"))
    for family, name, choice, instead in used:
        if choices.majorant_scale < 1 and choice.needs_bound:
            raise OptionError(
                f"{family} {name!r} is biased where bounds are too low, as by a majorant_scale below 1",
                hint=f"use one that carries weights, such as {instead}",
            )
        if resolved["lookup"] == "stochastic" and not choice.linear:
            raise OptionError(
                f"stochastic look-ups would bias {family} {name!r}, which is not linear in the density",
                hint="use lookup exact",
            )
