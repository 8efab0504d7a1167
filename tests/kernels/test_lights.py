"""Lights: every sampler against its density, and what arrives at a point against closed forms.

Device functions run on records of their own making, without a renderer.  Points are drawn by the renderer's
random numbers at fixed keys; each statistical test has a false-alarm rate of 1e-4 over all its comparisons.
Spot lights are compared with numbers that Mitsuba 3.9 gave.
"""

from types import SimpleNamespace

import numpy as np
import pyopencl as cl
import pytest
from sampling import uniforms
from stat_tests import FALSE_ALARM, chi2_p_value, largest_z, sidak, z_score

from clvol import layout, rotate, scale, translate
from clvol.device import programs
from clvol.device.launch import run_kernel
from clvol.scene.records import (
    ConstantEmitter,
    DirectionalEmitter,
    Film,
    Integrator,
    Mesh,
    Perspective,
    PointEmitter,
    Scene,
    Shape,
    SpotEmitter,
)
from clvol.tables import lights

DRAWS = 1 << 18

PRESENT = (
    "CONSTANT",
    "DIRECTIONAL",
    "POINT",
    "SPOT",
    "AREA",
    "AREA_MESH",
    "AREA_SPHERE",
    "AREA_DISK",
    "TRIANGLES",
    "QUADRICS",
    "SHADING_NORMALS",
)
DEFINES = {"NEE": 1, "SPECTRUM": 3, "EXTINCTION": 1, "ONE_CHANNEL_PER_PATH": 0, "BVH_STACK": 1}
DEFINES |= {"LIGHT_CHOICE": 0, "LIGHT_CACHE": 0}
ABSENT = ("ENVMAP", "SUN", "PROJECTOR", "VERTEX_UVS", "AREA_TEXTURE", "SPOT_TEXTURE")

BUFFERS = {
    "render": "Render",
    "emitters": "Emitter",
    "shapes": "Shape",
    "quadrics": "Quadric",
    "faces": "uint",
    "vertices": "float",
    "normals": "float",
    "light_faces": "uint",
    "light_cdf": "float",
}

KERNELS = (
    """
#define ARGUMENTS """
    + ", ".join(f"__global const {kind} *{name}_" for name, kind in BUFFERS.items())
    + """
#define SCENE const Scene scene_ = {"""
    + ", ".join(f".{name} = {name}_" for name in BUFFERS)
    + """}; const Scene *scene = &scene_; const uint i = get_global_id(0);

/* in: the point; out: direction, distance, value, pdf */
__kernel void sample_kernel(ARGUMENTS, __global const float *in, __global float *out)
{
    SCENE
"""
    + uniforms("choice", "u", "v")
    + """
    const LightSample light = sample_light(scene, vload3(0, in), choice, u, v);
    vstore3(light.direction, 0, out + 8 * i);
    out[8 * i + 3] = light.distance;
    vstore3(light.value, 0, out + 8 * i + 4);
    out[8 * i + 7] = light.pdf;
}

/* in: the point and the normal there; out: irradiance by 64 samples */
__kernel void arrive_kernel(ARGUMENTS, __global const float *in, __global float *out)
{
    SCENE
    float3 sum = 0.0f;
    for (uint n = 0; n < 64; ++n) {
        const uint4 k = philox4x32((uint4)(i, n, 1u, 0u), (uint2)(11u, 12u));
        const LightSample light = sample_light(scene, vload3(0, in), uniform_below_one(k.x),
                                               uniform_below_one(k.y), uniform_below_one(k.z));
        sum += light.value * max_of(dot(vload3(1, in), light.direction), 0.0f);
    }
    vstore3(sum / 64.0f, i, out);
}

/* in: from, direction, t, u, v, primitive; out: point, normal, radiance, pdf */
__kernel void look_kernel(ARGUMENTS, __global const float *in, __global float *out)
{
    SCENE
    in += 10 * i, out += 10 * i;
    const Ray ray = {vload3(0, in), vload3(1, in)};
    const Hit hit = {in[6], in[7], in[8], (uint)in[9]};
    const Surface surface = hit_surface(scene, ray, &hit);
    vstore3(surface.p, 0, out);
    vstore3(surface.ng, 1, out);
    vstore3(area_radiance(scene, &surface, ray.d), 2, out);
    out[9] = area_pdf(scene, &surface, ray.o, ray.d, hit.t);
}

/* in: choice; out: number of the light, what is left of the choice */
__kernel void choose_kernel(ARGUMENTS, __global const float *in, __global float *out)
{
    SCENE
    float choice = in[i];
    out[2 * i] = (float)choose_by_table(scene, &choice);
    out[2 * i + 1] = choice;
}
"""
)


def source(present=PRESENT, kernels=KERNELS):
    """One unit with every kind of light.  No ray is traced: a Hit is all that is needed of the tree."""
    macros = {f"CLVOL_{name}": value for name, value in DEFINES.items()}
    macros |= {f"CLVOL_HAS_{name}": int(name in present) for name in (*PRESENT, *ABSENT)}
    macros["CLVOL_HAS_SURFACES"] = macros["CLVOL_HAS_AREA"]
    headers = "".join(f'#include "{name}.h"\n' for name in ("core/random", "emitter/area", "emitter/emitter"))
    return programs.expand(headers + kernels, macros, {})


def rows(matrix):
    return matrix[:3].astype(np.float32).reshape(12)


class World:
    """Lights and shining shapes on the device; positions are relative to `centre`."""

    def __init__(self, device, shapes=(), emitters=(), centre=(0.0, 0.0, 0.0), radius=10.0):
        self.device, self.shapes, self.centre = device, shapes, np.asarray(centre, float)
        self.place_triangles()
        film, sensor = Film(4, 4), Perspective(np.eye(4), 40.0)
        scene = Scene(sensor, film, Integrator(), tuple(shapes), tuple(emitters))
        self.table = lights.light_table(scene, self.centre, radius, self)
        records = self.shape_records()
        render = np.zeros(1, layout.RENDER)
        kinds = self.table.emitters["kind"]
        sky_apart = len(kinds) > 1 and kinds[-1] == layout.enum("EMITTER", "constant")
        render["emitters"], render["triangles"] = len(kinds) - sky_apart, len(self.faces)
        quadrics = np.zeros(len(shapes), layout.QUADRIC)
        quadrics["shape"] = np.arange(len(shapes))
        self.buffers = [
            render,
            self.table.emitters,
            records,
            quadrics,
            self.faces,
            self.vertices,
            self.normals,
            self.table.faces,
            self.table.cdf,
        ]

    def place_triangles(self):
        vertices, normals, faces, first = [], [], [], 0
        for number, shape in enumerate(self.shapes):
            if shape.mesh is not None:
                v = shape.mesh.vertices @ shape.to_world[:3, :3].T + (shape.to_world[:3, 3] - self.centre)
                n = v * 0 if shape.mesh.normals is None else shape.mesh.normals
                vertices.append(v)
                normals.append(n @ np.linalg.inv(shape.to_world[:3, :3]))
                shape_column = np.full((len(shape.mesh.faces), 1), number)
                faces.append(np.hstack([shape.mesh.faces + first, shape_column]))
                first += len(v)
        self.vertices = np.concatenate([np.zeros((0, 3)), *vertices]).astype(np.float32)
        self.normals = np.concatenate([np.zeros((0, 3)), *normals]).astype(np.float32)
        self.faces = np.concatenate([np.zeros((0, 4)), *faces]).astype(np.uint32)

    def shape_records(self):
        records = np.zeros(max(len(self.shapes), 1), layout.SHAPE)
        for record, shape, emitter in zip(records, self.shapes, self.table.of_shape, strict=False):
            record["kind"] = layout.enum("SURFACE", shape.kind)
            record["flip"], record["emitter"] = shape.flip_normals, emitter
            record["normals"] = shape.mesh is not None and shape.mesh.normals is not None
            to_world = shape.to_world.copy()
            to_world[:3, 3] -= self.centre
            record["world_from_local"] = rows(to_world)
            record["local_from_world"] = rows(np.linalg.inv(to_world))
        return records

    def run(self, name, count, inputs, columns):
        """Output (count, columns), float64, of one kernel."""
        kernel = cl.Kernel(programs.build(self.device, source(), "lights"), f"{name}_kernel")
        out = np.zeros((count, columns), np.float32)
        arrays = [a if a.size else np.zeros(64, np.uint8) for a in self.buffers]
        arrays.append(np.ascontiguousarray(inputs, np.float32))
        run_kernel(self.device, kernel, count, [], arrays, [out], group=1)
        return out.astype(float)

    def sample(self, point, draws=DRAWS):
        """Directions, distances, values and densities of `draws` samples seen from a world point."""
        out = self.run("sample", draws, np.asarray(point, float) - self.centre, 8)
        return SimpleNamespace(direction=out[:, :3], distance=out[:, 3], value=out[:, 4:7], pdf=out[:, 7])

    def look(self, point, direction, t, u=0.0, v=0.0, primitive=0):
        """Surface points, normals, radiances and densities that rays from a world point meet."""
        start = np.broadcast_to(np.asarray(point, float) - self.centre, direction.shape)
        scalars = [np.broadcast_to(a, len(direction))[:, None] for a in (t, u, v, primitive)]
        out = self.run("look", len(direction), np.hstack([start, direction, *scalars]), 10)
        return SimpleNamespace(p=out[:, :3], n=out[:, 3:6], radiance=out[:, 6:9], pdf=out[:, 9])


def shape(kind, to_world, emission=(1.0,), flip=False, mesh=None):
    return Shape(kind, to_world, emission=emission, flip_normals=flip, mesh=mesh)


def patches(normals=False):
    """Five triangles of very different sizes, one of them of none, not in a plane.

    Two faces are wound the other way, where `normals` do not overrule it.
    """
    vertices = np.array(
        [[-1, -1, 0], [1, -1, 0.2], [1, 1, 0], [-1, 1, 0.3], [2.5, 0, 0.1], [1.01, 1, 0.2], [-1.1, 0, 0.5]]
    )
    faces = np.array([[0, 1, 2], [0, 3, 2], [1, 4, 2], [2, 2, 3], [2, 5, 4]], np.int32)
    n = vertices * 0 + [0.1, 0.0, 1.0]
    n = (n / np.linalg.norm(n, axis=1)[:, None]).astype(np.float32)
    return Mesh(vertices.astype(np.float32), faces, n if normals else None)


TURN = rotate((1, 2, 3), 50.0)
PLACE = translate((0.3, -0.2, 0.4)) @ TURN
LIGHTS = {
    "sphere": shape("sphere", PLACE @ scale(0.7)),
    "flipped sphere": shape("sphere", PLACE @ scale(0.7), flip=True),
    "ellipse": shape(
        "disk", PLACE @ scale((0.5, 1.3, 2.0)) @ rotate((1, 0.5, 0.2), 40.0)
    ),  # its axis is skew
    "flipped disk": shape("disk", PLACE @ scale((0.8, 0.8, -1.0)), flip=True),
    "cylinder": shape("cylinder", PLACE @ scale((0.4, 0.4, 1.7))),
    "flipped cylinder": shape("cylinder", PLACE @ scale((0.4, 0.4, 1.7)), flip=True),
    "mesh": shape("mesh", PLACE, mesh=patches()),
    "smooth mesh": shape("mesh", PLACE, mesh=patches(True)),
    "flipped smooth mesh": shape("mesh", PLACE, flip=True, mesh=patches(True)),
}
FILL = DirectionalEmitter((0.05,), (0.0, 0.0, -1.0))  # a second light, so that every density carries a choice
FROM = {  # in the light's own space
    "before": (0.2, 0.1, 3.0),
    "behind": (0.1, -0.3, -2.0),
    "beside": (3.0, 0.4, 0.02),
    "close": (0.05, 1.4, 0.3),
    "inside": (0.1, 0.2, 0.3),
    "far": (300.0, 100.0, 800.0),
}


def world_point(light, name):
    return (light.to_world @ [*FROM[name], 1.0])[:3]


@pytest.fixture(scope="module", params=LIGHTS, ids=lambda name: name.replace(" ", "-"))
def lit(request, device):
    """A light of unit radiance in the dark but for a weak light far away, and its world."""
    return LIGHTS[request.param], World(device, [LIGHTS[request.param]], [FILL], centre=(0.2, 0.1, 0.0))


def area_samples(samples):
    """The samples of the light that is not infinitely far away."""
    near = np.isfinite(samples.distance)
    return SimpleNamespace(**{name: array[near] for name, array in vars(samples).items()})


def cone(light, point):
    """Axis, distance and 1 − cos of half the angle under which a sphere is seen, in float64."""
    to = light.to_world[:3, 3] - point
    distance = np.linalg.norm(to)
    sine2 = (np.linalg.norm(light.to_world[:3, 0]) / distance) ** 2
    return to / distance, distance, sine2 / (1 + np.sqrt(max(1 - sine2, 0)))


def sampled_as_cone(light, point):
    outside = np.linalg.norm(np.linalg.solve(light.to_world, [*point, 1.0])[:3]) > 1
    return light.kind == "sphere" and not light.flip_normals and outside


def barycentric(world, points):
    """Triangle, u and v of points on a mesh: those of the nearest plane whose triangle they are in."""
    best = np.full(len(points), np.inf)
    found = np.zeros((3, len(points)))
    for number, (a, b, c) in enumerate(world.vertices[world.faces[:, :3]].astype(float)):
        edges = np.stack([b - a, c - a], 1)
        if np.linalg.matrix_rank(edges) < 2:
            continue
        u, v = np.linalg.pinv(edges) @ (points - a).T
        outside = np.maximum(np.maximum(-u, -v), u + v - 1).clip(0)
        miss = np.linalg.norm(a + np.stack([u, v], 1) @ edges.T - points, axis=1) + outside
        better = miss < best
        best[better] = miss[better]
        found[:, better] = np.stack([np.full(len(points), number), u, v])[:, better]
    assert best.max() < 1e-3
    return found[0].astype(int), found[1], found[2]


def place_in_unit_square(light, world, point, samples):
    """Where samples lie, in numbers that should be uniform, (2, n), and u, v, primitive of a hit there."""
    points = point - world.centre + samples.direction * samples.distance[:, None]
    local = np.linalg.solve(light.to_world, np.c_[points + world.centre, np.ones(len(points))].T)[:3]
    turn = np.arctan2(local[1], local[0]) / (2 * np.pi) % 1.0
    primitive = np.full(len(points), len(world.faces))
    if light.kind == "mesh":
        number, u, v = barycentric(world, points)
        corners = world.vertices[world.faces[:, :3]].astype(float)
        areas = np.linalg.norm(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1)
        share = areas / areas.sum()
        first = np.cumsum(share) - share
        s = np.clip(u + v, 1e-9, 1)
        return np.stack([first[number] + share[number] * np.clip(s**2, 0, 0.999999), v / s]), (u, v, number)
    if sampled_as_cone(light, point):
        axis, _, one_minus_cos = cone(light, point)
        u = np.linalg.norm(samples.direction - axis, axis=1) ** 2 / 2 / one_minus_cos
        s = np.cross(axis, [1.0, 0.3, 0.2])
        s /= np.linalg.norm(s)
        x, y = samples.direction @ s, samples.direction @ np.cross(axis, s)
        return np.stack([u, np.arctan2(y, x) / (2 * np.pi) % 1.0]), (0.0, 0.0, primitive)
    height = {"sphere": (1 - local[2]) / 2, "cylinder": local[2], "disk": local[0] ** 2 + local[1] ** 2}
    return np.stack([height[light.kind], turn]), (0.0, 0.0, primitive)


@pytest.mark.parametrize("place", FROM)
def test_points_of_lights_are_drawn_by_their_density(lit, place):
    """In the density that is said, which `area_pdf` repeats for a hit there.

    And the side that emits is the one that `hit_surface` calls the front.
    """
    light, world = lit
    point = world_point(light, place)
    samples = area_samples(world.sample(point, DRAWS))
    square, (u, v, primitive) = place_in_unit_square(light, world, point, samples)
    cells = np.clip((square * [[12], [16]]).astype(int), 0, [[11], [15]])
    observed = np.bincount(cells[0] * 16 + cells[1], minlength=192)
    p_value = chi2_p_value(observed, np.full(192, len(samples.pdf) / 192))
    assert p_value > sidak(FALSE_ALARM, len(FROM) * len(LIGHTS)), p_value

    seen = world.look(point, samples.direction, samples.distance, u, v, primitive)
    towards = point - world.centre - seen.p
    facing = (seen.n * towards).sum(1) / np.linalg.norm(towards, axis=1)
    clear = np.abs(facing) > 1e-3
    if light.kind == "mesh":  # points as near an edge as single precision puts them may be the neighbour's
        clear &= np.minimum(np.minimum(u, v), 1 - u - v) > 1e-7 * samples.distance
    front = facing > 0
    assert (front == (seen.radiance[:, 0] > 0))[clear].all()
    assert (front == (samples.value[:, 0] > 0))[clear].all()
    assert (front == (samples.pdf > 0))[clear].all()
    if light.kind == "mesh":  # the triangle beside an edge is a guess
        clear &= np.minimum(np.minimum(u, v), 1 - u - v) > 0.01
    both = front & clear & (np.abs(facing) > 0.02)
    assert np.allclose(seen.pdf[both], samples.pdf[both], rtol=5e-3 if place == "far" else 5e-4)
    assert np.allclose(samples.value[both, 0] * samples.pdf[both], 1.0, rtol=1e-5)
    number = world.table.of_shape[0]
    select = float(world.table.emitters["select_pdf"][number])
    if sampled_as_cone(light, point):
        expected = select / (2 * np.pi * cone(light, point)[2])
    else:
        distance2 = (towards**2).sum(1)
        expected = (select * distance2 / (float(world.table.emitters["area"][number]) * np.abs(facing)))[both]
    assert np.allclose(seen.pdf[both], expected, rtol=2e-3)


def test_a_wrong_density_is_caught(device):
    """The χ² test sees draws that are uniform in the radius of a disk rather than in its area."""
    light = LIGHTS["ellipse"]
    world = World(device, [light])
    point = world_point(light, "before")
    square, _ = place_in_unit_square(light, world, point, world.sample(point))
    cells = (square[0].clip(0, 0.999) * 12).astype(int)
    assert chi2_p_value(np.bincount(cells, minlength=12), np.full(12, DRAWS / 12)) > FALSE_ALARM
    edges = np.sqrt(np.arange(13) / 12)
    assert chi2_p_value(np.bincount(cells, minlength=12), DRAWS * np.diff(edges)) < 1e-9


ALONE = (
    "CONSTANT",
    "SPOT",
    "AREA_MESH AREA TRIANGLES",
    "AREA_SPHERE AREA QUADRICS",
    "AREA_DISK AREA QUADRICS TRIANGLES",
    "AREA QUADRICS TRIANGLES SHADING_NORMALS",
)


@pytest.mark.parametrize("present", ALONE)
def test_each_kind_of_light_builds_without_the_others(device, present):
    kernel = """
    __kernel void probe(__global float *out)
    {
        Scene scene; /* it is not run */
        LightSample light = sample_light(&scene, (float3)(0.0f), 0.5f, 0.5f, 0.5f);
    #if CLVOL_HAS_AREA
        Surface surface;
        light.value += area_radiance(&scene, &surface, light.direction);
        light.pdf += area_pdf(&scene, &surface, light.value, light.direction, 1.0f);
    #endif
        vstore3(light.value * light.pdf, 0, out);
    }"""
    text = source(present.split(), kernel)
    programs.build(device, text, "lights")


# -- what arrives at a point -------------------------------------------------------------------------


def polygon_irradiance(corners, point, normal):
    """Lambert's formula: irradiance of a point from a polygon of unit radiance, all above its horizon."""
    r = corners - point
    r /= np.linalg.norm(r, axis=1)[:, None]
    following = np.roll(r, -1, axis=0)
    edge = np.cross(r, following)
    sine = np.linalg.norm(edge, axis=1)
    angle = np.arctan2(sine, (r * following).sum(1))
    return abs(((angle / np.maximum(sine, 1e-300))[:, None] * edge).sum(0) @ normal) / 2


def rectangle_mesh():
    corners = np.array([[-1, -1, 0], [1, -1, 0], [1, 1, 0], [-1, 1, 0]], np.float32)
    return Mesh(corners, np.array([[0, 1, 2], [0, 2, 3]], np.int32))


def rim(to_world, count=4000):
    turn = 2 * np.pi * np.arange(count) / count
    return (to_world @ np.array([np.cos(turn), np.sin(turn), 0 * turn, 0 * turn + 1]))[:3].T


def cylinder_irradiance(to_world, point, normal):
    """By quadrature over the surface (no more than its visible half counts)."""
    turn = 2 * np.pi * (np.arange(4000) + 0.5) / 4000
    z = (np.arange(200) + 0.5) / 200
    turn, z = (a.ravel() for a in np.meshgrid(turn, z))
    local = np.stack([np.cos(turn), np.sin(turn), z])
    p = (to_world[:3, :3] @ local).T + to_world[:3, 3]
    n = (to_world[:3, :3] @ (local * [[1], [1], [0]])).T
    n /= np.linalg.norm(n, axis=1)[:, None]
    to = p - point
    square = (to**2).sum(1)
    integrand = (to @ normal).clip(0) * -(to * n).sum(1).clip(None, 0) / square**2
    return lights.quadric_area(shape("cylinder", to_world)) * integrand.mean()


UP = np.array([0.0, 0.0, 1.0])
ABOVE = translate((0.4, 0.3, 2.0)) @ rotate((1, 0.3, 0), 160.0)
SKEW = ABOVE @ scale((0.5, 1.3, 1.0))
LYING = translate((0.5, -0.3, 1.5)) @ rotate((0, 1, 0.2), 70.0) @ scale((0.4, 0.4, 1.2))


def sphere_over(radius, distance, polar=0.6):
    """A sphere all above the horizon of the origin, and the irradiance there of unit radiance."""
    at = distance * np.array([np.sin(polar), 0.0, np.cos(polar)])
    irradiance = np.pi * (radius / distance) ** 2 * np.cos(polar)
    return shape("sphere", translate(at) @ scale(radius)), irradiance


IRRADIANCE = {
    "sphere": sphere_over(0.5, 2.0),
    "near sphere": sphere_over(1.0, 1.02, 0.0),
    "far sphere": sphere_over(0.01, 50.0, 1.2),
    "sphere round the point": (
        shape("sphere", translate((0.2, 0.1, 0.3)) @ scale(2.0), flip=True),
        np.pi,
    ),
    "rectangle": (
        shape("mesh", SKEW, mesh=rectangle_mesh()),
        polygon_irradiance((SKEW @ np.c_[rectangle_mesh().vertices, np.ones(4)].T)[:3].T, np.zeros(3), UP),
    ),
    "ellipse": (shape("disk", SKEW), polygon_irradiance(rim(SKEW), np.zeros(3), UP)),
    "disk": (shape("disk", translate((0, 0, 2)), flip=True), np.pi / 5),
    "cylinder": (shape("cylinder", LYING), cylinder_irradiance(LYING, np.zeros(3), UP)),
}


def estimate(world, draws=1 << 22):
    """Mean and variance of the mean of the irradiance at the scene's centre, per channel."""
    sums = world.run("arrive", draws // 64, np.append(np.zeros(3), UP), 3)
    return sums.mean(0), sums.var(0) / len(sums)


@pytest.mark.parametrize("name", IRRADIANCE)
def test_lights_send_what_closed_forms_say(device, name):
    light, expected = IRRADIANCE[name]
    mean, variance = estimate(World(device, [light]))
    assert np.sqrt(variance[0]) < 0.001 * expected  # a bias of 0.5 % cannot hide
    z = abs(z_score(mean[0], variance[0] + (1e-5 * expected) ** 2, expected))
    assert z < largest_z(len(IRRADIANCE)), (mean[0], expected)


def test_a_scene_of_many_lights_sums_them(device):
    """One of each kind in three colours: the choice among them is made up for, and a uniform sky left out."""
    colours = np.random.default_rng(1).uniform(0.1, 2.0, (4, 3))
    names = ("sphere", "rectangle", "ellipse", "cylinder")
    shapes, expected = [], np.zeros(3)
    for name, colour in zip(names, colours, strict=True):
        light, irradiance = IRRADIANCE[name]
        shapes.append(shape(light.kind, light.to_world, tuple(colour), light.flip_normals, light.mesh))
        expected += irradiance * colour
    spot_to_world = translate((0, 0, 3)) @ rotate((1, 0, 0), 180.0 + 12.0)
    emitters = [
        PointEmitter((0.3, 1.0, 2.0), (0.0, 1.0, 2.0)),
        DirectionalEmitter((0.5, 0.2, 0.1), (0.0, 0.6, -0.8)),
        SpotEmitter((9.0, 4.0, 1.0), spot_to_world, 20.0, 8.0),
        ConstantEmitter((0.1, 0.2, 0.3)),
    ]
    expected += np.array([0.3, 1.0, 2.0]) * 2 / 5**1.5
    expected += np.array([0.5, 0.2, 0.1]) * 0.8
    expected += np.array([9.0, 4.0, 1.0]) / 9 * (20 - 12) / (20 - 8)
    centre = np.array([1e6, -2e6, 3e6])  # what the device sees does not depend on where the scene is
    moved = [
        Shape(
            s.kind,
            translate(centre) @ s.to_world,
            emission=s.emission,
            flip_normals=s.flip_normals,
            mesh=s.mesh,
        )
        for s in shapes
    ]
    emitters[0] = PointEmitter(emitters[0].intensity, tuple(centre + emitters[0].position))
    emitters[2] = SpotEmitter(emitters[2].intensity, translate(centre) @ spot_to_world, 20.0, 8.0)
    world = World(device, moved, emitters, centre, radius=1.0)
    assert world.table.emitters["kind"][-1] == layout.enum("EMITTER", "constant")
    mean, variance = estimate(world, 1 << 23)
    assert (np.sqrt(variance) < 0.001 * expected).all()
    assert (np.abs(z_score(mean, variance, expected)) < largest_z(3)).all(), (mean, expected)


@pytest.mark.parametrize(("radius", "distance"), [(1.0, 1.772453850905516e5), (1e-6, 0.5), (1e3, 1e3 + 0.01)])
def test_tiny_far_and_huge_spheres_have_their_solid_angle(device, radius, distance):
    """The first subtends 1e-10 sr; none of it is lost to rounding, nor in the density of a hit."""
    light = shape("sphere", translate((0, 0, distance)) @ scale(radius))
    world = World(device, [light], centre=(0, 0, 0))
    samples = world.sample((0, 0, 0), 4096)
    solid_angle = 2 * np.pi * cone(light, np.zeros(3))[2]
    assert np.allclose(samples.value[:, 0] * samples.pdf, 1.0, rtol=1e-6)
    # the third: float32 knows its distance from the surface to 6e-5 / 0.01
    assert np.allclose(samples.value[:, 0], solid_angle, rtol=1e-6 if radius < 10 else 1e-4)
    assert (samples.distance > 0).all()
    off = np.linalg.norm(np.cross(samples.direction, [0, 0, 1.0]), axis=1)
    assert off.max() <= radius / distance * (1 + 1e-4)
    assert 0.48 < (off**2).mean() / (radius / distance) ** 2 < 0.52 or radius > 10
    seen = world.look((0, 0, 0), samples.direction, samples.distance)
    clear = off < 0.9 * radius / distance
    assert np.allclose(seen.pdf[clear], samples.pdf[clear], rtol=1e-6)


# -- spot lights -------------------------------------------------------------------------------------

SPOTS = {  # cutoff, beam (degrees): intensity of Mitsuba 3.9 at shares of the cutoff
    (20.0, 15.0): "1 1 1 1 1 .959999 .800002 .400003 .04 0 0",
    (60.0, 10.0): "1 1 .840001 .6 .36 .288 .24 .12 .012 0 0",
    (120.0, 30.0): "1 1 .933334 .666667 .4 .32 .266667 .133333 .013333 0 0",
    (45.0, 45.0): "1 1 1 1 1 1 1 1 1 0 0",
}
SHARES = np.array([0, 0.1, 0.3, 0.5, 0.7, 0.76, 0.8, 0.9, 0.99, 1.01, 1.2])


def spot_intensity(device, cutoff, beam, angles):
    """Intensity at angles (radians) off the axis of a turned spot of intensity 2, through `sample_light`."""
    world = World(device, emitters=[SpotEmitter((2.0,), PLACE, cutoff, beam)])
    values = []
    for angle in angles:
        out = 2.5 * np.array([np.sin(angle) * 0.6, np.sin(angle) * 0.8, np.cos(angle)])
        sample = world.sample((PLACE @ [*out, 1.0])[:3], 1)
        assert sample.pdf[0] == 0 and abs(sample.distance[0] - 2.5) < 1e-5
        values.append(sample.value[0, 0] * 2.5**2 / 2)
    return np.array(values)


@pytest.mark.parametrize(("cutoff", "beam"), SPOTS)
def test_spots_fall_off_as_mitsubas(device, cutoff, beam):
    frozen = np.array(SPOTS[cutoff, beam].split(), float)
    assert np.abs(spot_intensity(device, cutoff, beam, np.radians(SHARES * cutoff)) - frozen).max() < 2e-5


def test_narrow_spots_keep_their_profile(device):
    angles = np.radians([0.0, 0.001, 0.0022, 0.005, 0.008, 0.0105])
    expected = [1, 1, (10 - 2.2) / 8, 5 / 8, 2 / 8, 0]
    # the turned axis and the direction are rounded to some 1e-7 of the 1.4e-4 between beam and cutoff
    assert np.abs(spot_intensity(device, 0.01, 0.002, angles) - expected).max() < 5e-3


@pytest.mark.parametrize(("cutoff", "beam"), [*SPOTS, (0.01, 0.002), (20.0, 30.0)])
def test_a_spots_power_is_the_integral_of_its_fall_off(cutoff, beam):
    c, b = np.radians(cutoff), np.radians(min(beam, cutoff))
    angle = (np.arange(200_000) + 0.5) / 200_000 * c
    fall_off = ((c - angle) / max(c - b, 1e-30)).clip(0, 1)
    expected = 2 * np.pi * (fall_off * np.sin(angle)).mean() * c
    assert abs(lights.spot_solid_angle(np.radians(cutoff), np.radians(beam)) / expected - 1) < 1e-5


# -- the choice among lights -------------------------------------------------------------------------


def choices(world, numbers):
    out = world.run("choose", len(numbers), numbers, 2)
    return out[:, 0].astype(int), out[:, 1]


def test_lights_are_chosen_by_their_power_and_never_without(device):
    """Powers from 1e-9 of the whole to most of it, and none; a uniform sky beside them never is."""
    dark = shape("sphere", np.eye(4), (0.0,))
    powers = np.array([1e-9, 3.0, 0.0, 1e-3, 0.4, 7.0, 0.0, 2e-6])
    points = [PointEmitter((p,), (i, 0.0, 0.0)) for i, p in enumerate(powers)]
    numbers = np.concatenate(
        [(np.arange(1 << 16) + 0.5) * 2.0**-16, np.arange(4096) * 2.0**-32, [1 - 2**-24]]
    )
    for sky in ([], [ConstantEmitter((0.0,))], [ConstantEmitter((1e-3,))]):
        world = World(device, [dark], [*points, *sky])
        table = world.table.emitters
        light, left = choices(world, numbers)
        assert (table["select_pdf"][light] > 0).all()
        assert set(light) == set(np.flatnonzero(table["select_pdf"] > 0))
        assert ((left >= 0) & (left < 1)).all()
        counts = np.bincount(light[: 1 << 16], minlength=len(table)) / 2**16
        assert np.abs(counts - table["select_pdf"]).max() < 2.0**-15
        assert abs(table["select_pdf"].sum(dtype=float) - 1) < 1e-6
        of_points = table["kind"] == layout.enum("EMITTER", "point")
        expected = powers[np.rint(table["position"][of_points, 0]).astype(int)]
        share = table["select_pdf"][of_points] / table["select_pdf"][of_points].sum()
        bright = expected > 1e-7
        assert np.allclose(share[bright], expected[bright] / powers.sum(), rtol=2e-4)
        # the rarest: as many of the 2³² random numbers as its probability says
        rare = float(table["select_pdf"][table["value"][:, 0] == np.float32(1e-9)][0])
        assert rare > 0 and rare * 2**32 == round(rare * 2**32)
        of_skies = table["kind"] == layout.enum("EMITTER", "constant")
        assert of_skies.tolist() == [False] * (len(table) - len(sky)) + [True] * len(sky)
        assert not table["select_pdf"][of_skies].any()


def test_lights_without_any_power_are_equally_likely(device):
    table = World(
        device, [shape("disk", np.eye(4), (0.0,))], [PointEmitter((0.0,), (0, 0, 0))]
    ).table.emitters
    assert table["select_pdf"].tolist() == [0.5, 0.5]


def test_what_is_left_of_a_choice_is_uniform(device):
    emitters = [PointEmitter((p,), (0, 0, 0)) for p in (0.3, 0.1, 2.0)]
    numbers = (np.arange(60_000) + 0.5) / 60_000
    light, left = choices(World(device, emitters=emitters), numbers)
    for number in range(3):
        chosen = np.sort(left[light == number])
        assert np.abs(chosen - (np.arange(len(chosen)) + 0.5) / len(chosen)).max() < 2 / len(chosen)


def test_areas_are_those_of_the_world():
    """Ellipses, scaled cylinders and spheres; a mesh's add up, and its run ends at 1."""
    assert np.isclose(lights.quadric_area(LIGHTS["sphere"]), 4 * np.pi * 0.49)
    assert np.isclose(lights.quadric_area(IRRADIANCE["ellipse"][0]), np.pi * 0.5 * 1.3)
    assert np.isclose(lights.quadric_area(LIGHTS["cylinder"]), 2 * np.pi * 0.4 * 1.7)


def test_runs_of_several_meshes_follow_each_other(device):
    """Each mesh light finds its own triangles, also where shapes that are no lights lie between."""
    shapes = [
        shape("mesh", np.eye(4), None, mesh=patches()),
        shape("mesh", np.eye(4), (2.0,), mesh=rectangle_mesh()),
        shape("disk", np.eye(4), (1.0,)),
        shape("mesh", np.eye(4), (1.0,), mesh=patches()),
    ]
    world = World(device, shapes)
    table, of_shape = world.table, world.table.of_shape
    assert of_shape[0] == -1 and sorted(of_shape[1:]) == [0, 1, 2]
    for number, triangles in ((1, [5, 6]), (3, [7, 8, 9, 10, 11])):
        record = table.emitters[of_shape[number]]
        assert record["shape"] == number and record["count"] == len(triangles)
        run = slice(record["first"], record["first"] + record["count"] + 1)
        assert table.faces[run][:-1].tolist() == triangles
        assert table.cdf[run][0] == 0 and table.cdf[run][-1] == 1 and (np.diff(table.cdf[run]) >= 0).all()
    assert table.emitters["area"][of_shape[1]] == 4.0
    assert np.diff(table.cdf[table.emitters["first"][of_shape[3]] :][:6])[3] == 0  # the triangle of no area
