"""Meshes that Mitsuba has loaded already, as the dicts that say the same."""

from __future__ import annotations

import sys
from typing import TYPE_CHECKING, Any

import numpy as np

from clvol.errors import SceneError

if TYPE_CHECKING:
    from collections.abc import Mapping


def is_loaded_mesh(value: object) -> bool:
    """Whether it is a mesh of Mitsuba, which tells all of itself (if what it is made of is simple)."""
    return any((kind.__module__, kind.__name__) == ("mitsuba", "Mesh") for kind in type(value).__mro__)


def dict_of_loaded_mesh(value: Any, where: str) -> Mapping[str, object]:
    """The dict of a mesh that Mitsuba has loaded, as `clvol.load_dict` takes it.

    Raises
    ------
    SceneError
        A BSDF other than one of a single colour, or media, which do not tell enough of themselves.
    """
    found = dict(sys.modules["mitsuba"].traverse(value))
    names = [name for name in found if name == "faces" or name.startswith(("vertex_", "face_"))]
    made: dict[str, object] = {"type": "mesh", **{name: np.array(found[name]) for name in names}}
    made |= {"face_normals": value.has_face_normals()}
    made |= {"flip_normals": value.has_flipped_normals()} if hasattr(value, "has_flipped_normals") else {}
    if value.is_medium_transition():
        raise _unclear("media", where)
    bsdf, emitter = value.bsdf(), value.emitter()
    made["bsdf"] = _bsdf(bsdf.class_name(), found, where)
    if emitter is not None:
        radiance = _colour(found, "emitter.radiance.value")
        if emitter.class_name() != "AreaLight" or radiance is None:
            raise _unclear(f"emitter ({emitter.class_name()})", where)
        made["emitter"] = {"type": "area", "radiance": radiance}
    return made


def _bsdf(name: str, found: Mapping[str, Any], where: str) -> dict[str, object]:
    if name == "Null":
        return {"type": "null"}
    reflectance = _colour(found, "bsdf.reflectance.value")
    if name != "SmoothDiffuse" or reflectance is None:
        raise _unclear(f"BSDF ({name})", where)
    return {"type": "diffuse", "reflectance": reflectance}


def _colour(found: Mapping[str, Any], name: str) -> object | None:
    """A colour of `mi.traverse`; None where there is no such parameter."""
    if name not in found:
        return None
    return {"type": "rgb", "value": np.asarray(found[name], np.float64).reshape(-1).tolist()}


def _unclear(part: str, where: str) -> SceneError:
    what = f"the {part} of a mesh that Mitsuba has loaded cannot be told from it"
    return SceneError(what, where, "give the dict that mi.load_dict made it from")
