"""The leaves of a kd-tree, found by walking its nodes as the device does."""

import numpy as np


def leaves_of(nodes, bounds):
    """(node, lower cell, upper cell, depth) of every leaf; cells x y z, within the lattice."""
    stack = [(0, np.zeros(3, int), np.array(bounds.cells), 0)]
    while stack:
        index, lower, upper, depth = stack.pop()
        word = int(nodes[index, 0])
        if word & 3 == 3:
            yield index, lower, np.maximum(np.minimum(upper, bounds.cells), lower), depth
            continue
        middle_upper, middle_lower = upper.copy(), lower.copy()
        middle_upper[word & 3] = middle_lower[word & 3] = word >> 2
        stack.append((int(nodes[index, 1]), lower, middle_upper, depth + 1))
        stack.append((int(nodes[index, 1]) + 1, middle_lower, upper, depth + 1))
