"""`mixturebsdf` and `mixturephase` of Mitsuba before version 2: any number of parts, as blends of two."""

from __future__ import annotations

import math
import re
from dataclasses import replace
from typing import TYPE_CHECKING

from clvol.errors import SceneError
from clvol.scene.xml_tree import Element

if TYPE_CHECKING:
    from clvol.scene.faults import Faults

MIXTURES = {("bsdf", "mixturebsdf"): "blendbsdf", ("phase", "mixturephase"): "blendphase"}
"""What they are blends of."""


def blended(element: Element, faults: Faults) -> Element:
    """A mixture as blends in blends.

    Weights of more than 1 in all are scaled to 1.  What BSDFs lack is black; phase functions are scaled up,
    which is said.

    Raises
    ------
    SceneError
        Weights that are no numbers >= 0, are all 0, or not as many as there are parts.
    """
    kind, name = element.tag, element.attributes["type"]
    parts = [child for child in element.children if child.tag in (kind, "ref")]
    others = [child for child in element.children if child.tag not in (kind, "ref")]
    weights = _weights(element, others, len(parts))
    total = sum(weights)
    if total < 1 - 1e-6 and kind == "bsdf":
        black = Element("rgb", {"name": "reflectance", "value": "0"}, element.where, old=True)
        parts.append(Element("bsdf", {"type": "diffuse"}, element.where, [black], old=True))
        weights.append(1 - total)
    elif total < 1 - 1e-6:
        faults.approximate(f"{kind} '{name}' is taken as one whose weights add up to 1", element.where)
    if len(parts) == 1:
        parts, weights = parts * 2, [1.0, 0.0]
    made, rest = parts[-1], weights[-1]
    for part, weight in zip(parts[-2::-1], weights[-2::-1], strict=True):
        rest += weight
        share = repr((rest - weight) / rest if rest > 0 else 0.0)
        number = Element("float", {"name": "weight", "value": share}, element.where, old=True)
        made = Element(
            kind,
            {"type": MIXTURES[kind, name]},
            element.where,
            [number, _nameless(part), _nameless(made)],
            old=True,
        )
    return replace(made, attributes=_nameless(made).attributes | _identity(element))


def _weights(element: Element, others: list[Element], count: int) -> list[float]:
    name = element.attributes["type"]
    given = [child for child in others if child.attributes.get("name") == "weights"]
    if len(given) != 1 or len(others) > 1:
        raise SceneError(f"a {name} takes its parts and their weights only", element.where)
    text = given[0].attributes.get("value", "")
    try:
        weights = [float(part) for part in re.split(r"[\s,]+", text.strip())]
    except ValueError:
        raise SceneError(
            f"the weights of a {name} must be numbers, got '{text[:60]}'", given[0].where
        ) from None
    if len(weights) != count:
        raise SceneError(
            f"a {name} takes as many weights as parts, {count}, not {len(weights)}", given[0].where
        )
    if not all(0 <= weight < math.inf for weight in weights) or not sum(weights) > 0:
        raise SceneError(f"the weights of a {name} must be finite and >= 0, and not all 0", given[0].where)
    return weights


def _nameless(element: Element) -> Element:
    kept = {key: value for key, value in element.attributes.items() if key != "name"}
    return replace(element, attributes=kept)


def _identity(element: Element) -> dict[str, str]:
    return {key: value for key, value in element.attributes.items() if key in ("id", "name")}
