"""The state of a path: every field that a slot may hold, with what it is and the feature that needs it.

A plan's macros decide which of them a scene's slots have.  Fields are 4 bytes each, and lie as structures of
arrays: all slots' first field, then all slots' second, ...
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

if TYPE_CHECKING:
    from collections.abc import Callable

Macros = Mapping[str, int]
"""``CLVOL_*`` macros of a plan, by name."""


@dataclass(frozen=True)
class PathField:
    """One 4-byte field of a path slot: its C type ("f", "i" or "u") and what it holds."""

    name: str
    kind: str
    meaning: str


@dataclass(frozen=True)
class Declared:
    """A field, or several alike, as the table below declares them.

    needs : macros all of which must be other than 0.  unless : a macro that must be 0.
    parts : what follows the name, each time in a field of its own; times : the macro that says how many
        numbered fields there are instead.
    absent : what stages read where there is none.
    """

    name: str
    kind: str
    meaning: str
    needs: tuple[str, ...] = ()
    unless: str = ""
    parts: tuple[str, ...] = ("",)
    times: str = ""
    absent: str = "0"

    def fields(self, macros: Macros) -> list[PathField]:
        """What there is of it under these macros."""
        if not all(macros[name] for name in self.needs) or (self.unless and macros[self.unless]):
            return []
        parts = [f"_{n}" for n in range(macros[self.times])] if self.times else self.parts
        return [PathField(self.name + part, self.kind, self.meaning) for part in parts]


XYZ = ("_x", "_y", "_z")
_NEE, _WALKS = "CLVOL_NEE", "CLVOL_HAS_HETEROGENEOUS"

COUNTS = {
    "lookups": "density look-ups",
    "tentative": "tentative collisions",
    "real": "real collisions",
    "cells": "majorant cells crossed",
    "violations": "look-ups above their majorant",
    "shadow_rays": "shadow rays traced",
}
"""What is counted along a path: by its walks, and where it scatters."""

FIRST_HIT = {"depth": 1, "normal": 3, "albedo": 3, "position": 3}
"""Pictures of what camera paths first meet, and the channels of each."""
ALPHA = "alpha"
"""The picture of how many camera paths meet something."""


def _count(name: str, needs: str) -> Declared:
    return Declared(name, "u", f"{COUNTS[name]}, of the path (if a picture shows them) or the slot", (needs,))


def _legs(prefix: str, *needs: str) -> tuple[Declared, ...]:
    """Where a walk stands that goes on in the next wave; the place is a sum of two floats."""
    return (
        Declared(f"{prefix}leg", "u", "legs that the walk has behind it", needs),
        Declared(f"{prefix}walked", "f", "ray parameter that it has come to", needs),
        Declared(f"{prefix}walked_rest", "f", "what rounding took from it", needs),
    )


def _first_hit(name: str) -> tuple[Declared, ...]:
    """A picture's fields; a position comes with its weight."""
    needs = (f"CLVOL_SHOWS_{name.upper()}",)
    parts = tuple(f"_{c}" for c in range(FIRST_HIT[name]))
    found = Declared(name, "f", "what a picture of the first hit shows", needs, parts=parts)
    weight = Declared("met", "f", "1 once the path has met something", needs)
    return (found, weight) if name == "position" else (found,)


PATH_STATE: tuple[Declared, ...] = (
    Declared("origin", "f", "start of the ray, world space", parts=XYZ),
    Declared("direction", "f", "unit direction of travel", parts=XYZ),
    Declared("beta", "f", "path weight", times="CLVOL_SPECTRUM"),
    Declared("radiance", "f", "radiance gathered so far", times="CLVOL_SPECTRUM"),
    Declared("pixel", "u", "pixel index y * width + x"),
    Declared("sample", "u", "sample index within the pixel"),
    Declared("job", "u", "where in `results` the path ends up; NO_JOB: the slot is empty"),
    Declared("bounce", "u", "scatterings so far"),
    Declared("event", "u", "what shade has to handle: EVENT_*"),
    _count("lookups", _WALKS),
    _count("tentative", "CLVOL_HAS_MEDIA"),
    _count("real", "CLVOL_HAS_MEDIA"),
    _count("cells", _WALKS),
    _count("violations", _WALKS),
    Declared("largest_weight", "f", "largest weight of the path or the slot", ("CLVOL_HAS_MEDIA",)),
    *_legs("", _WALKS),
    Declared(
        "exhausted", "u", "statistics of the slot: walks ended by a loop's bound", ("CLVOL_HAS_LONG_WALKS",)
    ),
    Declared("medium", "i", "medium of the collision", ("CLVOL_HAS_MANY_MEDIA",)),
    Declared(
        "medium_end",
        "f",
        "ray parameter where the walk ends",
        ("CLVOL_HAS_MEDIA",),
        unless="CLVOL_HAS_SEGMENTS",
    ),
    Declared(
        "hit_t",
        "f",
        "ray parameter of the surface hit, infinite if none",
        ("CLVOL_HAS_SURFACES",),
        absent="INFINITY",
    ),
    Declared("hit_primitive", "u", "primitive that was hit", ("CLVOL_HAS_SURFACES",), absent="NO_PRIMITIVE"),
    Declared("hit_u", "f", "where on it", ("CLVOL_HAS_TRIANGLES",)),
    Declared("hit_v", "f", "where on it", ("CLVOL_HAS_TRIANGLES",)),
    Declared("segment", "u", "surfaces passed since the last scattering", ("CLVOL_HAS_PASSABLE",)),
    Declared("after_t", "f", "ray parameter of the last surface passed", ("CLVOL_HAS_PASSABLE",)),
    Declared(
        "after_primitive",
        "u",
        "primitive of the last surface passed",
        ("CLVOL_HAS_PASSABLE",),
        absent="NO_PRIMITIVE",
    ),
    Declared("inside", "u", "a bit for each boundary the path is inside of", times="CLVOL_BOUNDARY_WORDS"),
    Declared(
        "sample_weight",
        "f",
        "what the pixel filter multiplies the result by",
        ("CLVOL_HAS_SIGNED_FILTER",),
        absent="1.0f",
    ),
    Declared("channel", "u", "the one channel this path follows", ("CLVOL_ONE_CHANNEL_PER_PATH",)),
    Declared("pdf", "f", "density of the last direction; 0 where MIS does not apply", ("CLVOL_MIS",)),
    Declared(
        "eta_squared",
        "f",
        "squared index of what the path is in, for roulette",
        ("CLVOL_HAS_TRANSMISSION",),
        absent="1.0f",
    ),
    _count("shadow_rays", _NEE),
    Declared("shadow_direction", "f", "direction to the light", (_NEE,), parts=XYZ),
    Declared(
        "shadow_distance",
        "f",
        "distance to the light",
        (_NEE, "CLVOL_HAS_NEAR_LIGHTS"),
        absent="INFINITY",
    ),
    Declared(
        "shadow_primitive",
        "u",
        "primitive of the light's point",
        (_NEE, "CLVOL_HAS_AREA"),
        absent="NO_PRIMITIVE",
    ),
    Declared("shadow_origin", "f", "start of the shadow ray", (_NEE, "CLVOL_HAS_SURFACES"), parts=XYZ),
    Declared(
        "shadow_inside",
        "u",
        "a bit for each boundary it starts inside of",
        (_NEE,),
        times="CLVOL_BOUNDARY_WORDS",
    ),
    Declared(
        "shadow_light",
        "f",
        "light of next-event estimation, where it is not attenuated yet",
        (_NEE,),
        times="CLVOL_SPECTRUM",
    ),
    Declared("goes_on", "u", "1: the path goes on when its shadow ray is through; 0: it has ended", (_NEE,)),
    *_legs("shadow_", _NEE, _WALKS),
    Declared("shadow_medium", "u", "medium it is in", (_NEE, _WALKS, "CLVOL_HAS_MANY_MEDIA")),
    Declared("shadow_segment", "u", "surfaces that it has passed", (_NEE, _WALKS, "CLVOL_HAS_PASSABLE")),
    Declared(
        "shadow_after_t",
        "f",
        "ray parameter of the last of them",
        (_NEE, _WALKS, "CLVOL_HAS_PASSABLE"),
    ),
    Declared(
        "shadow_after_primitive",
        "u",
        "primitive of the last of them",
        (_NEE, _WALKS, "CLVOL_HAS_PASSABLE"),
    ),
    *(field for name in FIRST_HIT for field in _first_hit(name)),
    Declared(ALPHA, "f", "1 less the weight with which the path has left unscattered", ("CLVOL_HAS_ALPHA",)),
    Declared("cut", "u", "statistics of the slot: paths ended by max_depth", ("CLVOL_HAS_MAX_DEPTH",)),
    Declared("cut_energy", "f", "statistics of the slot: weight of those paths", ("CLVOL_HAS_MAX_DEPTH",)),
    Declared("lane_steps", "u", "statistics of the slot: steps of lanes, idle or not", ("CLVOL_HAS_LANES",)),
    Declared("busy_lane_steps", "u", "statistics of the slot: of lanes that walked", ("CLVOL_HAS_LANES",)),
)
"""In the order in which a slot holds them.  What fewer scenes have comes later: units that do not use it then
agree on the places of the others, and are built once."""
_COUNTS = [declared for declared in PATH_STATE if declared.name in COUNTS]
_FIRST_HITS = [
    *(declared for name in FIRST_HIT for declared in _first_hit(name)),
    next(declared for declared in PATH_STATE if declared.name == ALPHA),
]

SLOT_STATISTICS: dict[str, Callable[..., Any]] = {
    "tentative": np.sum,
    "real": np.sum,
    "cells": np.sum,
    "violations": np.sum,
    "shadow_rays": np.sum,
    "cut": np.sum,
    "cut_energy": np.sum,
    "largest_weight": np.max,
    "lane_steps": np.sum,
    "busy_lane_steps": np.sum,
    "exhausted": np.sum,
}
"""Fields that a slot keeps from path to path, unless a picture shows them, and how those of slots combine."""


def path_fields(macros: Macros) -> list[PathField]:
    """The fields that a slot holds, in order."""
    return [field for declared in PATH_STATE for field in declared.fields(macros)]


def path_counts(macros: Macros) -> tuple[str, ...]:
    """Counts that are kept per path and summed per pixel, for pictures that show them."""
    return tuple(d.name for d in _COUNTS if macros[f"CLVOL_SHOWS_{d.name.upper()}"] and d.fields(macros))


def shows_weight(macros: Macros) -> bool:
    """Whether the largest weight is kept per path: a picture shows it."""
    return bool(macros["CLVOL_SHOWS_LARGEST_WEIGHT"] and macros["CLVOL_HAS_MEDIA"])


def counts_per_path(macros: Macros) -> int:
    """Numbers that a finished path writes beside its radiance: counts, and its largest weight if shown."""
    return len(path_counts(macros)) + shows_weight(macros)


def first_hit_fields(macros: Macros) -> list[str]:
    """Fields kept per path for pictures of the first hit and alpha, in order."""
    return [field.name for declared in _FIRST_HITS for field in declared.fields(macros)]


def slot_fields(macros: Macros) -> list[str]:
    """Statistics that slots keep for themselves."""
    per_path = {*path_counts(macros), *(("largest_weight",) if shows_weight(macros) else ())}
    return [f.name for f in path_fields(macros) if f.name in SLOT_STATISTICS and f.name not in per_path]
