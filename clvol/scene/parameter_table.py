"""What of a scene's records are parameters, what they are called, and what they may be.

Names are those of ``mi.traverse``, as far as Mitsuba has the parameter; what it lacks follows its style.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, fields, replace
from typing import TYPE_CHECKING, Any

import numpy as np

from clvol.layout import PRINCIPLED_NUMBERS
from clvol.scene import materials, records
from clvol.scene import parameter_values as values
from clvol.scene.medium_facts import channels_of
from clvol.scene.phase import MOST_PEAKED
from clvol.scene.sensor import field_of_view_x
from clvol.scene.sky_model import TURBIDITIES
from clvol.scene.sunsky import APERTURES, Daylight
from clvol.volumes.grid import DenseGrid
from clvol.volumes.transfer import Transfer

if TYPE_CHECKING:
    from clvol.scene.parameter_values import Check

Put = Callable[[Any, Any], Any]
"""A record and a value that was checked to the record with that value."""


@dataclass(frozen=True, eq=False)
class Parameter:
    """One value of a scene.

    Parameters
    ----------
    owner : the record that has it.  held : what is in it.
    check : turns what a user gives into what `put` takes; an error for what it cannot be.
    put : makes of the owner, which may have changed otherwise, one with such a value.
    shown : turns what is held into what users see.
    """

    owner: Any
    held: Any
    check: Check
    put: Put
    shown: Callable[[Any], Any] = lambda held: held


Found = Iterator[tuple[str, Parameter]]


def parameters_of(scene: records.Scene) -> dict[str, Parameter]:
    """Every parameter by name: of the sensors, the shapes and the emitters."""
    found: dict[str, Parameter] = {}
    taken: dict[str, int] = {}
    seen: set[int] = set()
    for kind, parts in (("sensor", scene.sensors), ("shape", scene.shapes), ("emitter", scene.emitters)):
        for part in parts:
            if id(getattr(part, "made_from", None)) in seen:  # the sun of a sky
                continue
            prefix = part.name or kind
            taken[prefix] = taken.get(prefix, -1) + 1
            prefix += f"_{taken[prefix]}" if taken[prefix] else ""
            for name, parameter in _DESCRIBE[kind](part, seen):
                found[f"{prefix}.{name}"] = parameter
    return found


def sensor_parameters(sensor: records.Sensor) -> dict[str, Parameter]:
    """The parameters of one sensor by name."""
    return dict(_sensor(sensor, set()))


def _field(owner: Any, name: str, check: Check, shown: Callable[[Any], Any] = lambda v: v) -> Parameter:
    """A field of a record that is a parameter as it stands."""
    return Parameter(owner, getattr(owner, name), check, lambda r, v: replace(r, **{name: v}), shown)


def _colour(owner: Any, name: str, maximum: float) -> Parameter:
    return _field(owner, name, values.colour(maximum), values.plain)


def _sensor(sensor: records.Sensor, seen: set[int]) -> Found:
    camera, film = sensor.camera, sensor.film
    if isinstance(camera, records.Batch):
        part = replace(film, width=max(1, film.width // len(camera.parts)))
        for number, one in enumerate(camera.parts):
            yield from _nested(camera.names[number] or f"sensor_{number}", _camera(one, part, seen))
    else:
        yield from _camera(camera, film, seen)
    yield from _film(film)


def _camera(camera: records.Camera, film: records.Film, seen: set[int]) -> Found:
    if isinstance(camera, records.Orthographic):
        yield "to_world", _field(camera, "to_world", values.matrix(values.invertible), values.frozen)
    elif not isinstance(camera, records.IrradianceMeter):  # which has its shape's
        yield "to_world", _field(camera, "to_world", values.matrix(values.rigid), values.frozen)
    if isinstance(camera, records.Perspective):
        yield from _perspective(camera, film)
    meters = records.Meter | records.IrradianceMeter
    for name in ("near_clip", "far_clip") if not isinstance(camera, meters) else ():
        yield name, _field(camera, name, values.number(0.0, exclusive=True))
    if camera.medium is not None:
        yield from _nested("medium", _medium(camera.medium, seen))


def _perspective(camera: records.Perspective, film: records.Film) -> Found:
    x_fov = float(np.degrees(field_of_view_x(camera, film)))
    degrees = values.number(0.0, 180.0, exclusive=True)
    yield "x_fov", Parameter(camera, x_fov, degrees, lambda c, v: replace(c, fov=v, fov_axis="x"))
    for axis, letter in enumerate("xy"):

        def offset(c: Any, value: float, axis: int = axis) -> Any:
            both = list(c.principal_point_offset)
            both[axis] = value
            return replace(c, principal_point_offset=tuple(both))

        now = camera.principal_point_offset[axis]
        yield f"principal_point_offset_{letter}", Parameter(camera, now, values.number(), offset)
    yield "aperture_radius", _field(camera, "aperture_radius", values.number(0.0))
    yield "focus_distance", _field(camera, "focus_distance", values.number(0.0, exclusive=True))


def _film(film: records.Film) -> Found:
    def resize(f: records.Film, size: tuple[int, int]) -> records.Film:
        return replace(f, width=size[0], height=size[1])

    def window(f: records.Film, first: int, pair: tuple[int, int]) -> records.Film:
        crop = list(f.window)
        crop[first : first + 2] = pair
        whole = tuple(crop) == (0, 0, f.width, f.height)
        return replace(f, crop=None if whole else (crop[0], crop[1], crop[2], crop[3]))

    x, y, width, height = film.window
    yield "film.size", Parameter(film, (film.width, film.height), values.pair(1), resize)
    yield "film.crop_size", Parameter(film, (width, height), values.pair(1), lambda f, v: window(f, 2, v))
    yield "film.crop_offset", Parameter(film, (x, y), values.pair(0), lambda f, v: window(f, 0, v))


def _shape(shape: records.Shape, seen: set[int]) -> Found:
    check = values.matrix(values.fits_shape(shape))
    yield "to_world", _field(shape, "to_world", check, values.frozen)
    if isinstance(shape.emission, tuple):
        yield "emitter.radiance.value", _colour(shape, "emission", values.BRIGHTEST)
    elif shape.emission is not None:
        yield from _picture("emitter.radiance", shape.emission, seen)
    yield from _nested("bsdf", _bsdf(shape.bsdf, seen))
    for side in ("interior", "exterior"):
        if (medium := getattr(shape, side)) is not None:
            yield from _nested(f"{side}_medium", _medium(medium, seen))


def _picture(name: str, picture: materials.Texture, seen: set[int]) -> Found:
    """What a light shows or throws, as bright as lights may be."""
    if id(picture) in seen:
        return
    if isinstance(picture, materials.Checkerboard):
        yield from _nested(name, _bsdf(picture, seen, values.BRIGHTEST))
    elif isinstance(picture, materials.Bitmap):
        seen.add(id(picture))
        yield f"{name}.data", _field(picture, "pixels", values.bright_texels, values.frozen)
    elif isinstance(picture, materials.VolumeTexture) and id(picture.volume) not in seen:
        seen.add(id(picture.volume))
        yield from _nested(f"{name}.volume", _volume(picture.volume, values.BRIGHTEST, signed=False))


def _nested(prefix: str, found: Found) -> Found:
    return ((f"{prefix}.{name}", parameter) for name, parameter in found)


def _medium(medium: records.Medium, seen: set[int]) -> Found:
    """Of a medium that has not been seen: one that several shapes share goes by the first one's name."""
    if id(medium) in seen:
        return
    seen.add(id(medium))
    yield "scale", _colour(medium, "scale", np.inf)
    yield from _transfers(medium)
    for name, maximum in (
        ("sigma_t", np.inf),
        ("albedo", 1.0),
        ("emission", np.inf),
        ("emission_density", np.inf),
    ):
        if getattr(medium, name) is not None and medium.transfer(name) is None:
            yield from _nested(name, _volume(getattr(medium, name), maximum, signed=False))
    if medium.emission is not None or medium.temperature is not None:
        yield "emission_scale", _colour(medium, "emission_scale", values.BRIGHTEST)
    if medium.emission_density is not None:
        yield "emission_density_scale", _colour(medium, "emission_density_scale", values.BRIGHTEST)
    if medium.temperature is not None:
        yield from _nested("temperature", _volume(medium.temperature, np.inf, signed=True))
        for name in ("temperature_scale", "temperature_offset"):
            yield name, _field(medium, name, values.number())
    yield from _nested("phase_function", _phase(medium, medium.phase, _put_phase))


def _transfers(medium: records.Medium) -> Found:
    """The transfer functions of a classified medium, by the names of its plugin, and the values."""
    if medium.transfers is None:
        return
    for name, role, maximum in (
        ("opacity", "sigma_t", np.inf),
        ("albedo", "albedo", 1.0),
        ("emission", "emission", values.BRIGHTEST),
    ):
        if (held := medium.transfer(role)) is not None:

            def put(record: Any, transfer: Any, role: str = role) -> Any:
                return replace(record, transfers=replace(record.transfers, **{role: transfer}))

            check = values.points(maximum, grey=role == "sigma_t")
            yield name, Parameter(medium, held, check, put, Transfer.points)
    yield from _nested("values", _volume(medium.sigma_t, np.inf, signed=True))


def _put_phase(medium: Any, phase: Any) -> Any:
    return replace(medium, phase=phase)


def _volume(volume: records.Volume, maximum: float, signed: bool) -> Found:
    if isinstance(volume, records.ConstVolume):
        check = values.kelvin() if signed else values.colour(maximum)
        yield "value.value", _field(volume, "value", check, values.plain)
    elif isinstance(volume.grid, DenseGrid):
        check = values.samples(channels_of(volume), maximum, signed)
        data = volume.grid.values if channels_of(volume) > 1 else volume.grid.values[..., 0]
        yield "data", Parameter(volume, data, check, values.with_samples, values.frozen)


def _phase(medium: Any, phase: records.PhaseFunction, put: Put, path: tuple[str, ...] = ()) -> Found:
    """Of a phase function in a medium, which owns it: equal ones may be one object in several media."""

    def inner(record: Any, **changes: Any) -> Any:
        now = record.phase
        for step in path:
            now = getattr(now, step)
        return put(record, replace(now, **changes))

    if isinstance(phase, records.BlendPhase):
        if isinstance(phase.weight, records.GridVolume):
            yield from _nested("weight", _volume(phase.weight, 1.0, signed=False))
        else:
            yield (
                "weight",
                Parameter(medium, phase.weight, values.number(0, 1), lambda m, v: inner(m, weight=v)),
            )
        for number, side in enumerate(("first", "second")):

            def put_side(record: Any, changed: Any, side: str = side) -> Any:
                return inner(record, **{side: changed})

            parts = _phase(medium, getattr(phase, side), put_side, (*path, side))
            yield from _nested(f"phase_{number}", parts)
    elif phase.kind == "hg":
        check = values.number(-MOST_PEAKED, MOST_PEAKED)
        yield "g", Parameter(medium, phase.g, check, lambda m, v: inner(m, g=v))
    elif phase.table is not None:
        check = values.phase_values(phase.table)
        shown = values.shown_values
        yield "values", Parameter(medium, phase.table, check, lambda m, v: inner(m, table=v), shown)
    elif isinstance(phase.flakes, records.GridVolume):
        volume = phase.flakes
        assert isinstance(volume.grid, DenseGrid)
        data = volume.grid.values
        yield "S.data", Parameter(volume, data, values.flake_samples, values.with_samples, values.frozen)
    elif phase.flakes is not None:
        yield "S", Parameter(medium, phase.flakes, values.flakes, lambda m, v: inner(m, flakes=v))


_BSDF_NUMBERS = {"alpha", "alpha_u", "alpha_v"}
_COLOURS = {
    "reflectance",
    "diffuse_reflectance",
    "specular_reflectance",
    "specular_transmittance",
    "opacity",
    "weight",
    "normalmap",
    "color0",
    "color1",
    "base_color",
    *PRINCIPLED_NUMBERS,
}
_NESTED = {
    **{"front": "brdf_0", "back": "brdf_1", "nested": "nested_bsdf"},
    **{"first": "bsdf_0", "second": "bsdf_1"},
    "texture": "nested_texture",
}


def _bsdf(bsdf: Any, seen: set[int], most: float = 1.0) -> Found:
    """Colours up to `most`, textures, roughness and indices of a BSDF and of those inside it."""
    if id(bsdf) in seen:
        return
    seen.add(id(bsdf))
    for name in (field.name for field in fields(bsdf)):
        value = getattr(bsdf, name)
        if name in _NESTED:
            yield from _nested(_NESTED[name], _bsdf(value, seen))
        elif name in _BSDF_NUMBERS and not isinstance(value, materials.Varied):
            yield name, _field(bsdf, name, values.number(0.0))
        elif name == "scale" and isinstance(bsdf, materials.BumpMap):
            yield name, _field(bsdf, name, values.number())
        elif name in ("int_ior", "ext_ior") or (name == "eta" and isinstance(value, float)):
            yield name, _field(bsdf, name, values.number(0.0, exclusive=True))
        elif name in ("eta", "k") and isinstance(value, tuple):
            yield f"{name}.value", _colour(bsdf, name, np.inf)
        elif name in _COLOURS and isinstance(value, tuple):
            yield f"{name}.value", _colour(bsdf, name, 2.0 if name == "diff_trans" else most)
        elif isinstance(value, materials.Checkerboard):
            yield from _nested(name, _bsdf(value, seen, np.inf if name in ("eta", "k") else 1.0))
        elif isinstance(value, materials.VolumeTexture) and id(value.volume) not in seen:
            seen.add(id(value.volume))
            yield from _nested(f"{name}.volume", _volume(value.volume, 1.0, signed=False))
        elif isinstance(value, materials.Bitmap) and id(value) not in seen:
            seen.add(id(value))
            check = values.bright_texels if name in ("eta", "k") else values.texels
            yield f"{_NESTED.get(name, name)}.data", _field(value, "pixels", check, values.frozen)


def _emitter(emitter: records.Emitter, seen: set[int]) -> Found:
    if getattr(emitter, "made_from", None) is not None:
        yield from _daylight(emitter.made_from, seen)  # type: ignore[union-attr]
        return
    match emitter:
        case records.ConstantEmitter():
            yield "radiance.value", _colour(emitter, "radiance", values.BRIGHTEST)
        case records.EnvmapEmitter():
            yield "data", _field(emitter, "radiance", values.environment, values.frozen)
            yield "to_world", _field(emitter, "to_world", values.matrix(values.unstretched), values.frozen)
        case records.DirectionalEmitter():
            yield "irradiance.value", _colour(emitter, "irradiance", values.BRIGHTEST)
            yield "direction", _field(emitter, "direction", values.direction)
        case records.SunEmitter():
            yield "irradiance.value", _colour(emitter, "irradiance", values.BRIGHTEST)
            yield "sun_direction", _field(emitter, "sun_direction", values.direction)
        case records.PointEmitter():
            yield "intensity.value", _colour(emitter, "intensity", values.MOST_INTENSE)
            yield "position", _field(emitter, "position", values.point)
        case records.SpotEmitter():
            yield "intensity.value", _colour(emitter, "intensity", values.MOST_INTENSE)
            if emitter.texture is not None:
                yield from _picture("texture", emitter.texture, seen)
            for name in ("cutoff_angle", "beam_width"):
                yield name, _field(emitter, name, values.number(0.0, 180.0))
            yield "to_world", _field(emitter, "to_world", values.matrix(values.unstretched), values.frozen)
        case records.ProjectorEmitter():
            yield from _projector(emitter, seen)


def _daylight(day: Daylight, seen: set[int]) -> Found:
    """A sunsky, of which the lights are made anew."""
    seen.add(id(day))
    air = day.air
    yield "turbidity", _field(air, "turbidity", values.number(*TURBIDITIES))
    for name in ("sky_scale", "sun_scale"):
        yield name, _field(air, name, values.number(0.0))

    def with_albedo(record: Any, value: records.Spectrum) -> Any:
        return replace(record, albedo=np.broadcast_to(np.array(value), 3))

    albedo = tuple(air.albedo.tolist())
    grey = albedo[:1] if len(set(albedo)) == 1 else albedo
    yield "albedo.value", Parameter(air, grey, values.colour(1.0), with_albedo, values.plain)
    yield "sun_aperture", _field(air, "aperture", values.number(*APERTURES))
    x, y, z = (day.turn @ day.sun).tolist()
    yield "sun_direction", Parameter(day, (x, y, z), values.direction, lambda d, v: replace(d, towards=v))
    yield "to_world", _field(air, "to_world", values.matrix(values.unstretched), values.frozen)


def _projector(emitter: records.ProjectorEmitter, seen: set[int]) -> Found:
    picture = emitter.irradiance
    if isinstance(picture, tuple):
        yield "irradiance.value", _colour(emitter, "irradiance", values.BRIGHTEST)
    else:
        yield from _picture("irradiance", picture, seen)
    yield "scale", _field(emitter, "scale", values.number(0.0, values.LARGEST_SCALE))
    yield "x_fov", _field(emitter, "x_fov", values.number(0.0, 180.0, exclusive=True))
    yield "to_world", _field(emitter, "to_world", values.matrix(values.unstretched), values.frozen)


_DESCRIBE: dict[str, Callable[[Any, set[int]], Found]] = {
    "sensor": _sensor,
    "shape": _shape,
    "emitter": _emitter,
}
