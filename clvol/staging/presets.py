"""Transfer functions by name, for CT, MR and simulations: how opaque values are, and what colour."""

from __future__ import annotations

from dataclasses import dataclass

Points = tuple[tuple[float, float | tuple[float, float, float]], ...]
"""Pairs of a value and a number or a linear colour."""


@dataclass(frozen=True)
class Preset:
    """A look of values.

    Parameters
    ----------
    summary : what it shows.
    opacity, colour, emission : points; opacities are relative to 1, and multiplied by what fits the volume.
    relative : values count from the least of the volume, 0, to the greatest, 1; else they are Hounsfield's.
    """

    summary: str
    opacity: Points
    colour: Points
    emission: Points = ()
    relative: bool = False


IVORY = (0.88, 0.80, 0.66)

PRESETS = {
    "bone": Preset(
        "CT: bone and metal, in ivory; soft tissue is left out",
        ((180.0, 0.0), (350.0, 0.2), (700.0, 0.8), (1500.0, 1.0)),
        ((180.0, (0.68, 0.44, 0.30)), (400.0, (0.87, 0.76, 0.60)), (900.0, IVORY)),
    ),
    "muscle": Preset(
        "CT: muscle in red, fat in yellow, thin; bone behind it, in ivory",
        ((-150.0, 0.0), (-80.0, 0.02), (0.0, 0.03), (50.0, 0.12), (150.0, 0.15), (300.0, 0.6), (800.0, 1.0)),
        (
            (-120.0, (0.80, 0.62, 0.28)),
            (-20.0, (0.78, 0.45, 0.25)),
            (50.0, (0.60, 0.14, 0.09)),
            (160.0, (0.66, 0.24, 0.16)),
            (350.0, IVORY),
        ),
    ),
    "lung": Preset(
        "CT: the tissue of lungs as a haze, vessels and airways' walls in red; air and bone are left out",
        ((-950.0, 0.0), (-860.0, 0.02), (-600.0, 0.15), (-400.0, 0.4), (-100.0, 0.5), (0.0, 0.0)),
        ((-900.0, (0.42, 0.52, 0.70)), (-650.0, (0.80, 0.45, 0.38)), (-300.0, (0.80, 0.20, 0.14))),
    ),
    "mr": Preset(
        "MR: brighter signals are more opaque; noise is left out",
        ((0.12, 0.0), (0.3, 0.08), (0.6, 0.4), (1.0, 1.0)),
        ((0.1, (0.40, 0.24, 0.22)), (0.5, (0.72, 0.56, 0.50)), (1.0, (0.92, 0.88, 0.84))),
        relative=True,
    ),
    "fire": Preset(
        "simulation: dark smoke that glows from red to white where values are great",
        ((0.0, 0.0), (0.05, 0.1), (1.0, 1.0)),
        ((0.0, 0.45), (0.3, 0.2), (1.0, 0.05)),
        (
            (0.15, 0.0),
            (0.35, (0.9, 0.12, 0.01)),
            (0.6, (3.0, 0.9, 0.12)),
            (0.85, (6.0, 3.4, 1.0)),
            (1.0, (8.0, 6.5, 4.0)),
        ),
        relative=True,
    ),
    "density": Preset(
        "simulation: more is denser, from blue through green to yellow",
        ((0.0, 0.0), (0.02, 0.0), (1.0, 1.0)),
        (
            (0.0, (0.13, 0.22, 0.62)),
            (0.35, (0.10, 0.55, 0.60)),
            (0.65, (0.35, 0.75, 0.25)),
            (1.0, (0.98, 0.86, 0.14)),
        ),
        relative=True,
    ),
}
"""By name."""
