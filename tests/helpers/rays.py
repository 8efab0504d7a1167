"""Casts rays on the device against a hierarchy, and in float64 against every triangle."""

from dataclasses import dataclass

import numpy as np
import pyopencl as cl

from clvol import layout
from clvol.accel.bvh import NO_PRIMITIVE, build_bvh
from clvol.device import programs
from clvol.device.launch import run_kernel

NO_BOXES = np.empty((0, 2, 3), np.float32)
NO_FACES = np.empty((0, 3), np.int32)
NO_VERTICES = np.empty((0, 3), np.float32)
QUADRIC_KINDS = {name.lower(): number for number, name in enumerate(layout.ENUMS["QUADRIC"])}

_KERNELS = """
__kernel void closest_hits(ARGUMENTS, __global const float *t_max, __global const float *after_t,
                      __global const uint *after_primitive, __global float *found, __global uint *primitive)
{
    BEGIN
    const Hit hit = closest_hit(&scene, ray, after_t[i], after_primitive[i], t_max[i]);
    vstore3((float3)(hit.t, hit.u, hit.v), i, found);
    primitive[i] = hit.primitive;
}

__kernel void any_hits(ARGUMENTS, __global const float *t_max, __global uint *blocked)
{
    BEGIN
    const Target none = {NO_PRIMITIVE, NO_PRIMITIVE, 0u, 0.0f};
    blocked[i] = any_hit(&scene, ray, t_max[i], &none);
}
"""
_ARGUMENTS = (
    "__global const float8 *nodes, __global const float8 *triangles, __global const Quadric *quadrics, "
    "__global const float *o, __global const float *d"
)
_BEGIN = (
    "const Scene scene = {.bvh_nodes = nodes, .bvh_triangles = triangles, .quadrics = quadrics}; "
    "const size_t i = get_global_id(0); "
    "const Ray ray = {vload3(i, o), vload3(i, d)};"
)


def ray_source(stack, triangles=True, quadrics=False, kernels=_KERNELS):
    """A unit with cl/geometry/bvh.h, and kernels whose ARGUMENTS and BEGIN stand for a scene and ray i."""
    flags = {"CLVOL_SPECTRUM": 1, "CLVOL_EXTINCTION": 1, "CLVOL_ONE_CHANNEL_PER_PATH": 0}
    flags |= {"CLVOL_HAS_TRIANGLES": int(triangles), "CLVOL_HAS_QUADRICS": int(quadrics)}
    flags |= {"CLVOL_BVH_STACK": stack}
    flags |= {"CLVOL_HAS_SURFACES": 1}
    text = kernels.replace("ARGUMENTS", _ARGUMENTS).replace("BEGIN", _BEGIN)
    return programs.expand('#include "geometry/bvh.h"\n' + text, flags, {})


def directions(generator, count):
    """Uniform unit vectors, float32 (count, 3)."""
    d = generator.normal(size=(count, 3))
    return (d / np.linalg.norm(d, axis=1, keepdims=True)).astype(np.float32)


@dataclass
class Hits:
    """t, u, v : float32 (rays,).  primitive : uint32 (rays,), NO_PRIMITIVE where nothing is hit."""

    t: np.ndarray
    u: np.ndarray
    v: np.ndarray
    primitive: np.ndarray

    @property
    def any(self):
        return self.primitive != NO_PRIMITIVE


class Caster:
    """A hierarchy on the device."""

    def __init__(self, device, vertices=NO_VERTICES, faces=NO_FACES, quadrics=None, boxes=NO_BOXES):
        self.device = device
        vertices = np.ascontiguousarray(vertices, np.float32)
        self.bvh = build_bvh(vertices, np.ascontiguousarray(faces, np.int32), boxes)
        source = ray_source(-(-self.bvh.stack // 64) * 64, len(faces) > 0, len(boxes) > 0)
        self.program = programs.build(device, source, "rays")
        records = np.zeros(1, layout.QUADRIC) if quadrics is None else quadrics
        self.scene = [device.memory.upload(a, "") for a in (self.bvh.nodes, self.bvh.packets, records)]

    def _run(self, name, o, d, inputs, outputs):
        arrays = [np.ascontiguousarray(a, np.float32) for a in (o, d)] + inputs
        # PoCL compiles a kernel anew for every local size
        run_kernel(self.device, cl.Kernel(self.program, name), len(o), self.scene, arrays, outputs, group=1)

    def closest(self, o, d, t_max=np.inf, after_t=0.0, after_primitive=NO_PRIMITIVE):
        """First hits after (after_t, after_primitive), numbers or arrays."""
        n = len(o)
        inputs = [np.full(n, t_max, np.float32), np.full(n, after_t, np.float32)]
        inputs.append(np.full(n, after_primitive, np.uint32))
        found, primitive = np.empty((n, 3), np.float32), np.empty(n, np.uint32)
        self._run("closest_hits", o, d, inputs, [found, primitive])
        return Hits(*found.T, primitive)

    def any(self, o, d, t_max=np.inf):
        """Whether anything is hit."""
        blocked = np.empty(len(o), np.uint32)
        self._run("any_hits", o, d, [np.full(len(o), t_max, np.float32)], [blocked])
        return blocked != 0

    def walk(self, o, d, most=1000):
        """All hits of each ray, in order: lists of (t, primitive)."""
        lists = [[] for _ in range(len(o))]
        alive = np.arange(len(o))
        after_t, after_primitive = np.zeros(len(o), np.float32), np.full(len(o), NO_PRIMITIVE)
        for _ in range(most):
            hits = self.closest(o[alive], d[alive], np.inf, after_t, after_primitive)
            alive, after_t, after_primitive = alive[hits.any], hits.t[hits.any], hits.primitive[hits.any]
            for ray, t, primitive in zip(alive, after_t, after_primitive, strict=True):
                lists[ray].append((float(t), int(primitive)))
            if len(alive) == 0:
                return lists
        raise AssertionError("a ray's hits do not end")


def all_hits(vertices, faces, o, d):
    """Möller and Trumbore 1997 in float64 for each ray and triangle.

    Returns t and the least barycentric weight, float64 (rays, triangles): a hit where the weight is not
    negative and t > 0, and beyond doubt where the weight is not near 0.
    """
    a, b, c = (np.asarray(vertices, np.float64)[faces[:, k]] for k in range(3))
    o, d = np.asarray(o, np.float64)[:, None], np.asarray(d, np.float64)[:, None]
    e1, e2, s = b - a, c - a, o - a
    p, q = np.cross(d, e2), np.cross(s, e1)
    with np.errstate(divide="ignore", invalid="ignore"):
        det = np.sum(e1 * p, axis=-1)
        u, v = np.sum(s * p, axis=-1) / det, np.sum(d * q, axis=-1) / det
        t = np.sum(e2 * q, axis=-1) / det
    weight = np.minimum(np.minimum(u, v), 1 - u - v)
    return np.where(det == 0, np.nan, t), np.where(det == 0, -np.inf, weight)
