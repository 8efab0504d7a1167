"""Scenes of Mitsuba before version 2 in the words of version 3: rules on the elements of their XML.

What differs is data in `clvol.scene.old_names`; what cannot be said in a table is here.
"""

from __future__ import annotations

import re
from dataclasses import replace
from itertools import pairwise
from typing import TYPE_CHECKING

import numpy as np

from clvol.scene.old_mixtures import MIXTURES, blended
from clvol.scene.old_names import NOT_HEEDED, NULL_IN_MEDIA, ON_ALL, ON_FILMS, RULES, SKIES, TAGS, UV, Rule
from clvol.scene.spectra import srgb_to_linear
from clvol.scene.xml_tree import Element

if TYPE_CHECKING:
    from collections.abc import Sequence

    from clvol.scene.faults import Faults

_HEX = re.compile(r"#" + 3 * "([0-9a-fA-F]{2})")
_NUMBERS = re.compile(r"\s*\d{0,9}\.?\d{1,30}(?:[\s,]+\d{0,9}\.?\d{1,30}){0,2}\s*", re.ASCII)
MEDIA = ("interior", "exterior")
_TEXTURES = ("texture", "ref")
"""Elements that stand in the place of a value of their name."""


def snake_case(name: str) -> str:
    """A camelCase name as Mitsuba 3 upgrades it: toWorld is to_world, intIOR is int_ior."""
    out, after_capital = name[:1], False
    for before, letter in pairwise(name):
        starts = letter.isupper() and before.islower()
        after_capital = starts or (after_capital and letter.isupper())
        out += ("_" if starts else "") + (letter.lower() if after_capital else letter)
    return out


def upgraded(element: Element, faults: Faults) -> Element:
    """An element of an old scene, with all inside of it, as version 3 would have it.

    What is taken as something else is said, as `Faults.approximate` does.
    """
    tag = TAGS.get(element.tag, element.tag)
    attributes = dict(element.attributes)
    if "name" in attributes and tag not in ("default", "include"):
        attributes["name"] = snake_case(attributes["name"])
    children = [upgraded(child, faults) for child in element.children]
    if tag in ("rgb", "spectrum"):
        attributes.pop("intent", None)
        attributes |= _linear(attributes.get("value", ""), element.tag == "srgb")
    made = Element(tag, attributes, element.where, children, old=True)
    return _plugin(made, faults) if "type" in attributes else made


def _linear(text: str, encoded: bool) -> dict[str, str]:
    """A colour in linear numbers, where it is written as "#rrggbb" or `encoded` as sRGB has it."""
    if found := _HEX.fullmatch(text.strip()):
        values = [int(part, 16) / 255 for part in found.groups()]
    elif encoded and _NUMBERS.fullmatch(text):
        values = [float(part) for part in re.split(r"[\s,]+", text.strip())]
    else:
        return {"value": text} if text else {}
    if encoded:
        values = srgb_to_linear(np.array(values)).tolist()
    return {"value": ", ".join(map(repr, values))}


def _plugin(element: Element, faults: Faults) -> Element:
    """A plugin's element, whose children are upgraded."""
    kind, name = element.tag, element.attributes["type"]
    if (kind, name) in MIXTURES:
        return blended(element, faults)
    rule = RULES.get((kind, name), Rule())
    dropped = (*rule.dropped, *ON_ALL.get(kind, ()))
    children = [_parameter(child, rule) for child in element.children]
    children = [child for child in children if child.attributes.get("name") not in dropped]
    if kind == "film":
        children = [child for child in children if not child.attributes.get("name", "").startswith(ON_FILMS)]
    children = [child for child in children if not _is_not_heeded(child, (kind, name), faults)]
    textured = [child.attributes.get("name") for child in children if child.tag in _TEXTURES]
    children = [child for child in children if child.tag in _TEXTURES or not _named(child, textured)]
    given = {child.attributes.get("name") for child in children}
    for tag, parameter, value in rule.added:
        if parameter not in given and not given.intersection(rule.unless):
            children.append(Element(tag, {"name": parameter, "value": value}, element.where, old=True))
    if rule.said:
        faults.approximate(f"{kind} '{name}' is taken as {rule.said}", element.where)
    made = replace(element, attributes=element.attributes | {"type": rule.to or name}, children=children)
    if kind == "shape":
        return _shape(made)
    if kind == "emitter" and name in SKIES:
        return _sky(made)
    if kind == "texture":
        return _decoded(_texture(made), faults)
    if name == "mfilm" and not any(child.tag in ("rfilter", "ref") for child in children):
        return replace(
            made, children=[*children, Element("rfilter", {"type": "box"}, element.where, old=True)]
        )
    return _grid(made) if name == "gridvolume" else made


def _is_not_heeded(child: Element, plugin: tuple[str, str], faults: Faults) -> bool:
    """Whether a parameter is left out although it changes the picture, which is said."""
    kind, name = plugin
    parameter = child.attributes.get("name", "")
    said = NOT_HEEDED.get((kind, name, parameter)) or NOT_HEEDED.get((kind, "", parameter))
    if said:
        faults.approximate(f"'{parameter}' of {kind} '{name}' is not heeded: {said}", child.where)
    return said is not None


def _parameter(element: Element, rule: Rule) -> Element:
    name, value = element.attributes.get("name", ""), element.attributes.get("value", "")
    changed = {"name": rule.renamed[name]} if name in rule.renamed else {}
    names = rule.values.get(name, {})
    key = value.lower().replace(" ", "").replace("_", "")
    if name in rule.values and "$" not in value:
        changed["value"] = names.get(key, value.lower())
    return replace(element, attributes=element.attributes | changed)


def _shape(element: Element) -> Element:
    """A shape: light passes one that only has a medium."""
    names = [child.attributes.get("name", "") for child in element.children]
    has_medium = any(name in MEDIA for name in names)
    has_look = any(
        child.tag in ("bsdf", "emitter", "subsurface") or (child.tag == "ref" and name not in MEDIA)
        for child, name in zip(element.children, names, strict=True)
    )
    if not has_medium or has_look:
        return element
    null = Element("bsdf", {"type": NULL_IN_MEDIA}, element.where, old=True)
    return replace(element, children=[*element.children, null])


def _texture(element: Element) -> Element:
    """A texture's offset and scale as `to_uv`: first the offset, as Mitsuba's upgrader has it."""
    given = {child.attributes["name"]: child for child in element.children if _named(child, UV)}
    if not given:
        return element
    offset = {
        a: given[n].attributes.get("value", "") for a, n in zip("xy", UV[:2], strict=True) if n in given
    }
    scale = {a: given[n].attributes.get("value", "") for a, n in zip("xy", UV[2:], strict=True) if n in given}
    steps = [Element("translate", offset, element.where), Element("scale", scale, element.where)]
    to_uv = Element("transform", {"name": "to_uv"}, element.where, steps, old=True)
    others = [child for child in element.children if not _named(child, UV)]
    return replace(element, children=[*others, to_uv])


def _decoded(element: Element, faults: Faults) -> Element:
    """A texture of `gamma` 1 is `raw`; one of another than sRGB's is decoded as sRGB, which is said."""
    gamma = next((child for child in element.children if _named(child, ("gamma",))), None)
    if gamma is None:
        return element
    others = [child for child in element.children if child is not gamma]
    text = gamma.attributes.get("value", "")
    try:
        value = float(text)
    except ValueError:
        value = 0.0 if text.lower() == "srgb" else float("nan")
    if value == 1:
        others.append(Element("boolean", {"name": "raw", "value": "true"}, gamma.where, old=True))
    elif not (value <= 0 or value == 2.2):
        faults.approximate(f"a texture of gamma {text} is decoded as sRGB", gamma.where)
    return replace(element, children=others)


def _grid(element: Element) -> Element:
    """A grid lies in the box of its file, or in that of `min` and `max`."""
    corners = {child.attributes["name"]: child for child in element.children if _named(child, ("min", "max"))}
    if len(corners) < 2:
        return element
    low, high = ([corners[name].attributes.get(axis, "0") for axis in "xyz"] for name in ("min", "max"))
    try:
        size = [repr(float(b) - float(a)) for a, b in zip(low, high, strict=True)]
    except ValueError:
        return element  # not numbers, or $names: the reader says that it does not know them
    steps = [
        Element("scale", dict(zip("xyz", size, strict=True)), element.where),
        Element("translate", dict(zip("xyz", low, strict=True)), element.where),
    ]
    ours = (*corners, "use_grid_bbox", "to_world")
    others = [child for child in element.children if not _named(child, ours)]
    own = next((child for child in element.children if _named(child, ("to_world",))), None)
    to_world = Element("transform", {"name": "to_world"}, element.where, steps, old=True)
    to_world.children += own.children if own else []
    return replace(element, children=[*others, to_world])


SUN_APERTURE, LEAST_APERTURE = 0.5358, 1e-4
"""Of the sun, in degrees, and of one that had no size."""
SKY_MATRIX = "0 -1 0 0  0 0 1 0  1 0 0 0  0 0 0 1"
"""From a sky whose z is up and whose x is south to one whose y is up and whose x is east."""


def _sky(element: Element) -> Element:
    """A sky: one scale for both parts, the size of the sun, and where up was."""
    children = []
    for child in element.children:
        name, value = child.attributes.get("name", ""), child.attributes.get("value", "")
        if name == "scale":
            both = ({"name": part} for part in ("sky_scale", "sun_scale") if not _has(element, part))
            children += [replace(child, attributes=child.attributes | named) for named in both]
        elif name == "sun_radius_scale":
            changed = {"name": "sun_aperture", "value": _aperture(value)}
            children.append(replace(child, attributes=child.attributes | changed))
        elif name != "to_world":
            children.append(child)
    own = next((child for child in element.children if _named(child, ("to_world",))), None)
    steps = [
        Element("matrix", {"value": SKY_MATRIX}, element.where, old=True),
        *(own.children if own else []),
    ]
    children.append(Element("transform", {"name": "to_world"}, element.where, steps, old=True))
    return replace(element, children=children)


def _aperture(text: str) -> str:
    try:
        return repr(max(float(text) * SUN_APERTURE, LEAST_APERTURE))
    except ValueError:
        return text  # no number, or a $name: the reader says that it is none


def _has(element: Element, name: str) -> bool:
    return any(_named(child, (name,)) for child in element.children)


def _named(element: Element, names: Sequence[str | None]) -> bool:
    """Whether its name is one of these; elements without a name have none."""
    return "name" in element.attributes and element.attributes["name"] in names
