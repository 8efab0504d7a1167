"""The medium that a volume's grids make: density, colour, glow; how dense and how bright it should be."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np

from clvol.errors import VolumeError
from clvol.scene.records import GridVolume
from clvol.staging.finding import IN_UNITS, Found, find_grids, plain
from clvol.staging.thickness import WANTED, Rays, glow, thickness

if TYPE_CHECKING:
    from types import SimpleNamespace

    from clvol.staging.source import Field, Source

ALBEDO, DARK = 0.95, 0.5
"""Of smoke and cloud, and of the smoke of a fire."""
ANISOTROPY = 0.3
KELVIN = 500.0
"""A greatest temperature below it is no kelvin: nothing glows there."""
HOTTEST = 2000.0
"""Kelvin that the greatest temperature then stands for."""
COLD = 0.6
"""Share of the greatest temperature below which nothing glows, where no flame says what does."""
BRIGHT = 0.45
"""Radiance that the brightest tenth of a fire should have."""


@dataclass(frozen=True, eq=False)
class Grids:
    """What a volume's grids are, read and placed."""

    found: Found
    density: Field
    temperature: Field | None
    flame: Field | None
    colour: Field | None

    @classmethod
    def of(cls, source: Source, options: SimpleNamespace) -> Grids:
        """Find them by name, and read those that are used."""
        asked = {kind: getattr(options, kind) for kind in ("density", "temperature", "flame", "colour")}
        found = find_grids(source.listed(), asked, source.name)
        fields = {name: source.open(name) for name in dict.fromkeys(vars(found).values()) if name is not None}
        others = (found.temperature, found.flame, found.colour)
        grids = cls(found, fields[found.density], *(None if n is None else fields[n] for n in others))
        grids.check(source.name)
        return grids.without_dark(options)

    def check(self, where: str) -> None:
        """VolumeError for a grid of another number of channels than its use has."""
        for kind, has in (("temperature", self.temperature), ("flame", self.flame)):
            if has is not None and not has.empty and has.channels != 1 and kind == "temperature":
                raise VolumeError(f"grid {has.name!r} has three channels, a {kind} has one", where)
        if self.colour is not None and not self.colour.empty and self.colour.channels != 3:
            hint = "--colour none leaves it out"
            raise VolumeError(f"grid {self.colour.name!r} has one channel, a colour has three", where, hint)

    def without_dark(self, options: SimpleNamespace) -> Grids:
        """Without what glows where nothing does."""
        if options.emission_scale == 0:
            return replace(self, temperature=None, flame=None)
        glowing = [f if f is not None and f.peak > 0 else None for f in (self.temperature, self.flame)]
        return replace(self, temperature=glowing[0], flame=glowing[1])

    @property
    def burns(self) -> bool:
        """Whether anything glows."""
        return self.temperature is not None or self.flame is not None


@dataclass(frozen=True)
class Scales:
    """What the values of the grids are multiplied by: chosen once, for all frames of a sequence.

    coldest : temperature up to which nothing glows, in the grid's own values.
    """

    density: float
    kelvin: float
    emission: float
    coldest: float = 0.0

    def hottest(self, peak: float) -> float:
        """Kelvin of the greatest temperature."""
        return (peak - self.coldest) * self.kelvin


def choose_scales(grids: Grids, options: SimpleNamespace, rays: Rays) -> Scales:
    """Those that a user gives, and for the others those with which the picture reads well along the rays."""
    density = options.density_scale
    values = None
    if density is None:
        density = 1.0
        if plain(grids.found.density) not in IN_UNITS and not grids.density.empty:
            values = _sampled(grids.density, rays)
            thick = thickness(values, rays)
            density = _rounded(WANTED / thick) if thick > 0 else 1.0
    kelvin, coldest = _kelvin(grids, options) if grids.burns else (1.0, 0.0)
    emission = options.emission_scale
    if emission is None:
        emission = 1.0
        if grids.burns and not grids.density.empty:
            values = _sampled(grids.density, rays) if values is None else values
            absorbed = 1 - float(np.mean(albedo_of(grids, options)))
            emission = _brightness(grids, density * values, rays, absorbed, coldest)
    return Scales(density, kelvin, emission, coldest)


def _kelvin(grids: Grids, options: SimpleNamespace) -> tuple[float, float]:
    """Kelvin of a step of 1 in temperature, and the temperature up to which nothing glows.

    The greatest temperature has its own kelvin where it can be kelvin at all, else those of a fire.
    """
    heat = grids.temperature or glowing(grids)
    coldest = _rounded(COLD * heat.peak) if grids.flame is None else 0.0
    hottest = HOTTEST
    if options.temperature_scale is not None:
        hottest = options.temperature_scale * heat.peak
    elif grids.temperature and heat.peak > KELVIN:
        hottest = heat.peak
    exact = hottest / (heat.peak - coldest)
    return (_rounded(exact) if hottest == HOTTEST else exact), coldest


def _brightness(grids: Grids, sigma_t: np.ndarray, rays: Rays, absorbed: float, coldest: float) -> float:
    weight = _sampled(glowing(grids), rays)
    seen = glow(absorbed * sigma_t * np.where(weight > coldest, weight, 0), sigma_t, rays)
    return _rounded(BRIGHT / seen) if seen > 0 else 1.0


def glowing(grids: Grids) -> Field:
    """The grid that says how much glows where: the flame, or the temperature where there is none."""
    field = grids.flame or grids.temperature
    assert field is not None
    return field


def albedo_of(grids: Grids, options: SimpleNamespace) -> tuple[float, ...]:
    """As given, or what is usual."""
    return options.albedo or ((DARK,) if grids.burns else (ALBEDO,))


def medium(grids: Grids, options: SimpleNamespace, scales: Scales) -> dict[str, Any]:
    """The plugin."""
    described: dict[str, Any] = {
        "type": "heterogeneous",
        "sigma_t": grids.density.plugin,
        "scale": scales.density,
        "albedo": grids.colour.plugin if grids.colour else _value(albedo_of(grids, options)),
        "phase": {"type": "hg", "g": ANISOTROPY if options.anisotropy is None else options.anisotropy},
    }
    if grids.burns:
        described["emission"] = glowing(grids).plugin
        described["emission_scale"] = scales.emission
        described["temperature"] = (grids.temperature or glowing(grids)).plugin
        described["temperature_scale"] = scales.kelvin
        if scales.coldest:
            described["temperature_offset"] = scales.coldest
    return described


def _value(spectrum: tuple[float, ...]) -> Any:
    return spectrum[0] if len(spectrum) == 1 else {"type": "rgb", "value": list(spectrum)}


def _sampled(field: Field, rays: Rays) -> np.ndarray:
    if not isinstance(field.volume, GridVolume):
        return np.zeros(rays.places.shape[:2], np.float32)
    return rays.sample(field.volume, field.means)


def _rounded(value: float) -> float:
    """To two digits: it is a guess, and users edit it."""
    return float(f"{value:.2g}")
