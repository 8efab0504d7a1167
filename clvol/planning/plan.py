"""The plan of a render: what follows from a scene's records and the user's choices, worked out once.

Pure: no device, no table of a scene's values.  What is compiled, launched and allocated follows from it.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property
from types import MappingProxyType
from typing import TYPE_CHECKING

from clvol import layout
from clvol.errors import OptionError
from clvol.planning.auto import OWN, UNSETTLED, resolve
from clvol.planning.choices import Choices
from clvol.planning.compiled import filled_slots, plan_macros
from clvol.planning.decisions import Decisions
from clvol.planning.description import describe_plan
from clvol.planning.in_force import biased_choices, need_bound, used_names
from clvol.planning.inspection import find_features
from clvol.planning.refusals import refuse_impossible
from clvol.scene.boundaries import Boundaries, find_boundaries
from clvol.scene.records import Batch

if TYPE_CHECKING:
    from collections.abc import Mapping

    from clvol.planning.features import Features
    from clvol.planning.names import Names
    from clvol.planning.settled import Settled, Tuning
    from clvol.scene.records import Scene

_NOTHING = Boundaries((), (), ())


@dataclass(frozen=True, repr=False)
class Plan(Decisions):
    """What is done for a scene with a user's choices; equal plans compile the same.

    It is made in steps, each of which knows more: `of` a scene; `settle`, once volumes are prepared
    (`clvol.tables.prepare`); `tune`, on a device.
    """

    @classmethod
    def of(cls, scene: Scene, choices: Choices | None = None) -> Plan:
        """Inspect a scene and plan its render; OptionError for choices that cannot be right."""
        if isinstance(scene.sensor, Batch):
            raise OptionError(
                "a batch is a picture of several sensors, which has no plan of its own",
                scene.source,
                "take one of its sensors, whose numbers follow those of the scene's own",
            )
        found = find_boundaries(scene)
        features, own = find_features(scene, found), scene.integrator.choices
        return cls.for_features(features, choices or Choices(), found, own)

    @classmethod
    def for_features(
        cls,
        features: Features,
        choices: Choices,
        boundaries: Boundaries = _NOTHING,
        own: Mapping[str, str] = MappingProxyType({}),
    ) -> Plan:
        """Plan the render of a scene that has these features; `own`: the names that it gives itself."""
        chosen, reasons = resolve(features, choices.names, own)
        refuse_impossible(features, choices, chosen)
        return cls(features, choices, chosen, reasons, boundaries)

    def having(self, choices: Choices, reasons: Mapping[str, str] = MappingProxyType({})) -> Plan:
        """The plan of the same scene with other choices; OptionError for what cannot be right.

        reasons : why, by family, where it is not that they were asked for.
        """
        own = {family: self.chosen[family] for family, reason in self.reasons.items() if reason == OWN}
        plan = self.for_features(self.features, choices, self.boundaries, own)
        return replace(plan, reasons=plan.reasons.but(**reasons))

    def settle(self, settled: Settled) -> Plan:
        """With what the volumes show."""
        chosen, reasons = self.chosen.but(majorant=settled.majorant), self.reasons
        if settled.costs:
            reasons = reasons.but(majorant=settled.reason)
        return replace(self, chosen=chosen, reasons=reasons, settled=settled)

    def renamed(self, **names: str) -> Plan:
        """With other choices in place of those that were resolved; for plans that are only compared."""
        return replace(self, chosen=self.chosen.but(**names))

    def tune(self, tuning: Tuning) -> Plan:
        """With what the kind of device decides."""
        chosen = self.chosen
        if chosen["lanes"] == UNSETTLED:
            chosen = chosen.but(lanes=str(tuning.lanes or "off"))
        return replace(self, chosen=chosen, tuning=tuning)

    @cached_property
    def in_force(self) -> Names:
        """The choices that the scene has a use for, else "none", or "analytic" for closed forms."""
        return used_names(self)

    @property
    def biased(self) -> list[str]:
        """The choices in force whose pictures are biased, as "family name"."""
        return biased_choices(self)

    @property
    def needs_bound(self) -> bool:
        """Whether a choice in force is right only where majorants bound the density."""
        return need_bound(self)

    @cached_property
    def stages(self) -> tuple[str, ...]:
        """Kernels of one wave, in launch order."""
        return layout.launched(self.macros)

    @cached_property
    def macros(self) -> dict[str, int]:
        """``CLVOL_*`` macros: what is compiled, and what a path's state and the kernels' arguments hold."""
        return plan_macros(self)

    @cached_property
    def slots(self) -> dict[str, str]:
        """The headers under cl/ that choices fill in, by family; the majorant's once it is settled."""
        return filled_slots(self)

    def describe(self) -> list[str]:
        """The plan in lines of text: choices with their reasons, features, stages, what is compiled."""
        return list(describe_plan(self))

    def __repr__(self) -> str:
        used = [f"{family} {name}" for family, name in self.in_force.items() if name != "none"]
        return f"<Plan {', '.join(used)}>"

    def __str__(self) -> str:
        return "\n".join(self.describe())
