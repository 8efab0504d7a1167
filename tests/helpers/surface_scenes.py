"""Scenes of surfaces and media that share kernels, and a float64 oracle of what absorbs light along a ray.

`sampled` and `found` add specks of everything else far away, so that one set of kernels serves most of the
tests.  The oracle follows METHODS §6 with its own geometry: it sorts all crossings of a ray's *line*, from
behind its start, so that it also knows what a ray starts inside of.
"""

from dataclasses import replace

import numpy as np
import trimesh
from pictures import ball, box, camera_rays, gridded, homogeneous, picture, volume

import clvol
from clvol.scene.materials import (
    Bitmap,
    Conductor,
    Dielectric,
    Diffuse,
    Mask,
    RoughDielectric,
)
from clvol.scene.primitives import mesh_of
from clvol.scene.records import (
    ConstantEmitter,
    DirectionalEmitter,
    EnvmapEmitter,
    Mesh,
    PointEmitter,
    Shape,
    SpotEmitter,
)

SKY, DARK = ConstantEmitter((1.0,)), ConstantEmitter((0.0,))
SPECK = 1e-3
MOST_CROSSINGS = 8


def meshed(mesh, medium=None, **keywords):
    """A trimesh as a shape, without a surface unless one is named."""
    triangles = Mesh(np.array(mesh.vertices, np.float32), np.array(mesh.faces, np.int32))
    return Shape("mesh", np.eye(4), medium, mesh=triangles, **keywords)


def icosphere(centre=(0, 0, 0), radius=1.0, medium=None, level=1, **keywords):
    mesh = trimesh.creation.icosphere(level, radius)
    return meshed(mesh.apply_translation(centre), medium, **keywords)


def mesh_box(lower, upper, medium=None, **keywords):
    """A box as a mesh, which is a boundary where a cube would be a span."""
    return meshed(trimesh.creation.box(bounds=[lower, upper]), medium, **keywords)


def surfaced(shape, bsdf, **keywords):
    return replace(shape, bsdf=bsdf, **keywords)


def solid_grid(value, lower, upper, albedo=0.0, **keywords):
    """A heterogeneous medium that is the same everywhere within a box."""
    return gridded(volume(np.full((4, 4, 4), float(value)), lower, upper), albedo, **keywords)


def moved(shape, offset):
    """A shape elsewhere, with the grid inside it."""
    step, medium = clvol.translate(offset), shape.interior
    if medium is not None and hasattr(medium.sigma_t, "index_to_world"):
        sigma_t = replace(medium.sigma_t, index_to_world=step @ medium.sigma_t.index_to_world)
        shape = replace(shape, interior=replace(medium, sigma_t=sigma_t))
    return replace(shape, to_world=step @ shape.to_world)


CORNER = np.array([30.0, 31.0, 29.0])


def _surfaces(bsdfs):
    """A sphere and a box of each BSDF, and a lamp of each, far away and too small for any path to find."""
    shapes = []
    for number, (bsdf, emission) in enumerate([*((b, None) for b in bsdfs), (Diffuse((0.0,)), (0.0,))]):
        place = CORNER + 0.01 * number
        shapes.append(surfaced(ball(place, SPECK), bsdf, emission=emission))
        shapes.append(surfaced(mesh_box(place + 0.004, place + 0.004 + SPECK), bsdf, emission=emission))
    return shapes


def _media(grids):
    """A boundary and spans of either kind that overlap."""
    a, b = CORNER - 0.02, CORNER - 0.02 + SPECK
    return [
        mesh_box(a, b, homogeneous(1.0, 0.5)),
        box(a, b, homogeneous(1.0, 0.5)),
        ball((a + b) / 2, SPECK, homogeneous(1.0, 0.5)),
        *([box(a, b, solid_grid(1.0, a, b, 0.5))] if grids else []),
    ]


def _around():
    """One boundary of two specks, at opposite corners: a camera in between may be inside, and has to look."""
    pair = [trimesh.creation.box(bounds=[c, c + SPECK]) for c in (CORNER - 0.04, -CORNER)]
    return meshed(trimesh.util.concatenate(pair), homogeneous(1.0, 0.5))


HALF = Bitmap(np.full((2, 2, 3), 0.5, np.float32))
GLASS = Dielectric(1.5, 1.0)
SAMPLED = [
    *_surfaces([Diffuse(), GLASS, replace(GLASS, thin=True), Mask(Diffuse(), HALF)]),
    *_media(True),
    _around(),
]
FOUND = [
    *_surfaces([Diffuse(), GLASS, RoughDielectric(1.5, 1.0, "ggx"), Conductor(), Mask(Diffuse(), HALF)]),
    *_media(False),
]
UNLIT = (
    DirectionalEmitter((0.0,), (0.0, -1.0, 0.0)),
    PointEmitter((0.0,), (0.0, 90.0, 0.0)),
    SpotEmitter((0.0,), clvol.look_at((0, 80.0, 0), (1.0, 90.0, 0), (0, 0, 1))),
)
UNREACHED = 1_000_000


def view(shapes, lights, eye=(0.13, 0.21, -4.0), target=(0.05, 0.02, 0.0), fov=30.0, size=(4, 4), **more):
    return picture(shapes, lights, eye, target, fov, size, **{"max_depth": UNREACHED} | more)


def sampled(shapes, lights=(SKY,), **more):
    """A scene for next-event estimation; `lights` of any kind, the sky among them.

    That is a map: a uniform sky beside other lights would not be sampled.
    """
    return view([*shapes, *SAMPLED], (*map(_mapped, lights), *UNLIT), **more)


def _mapped(light):
    if not isinstance(light, ConstantEmitter):
        return light
    return EnvmapEmitter(np.tile(np.float32(light.radiance), (2, 4, 3 // len(light.radiance))), np.eye(4))


def found(shapes, lights=(SKY,), **more):
    """A scene for transmittance "none": a path runs into every light by itself."""
    return view([*shapes, *FOUND], lights, **more)


# -- the oracle --------------------------------------------------------------------------------------


def triangles_of(shape):
    mesh = mesh_of(shape)
    corners = mesh.vertices.astype(float) @ shape.to_world[:3, :3].T + shape.to_world[:3, 3]
    faces = mesh.faces if np.linalg.det(shape.to_world[:3, :3]) > 0 else mesh.faces[:, ::-1]
    return corners[faces]  # outside stays outside in a mirror


def crossings(shape, o, d):
    """Parameters (rays, k) of each line's crossings, inf where there are no more; and +1 inwards, -1 out."""
    if shape.kind == "sphere":
        inverse = np.linalg.inv(shape.to_world)
        p, v = o @ inverse[:3, :3].T + inverse[:3, 3], d @ inverse[:3, :3].T
        a, b, c = (v * v).sum(-1), (p * v).sum(-1), (p * p).sum(-1) - 1
        root = b * b - a * c
        half = np.sqrt(np.maximum(root, 0)) / a
        t = np.stack([-b / a - half, -b / a + half], -1)
        t[root <= 0] = np.inf
        sign = np.broadcast_to([1, -1], t.shape)
    else:
        t, sign = triangle_crossings(triangles_of(shape), o, d)
    return t, -sign if shape.flip_normals else sign


def triangle_crossings(corners, o, d):
    a, e1, e2 = corners[:, 0], corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]
    normal = np.cross(e1, e2)
    along = d @ normal.T  # (rays, triangles)
    q = o[:, None] - a
    with np.errstate(divide="ignore", invalid="ignore"):
        t = -(q * normal).sum(-1) / along
        p = q + t[..., None] * d[:, None]
        square = (normal * normal).sum(-1)
        u = (np.cross(p, e2) * normal).sum(-1) / square
        v = -(np.cross(p, e1) * normal).sum(-1) / square
        inside = (u >= 0) & (v >= 0) & (u + v <= 1)
    t = np.where(inside, t, np.inf)
    order = np.argsort(t, axis=1)[:, :MOST_CROSSINGS]
    return np.take_along_axis(t, order, 1), np.take_along_axis(np.where(along < 0, 1, -1), order, 1)


def extinction_of(medium):
    volume = medium.sigma_t
    value = volume.value[0] if hasattr(volume, "value") else volume.grid.values.flat[0]
    return float(value) * medium.scale[0]


def media_of(shapes):
    found = {id(m): m for s in shapes for m in (s.interior, s.exterior) if m is not None}
    return list(found.values())


def optical_depth(shapes, o, d):
    """Optical depth from o to infinity along rays (n, 3): inf where something opaque is in the way."""
    media = media_of(shapes)
    names = np.array([[(s.interior is m) * 1 - (s.exterior is m) * 1 for s in shapes] for m in media])
    everywhere = np.array(
        [[int(all(s.interior is not m or s.interior is s.exterior for s in shapes))] for m in media]
    )
    sigma = np.array([extinction_of(m) for m in media])[:, None]
    found = [crossings(s, o, d) for s in shapes]
    t, sign = (np.concatenate([f[n] for f in found], axis=1) for n in (0, 1))
    of = np.concatenate([np.full(f[0].shape[1], n) for n, f in enumerate(found)])
    order = np.argsort(t, axis=1)
    t, sign, of = np.take_along_axis(t, order, 1), np.take_along_axis(sign, order, 1), of[order]
    opaque = np.array([isinstance(s.bsdf, Diffuse) for s in shapes])
    inside, depth, last = np.zeros((len(o), len(shapes))), np.zeros(len(o)), np.zeros(len(o))
    blocked = np.zeros(len(o), bool)
    for k in range(t.shape[1] + 1):
        here = t[:, k] if k < t.shape[1] else np.full(len(o), np.inf)
        until = np.maximum(here, 0)
        rate = (sigma * np.maximum(everywhere + names @ inside.T, 0)).sum(0)
        with np.errstate(invalid="ignore"):
            depth += np.where(blocked | (rate == 0) | np.isinf(last), 0.0, rate * (until - last))
        last = until
        if k < t.shape[1]:
            met = np.isfinite(here)
            blocked |= met & (here > 0) & opaque[of[:, k]]
            inside[met, of[met, k]] = sign[met, k] > 0
    return np.where(blocked, np.inf, depth)


def seen_sky(scene, shapes, nodes=24):
    """The picture (h, w, 1) of a sky of radiance 1 through absorbing media and black solids."""
    o, d, w = camera_rays(scene, nodes)
    flat = d.reshape(-1, 3)
    start = scene.sensor.near_clip / (flat @ scene.sensor.to_world[:3, 2])
    moved_o = o + start[:, None] * flat
    arrives = np.exp(-optical_depth(shapes, moved_o, flat)).reshape(d.shape[:-1])
    return (arrives @ w)[..., None]
