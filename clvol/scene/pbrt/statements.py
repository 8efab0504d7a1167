"""What the statements of a .pbrt file come to: things, and the graphics state that each was made under."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from clvol.errors import shortened
from clvol.scene.pbrt.parameters import Parameter, Parameters


@dataclass(frozen=True)
class State:
    """What holds where a statement stands.  `ctm`: 4x4, from its own space to the space around."""

    ctm: np.ndarray = field(default_factory=lambda: np.eye(4))
    reverse: bool = False
    material: Thing | str | None = None  # itself or its name; None: pbrt's default
    area_light: Thing | None = None
    inside: str = ""
    outside: str = ""
    space: str = "srgb"
    starting: bool = True  # whether transforms are for the exposure's start
    defaults: tuple[tuple[str, Parameter], ...] = ()  # of `Attribute`, by what they are for


@dataclass(frozen=True, eq=False)
class Thing:
    """A statement that makes something: its `type`, as "sphere", its parameters, and the state there."""

    what: str
    type: str
    given: list[Parameter]
    where: str
    state: State

    def parameters(self) -> Parameters:
        """Typed access to its parameters, of which nobody has asked for any yet."""
        target = {"AreaLightSource": "light", "LightSource": "light", "MakeNamedMaterial": "material"}
        target["MakeNamedMedium"] = "medium"
        kind = target.get(self.what, self.what.lower())
        defaults = tuple(parameter for name, parameter in self.state.defaults if name == kind)
        return Parameters(self.given, f"{self.what} '{shortened(self.type, 60)}'", self.where, defaults)


@dataclass
class Read:
    """All that a file asks for."""

    options: dict[str, Thing] = field(default_factory=dict)  # Camera, Film, Sampler, …
    shapes: list[tuple[Thing, tuple[np.ndarray, ...]]] = field(default_factory=list)  # and its instance
    lights: list[Thing] = field(default_factory=list)
    materials: dict[str, Thing] = field(default_factory=dict)
    media: dict[str, Thing] = field(default_factory=dict)
    textures: dict[tuple[str, str], Thing] = field(default_factory=dict)  # by "float" or "spectrum", and name
    seed: int = 0  # of samplers that say none
    said: list[tuple[str, str]] = field(default_factory=list)  # what is taken as something else, and where
    moving: str = ""  # where the first transform was left out that holds at the end of the exposure alone
