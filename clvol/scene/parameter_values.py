"""What parameters may be: checks that turn what a user gives into what records hold, as scene files' are."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np

from clvol.base.arguments import index
from clvol.base.masks import as_array, masked_count
from clvol.errors import SceneError, shown
from clvol.scene import records
from clvol.scene.emitter import LARGEST_SCALE, MOST_INTENSE, check_radiance
from clvol.scene.flakes import fault_of_flakes, fault_of_matrix
from clvol.scene.image import image_from_array
from clvol.scene.medium_facts import channels_of
from clvol.scene.reader import BRIGHTEST, ROUNDING, range_in_words
from clvol.scene.sensor import film_fault, is_rigid
from clvol.scene.tabulated import table_fault
from clvol.scene.texture import check_texels
from clvol.scene.transforms import as_matrix, check_size, keeps_angles, scale, stays_round, translate
from clvol.scene.volume import largest_value
from clvol.volumes import check_coefficients, check_finite, dense_from_array
from clvol.volumes.grid import DenseGrid
from clvol.volumes.transfer import Transfer, transfer_of_points

__all__ = ["BRIGHTEST", "LARGEST_SCALE", "MOST_INTENSE"]

Check = Callable[[Any, str], Any]
"""A user's value and the parameter's name to what a record holds; SceneError or VolumeError at the name."""


def frozen(array: np.ndarray) -> np.ndarray:
    """A view that cannot be written to: what is changed in place would go unnoticed."""
    view = array.view()
    view.flags.writeable = False
    return view


def plain(spectrum: records.Spectrum) -> float | records.Spectrum:
    """A colour as users see it: one number where it is grey."""
    return spectrum[0] if len(spectrum) == 1 else spectrum


def _wrong(name: str, expected: str, value: object) -> SceneError:
    return SceneError(f"must be {expected}, got {shown(value)}", name)


def _numbers(value: Any) -> np.ndarray:
    """As float64; empty where there are no numbers, or some are masked."""
    try:
        array = as_array(value)
        real = array.dtype.kind in "iuf" and not masked_count(value)
        return array.astype(np.float64) if real else np.empty(0)
    except (TypeError, ValueError, OverflowError):
        return np.empty(0)


def number(least: float = -np.inf, most: float = np.inf, exclusive: bool = False) -> Check:
    """A finite number in an interval, or within it."""

    def check(value: Any, name: str) -> float:
        array = np.empty(0) if isinstance(value, bool | np.bool_) else _numbers(value)
        given = float(array) if array.shape == () else np.nan
        inside = least < given < most if exclusive else least <= given <= most
        if not (np.isfinite(given) and inside):
            words = range_in_words(least, most, exclusive)
            raise _wrong(name, f"a number{'' if words == 'finite' else f' that is {words}'}", value)
        return given

    return check


def colour(maximum: float) -> Check:
    """One number, or three, from 0 to `maximum`."""

    def check(value: Any, name: str) -> records.Spectrum:
        array = np.empty(0) if isinstance(value, bool | np.bool_) else _numbers(value).reshape(-1)
        fits = array.size in (1, 3) and np.isfinite(array).all() and (array >= 0).all()
        if not fits or (array > maximum * (1 + ROUNDING)).any():
            raise _wrong(name, f"a number or a colour of three, {range_in_words(0, maximum, False)}", value)
        found = tuple(np.minimum(array, maximum).tolist())
        return found[:1] if len(set(found)) == 1 else found

    return check


def points(maximum: float, grey: bool) -> Check:
    """A transfer function from its points, whose numbers are at most `maximum`; see `transfer_of_points`."""

    def check(value: Any, name: str) -> Transfer:
        try:
            transfer = transfer_of_points(value)
        except ValueError as error:
            raise SceneError(str(error), name) from None
        if transfer.largest > maximum or (grey and not transfer.is_grey):
            each = "one number for each value" if grey else f"numbers of at most {maximum:g}"
            raise _wrong(name, f"points with {each}", value)
        return transfer

    return check


def phase_values(table: records.PhaseTable) -> Check:
    """The values of a phase function's table, whose angles stay."""

    def check(value: Any, name: str) -> records.PhaseTable:
        changed = replace(table, values=tuple(_numbers(value).reshape(-1).tolist()))
        if fault := table_fault(changed):
            raise SceneError(f"{fault[1]} of a tabphase", name)
        return changed

    return check


def shown_values(table: records.PhaseTable) -> np.ndarray:
    """The values of a phase function's table as users see them."""
    return frozen(np.array(table.values))


def kelvin() -> Check:
    """A temperature that is the same everywhere."""
    one = number()
    return lambda value, name: (one(value, name),)


def point(value: Any, name: str) -> tuple[float, float, float]:
    """Three finite numbers."""
    array = _numbers(value)
    if array.shape != (3,) or not np.isfinite(array).all():
        raise _wrong(name, "three finite numbers", value)
    x, y, z = array.tolist()
    return x, y, z


def direction(value: Any, name: str) -> tuple[float, float, float]:
    """A direction of any length but 0, as a unit vector."""
    array = np.array(point(value, name))
    length = float(np.linalg.norm(array))
    if length == 0:
        raise _wrong(name, "a direction of another length than 0", value)
    x, y, z = (array / length).tolist()
    return x, y, z


def pair(least: int) -> Check:
    """Two whole numbers, (along x, along y)."""

    def check(value: Any, name: str) -> tuple[int, int]:
        try:
            x, y = map(index, value)
        except (TypeError, ValueError):
            raise _wrong(name, "two whole numbers", value) from None
        if min(x, y) < least:
            raise _wrong(name, f"two whole numbers of at least {least}", value)
        return x, y

    return check


Rule = Callable[[np.ndarray], str]
"""What is wrong with a matrix, "" if nothing."""


def rigid(matrix: np.ndarray) -> str:
    """A camera's transform."""
    return "" if is_rigid(matrix) else "must not scale or shear"


def invertible(matrix: np.ndarray) -> str:
    """Any transform: whatever can be none is an error before."""
    return ""


def unstretched(matrix: np.ndarray) -> str:
    """The transform of an environment, a spot or a projector."""
    return "" if keeps_angles(matrix) else "must not stretch or shear"


def fits_shape(shape: records.Shape) -> Rule:
    """The transform of a shape of this kind."""

    def rule(matrix: np.ndarray) -> str:
        check_size(matrix)
        if shape.kind == "sphere" and not keeps_angles(matrix):
            return "must not stretch or shear a sphere"
        if shape.kind == "cylinder" and shape.emission is not None and not stays_round(matrix):
            return "must not stretch a cylinder that emits across, or shear it"
        return ""

    return rule


def matrix(rule: Rule) -> Check:
    """A 4x4 transform, or an object that has one as ``.matrix``."""

    def check(value: Any, name: str) -> np.ndarray:
        try:
            found = as_matrix(value)
            fault = rule(found)
        except SceneError as error:
            raise SceneError(error.what, name, error.hint) from None
        if fault:
            raise SceneError(fault, name)
        return frozen(found)

    return check


def _array(value: Any, name: str) -> np.ndarray:
    """An array of numbers, with its masks."""
    try:
        array = as_array(value)
    except (TypeError, ValueError):
        array = np.empty(0, object)
    if array.dtype.kind not in "buif":
        raise _wrong(name, "an array of numbers", value)
    return array


def samples(channels: int, maximum: float, signed: bool) -> Check:
    """The samples of a gridvolume, [z, y, x] or [z, y, x, channel], of any resolution."""

    def check(value: Any, name: str) -> np.ndarray:
        grid = dense_from_array(_array(value, name), source=name)
        if grid.values.shape[3] != channels:
            raise SceneError(
                f"must have {channels} channel{'s' if channels > 1 else ''} as before, "
                f"got {grid.values.shape[3]}",
                name,
                "load a scene of its own for it",
            )
        verify = check_finite if signed else check_coefficients
        verify(grid, name.rpartition(".")[2], mendable=False)
        largest = float(grid.values.max())
        if largest > maximum:
            raise SceneError(f"must be at most {maximum:g}, the samples reach {largest:.9g}", name)
        return grid.values if channels > 1 else grid.values[..., 0]

    return check


def flake_samples(value: Any, name: str) -> np.ndarray:
    """The matrices of an sggx, [z, y, x, 6]."""
    grid = dense_from_array(_array(value, name), source=name, channels=(6,))
    if grid.channels != 6:
        raise SceneError("must have 6 channels, got 1", name)
    if fault := fault_of_flakes(grid):
        raise SceneError(f"S of an sggx {fault}", name)
    return grid.values


def flakes(value: Any, name: str) -> tuple[float, ...]:
    """The six numbers of an sggx."""
    six = _array(value, name).astype(np.float64).reshape(-1)
    if len(six) != 6:
        raise _wrong(name, "six numbers", value)
    numbers = tuple(six.tolist())
    if fault := fault_of_matrix(numbers):
        raise SceneError(f"S of an sggx {fault}", name)
    return numbers


def with_samples(volume: records.GridVolume, data: np.ndarray) -> records.GridVolume:
    """The volume with other samples, in the same place in the world."""
    values = data if data.ndim == 4 else data[..., None]
    assert isinstance(volume.grid, DenseGrid)
    before, after = (np.array(v.shape[2::-1], np.float64) for v in (volume.grid.values, values))
    place = volume.index_to_world
    if (before != after).any():
        unit_to_world = place @ translate(-0.5) @ scale(before)
        place = unit_to_world @ scale(1 / after) @ translate(0.5)
    grid = replace(volume.grid, values=values)
    return replace(volume, grid=grid, index_to_world=place, upper=after - 0.5)


def environment(value: Any, name: str) -> np.ndarray:
    """The radiance of an envmap, (height, width, 3), linear."""
    radiance = image_from_array(_array(value, name), name)
    if radiance.shape[0] < 3 or radiance.shape[1] < 2:
        size = f"{radiance.shape[1]} x {radiance.shape[0]}"
        raise SceneError(f"an envmap has at least 2 x 3 pixels, got {size}", name)
    if fault := check_radiance(radiance, np.float32(1)):
        raise SceneError(fault, name)
    return frozen(radiance)


def texels(value: Any, name: str, maximum: float = 1.0) -> np.ndarray:
    """The texels of a bitmap, (height, width, 3), linear, from 0 to `maximum`."""
    pixels = image_from_array(_array(value, name), name, raw=True)
    if fault := check_texels(pixels, maximum):
        raise SceneError(fault, name)
    return frozen(pixels)


def bright_texels(value: Any, name: str) -> np.ndarray:
    """The texels of a light's bitmap, or of a metal's."""
    return texels(value, name, BRIGHTEST)


def check_together(record: Any, name: str) -> None:
    """SceneError, at `name`, where values of a record do not go with each other."""
    if fault := _fault(record):
        raise SceneError(fault, name)


def _fault(record: Any) -> str:
    match record:
        case records.Perspective() | records.Orthographic() if record.far_clip <= record.near_clip:
            return f"far_clip ({record.far_clip:g}) must be beyond near_clip ({record.near_clip:g})"
        case records.Film():
            x, y, width, height = record.window
            if x + width > record.width or y + height > record.height:
                return "the crop window reaches beyond the film"
            return film_fault(record.width, record.height)
        case records.SpotEmitter(cutoff_angle=cutoff, beam_width=beam) if beam > cutoff or cutoff <= 0:
            return f"beam_width ({beam:g}) must not exceed cutoff_angle ({cutoff:g}), which is above 0"
        case records.Medium(sigma_t=sigma_t, scale=factors):
            coloured = isinstance(sigma_t, records.GridVolume) and channels_of(sigma_t) > 1
            if coloured and len(factors) > 1:
                return "a coloured scale needs a sigma_t of one channel, this grid has three"
            emitted = (record.emission, record.emission_scale)
            for emission, scale in (emitted, (record.emission_density, record.emission_density_scale)):
                brightest = largest_value(emission or records.ConstVolume((0.0,))) * max(scale)
                if brightest > BRIGHTEST:
                    return f"the medium emits {brightest:g}, and may emit at most {BRIGHTEST:g}"
    return ""
