"""Plugins of Mitsuba before version 2 that clvol takes in any scene, as what version 3 has instead."""

from __future__ import annotations

import numpy as np

from clvol.scene.integrator import BEFORE, WRAPPERS
from clvol.scene.nodes import Node
from clvol.scene.sensor import OTHER_SAMPLERS, SAMPLERS_BEFORE
from clvol.scene.spectra import sampled_to_rgb


def modernise(node: Node) -> None:
    """Put what version 3 has in place of old integrators and samplers in a node; drop what is in vain."""
    for name in node.unheeded:
        node.pop(name, None)
    if node.kind == "medium" and {"sigma_s", "sigma_a"} <= node.keys():
        _add_up(node)
    for name, value in list(node.parameters()):
        if isinstance(value, Node) and value.kind:
            node[name] = _modern(value)
            modernise(node[name])


def _add_up(medium: Node) -> None:
    """`sigma_t` and `albedo` in place of `sigma_s` and `sigma_a`, of the same bits; spectra in files stay."""
    scattered, absorbed = (_colour(medium[name]) for name in ("sigma_s", "sigma_a"))
    if scattered is None or absorbed is None:
        return
    total = scattered + absorbed
    albedo = np.divide(scattered, total, out=np.zeros_like(total), where=total > 0)
    for old, new, values in (("sigma_s", "sigma_t", total), ("sigma_a", "albedo", albedo)):
        where = medium.place(old)
        del medium[old]
        made = Node(where)
        made.add("type", "rgb", where)
        made.add("value", values.tolist(), where)
        medium.add(new, made if len(values) > 1 else float(values[0]), where)


def _colour(value: object) -> np.ndarray | None:
    """A number or three, as the reader has them; None of what is not in the scene's text."""
    if isinstance(value, Node):
        value = value.get("value") if value.is_value else None
    if value is None:
        return None
    numbers = np.atleast_1d(np.asarray(value, np.float64))
    return numbers if numbers.ndim == 1 else sampled_to_rgb(numbers[:, 0], numbers[:, 1], False)


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
