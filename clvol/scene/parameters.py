"""`clvol.traverse`: the values of a scene by name, as ``mi.traverse`` has them, and how they are changed."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, MutableMapping
from dataclasses import fields, is_dataclass, replace
from typing import Any

import numpy as np

from clvol.errors import OptionError, shown
from clvol.scene.parameter_table import Parameter, parameters_of, sensor_parameters
from clvol.scene.parameter_values import check_together
from clvol.scene.records import Medium, Scene, Sensor
from clvol.scene.sunsky import remade
from clvol.scene.vocabulary import did_you_mean, join_hints, listed

_ALIASES = {"interior": "interior_medium", "exterior": "exterior_medium", "phase": "phase_function"}
"""What scene files call the parts that Mitsuba's parameters name so."""
_SCENE_FIELDS = ("sensors", "shapes", "emitters")


class UnknownParameterError(OptionError, KeyError):
    """A name that no parameter of a scene has."""

    __str__ = Exception.__str__


def traverse(scene: Scene) -> SceneParameters:
    """The parameters of a scene by name, which may be changed: ``mi.traverse`` in Mitsuba.

    From then on what the scene takes on a device stays there between renders, until the scene goes, and a
    render uploads what changed, and builds kernels only where the scene has new features.

    Parameters
    ----------
    scene
        From `load_file` or `load_dict`.

    Returns
    -------
    SceneParameters
        Set its items and call `SceneParameters.update`; then render the scene again.

    Raises
    ------
    OptionError
        Something other than a scene.
    """
    if not isinstance(scene, Scene):
        raise OptionError(
            f"traverse takes a Scene, not {type(scene).__name__}", hint="make one with load_file or load_dict"
        )
    scene.kept.on_device = True
    return SceneParameters(scene)


class SceneParameters(MutableMapping[str, Any]):
    """The parameters of a scene, by names as ``sensor.to_world`` and ``smoke.interior_medium.scale``.

    Names are Mitsuba's, and begin with the ids of the scene's sensors, shapes and emitters: in a dict their
    keys.  What has no id is called sensor, shape, emitter, and shape_1 and so on where there are several.
    ``sensor`` is always the first sensor, and names as scene files have them will do, as
    ``smoke.interior.scale``.

    Values are numbers, tuples of three numbers (colours, points), and arrays that cannot be written to.  What
    is set counts from `update` on.
    """

    def __init__(self, scene: Scene) -> None:
        self.scene = scene
        self._set: dict[str, Any] = {}
        self._read()

    def _read(self) -> None:
        self._known: dict[str, Parameter] = parameters_of(self.scene)
        self._read_from = tuple(getattr(self.scene, field) for field in _SCENE_FIELDS)

    @property
    def _found(self) -> dict[str, Parameter]:
        """The scene's parameters as it is now: others may have traversed and changed it."""
        now = tuple(getattr(self.scene, field) for field in _SCENE_FIELDS)
        if any(one is not other for one, other in zip(now, self._read_from, strict=True)):
            self._read()
        return self._known

    def __getitem__(self, name: str) -> Any:
        key = self._key(name)
        found = self._found[key]
        return found.shown(self._set.get(key, found.held))

    def __setitem__(self, name: str, value: Any) -> None:
        """Check a value and note it; SceneError or VolumeError for one that the parameter cannot have."""
        key = self._key(name)
        self._set[key] = self._found[key].check(value, name)

    def __delitem__(self, name: str) -> None:
        raise OptionError(f"{self._key(name)} cannot be taken out of the scene", hint="set it instead")

    def __contains__(self, name: object) -> bool:
        return self._resolved(name) is not None

    def __iter__(self) -> Iterator[str]:
        return iter(self._found)

    def __len__(self) -> int:
        return len(self._found)

    def __repr__(self) -> str:
        width = max(map(len, self._found), default=0)
        lines = [f"  {name:<{width}}  {_brief(self[name])}" for name in self._found]
        return "\n".join([f"<SceneParameters of {self.scene!r}", *lines, ">"])

    def _resolved(self, name: object) -> str | None:
        """The name that the parameter has here; None where there is none."""
        if not isinstance(name, str):
            return None
        first, *rest = name.split(".")
        path = ".".join([first, *(_ALIASES.get(part, part) for part in rest)])
        paths = [path]
        if first == "sensor":
            paths.append(".".join([next(iter(self._found)).split(".")[0], *path.split(".")[1:]]))
        for candidate in paths:
            for ending in ("", ".value", ".value.value"):
                if candidate + ending in self._found:
                    return candidate + ending
        return None

    def _key(self, name: str) -> str:
        key = self._resolved(name)
        if key is None:
            close = did_you_mean(name, self._found) if isinstance(name, str) else ""
            raise UnknownParameterError(
                f"the scene has no parameter {shown(name)}",
                hint=join_hints(close, f"its parameters: {listed(self._found)}"),
            )
        return key

    def update(self, *values: Any, **named: Any) -> list[str]:  # type: ignore[override]
        """Change the scene by what was set, and by `values`, a dict of more; all of it or nothing.

        Returns
        -------
        list of str
            The parameters that changed.

        Raises
        ------
        SceneError, VolumeError
            Values that do not go together; the scene and what was set are as they were.
        """
        try:
            given = dict(*values, **named)
        except (TypeError, ValueError):
            raise OptionError(f"update takes a dict of values, not {shown(values)}") from None
        for name, value in given.items():
            self[name] = value
        changed = {n: v for n, v in self._set.items() if not _same(v, self._found[n].held)}
        made: dict[int, tuple[object, Any]] = {}
        for name, value in changed.items():
            _put(made, self._found[name], value)
        done: dict[int, Any] = {}
        parts = {field: _rebuilt(getattr(self.scene, field), made, done) for field in _SCENE_FIELDS}
        media = [record for record in done.values() if isinstance(record, Medium)]
        for name in changed:
            record = done[id(self._found[name].owner)]
            for one in (record, *(medium for medium in media if _holds(medium, record))):
                check_together(one, name)
        parts["emitters"] = remade(parts["emitters"], self.scene.emitters)
        self._put(parts)
        self._set.clear()
        self._read()
        return list(changed)

    def _put(self, parts: Mapping[str, Any]) -> None:
        """The one place where a scene changes."""
        viewed = next((n for n, s in enumerate(self.scene.sensors) if s.camera is self.scene.sensor), None)
        if viewed is not None:
            view = parts["sensors"][viewed]
            parts = {**parts, "sensor": view.camera}
            if self.scene.film is self.scene.sensors[viewed].film:
                parts["film"] = view.film
        for field, value in parts.items():
            object.__setattr__(self.scene, field, value)


def sensor_with(sensor: Sensor, values: Mapping[str, Any]) -> Sensor:
    """A sensor with other values, by the names of its parameters; errors as `SceneParameters.update` has."""
    found = sensor_parameters(sensor)
    made: dict[int, tuple[object, Any]] = {}
    for name, value in values.items():
        if name not in found:
            hint = join_hints(did_you_mean(str(name), found), f"its parameters: {listed(found)}")
            raise UnknownParameterError(f"a sensor has no parameter {shown(name)}", hint=hint)
        _put(made, found[name], found[name].check(value, f"sensor.{name}"))
    for name in values:
        check_together(made[id(found[name].owner)][1], f"sensor.{name}")
    changed: Sensor = _rebuilt(sensor, made, {})
    return changed


def _put(made: dict[int, tuple[object, Any]], parameter: Parameter, value: Any) -> None:
    """Note the owner of a parameter, as it has been made so far, with a value that was checked."""
    _, record = made.get(id(parameter.owner), (None, parameter.owner))
    made[id(parameter.owner)] = parameter.owner, parameter.put(record, value)


def _rebuilt(value: Any, made: Mapping[int, tuple[object, Any]], done: dict[int, Any]) -> Any:
    """A record with those in it that were made anew, or itself.  What was shared stays shared."""
    if isinstance(value, tuple):
        parts = tuple(_rebuilt(part, made, done) for part in value)
        return parts if any(a is not b for a, b in zip(parts, value, strict=True)) else value
    if not is_dataclass(value) or isinstance(value, type):
        return value
    if id(value) not in done:
        _, record = made.get(id(value), (value, value))
        changes = {}
        for field in fields(record):
            part = getattr(record, field.name)
            if is_dataclass(part) or isinstance(part, tuple):
                other = _rebuilt(part, made, done)
                if other is not part:
                    changes[field.name] = other
        done[id(value)] = replace(record, **changes) if changes else record
    return done[id(value)]


def _holds(medium: Medium, volume: Any) -> bool:
    """Whether a volume is one of a medium's, whose other values it has to go with."""
    return any(getattr(medium, field.name) is volume for field in fields(medium))


def _same(one: Any, other: Any) -> bool:
    if isinstance(one, np.ndarray) or isinstance(other, np.ndarray):
        return np.array_equal(one, other)
    return bool(one == other)


def _brief(value: Any) -> str:
    """A value in a line of the table."""
    if isinstance(value, np.ndarray):
        return f"{value.dtype} {value.shape}"
    return shown(value)
