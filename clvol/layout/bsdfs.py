"""Kinds of BSDF, and what of them host and device both decide by."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class BsdfFacts:
    """What light does at a surface of this kind.

    smooth : it has delta lobes only, so that no light can be sampled for it.
    transmits : light passes, and directions may be on either side; others are seen from their front alone.
    """

    smooth: bool = False
    transmits: bool = False


BSDF_FACTS = {
    "NULL": BsdfFacts(smooth=True, transmits=True),
    "DIFFUSE": BsdfFacts(),
    "DIELECTRIC": BsdfFacts(smooth=True, transmits=True),
    "THIN_DIELECTRIC": BsdfFacts(smooth=True, transmits=True),
    "ROUGH_DIELECTRIC": BsdfFacts(transmits=True),
    "CONDUCTOR": BsdfFacts(smooth=True),
    "ROUGH_CONDUCTOR": BsdfFacts(),
    "PLASTIC": BsdfFacts(),
    "ROUGH_PLASTIC": BsdfFacts(),
    "PRINCIPLED": BsdfFacts(),
    "PRINCIPLED_GLASS": BsdfFacts(transmits=True),
    "PRINCIPLED_THIN": BsdfFacts(transmits=True),
    "BLEND": BsdfFacts(smooth=True),
    "BENT": BsdfFacts(smooth=True),
}
"""By name; masks and two-sided ones have none, mixtures and bent ones the lobes of what they hold.
Principled ones that transmit are of glass."""

BSDFS = tuple(BSDF_FACTS)
"""In the order of their numbers on the device."""
