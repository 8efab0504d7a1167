"""Plugins of Mitsuba before version 2 that clvol takes in any scene, as what version 3 has instead."""

from __future__ import annotations

from clvol.scene.integrator import BEFORE, WRAPPERS
from clvol.scene.nodes import Node
from clvol.scene.sensor import OTHER_SAMPLERS, SAMPLERS_BEFORE


def modernise(node: Node) -> None:
    """Put what version 3 has in place of old integrators and samplers in a node; drop what is in vain."""
    for name in node.unheeded:
        node.pop(name, None)
    for name, value in list(node.parameters()):
        if isinstance(value, Node) and value.kind:
            node[name] = _modern(value)
            modernise(node[name])


def _modern(node: Node) -> Node:
    inside = [value for _, value in node.parameters() if isinstance(value, Node) and not value.is_value]
    if node.kind == "integrator" and node.type in WRAPPERS and len(inside) == 1:
        return _modern(inside[0])
    if node.kind == "integrator" and node.type in BEFORE:
        return _as("volpath", node.without(BEFORE[node.type].ignored))
    if node.kind == "sampler" and node.type in SAMPLERS_BEFORE:
        return _as("independent", node.without(OTHER_SAMPLERS[node.type]))
    return node


def _as(type: str, node: Node) -> Node:
    node["type"] = type
    return node
