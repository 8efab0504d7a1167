"""Bounding volume hierarchy of triangles and boxed primitives, eight children wide, for cl/geometry/bvh.h.

A binary tree (clvol.accel.bvh_split) is collapsed: a node takes in the children of its largest child until
it has eight.  A node is eight rows of eight floats: the children's lower x, upper x, lower y, … upper z, the
children's references, and a spare row (the root's first number there: how many triangles there are).  An
unused child has an empty box.  A leaf is one packet of ten rows: x, y, z of the first vertices, of the
second, of the third, and the primitives' numbers, which count the triangles first, then the quadrics.

Boxes are padded so that rounding in the traversal never loses a hit.  The triangle test moves a vertex by a
few units in the last place of its distance from the ray's origin.  The traversal allows for as much of the
distance to the box; what is left is less than PADDING times the primitive's longest extent.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from clvol import layout
from clvol.accel.bvh_split import BinaryTree, half_area, split_boxes
from clvol.errors import SceneError
from clvol.layout import BVH_NODE_ROWS, BVH_PACKET, BVH_PACKET_ROWS, BVH_WIDTH

LEAF, HAS_QUADRICS = np.uint32(layout.BVH_LEAF), np.uint32(layout.BVH_HAS_QUADRICS)
NO_PRIMITIVE = np.uint32(layout.NO_PRIMITIVE)
PADDING = np.float32(2.0**-20)
_MOST_COORDINATE = 1e12
"""The triangle test multiplies three coordinates."""
_CHUNK = 1 << 17


@dataclass(frozen=True, eq=False)
class Bvh:
    """A hierarchy of boxes as the device has it.

    nodes : float32 (nodes, 8, 8), root first; row 6 holds uint32 references, [0, 7, 0] the triangle count.
    packets : float32 (leaves, 10, 8), row 9 holds uint32 numbers of primitives.
    depth : nodes on the longest way from the root to a leaf.
    stack : entries that a traversal keeps at most.
    triangles, quadrics : their number.
    """

    nodes: np.ndarray
    packets: np.ndarray
    depth: int
    stack: int
    triangles: int
    quadrics: int


def check_mesh(vertices: np.ndarray, faces: np.ndarray, name: str) -> None:
    """Raise SceneError, which names the mesh, unless it can be rendered.

    Parameters
    ----------
    vertices : float32 (n, 3), finite and below 1e12 in magnitude.
    faces : integers (m, 3), m at least 1, each the number of a vertex.
    """
    for array, what in ((vertices, "vertices"), (faces, "faces")):
        if array.ndim != 2 or array.shape[1] != 3:
            raise SceneError(f"{what} have shape {array.shape}, not (n, 3)", name)
    if faces.dtype.kind not in "iu":
        raise SceneError(f"faces are {faces.dtype}, not integers", name)
    if len(faces) == 0:
        raise SceneError("the mesh has no faces", name)
    for first in range(0, len(vertices), _CHUNK):
        usable = (np.abs(vertices[first : first + _CHUNK]) <= _MOST_COORDINATE).all(axis=1)
        if not usable.all():
            at = first + int(np.argmin(usable))
            raise SceneError(
                f"vertex {at} is {tuple(vertices[at].tolist())}: coordinates must be finite and below 1e12",
                name,
            )
    if faces.min() < 0 or faces.max() >= len(vertices):
        outside = int(np.argmax(((faces < 0) | (faces >= len(vertices))).any(axis=1)))
        raise SceneError(
            f"face {outside} is {tuple(faces[outside].tolist())}, but there are {len(vertices)} vertices",
            name,
        )


def drop_degenerate(vertices: np.ndarray, faces: np.ndarray) -> tuple[np.ndarray, int]:
    """Numbers of the faces that have an area, int32, and how many have none: no ray can hit those."""
    kept = []
    for first in range(0, len(faces), _CHUNK):
        a, b, c = (vertices[faces[first : first + _CHUNK, corner]].astype(np.float64) for corner in range(3))
        kept.append(first + np.flatnonzero(np.cross(b - a, c - a).any(axis=1)).astype(np.int32))
    indices = np.concatenate(kept) if kept else np.empty(0, np.int32)
    return indices, len(faces) - len(indices)


def build_bvh(vertices: np.ndarray, faces: np.ndarray, boxes: np.ndarray) -> Bvh:
    """The hierarchy over triangles, then boxed primitives (quadrics), together at least one.

    Parameters
    ----------
    vertices, faces : as `check_mesh` passes them and `drop_degenerate` leaves them; faces may be (0, 3).
    boxes : float32 (q, 2, 3), lower and upper corner of each quadric in world space.
    """
    tree = split_boxes(_padded_boxes(vertices, faces, boxes))
    nodes, leaves, depth, stack = _collapse(tree)
    nodes[0, 7, 0] = np.uint32(len(faces)).view(np.float32)
    packets = _packets(tree, leaves, vertices, faces)
    mixed = np.zeros(len(leaves), bool) if len(boxes) == 0 else _holds_quadrics(packets, len(faces))
    if mixed.any():
        references = nodes[:, 6].view(np.uint32)
        leaf = (references & LEAF) != 0
        references[leaf] |= np.where(mixed[references[leaf] & ~LEAF], HAS_QUADRICS, np.uint32(0))
    return Bvh(nodes, packets, depth, stack, len(faces), len(boxes))


def _padded_boxes(vertices: np.ndarray, faces: np.ndarray, boxes: np.ndarray) -> np.ndarray:
    """Boxes as `split_boxes` takes them, float32 (6, primitives), padded as the module says."""
    total = len(faces) + len(boxes)
    padded = np.empty((6, total), np.float32)
    for first in range(0, len(faces), _CHUNK):
        a, b, c = (vertices[faces[first : first + _CHUNK, corner]] for corner in range(3))
        lower, upper = np.minimum(np.minimum(a, b), c), np.maximum(np.maximum(a, b), c)
        _pad(padded[:, first : first + len(a)], lower, upper, PADDING)
    if len(boxes):
        _pad(padded[:, len(faces) :], boxes[:, 0], boxes[:, 1], 8 * PADDING)
    return padded


def _pad(out: np.ndarray, lower: np.ndarray, upper: np.ndarray, padding: np.float32) -> None:
    """Write boxes, grown by `padding` of the longest extent and by more than an ulp of each plane.

    The last also serves rays along a plane: their origin is inside, or at a distance that is not 0.
    """
    longest = (upper - lower).max(axis=1, keepdims=True) * padding + np.float32(1e-20)
    ulp = np.float32(2.0**-22)
    out[:3] = (lower - (longest + np.abs(lower) * ulp)).T
    out[3:] = -(upper + (longest + np.abs(upper) * ulp)).T


def _collapse(tree: BinaryTree) -> tuple[np.ndarray, np.ndarray, int, int]:
    """Wide nodes, level by level; the binary tree's leaves, as the packets follow; depth; stack entries."""
    area = half_area(tree.box)
    blocks, leaves = [], []
    frontier, pending = np.zeros(1, np.int32), np.zeros(1, np.int32)
    known, packets, most = 1, 0, 0
    while len(frontier):
        slots = _widest_children(tree, area, frontier)
        used = slots >= 0
        pending = pending + used.sum(axis=1) - 1  # siblings that wait on the stack on the way here
        most = max(most, int(pending.max()))
        leaf = used & (tree.left[slots] < 0)
        inner = used & ~leaf
        references = np.zeros(slots.shape, np.uint32)
        references[inner] = known + np.arange(np.count_nonzero(inner))
        references[leaf] = (packets + np.arange(np.count_nonzero(leaf))).astype(np.uint32) | LEAF
        block = np.zeros((len(slots), BVH_NODE_ROWS, BVH_WIDTH), np.float32)
        for axis in range(3):
            block[:, 2 * axis] = np.where(used, tree.box[axis][slots], np.inf)
            block[:, 2 * axis + 1] = np.where(used, -tree.box[axis + 3][slots], -np.inf)
        block[:, 6] = references.view(np.float32)
        blocks.append(block)
        leaves.append(slots[leaf])
        frontier, pending = slots[inner], np.repeat(pending, inner.sum(axis=1))
        known, packets = known + len(frontier), packets + len(leaves[-1])
    return np.concatenate(blocks), np.concatenate(leaves), len(blocks), most + 1


def _widest_children(tree: BinaryTree, area: np.ndarray, nodes: np.ndarray) -> np.ndarray:
    """Up to eight descendants that cover each node, int32 (nodes, 8), -1 where there are fewer.

    The one of the largest surface is replaced by its two halves, six times.
    """
    slots = np.full((len(nodes), BVH_WIDTH), -1, np.int32)
    splits = tree.left[nodes] >= 0  # else the root is a leaf
    slots[:, 0] = np.where(splits, tree.left[nodes], nodes)
    slots[splits, 1] = tree.left[nodes[splits]] + 1
    rows, filled = np.arange(len(nodes)), np.where(splits, 2, 1)
    for _ in range(BVH_WIDTH - 2):
        opens = (slots >= 0) & (tree.left[slots] >= 0)
        widest = np.argmax(np.where(opens, area[slots], np.float32(-1)), axis=1)
        row = rows[opens[rows, widest]]
        halves = tree.left[slots[row, widest[row]]]
        slots[row, widest[row]] = halves
        slots[row, filled[row]] = halves + 1
        filled[row] += 1
    return slots


def _packets(tree: BinaryTree, leaves: np.ndarray, vertices: np.ndarray, faces: np.ndarray) -> np.ndarray:
    """One packet a leaf; lanes of quadrics and unused ones have three equal vertices, which no ray hits."""
    packets = np.zeros((len(leaves), BVH_PACKET_ROWS, BVH_WIDTH), np.float32)
    lanes = np.arange(BVH_PACKET)
    for first in range(0, len(leaves), _CHUNK // BVH_PACKET):
        part = leaves[first : first + _CHUNK // BVH_PACKET]
        used = lanes < tree.count[part][:, None]
        primitive = np.full(used.shape, NO_PRIMITIVE)
        primitive[used] = tree.order[(tree.first[part][:, None] + lanes)[used]]
        packet, lane = np.nonzero(primitive < len(faces))
        corners = vertices[faces[primitive[packet, lane]]].reshape(-1, 9)
        packets[first : first + len(part)][packet, :9, lane] = corners
        packets[first : first + len(part), 9] = primitive.view(np.float32)
    return packets


def _holds_quadrics(packets: np.ndarray, triangles: int) -> np.ndarray:
    """Which packets have a primitive beyond the triangles."""
    primitive = packets[:, 9].view(np.uint32)
    holds: np.ndarray = np.any((primitive >= triangles) & (primitive != NO_PRIMITIVE), axis=1)
    return holds
