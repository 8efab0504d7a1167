"""The `classified` medium: what transfer functions make of one field's values."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from clvol.scene.medium import common_parameters, emission_density, emission_scale, own_volume, sane
from clvol.scene.medium_facts import channels_of
from clvol.scene.nodes import Node
from clvol.scene.reader import BRIGHTEST
from clvol.scene.records import ConstVolume, GridVolume, Medium, Volume
from clvol.volumes import check_finite
from clvol.volumes.transfer import Transfer, Transfers, transfer_of_points

if TYPE_CHECKING:
    from clvol.scene.reader import Reader

Field = tuple[Volume, Transfer | None]
"""A coefficient: a constant, or the field and what is made of its values."""


def classified(reader: Reader) -> Medium:
    """The `classified` plugin: extinction, albedo and emission as functions of the values of a volume.

    `opacity`, `albedo` and `emission` are points, value: number or colour, between which they are linear; the
    values are interpolated first.  `albedo` and `emission` may be a number or a colour as well.
    `emission_density` is as in other media.
    """
    values = sane(reader, own_volume(reader, "values", "a volume of one channel"), signed=True)
    if channels_of(values) > 1:
        reader.fail("'values' must be a volume of one channel, this one has three", "values")
    if isinstance(values, GridVolume):
        check_finite(values.grid, f"values of medium '{reader.type}'")
    if not reader.has("opacity"):
        reader.fail(
            "a classified medium needs opacity",
            hint="give points, value: extinction, such as '-200: 0, 300: 5'",
        )
    fields: dict[str, Field] = {"sigma_t": _field(reader, "opacity", values, grey=True)}
    fields["albedo"] = _field(reader, "albedo", values, default=0.75, maximum=1.0)
    scale = reader.color("scale", 1.0)
    emission: dict[str, Any] = {}
    if reader.has("emission"):
        fields["emission"] = _field(reader, "emission", values, maximum=BRIGHTEST, light=True)
        emission = emission_scale(reader, _largest(*fields["emission"]))
    made = {name: transfer for name, (_, transfer) in fields.items() if transfer is not None}
    volumes = {name: volume for name, (volume, _) in fields.items()}
    return Medium(
        volumes["sigma_t"],
        volumes["albedo"],
        scale,
        homogeneous=False,
        emission=volumes.get("emission"),
        transfers=Transfers(**made) if made else None,
        **emission,
        **emission_density(reader),
        **common_parameters(reader),
    )


def _field(
    reader: Reader,
    name: str,
    values: Volume,
    *,
    grey: bool = False,
    default: float = 1.0,
    maximum: float = float("inf"),
    light: bool = False,
) -> Field:
    """Parameter `name`: points, or a number or colour where it is no points."""
    given = reader.node.get(name)
    if not grey and (given is None or isinstance(given, Node | int | float)):
        return ConstVolume(reader.color(name, default, light, maximum)), None
    try:
        transfer = transfer_of_points(reader.raw(name))
    except ValueError as error:
        reader.fail(f"'{name}' of medium '{reader.type}': {error}", name)
    if grey and not transfer.is_grey:
        reader.fail(
            f"'{name}' of medium '{reader.type}' takes one number for each value", name, "colour scale"
        )
    if transfer.largest > maximum:
        reader.fail(f"'{name}' must be at most {maximum:g}, its points reach {transfer.largest:.9g}", name)
    if isinstance(values, ConstVolume):
        colour = transfer(np.array(values.value[0])).tolist()
        return ConstVolume(tuple(colour[:1] if transfer.is_grey else colour), values.to_world), None
    return values, transfer


def _largest(volume: Volume, transfer: Transfer | None) -> float:
    if transfer is not None:
        return transfer.largest
    assert isinstance(volume, ConstVolume)
    return max(volume.value)
