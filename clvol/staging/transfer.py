"""`clvol.transfer`: a medium that is made of a field's values; and what a user says of how it is made."""

from __future__ import annotations

import difflib
import os
from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np

from clvol.base.extras import need
from clvol.errors import OptionError, either, shown
from clvol.scene.loader import load_plugin
from clvol.scene.records import GridVolume
from clvol.scene.spectra import srgb_to_linear
from clvol.staging.presets import PRESETS
from clvol.volumes.grid import DenseGrid, Grid
from clvol.volumes.transfer import Transfer, text_of_points, transfer_of_points

if TYPE_CHECKING:
    from collections.abc import Sequence

    from clvol.scene.records import Volume

COLOURMAP_POINTS = 65
"""Points of a transfer function that a colour map becomes."""
WHITE = 0.95
"""Albedo where no colour is said."""
ACROSS = 50.0
"""Optical thickness of a preset's opacity of 1 along the longest side of a volume."""
_PARTS = ("opacity", "colour", "emission")


@dataclass(frozen=True, eq=False)
class Look:
    """How values look: functions of them, and whether these are relative.

    Parameters
    ----------
    name : of the preset it is; "" for one of a user's own.
    relative_values : 0 is the least value of the volume, and 1 the greatest.
    relative_opacity : the opacity is to be multiplied by what fits the volume.
    """

    name: str
    opacity: Transfer
    colour: Transfer
    emission: Transfer | None = None
    relative_values: bool = False
    relative_opacity: bool = False

    def within(self, low: float, high: float) -> Look:
        """With values in those of a volume that has them from `low` to `high`."""
        if not self.relative_values:
            return self
        step = high - low if high > low else 1.0

        def moved(transfer: Transfer) -> Transfer:
            return replace(
                transfer, values=(low + step * transfer.values.astype(np.float64)).astype(np.float32)
            )

        emission = self.emission and moved(self.emission)
        return replace(
            self,
            opacity=moved(self.opacity),
            colour=moved(self.colour),
            emission=emission,
            relative_values=False,
        )

    def plugin(self, values: dict[str, Any], scale: float) -> dict[str, Any]:
        """The medium of a volume's plugin."""
        described = {
            "type": "classified",
            "values": values,
            "opacity": text_of_points(self.opacity),
            "albedo": text_of_points(self.colour),
            "scale": scale,
        }
        return described | ({"emission": text_of_points(self.emission)} if self.emission else {})


def look_of(preset: str | None = None, opacity: Any = None, colour: Any = None, emission: Any = None) -> Look:
    """A preset, with what is given in the place of its own; OptionError for what won't do."""
    found = None
    if preset is not None:
        if not isinstance(preset, str) or preset not in PRESETS:
            close = difflib.get_close_matches(str(preset)[:64], PRESETS, n=1)
            guess = f"did you mean '{close[0]}'? " if close else ""
            hint = f"{guess}choose one of {', '.join(PRESETS)}{either(', or give opacity', '')}"
            raise OptionError(f"unknown transfer function {shown(preset)}", hint=hint)
        found = PRESETS[preset]
    elif opacity is None:
        hint = f"give points (value, extinction), or a preset: {', '.join(PRESETS)}"
        raise OptionError("a transfer function needs an opacity", hint=hint)
    relative = found is not None and found.relative
    if relative and not (opacity is colour is emission is None):
        hint = "give opacity and colour yourself"
        raise OptionError(f"preset '{preset}' has values of its own, from 0 to 1", hint=hint)
    own = found.opacity if opacity is None and found is not None else opacity
    opaque = _points("opacity", own)
    if not opaque.is_grey:
        raise OptionError("opacity takes one number for each value", hint="colour is by colour")
    if colour is not None or found is None:
        coloured = _colour(colour, opaque)
    else:
        coloured = transfer_of_points(found.colour)
    glow = None
    if emission is not None:
        glow = _emission(emission, coloured)
    elif found is not None and found.emission:
        glow = transfer_of_points(found.emission)
    return Look(preset or "", opaque, coloured, glow, relative, opacity is None)


def look_option(name: str, value: Any) -> Look:
    """What `volume_scene` takes as a transfer function: a preset's name, or a dict of `transfer`'s words."""
    if isinstance(value, Look):
        return value
    if isinstance(value, Mapping):
        unknown = [key for key in value if key not in ("preset", *_PARTS)]
        if unknown:
            hint = f"it takes preset, {', '.join(_PARTS)}"
            raise OptionError(f"{name} has an unknown {shown(unknown[0])}", hint=hint)
        return look_of(**value)
    return look_of(value)


def _points(name: str, points: Any) -> Transfer:
    try:
        return transfer_of_points(points)
    except ValueError as error:
        raise OptionError(f"{name}: {error}") from None


def _colour(colour: Any, opacity: Transfer) -> Transfer:
    """A colour map by name over the values of the opacity's points, points, or one colour."""
    if colour is None:
        return transfer_of_points([(0.0, WHITE)])
    if isinstance(colour, str) and ":" not in colour:
        return colourmap(colour, float(opacity.values[0]), float(opacity.values[-1]))
    if isinstance(colour, str):
        made = _points("colour", colour)
    else:
        one = _one_colour(colour)
        made = _points("colour", colour) if one is None else transfer_of_points([(0.0, one)])
    if made.largest > 1:
        raise OptionError(f"colour is an albedo, at most 1, and reaches {made.largest:g}")
    return made


def _one_colour(value: Any) -> tuple[float, ...] | None:
    try:
        numbers = np.asarray(value, np.float64)
    except (TypeError, ValueError):
        return None
    return tuple(numbers.reshape(-1).tolist()) if numbers.shape in ((), (3,)) else None


def _emission(emission: Any, colour: Transfer) -> Transfer:
    """Points of radiance; or a number by which the colours shine."""
    if isinstance(emission, int | float) and not isinstance(emission, bool):
        if not (0 <= emission < float("inf")):
            raise OptionError(f"emission must be a number of at least 0 or points, not {shown(emission)}")
        return replace(colour, colours=(colour.colours * np.float32(emission)).astype(np.float32))
    return _points("emission", emission)


def colourmap(name: str, low: float, high: float) -> Transfer:
    """One of matplotlib's colour maps over values from `low` to `high`, as linear colours."""
    matplotlib = need("matplotlib", f"colour map {name!r}", "science")
    if name not in matplotlib.colormaps:
        close = difflib.get_close_matches(name[:64], list(matplotlib.colormaps), n=1)
        hint = f"did you mean '{close[0]}'?" if close else "matplotlib.colormaps lists them"
        raise OptionError(f"matplotlib has no colour map {shown(name)}", hint=hint)
    share = np.linspace(0, 1, COLOURMAP_POINTS)
    encoded = np.asarray(matplotlib.colormaps[name](share), np.float32)[:, :3]
    colours = np.clip(srgb_to_linear(encoded), 0, 1)
    return transfer_of_points(list(zip(low + (high - low) * share, colours, strict=True)))


def made_grid(grid: Grid, opacity: Transfer) -> Grid:
    """A grid of what is made of another's samples: about what is made of its interpolated values."""

    def made(values: np.ndarray) -> np.ndarray:
        found: np.ndarray = opacity(values)[..., 0].astype(np.float32)
        return found

    if isinstance(grid, DenseGrid):
        parts = [made(plane) for plane in grid.values]  # plane by plane: points take memory
        return replace(grid, values=np.stack(parts))
    leaves = [made(leaf) for leaf in grid.leaf_values]
    return replace(
        grid,
        leaf_values=np.stack(leaves) if leaves else grid.leaf_values,
        tile_values=made(grid.tile_values),
        background=made(grid.background),
    )


def value_range(grid: Grid) -> tuple[float, float]:
    """The least and the greatest sample, but for a thousandth of all at either end, which are noise."""
    parts = [grid.values] if isinstance(grid, DenseGrid) else [grid.leaf_values, grid.tile_values]
    samples = np.concatenate([part.reshape(-1)[:: max(part.size // 1_000_000, 1)] for part in parts])
    samples = samples[np.isfinite(samples)]
    if not samples.size:
        return 0.0, 1.0
    low, high = np.quantile(samples, [0.001, 0.999]).tolist()
    return (low, high) if high > low else (float(samples.min()), float(samples.max()))


def transfer(
    values: Any,
    preset: str | None = None,
    *,
    opacity: Sequence[tuple[float, float]] | str | None = None,
    colour: Sequence[tuple[float, Any]] | Sequence[float] | str | float | None = None,
    emission: Sequence[tuple[float, Any]] | float | None = None,
    scale: float | None = None,
) -> dict[str, Any]:
    """A medium of which extinction, colour and glow are functions of a field's values.

    Values are interpolated first and classified then, so that functions may be sharp. The functions are small
    tables on the device; `clvol.traverse` changes them without loading the volume again.

    Parameters
    ----------
    values
        An array [z, y, x], an xarray.DataArray, or a file's name.
    preset
        "bone", "muscle", "lung" (CT, Hounsfield units), "mr", "fire" or "density" (from the least value to
        the greatest). What is given beside it replaces its own.
    opacity
        Points (value, extinction per world length), linear between them. Two of one value make a step.
    colour
        The albedo: one of matplotlib's colour maps by name, over the values of the opacity's points; points
        (value, linear rgb); or one colour. 0.95 by default.
    emission
        Points (value, radiance), a number or rgb each; or a number by which the colours shine.
    scale
        Multiplies the opacity. By default 1; of a preset's own opacity 50 over the volume's longest side.

    Returns
    -------
    dict
        The medium "classified", for the interior of a shape in `load_dict`.
        ``volume_scene(values, transfer="bone")`` makes a whole scene.

    Raises
    ------
    OptionError, VolumeError
        Functions or values that won't do.
    """
    look = look_of(preset, opacity, colour, emission)
    plugin: dict[str, Any] = {"type": "gridvolume"}
    plugin |= {"filename": os.fspath(values)} if isinstance(values, str | os.PathLike) else {"data": values}
    if look.relative_values or (look.relative_opacity and scale is None):
        volume = load_plugin(plugin, {})
        if isinstance(volume, GridVolume):
            plugin = {**plugin, "data": volume.grid}
            plugin.pop("filename", None)
            look = look.within(*value_range(volume.grid))
            scale = ACROSS / _longest(volume) if look.relative_opacity and scale is None else scale
    return look.plugin(plugin, 1.0 if scale is None else scale)


def _longest(volume: Volume) -> float:
    """The longest side of a volume's box in the world."""
    assert isinstance(volume, GridVolume)
    edges = volume.index_to_world[:3, :3] * (volume.upper - volume.lower)
    return float(np.linalg.norm(edges, axis=0).max())
