"""Participating media and their phase functions."""

from __future__ import annotations

import numpy as np

from clvol.scene.reader import Reader
from clvol.scene.records import ConstVolume, GridVolume, Medium, Phase, Volume
from clvol.scene.volume import largest_value
from clvol.volumes import check_coefficients


def homogeneous(reader: Reader) -> Medium:
    """The `homogeneous` plugin: the same extinction wherever its shape is."""
    return _medium(reader, homogeneous=True)


def heterogeneous(reader: Reader) -> Medium:
    """The `heterogeneous` plugin: extinction from a volume, and none outside the volume's box."""
    return _medium(reader, homogeneous=False)


def _medium(reader: Reader, homogeneous: bool) -> Medium:
    sigma_t = _coefficient(reader, "sigma_t", 1.0)
    if homogeneous and isinstance(sigma_t, GridVolume):
        reader.fail(
            "a homogeneous medium cannot have a grid as sigma_t", "sigma_t", "use the heterogeneous plugin"
        )
    albedo = _coefficient(reader, "albedo", 0.75, maximum=1.0)
    scale = reader.number("scale", 1.0, minimum=0.0)
    sample_emitters = reader.boolean("sample_emitters", True)
    for name in ("emission", "emission_scale", "temperature", "temperature_scale", "temperature_offset"):
        reader.refuse(name)
    reader.ignore("has_spectral_extinction")
    phase = reader.only_child("phase")
    return Medium(
        sigma_t,
        albedo,
        scale,
        reader.build.build(phase) if phase else Phase(),
        homogeneous,
        sample_emitters,
        name=reader.node.id,
    )


def _coefficient(reader: Reader, name: str, default: float, maximum: float = np.inf) -> Volume:
    """Parameter `name`, a number, a colour or a volume, with values in [0, maximum]."""
    if reader.is_value(name):
        return ConstVolume(reader.color(name, default, maximum=maximum))
    reader.has(name)
    found = reader.children("volume", name)
    if not found:
        reader.refuse_plugin(name, "a number, a colour or a volume")
    volume = reader.build.build(found[0][1])
    if isinstance(volume, GridVolume):
        check_coefficients(volume.grid, f"{name} of medium '{reader.type}'")
    if np.isfinite(maximum) and largest_value(volume) > maximum:
        largest = largest_value(volume)
        reader.fail(f"'{name}' must be at most {maximum:g}, the volume reaches {largest:g}", name)
    return volume


def isotropic(reader: Reader) -> Phase:
    """The `isotropic` phase function."""
    return Phase()


def hg(reader: Reader) -> Phase:
    """The Henyey-Greenstein phase function of mean cosine `g`, -1 < g < 1."""
    return Phase("hg", reader.number("g", 0.8, minimum=-1.0, maximum=1.0, open_interval=True))
