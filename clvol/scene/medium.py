"""Participating media: extinction, albedo and emission, each a number, a colour or a volume."""

from __future__ import annotations

import logging
from dataclasses import replace
from typing import Any, NoReturn

import numpy as np

from clvol.scene.medium_facts import channels_of
from clvol.scene.reader import BRIGHTEST, ROUNDING, Reader
from clvol.scene.records import ConstVolume, GridVolume, Medium, Phase, Spectrum, Volume
from clvol.scene.volume import largest_value, limited
from clvol.volumes import check_coefficients, check_finite
from clvol.volumes.grid import DenseGrid
from clvol.volumes.proportional import proportional_channels
from clvol.volumes.repair import sanitized, warn_of

log = logging.getLogger("clvol")


def homogeneous(reader: Reader) -> Medium:
    """The `homogeneous` plugin: the same extinction wherever its shape is."""
    return _medium(reader, homogeneous=True)


def heterogeneous(reader: Reader) -> Medium:
    """The `heterogeneous` plugin: extinction from a volume, and none outside the volume's box."""
    return _medium(reader, homogeneous=False)


def _medium(reader: Reader, homogeneous: bool) -> Medium:
    if reader.has("sigma_s") or reader.has("sigma_a"):
        sigma_t, albedo = _by_parts(reader)
        scale = reader.color("scale", 1.0)
    else:
        sigma_t, scale = _extinction(reader, homogeneous)
        albedo = _coefficient(reader, "albedo", 0.75, maximum=1.0)
    emission = _emission(reader) | emission_density(reader)
    return Medium(sigma_t, albedo, scale, homogeneous=homogeneous, **emission, **common_parameters(reader))


def common_parameters(reader: Reader) -> dict[str, Any]:
    """Fields of a Medium that every kind has from the same parameters: phase, sample_emitters and name."""
    sample_emitters = reader.boolean("sample_emitters", True)
    reader.ignore(has_spectral_extinction=bool)
    phase = reader.only_child("phase")
    built = reader.build(phase) if phase else Phase()
    if isinstance(built, Phase) and isinstance(built.flakes, GridVolume) and _is_even(reader):
        name = reader.children("phase")[0][0]
        what = "an sggx whose S differs from place to place, where sigma_t does not"
        reader.unsupported(what, name, "give a heterogeneous medium a gridvolume as sigma_t")
    return {"phase": built, "sample_emitters": sample_emitters, "name": reader.node.id}


def _is_even(reader: Reader) -> bool:
    """Whether the extinction is no volume of samples."""
    found = reader.children("volume", "sigma_t") or reader.children("volume", "values")
    return not found or not isinstance(reader.build(found[0][1]), GridVolume)


def _extinction(reader: Reader, homogeneous: bool) -> tuple[Volume, Spectrum]:
    """`sigma_t` and `scale`, with the factors of a coloured grid that is a grey one times a colour."""
    sigma_t = _coefficient(reader, "sigma_t", 1.0)
    scale = reader.color("scale", 1.0)
    if not isinstance(sigma_t, GridVolume):
        return sigma_t, scale
    if homogeneous:
        reader.fail(
            "a homogeneous medium cannot have a grid as sigma_t", "sigma_t", "use the heterogeneous plugin"
        )
    if channels_of(sigma_t) == 1:
        return sigma_t, scale
    if len(scale) > 1:
        reader.fail(
            "a coloured scale needs a sigma_t of one channel, this grid has three",
            "scale",
            "give a number as scale, or a grid of one channel",
        )
    sigma_t, factors = _reduced(reader, sigma_t)
    return sigma_t, tuple(scale[0] * factor for factor in factors)


def _by_parts(reader: Reader) -> tuple[Volume, Volume]:
    """sigma_t and albedo from `sigma_s` and `sigma_a`, as Mitsuba's media before version 2 have them."""
    for name, other in (("sigma_s", "sigma_a"), ("sigma_a", "sigma_s")):
        if not reader.has(name):
            reader.fail(f"a medium with '{other}' needs '{name}' too", other)
    for name in ("sigma_t", "albedo"):
        if reader.has(name):
            reader.fail(f"give either sigma_t and albedo, or sigma_s and sigma_a, not '{name}' too", name)
    parts = [np.array(reader.color(name, 0.0)) for name in ("sigma_s", "sigma_a")]
    total = parts[0] + parts[1]
    albedo = np.divide(parts[0], total, out=np.zeros_like(total), where=total > 0)
    return ConstVolume(tuple(total.tolist())), ConstVolume(tuple(albedo.tolist()))


def _reduced(reader: Reader, volume: GridVolume) -> tuple[GridVolume, Spectrum]:
    """The volume in one channel and its colour where its channels are proportional; else as it is.

    One look-up then serves all.  What media share stays shared.
    """
    done, grid = reader.library.reduced, volume.grid
    if id(grid) not in done:
        done[id(grid)] = proportional_channels(grid) if isinstance(grid, DenseGrid) else None
    if done[id(grid)] is None:
        return volume, (1.0,)
    one, factors = done[id(grid)]
    if id(volume) not in done:
        done[id(volume)] = replace(volume, grid=one)
    return done[id(volume)], factors


def _coefficient(
    reader: Reader, name: str, default: float, maximum: float = np.inf, light: bool = False
) -> Volume:
    """Parameter `name`, a number, a colour or a volume, with values in [0, maximum]."""
    if reader.is_value(name):
        return ConstVolume(reader.color(name, default, light, maximum))
    volume = sane(reader, own_volume(reader, name, "a number, a colour or a volume"))
    if isinstance(volume, GridVolume):
        check_coefficients(volume.grid, f"{name} of medium '{reader.type}'")
    if np.isfinite(maximum) and (largest := largest_value(volume)) > maximum:
        if largest > maximum * (1 + ROUNDING):
            reader.fail(f"'{name}' must be at most {maximum:g}, the volume reaches {largest:.9g}", name)
        log.warning("%s: the volume reaches %.9g, taken as %g", reader.node.place(name), largest, maximum)
        volume = limited(volume, maximum)
    return volume


def sane(reader: Reader, volume: Volume, signed: bool = False) -> Volume:
    """The volume as it is to be used: with the samples repaired that it asks for.

    What media share stays shared.  signed : as in `sanitized`.
    """
    if not isinstance(volume, GridVolume) or not volume.sanitize:
        return volume
    done = reader.library.sanitized
    if (id(volume.grid), signed) not in done:
        done[id(volume.grid), signed] = sanitized(volume.grid, signed)
        warn_of(volume.grid, done[id(volume.grid), signed][1])
    if (id(volume), signed) not in done:
        grid, repairs = done[id(volume.grid), signed]
        done[id(volume), signed] = replace(volume, grid=grid, repairs=str(repairs))
    repaired: Volume = done[id(volume), signed]
    return repaired


def own_volume(reader: Reader, name: str, expected: str) -> Volume:
    """The volume that is parameter `name`; SceneError, with what is `expected`, for anything else."""
    if not reader.has(name):
        reader.fail(f"{reader.kind} '{reader.type}' needs '{name}', {expected}")
    found = reader.children("volume", name)
    if not found:
        reader.refuse_plugin(name, expected)
    volume: Volume = reader.build(found[0][1])
    if channels_of(volume) == 6:
        reader.fail(
            f"'{name}' has six channels: they are for the S of an sggx alone", name, f"give {expected}"
        )
    return volume


def _emission(reader: Reader) -> dict[str, Any]:
    """The fields of a Medium that say what it emits.  A spectrum is seen as that of a light."""
    fields: dict[str, Any] = {}
    if reader.has("emission"):
        fields["emission"] = _coefficient(reader, "emission", 1.0, light=True)
    if reader.has("temperature"):
        fields["temperature"] = _temperature(reader)
        fields["temperature_scale"] = reader.number("temperature_scale", 1.0)
        fields["temperature_offset"] = reader.number("temperature_offset", 0.0)
    if fields:
        emission = fields.get("emission", ConstVolume((1.0,)))  # a blackbody's luminance is 1
        fields |= emission_scale(reader, largest_value(emission))
    needs = {"emission_scale": "an emission or a temperature"}
    needs |= dict.fromkeys(("temperature_scale", "temperature_offset"), "a temperature")
    for name, what in needs.items():
        if reader.has(name) and name not in fields:
            _nothing_to_scale(reader, name, what)
    return fields


def emission_density(reader: Reader) -> dict[str, Any]:
    """The fields of a Medium that say what it emits per length, whatever its extinction."""
    name, scale = "emission_density", "emission_density_scale"
    if reader.has(name):
        volume = _coefficient(reader, name, 0.0, light=True)
        return {name: volume} | emission_scale(reader, largest_value(volume), name)
    if reader.has(scale):
        _nothing_to_scale(reader, scale, "an emission_density")
    return {}


def emission_scale(reader: Reader, largest: float, of: str = "emission") -> dict[str, Any]:
    """`emission_scale`, or that `of` another field, of one whose unscaled values are at most `largest`."""
    scale = f"{of}_scale"
    factor = reader.color(scale, 1.0)
    brightest = largest * max(factor)
    if brightest > BRIGHTEST:
        name = scale if reader.has(scale) else of
        reader.fail(f"medium '{reader.type}' emits {brightest:g}, and may emit at most {BRIGHTEST:g}", name)
    return {scale: factor}


def _nothing_to_scale(reader: Reader, name: str, needed: str) -> NoReturn:
    reader.fail(f"'{name}' of medium '{reader.type}' has nothing to scale", name, f"give the medium {needed}")


def _temperature(reader: Reader) -> Volume:
    """`temperature`, a number or a volume of one channel; any finite values."""
    name, expected = "temperature", "a number or a volume of one channel"
    if reader.is_value(name):
        return ConstVolume((reader.number(name, 0.0),))
    volume = sane(reader, own_volume(reader, name, expected), signed=True)
    if channels_of(volume) > 1:
        reader.fail(f"'{name}' of medium '{reader.type}' must be {expected}, this one has three", name)
    if isinstance(volume, GridVolume):
        check_finite(volume.grid, f"{name} of medium '{reader.type}'")
    return volume
