"""Shapes: quadrics as they are, everything else as triangles, with normals to the side that pbrt's have."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from clvol.scene.lookup import find
from clvol.scene.mesh import RawMesh, build_mesh
from clvol.scene.pbrt.tokens import read_bytes
from clvol.scene.ply import read_ply
from clvol.scene.transforms import keeps_angles, scale, translate
from clvol.scene.vocabulary import did_you_mean, join_hints, listed

if TYPE_CHECKING:
    from collections.abc import Callable

    from clvol.scene.nodes import Node
    from clvol.scene.pbrt.context import Context
    from clvol.scene.pbrt.parameters import Parameters
    from clvol.scene.pbrt.statements import Thing
    from clvol.scene.records import Mesh

MOST_LEVELS = 8
_ROUND = 128
"""Segments round a sphere that is stretched, and twice those from pole to pole."""
_PATCH = 16
"""Rows and columns of squares in a bilinear patch that is not flat."""


class Shapes:
    """The geometry of a scene's shapes; meshes are read and built once for all their instances."""

    def __init__(self, context: Context) -> None:
        self.context = context
        self._raw: dict[int, RawMesh] = {}
        self._asked: dict[int, tuple[str, ...]] = {}  # of the parameters of each statement
        self._built: dict[tuple[int, bytes], tuple[Mesh, np.ndarray]] = {}
        self._placed: dict[int, RawMesh] = {}
        self._textured = False
        self._things: list[Thing] = []  # kept alive: their id() is a key

    def surface(self, thing: Thing, matrix: np.ndarray) -> str:
        """Of `textures.SURFACES`: which a shape is under `matrix`."""
        round_ = thing.type == "sphere" and keeps_angles(matrix)
        return thing.type if round_ or thing.type == "disk" else ""

    def node(self, thing: Thing, parameters: Parameters, matrix: np.ndarray, textured: bool) -> Node:
        """A shape under `matrix`, without what it is made of; `textured`: which has pictures on it."""
        self._textured = textured
        builder = _BUILDERS.get(thing.type)
        if builder is None:
            hint = join_hints(did_you_mean(thing.type, _BUILDERS), f"supported: {listed(_BUILDERS)}")
            parameters.refuse(f"the shape '{thing.type[:60]}'", hint=hint)
        return builder(self, thing, parameters, matrix)

    # -- quadrics ------------------------------------------------------------------------------------

    def sphere(self, thing: Thing, parameters: Parameters, matrix: np.ndarray) -> Node:
        """A whole sphere; where the transform stretches it a mesh."""
        radius = self._radius(parameters)
        whole = parameters.number("phimax", 360.0) >= 360
        low, high = parameters.number("zmin", -radius), parameters.number("zmax", radius)
        if not whole or min(low, high) > -radius or max(low, high) < radius:
            parameters.refuse("a part of a sphere", hint="leave out zmin, zmax and phimax")
        if keeps_angles(matrix):
            return self._quadric("sphere", thing, matrix @ scale(radius))
        self.context.say("a sphere that is stretched is taken as a mesh", thing.where)
        return self._mesh(thing, _unit_sphere(), matrix @ scale(radius))

    def disk(self, thing: Thing, parameters: Parameters, matrix: np.ndarray) -> Node:
        """A whole disk; its normal is +z, as Mitsuba's."""
        radius, height = self._radius(parameters), parameters.number("height", 0.0)
        if parameters.number("phimax", 360.0) < 360 or parameters.number("innerradius", 0.0) > 0:
            parameters.refuse("a part of a disk", hint="leave out innerradius and phimax")
        return self._quadric("disk", thing, matrix @ translate([0, 0, height]) @ scale([radius, radius, 1]))

    def cylinder(self, thing: Thing, parameters: Parameters, matrix: np.ndarray) -> Node:
        """An open cylinder, with normals outwards."""
        radius = self._radius(parameters)
        low, high = parameters.number("zmin", -1.0), parameters.number("zmax", 1.0)
        if parameters.number("phimax", 360.0) < 360:
            parameters.refuse("a part of a cylinder", hint="leave out phimax")
        if low == high:
            parameters.fail("zmin and zmax are the same")
        low, high = min(low, high), max(low, high)
        size = scale([radius, radius, high - low])
        return self._quadric("cylinder", thing, matrix @ translate([0, 0, low]) @ size)

    def _radius(self, parameters: Parameters) -> float:
        radius = parameters.number("radius", 1.0, 0.0)
        if radius == 0:
            parameters.fail("the radius is 0", parameters.place("radius"))
        return radius

    def _quadric(self, kind: str, thing: Thing, matrix: np.ndarray) -> Node:
        flip = True if thing.state.reverse else None
        return self.context.node("shape", kind, thing.where, to_world=matrix, flip_normals=flip)

    # -- meshes --------------------------------------------------------------------------------------

    def triangles(self, thing: Thing, parameters: Parameters, matrix: np.ndarray) -> Node:
        """Triangles from the file itself."""
        raw = self._once(thing, parameters, lambda: _indexed(parameters, 3))
        if self._textured and raw.uvs is None:
            raw = self._placed.setdefault(id(raw), _with_places(raw))
        return self._mesh(thing, raw, matrix)

    def bilinear(self, thing: Thing, parameters: Parameters, matrix: np.ndarray) -> Node:
        """Bilinear patches: two triangles where they are flat, else many."""

        def read() -> RawMesh:
            parameters.get("emissionfilename")
            raw, exact = _patches(_indexed(parameters, 4))
            if not exact:
                what = f"a bilinear patch that is bent is taken as {2 * _PATCH**2} triangles"
                self.context.say(what, thing.where)
            return raw

        return self._mesh(thing, self._once(thing, parameters, read), matrix)

    def ply(self, thing: Thing, parameters: Parameters, matrix: np.ndarray) -> Node:
        """A .ply file, or one packed by gzip."""
        if parameters.get("displacement") is not None:
            self.context.say("'displacement' of meshes is left out", parameters.place("displacement"))
        parameters.ignore("edgelength", "displacement.edgelength")
        name, where = parameters.string("filename", ""), parameters.place("filename")

        def read() -> RawMesh:
            path = find(name, self.context.folders, where)
            try:
                return read_ply(read_bytes(path, where))
            except (ValueError, IndexError, OverflowError) as error:
                parameters.fail(f"mesh '{path}': {error}", where)

        return self._mesh(thing, self._once(thing, parameters, read), matrix)

    def loop(self, thing: Thing, parameters: Parameters, matrix: np.ndarray) -> Node:
        """A control mesh, subdivided by Loop's rules."""
        levels = parameters.integer("levels", 3, 0, MOST_LEVELS)
        parameters.ignore("scheme")

        def read() -> RawMesh:
            import trimesh

            raw = _indexed(parameters, 3)
            if len(raw.faces) * 4**levels > 10**8:
                parameters.fail("it has too many triangles once it is subdivided", hint="give fewer levels")
            build_mesh(raw, thing.where, smooth=False)
            vertices, faces = trimesh.remesh.subdivide_loop(raw.vertices, raw.faces, levels)
            # all 0: worked out from the faces round each vertex
            return RawMesh(np.asarray(vertices), np.asarray(faces), np.zeros_like(vertices))

        what = "a subdivision surface is taken as the mesh that is subdivided, not its limit"
        self.context.say(what, thing.where)
        return self._mesh(thing, self._once(thing, parameters, read), matrix)

    def _once(self, thing: Thing, parameters: Parameters, read: Callable[[], RawMesh]) -> RawMesh:
        """What is read of a statement, once for all instances, whose parameters are known then."""
        if id(thing) not in self._raw:
            try:
                self._raw[id(thing)] = read()
            except ValueError as error:
                parameters.fail(str(error))
            self._things.append(thing)
            self._asked[id(thing)] = parameters.asked
        parameters.ignore(*self._asked[id(thing)])
        return self._raw[id(thing)]

    def _mesh(self, thing: Thing, raw: RawMesh, matrix: np.ndarray) -> Node:
        """Triangles in the world.  Under a transform that mirrors they are put there one by one."""
        mirrored = np.linalg.det(matrix[:3, :3]) < 0
        key = id(raw), matrix.tobytes() if mirrored else b""
        if key not in self._built:
            self._raw.setdefault(id(raw), raw)
            turned = _turned(raw, thing.state.reverse, matrix if mirrored else None)
            try:
                self._built[key] = build_mesh(turned, thing.where, turned.normals is not None)
            except ValueError as error:
                thing.parameters().fail(str(error))
        mesh, origin = self._built[key]
        to_world = (np.eye(4) if mirrored else matrix) @ translate(origin)
        return self.context.node("shape", "trianglemesh", thing.where, mesh=mesh, to_world=to_world)


_BUILDERS: dict[str, Callable[[Shapes, Thing, Parameters, np.ndarray], Node]] = {
    "sphere": Shapes.sphere,
    "disk": Shapes.disk,
    "cylinder": Shapes.cylinder,
    "trianglemesh": Shapes.triangles,
    "bilinearmesh": Shapes.bilinear,
    "plymesh": Shapes.ply,
    "loopsubdiv": Shapes.loop,
}


def _turned(raw: RawMesh, reverse: bool, matrix: np.ndarray | None) -> RawMesh:
    """The triangles with their normals to the side that pbrt's have; under `matrix`, which mirrors.

    That is the side of the vertices' normals where there are some; else that of the winding, which a mirror
    does not change.  `reverse`: the other one.
    """
    vertices, faces, normals = np.asarray(raw.vertices, np.float64), np.asarray(raw.faces), raw.normals
    mirrored = matrix is not None
    if matrix is not None:
        vertices = vertices @ matrix[:3, :3].T + matrix[:3, 3]
        normals = None if normals is None else normals @ np.linalg.inv(matrix[:3, :3])
    if normals is None or not normals.any():
        flipped = np.full(len(faces), reverse != mirrored)
    else:
        normals = -normals if reverse else normals
        a, b, c = (vertices[faces[:, n]] for n in range(3))
        means = normals[faces].sum(axis=1)
        flipped = (np.cross(b - a, c - a) * means).sum(axis=1) < 0
    if flipped.any():
        faces = np.where(flipped[:, None], faces[:, ::-1], faces)
    return RawMesh(vertices, faces, normals, raw.uvs, raw.without_uvs)


def _indexed(parameters: Parameters, corners: int) -> RawMesh:
    """Vertices P, N and uv, and faces of so many corners."""
    vertices = parameters.rows("P", "point3")
    if vertices is None:
        parameters.fail("'P' is missing")
    normals, uvs = parameters.rows("N", "normal3"), parameters.rows("uv", "point2")
    uvs = parameters.rows("st", "point2") if uvs is None else uvs
    parameters.ignore("S", "faceIndices")
    for name, values in (("N", normals), ("uv", uvs)):
        if values is not None and len(values) != len(vertices):
            parameters.fail(f"'{name}' has {len(values)} values for {len(vertices)} vertices")
    indices = parameters.integers("indices")
    if indices is None:
        if len(vertices) != corners:
            parameters.fail("'indices' are missing")
        indices = np.arange(corners)
    if not len(indices) or len(indices) % corners:
        parameters.fail(f"'indices' come in groups of {corners}, got {len(indices)}")
    if indices.min() < 0 or indices.max() >= len(vertices):
        wrong = indices.min() if indices.min() < 0 else indices.max()
        parameters.fail(f"'indices' name vertex {wrong} of {len(vertices)}", parameters.place("indices"))
    return RawMesh(vertices, indices.reshape(-1, corners), normals, uvs)


def _with_places(raw: RawMesh) -> RawMesh:
    """Triangles that share no vertices, each with pbrt's texture coordinates where none are given."""
    faces = np.asarray(raw.faces)
    vertices, normals = (
        None if values is None else np.asarray(values)[faces].reshape(-1, 3)
        for values in (raw.vertices, raw.normals)
    )
    assert vertices is not None
    uvs = np.tile([[0.0, 0], [1, 0], [1, 1]], (len(faces), 1))
    return RawMesh(vertices, np.arange(faces.size).reshape(faces.shape), normals, uvs)


def _patches(raw: RawMesh) -> tuple[RawMesh, bool]:
    """Triangles of bilinear patches (u, v) = 00, 10, 01, 11, and whether they are exactly these."""
    quads = raw.faces
    p = np.asarray(raw.vertices)[quads]
    twist = np.linalg.norm(p[:, 0] - p[:, 1] - p[:, 2] + p[:, 3], axis=1)
    size = np.linalg.norm(p.max(axis=1) - p.min(axis=1), axis=1)
    if (twist <= 1e-6 * size).all():
        uvs = raw.uvs
        if uvs is None and len(np.unique(quads)) == quads.size:
            uvs = np.zeros((len(raw.vertices), 2))
            uvs[quads.reshape(-1)] = np.tile([[0, 0], [1, 0], [0, 1], [1, 1]], (len(quads), 1))
        faces = np.concatenate([quads[:, [0, 1, 3]], quads[:, [0, 3, 2]]])
        return RawMesh(raw.vertices, faces, raw.normals, uvs), True
    side = np.linspace(0, 1, _PATCH + 1)
    v, u = (one.reshape(-1, 1) for one in np.meshgrid(side, side, indexing="ij"))
    weights = np.concatenate([(1 - u) * (1 - v), u * (1 - v), (1 - u) * v, u * v], axis=1)
    at = np.arange((_PATCH + 1) ** 2).reshape(_PATCH + 1, _PATCH + 1)
    a, b, c, d = (one.reshape(-1) for one in (at[:-1, :-1], at[:-1, 1:], at[1:, :-1], at[1:, 1:]))
    local = np.concatenate([np.stack([a, b, d], axis=1), np.stack([a, d, c], axis=1)])
    first = len(weights) * np.arange(len(quads))
    faces = (local[None] + first[:, None, None]).reshape(-1, 3)

    def spread(values: np.ndarray | None) -> np.ndarray | None:
        return (
            None if values is None else (weights @ values[quads]).reshape(len(faces) and -1, values.shape[1])
        )

    vertices = spread(np.asarray(raw.vertices))
    assert vertices is not None
    uvs = spread(raw.uvs)
    uvs = np.tile(np.concatenate([u, v], axis=1), (len(quads), 1)) if uvs is None else uvs
    return RawMesh(vertices, faces, spread(raw.normals), uvs), False


_SPHERE: list[RawMesh] = []


def _unit_sphere() -> RawMesh:
    """The unit sphere as triangles, faces outwards, with pbrt's (u, v)."""
    if not _SPHERE:
        theta, phi = np.linspace(0, np.pi, _ROUND + 1), np.linspace(0, 2 * np.pi, 2 * _ROUND + 1)
        t, f = (one.reshape(-1) for one in np.meshgrid(theta, phi, indexing="ij"))
        points = np.stack([np.sin(t) * np.cos(f), np.sin(t) * np.sin(f), np.cos(t)], axis=1)
        points[np.isclose(f, 2 * np.pi)] = points[np.isclose(f, 0)]  # closed to the last bit
        points[np.isclose(t, 0)], points[np.isclose(t, np.pi)] = (0, 0, 1), (0, 0, -1)
        at = np.arange(len(points)).reshape(_ROUND + 1, -1)
        a, b, c, d = (one.reshape(-1) for one in (at[:-1, :-1], at[:-1, 1:], at[1:, :-1], at[1:, 1:]))
        upper, lower = np.stack([a, c, d], axis=1), np.stack([a, d, b], axis=1)
        columns = 2 * _ROUND
        faces = np.concatenate([upper[:-columns], lower[columns:]])  # none without an area at the poles
        uvs = np.stack([f / (2 * np.pi), 1 - t / np.pi], axis=1)
        _SPHERE.append(RawMesh(points, faces, points.copy(), uvs))
    return _SPHERE[0]
