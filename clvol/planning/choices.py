"""What a user asks for: a name of every family of the registry or "auto", and a few numbers."""

from __future__ import annotations

from dataclasses import dataclass, fields
from typing import TYPE_CHECKING, Any

from clvol.base.arguments import listed, positive
from clvol.errors import OptionError, shown
from clvol.planning import registry
from clvol.planning.names import Names

if TYPE_CHECKING:
    from collections.abc import Iterable, Mapping

    from clvol.scene.records import Scene


NUMBERS = ("majorant_scale", "step", "target_error", "aov")
"""What may be chosen beside the names."""


@dataclass(frozen=True, init=False)
class Choices:
    """Everything a user may choose about how a picture is estimated, as ``Choices(technique="delta")``.

    Parameters
    ----------
    names : by family of `clvol.planning.registry`, each as a keyword of its own; "auto" where none is given.
    majorant_scale : multiplies every bound, for experiments.
    step : world length of a marching step; None takes the edge of a voxel.
    target_error : mean relative standard error at which the render ends; samples go where the error is.
    aov : names of `registry.AOVS` to return as pictures; look-ups always are.

    Raises
    ------
    OptionError : a name that is none, or a number that is not positive.
    """

    names: Names
    majorant_scale: float
    step: float | None
    target_error: float | None
    aov: tuple[str, ...]

    def __init__(
        self,
        *,
        majorant_scale: float = 1.0,
        step: float | None = None,
        target_error: float | None = None,
        aov: str | Iterable[str] = (),
        **names: str,
    ) -> None:
        for family in names:
            if family not in registry.FAMILIES:
                raise TypeError(f"Choices has no {family!r}")
        asked = dict.fromkeys(registry.FAMILIES, "auto") | names
        for family, name in asked.items():
            registry.check_choice(family, name)
        positive("majorant_scale=", majorant_scale)
        for number, given in {"step": step, "target_error": target_error}.items():
            if given is not None:
                positive(f"{number}=", given)
        values = (Names(asked), majorant_scale, step, target_error, _aovs(aov))
        for field, value in zip(fields(self), values, strict=True):
            object.__setattr__(self, field.name, value)

    def __getitem__(self, family: str) -> str:
        """What is asked for of a family."""
        return self.names[family]

    def but(self, **changes: Any) -> Choices:
        """The same with other names or numbers, by keyword."""
        numbers = {field.name: getattr(self, field.name) for field in fields(self) if field.name != "names"}
        return Choices(**{**self.names, **numbers, **changes})

    @classmethod
    def for_scene(cls, scene: Scene, names: Mapping[str, str], **numbers: Any) -> Choices:
        """`names`, but the scene's own in the place of "auto"; and the numbers that `Choices` takes."""
        own = scene.integrator.choices
        given = {f: names.get(f, "auto") for f in registry.FAMILIES}
        asked: dict[str, Any] = {f: own.get(f, "auto") if n == "auto" else n for f, n in given.items()}
        aov = (*scene.integrator.aovs, *_aovs(numbers.get("aov", ())))
        return cls(**asked, **(numbers | {"aov": aov}))


def _aovs(names: str | Iterable[str]) -> tuple[str, ...]:
    given, known = listed(names), list(registry.AOVS)
    if given is None:
        raise OptionError(f"aov={shown(names)} is not a list of names", hint=registry.choose_among(known))
    for name in given:
        if not isinstance(name, str) or name not in known:
            raise OptionError(f"unknown aov {shown(name)}", hint=registry.choose_among(known, name))
    return tuple(dict.fromkeys(given))
