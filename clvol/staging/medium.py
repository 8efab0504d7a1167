"""The medium that a volume's grids make: density, colour, glow; how dense and how bright it should be."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np

from clvol.errors import OptionError, VolumeError, option
from clvol.scene.reader import ROUNDING
from clvol.scene.records import ConstVolume, GridVolume
from clvol.staging.finding import IN_UNITS, Found, find_grids, plain
from clvol.staging.source import Field
from clvol.staging.thickness import WANTED, Rays, glow, thickness
from clvol.staging.transfer import Look, look_of

if TYPE_CHECKING:
    from types import SimpleNamespace

    from clvol.staging.source import Source

ALBEDO, DARK = 0.95, 0.5
"""Of smoke and cloud, and of the smoke of a fire."""
ANISOTROPY = 0.3
KELVIN = 500.0
"""A greatest temperature below it is no kelvin: nothing glows there."""
HOTTEST = 2000.0
"""Kelvin that the greatest temperature then stands for."""
COLD = 0.6
"""Share of the greatest temperature below which nothing glows, where no flame says what does."""
LARGEST = 1e30
"""Factor that is chosen, whatever the values."""
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
    def of(cls, source: Source, options: SimpleNamespace, of_sequence: bool = False) -> Grids:
        """Find them by name, and read those that are used.

        Of a sequence a file without any grid is an empty frame.
        """
        listed = source.listed()
        if of_sequence and not listed:
            return cls(Found(""), Field("", {}, ConstVolume((0.0,))), None, None, None)
        asked = {kind: getattr(options, kind) for kind in ("density", "temperature", "flame", "colour")}
        found = find_grids(listed, asked, source.name)
        sane = {"sanitize": True} if options.sanitize else {}
        fog = {"level_set": options.level_set} if options.level_set else {}
        fields = {
            name: source.open(name, sane | (fog if name == found.density else {}))
            for name in dict.fromkeys(vars(found).values())
            if name is not None
        }
        others = (found.temperature, found.flame, found.colour)
        density = fields[found.density].seen_as(options.transfer or scanned(fields[found.density]))
        grids = cls(found, density, *(None if n is None else fields[n] for n in others))
        if density.look is not None:
            _refuse_beside(density.look, options)
            return replace(grids.dark(), colour=None)
        grids.check(source.name)
        return grids.dark() if options.emission_scale == 0 else grids.lit()

    def check(self, where: str) -> None:
        """VolumeError for a grid of another number of channels than its use has."""
        heat, colour = self.temperature, self.colour
        if heat is not None and not heat.empty and heat.channels != 1:
            hint = "temperature 'none' leaves it out"
            raise VolumeError(f"grid {heat.name!r} has three channels, a temperature has one", where, hint)
        if colour is not None and not colour.empty and colour.channels != 3:
            hint = "colour 'none' leaves it out"
            raise VolumeError(f"grid {colour.name!r} has one channel, a colour has three", where, hint)
        if colour is not None and colour.peak > 1 + ROUNDING:
            hint = "divide it in the file; colour 'none' leaves it out"
            raise VolumeError(
                f"grid {colour.name!r} is an albedo, at most 1, and reaches {colour.peak:.4g}", where, hint
            )

    def between(self, limits: tuple[float, float] | None, look: Look | None) -> Grids:
        """With a look of other limits, those of a sequence."""
        if self.density.look is None or limits is None or look is None:
            return self
        return replace(self, density=self.density.seen_as(look, limits))

    def dark(self) -> Grids:
        """Without anything that glows."""
        return replace(self, temperature=None, flame=None)

    def lit(self) -> Grids:
        """Without what is nowhere above 0: where there is a flame to be, nothing glows but for it."""
        if self.flame is not None and self.flame.peak <= 0:
            return self.dark()
        heat = self.temperature
        return replace(self, temperature=heat if heat is not None and heat.peak > 0 else None)

    @property
    def burns(self) -> bool:
        """Whether anything glows."""
        return self.temperature is not None or self.flame is not None

    @property
    def heat(self) -> Field | None:
        """What gives the colour of the glow by its temperature; None of a flame with colours of its own."""
        if self.temperature is None and self.flame is not None and self.flame.channels == 3:
            return None
        return self.temperature or self.flame


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


def choose_scales(grids: Grids, options: SimpleNamespace, rays: Rays, peak: float) -> Scales:
    """Those that a user gives, and for the others those with which the picture reads well along the rays.

    peak : the greatest temperature there is, in all frames of a sequence.
    """
    values = None if grids.density.empty else _sampled(grids.density, rays)
    density = options.density_scale
    if density is None:
        density = 1.0
        look = grids.density.look
        in_units = plain(grids.found.density) in IN_UNITS if look is None else not look.relative_opacity
        if not in_units and values is not None:
            thick = thickness(values, rays)
            density = _rounded(min(WANTED / thick, LARGEST)) if 0 < thick < np.inf else 1.0
    kelvin, coldest = _kelvin(grids, options, peak) if peak > 0 else (1.0, 0.0)
    emission = options.emission_scale
    if emission is None:
        emission = 1.0
        if grids.burns and values is not None:
            absorbed = 1 - float(np.mean(options.albedo))
            emission = _brightness(grids, density * values, rays, absorbed, coldest)
    return Scales(density, kelvin, emission, coldest)


def _kelvin(grids: Grids, options: SimpleNamespace, peak: float) -> tuple[float, float]:
    """Kelvin of a step of 1 in temperature, and the temperature up to which nothing glows.

    The greatest temperature has its own kelvin where it can be kelvin at all, else those of a fire.
    """
    coldest = _rounded(COLD * peak) if grids.flame is None else 0.0
    hottest = HOTTEST
    if options.temperature_scale is not None:
        hottest = options.temperature_scale * peak
    elif grids.temperature and peak > KELVIN:
        hottest = peak
    exact = hottest / (peak - coldest)
    return (_rounded(exact) if hottest == HOTTEST else exact), coldest


def _brightness(grids: Grids, sigma_t: np.ndarray, rays: Rays, absorbed: float, coldest: float) -> float:
    weight = _sampled(glowing(grids), rays)
    seen = glow(absorbed * sigma_t * np.where(weight > coldest, weight, 0), sigma_t, rays)
    return _rounded(min(BRIGHT / seen, LARGEST)) if 0 < seen < np.inf else 1.0


def glowing(grids: Grids) -> Field:
    """The grid that says how much glows where: the flame, or the temperature where there is none."""
    field = grids.flame or grids.temperature
    assert field is not None
    return field


def medium(grids: Grids, options: SimpleNamespace, scales: Scales) -> dict[str, Any]:
    """The plugin."""
    phase = {"type": "hg", "g": ANISOTROPY if options.anisotropy is None else options.anisotropy}
    if grids.density.look is not None:
        made = grids.density.look.plugin(grids.density.plugin, scales.density)
        scaled = {} if options.emission_scale is None else {"emission_scale": options.emission_scale}
        return made | {"phase": phase} | (scaled if "emission" in made else {})
    described: dict[str, Any] = {
        "type": "heterogeneous",
        "sigma_t": grids.density.plugin,
        "scale": scales.density,
        "albedo": grids.colour.plugin if grids.colour else _value(options.albedo),
        "phase": phase,
    }
    if grids.burns:
        described["emission"] = glowing(grids).plugin
        described["emission_scale"] = scales.emission
    if grids.burns and grids.heat is not None:
        described["temperature"] = grids.heat.plugin
        described["temperature_scale"] = scales.kelvin
        if scales.coldest:
            described["temperature_offset"] = scales.coldest
    return described


def _refuse_beside(look: Look, options: SimpleNamespace) -> None:
    """OptionError for what has no effect where a transfer function makes all of the medium of one grid."""
    names = ["temperature", "flame", "colour", "albedo", "temperature_scale"]
    names += [] if look.emission else ["emission_scale"]
    for name in names:
        if getattr(options, name) not in (None, "none"):
            hint = "leave one of them out; a transfer's own colour and emission say how values look"
            raise OptionError(f"{option('transfer')} and {option(name)} exclude each other", hint=hint)


def scanned(density: Field) -> Look | None:
    """The look of a CT scan, whose values can be no density: air has about -1000 Hounsfield units."""
    volume = density.volume
    if (
        isinstance(volume, GridVolume)
        and getattr(volume.grid, "unit", "") == "mm"
        and density.limits[0] < -500
    ):
        return look_of("bone")
    return None


def _value(spectrum: tuple[float, ...]) -> Any:
    return spectrum[0] if len(spectrum) == 1 else {"type": "rgb", "value": list(spectrum)}


def _sampled(field: Field, rays: Rays) -> np.ndarray:
    if not isinstance(field.volume, GridVolume):
        return np.zeros(rays.places.shape[:2], np.float32)
    return rays.sample(field.volume, field.means)


def _rounded(value: float) -> float:
    """To two digits: it is a guess, and users edit it."""
    return float(f"{value:.2g}")
