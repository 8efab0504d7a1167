"""What stands before a lamp hides it, however near; what is the lamp itself, or stands behind it, does not.

A small patch of floor at the origin faces a lamp at height `D`; the camera looks at that patch alone.  All
techniques share shadow rays, so that no comparison between them would see light pass an occluder: answers are
closed forms, and 0 where nothing may arrive, to the last bit.
"""

from dataclasses import replace

import numpy as np
import pytest
import trimesh
from pictures import assert_mean, picture
from surface_scenes import UNREACHED, meshed
from tiers import quick_first

import clvol
from clvol.scene.materials import Diffuse, Null
from clvol.scene.records import PointEmitter, Shape, SpotEmitter

BLACK, WHITE = Diffuse((0.0,)), Diffuse((1.0,))
RADIANCE = 10.0
UP = np.array([0.0, 0.0, 1.0])
NO_LIGHT = PointEmitter((0.0,), (0.0, 0.0, -60.0))
NO_SPOT = SpotEmitter((0.0,), clvol.translate((0.0, 0.0, -60.0)))


def shape(kind, to_world, bsdf=BLACK, **keywords):
    return Shape(kind, to_world, bsdf=bsdf, **keywords)


def lamp(kind, to_world, **keywords):
    return shape(kind, to_world, emission=(RADIANCE,), **keywords)


def polygon(corners):
    """Irradiance of the origin, facing up, from a polygon of unit radiance above the horizon (Lambert)."""
    v = np.asarray(corners, float) / np.linalg.norm(corners, axis=1, keepdims=True)
    cross = np.cross(v, np.roll(v, -1, 0))
    sine = np.linalg.norm(cross, axis=1)
    return 0.5 * abs(np.sum(cross @ UP / sine * np.arctan2(sine, np.sum(v * np.roll(v, -1, 0), axis=1))))


def square(r, height):
    return [(-r, -r, height), (r, -r, height), (r, r, height), (-r, r, height)]


def disk(r, height):
    return np.pi * r**2 / (r**2 + height**2)


def cylinder(r, height, length, steps=1000):
    """A cylinder that lies with its axis along y at the height, symmetric about the origin."""
    turn = (np.arange(steps) + 0.5) / steps * 2 * np.pi
    along = ((np.arange(steps) + 0.5) / steps - 0.5)[:, None] * length
    x, z, y = r * np.cos(turn), height + r * np.sin(turn), along
    square = x * x + y * y + z * z
    facing = np.maximum(-(np.cos(turn) * x + np.sin(turn) * z), 0)
    return np.sum(facing * z / square**2) * (2 * np.pi * r / steps) * (length / steps)


def facets(mesh):
    """A convex mesh of outward triangles: those that face the origin do not hide each other."""
    corners = mesh.vertices[mesh.faces].astype(float)
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    return sum(polygon(c) for c, n in zip(corners, normals, strict=True) if n @ c[0] < 0)


def geodesic(r, height, level):
    mesh = trimesh.creation.icosphere(level, r).apply_translation((0, 0, height + r))
    return meshed(mesh, bsdf=BLACK, emission=(RADIANCE,)), facets(mesh)


DOWN = clvol.rotate((1, 0, 0), 180)


def lamps(r, height):
    """Each kind: the shape or emitter, its irradiance of the origin in units of the radiance, and its top."""
    at, above = clvol.translate((0, 0, height)), clvol.translate((0, 0, height + r))
    size = clvol.scale((r, r, r))
    lying = (
        above @ clvol.translate((0, -2 * r, 0)) @ clvol.rotate((1, 0, 0), -90) @ clvol.scale((r, r, 4 * r))
    )
    tube = at @ clvol.scale((r, r, 3 * r))
    mesh, mesh_irradiance = geodesic(r, height, 2)
    spot = clvol.look_at((0, 0, height), (0, 0, 0), (0, 1, 0))
    return {
        "sphere": (lamp("sphere", above @ size), np.pi * (r / (height + r)) ** 2, 2 * r),
        "disk": (lamp("disk", at @ DOWN @ size), disk(r, height), 0.0),
        "rectangle": (lamp("rectangle", at @ DOWN @ size), polygon(square(r, height)), 0.0),
        "cube": (lamp("cube", above @ size), polygon(square(r, height)), 2 * r),
        "cylinder": (lamp("cylinder", lying), cylinder(r, height + r, 4 * r), 2 * r),
        "mesh": (mesh, mesh_irradiance, 2 * r),
        # shines inwards, seen through its lower end; its upper end is open
        "tube": (lamp("cylinder", tube, flip_normals=True), disk(r, height) - disk(r, height + 3 * r), 3 * r),
        "point": (PointEmitter((RADIANCE,), (0, 0, height)), 1 / height**2, 0.0),
        "spot": (SpotEmitter((RADIANCE,), spot, 60.0, 50.0), 1 / height**2, 0.0),
    }


KINDS = tuple(lamps(1.0, 1.0))


def level_disk(height, radius):
    return shape("disk", clvol.translate((0, 0, height)) @ clvol.scale((radius, radius, 1)))


def specks():
    """A lamp of every kind, dark and out of sight, so that one set of kernels serves all scenes."""
    place = clvol.translate((0, 0, -70.0)) @ clvol.scale(1e-3)
    return [
        shape(kind, clvol.translate((0.1 * n, 0, 0)) @ place, emission=(0.0,))
        for n, kind in enumerate(("sphere", "disk", "rectangle", "cylinder"))
    ]


def moved(light, offset):
    if isinstance(light, PointEmitter):
        return replace(light, position=tuple(np.add(light.position, offset)))
    return replace(light, to_world=clvol.translate(offset) @ light.to_world)


def floor_radiance(light, height, others=(), shift=0.0, passable=False, samples=64):
    """The picture of what the patch reflects, in units of the lamp's radiance over pi.

    shift : x of the whole scene; as much is put on the other side, so that it is away from the origin.
    passable : a surface that light passes through is about, over which shadow rays step.
    """
    shapes = [shape("rectangle", clvol.scale((height, height, 1)), WHITE), *others, *specks()]
    emitters = [NO_LIGHT, NO_SPOT]
    (shapes if isinstance(light, Shape) else emitters).append(light)
    if passable:
        shapes.append(replace(level_disk(height / 8, height / 9), bsdf=Null()))
    offset = np.array([shift, 0.0, 0.0])
    shapes, emitters = ([moved(light, offset) for light in lights] for lights in (shapes, emitters))
    if shift:
        shapes.append(moved(level_disk(0.0, 1e-3), -offset))
    eye = offset + np.array([0.7, 0.2, 0.1]) * height
    scene = picture(shapes, emitters, eye, offset, 0.01, up=(0, 0, 1), max_depth=UNREACHED)
    result = clvol.render(scene, spp=samples, seed=7, sampler="sobol")
    return replace(
        result, image=result.image * (np.pi / RADIANCE), variance=result.variance * (np.pi / RADIANCE) ** 2
    )


# -- what stands before a lamp -----------------------------------------------------------------------


@quick_first("passable", [False, True], ids=["opaque", "passable"])
@quick_first("kind", KINDS, count=3)
def test_nothing_passes_an_occluder(kind, passable):
    height = 3.0
    light = lamps(0.05, height)[kind][0]
    for gap in (1e-4, 2e-3, 0.1):
        assert (
            floor_radiance(light, height, [level_disk(height - gap, 4.0)], passable=passable).image.max() == 0
        )


@pytest.mark.parametrize("kind", KINDS)
def test_nothing_passes_an_occluder_far_away(kind):
    """As near as single precision tells apart: 2^-20 of the largest coordinate or distance, a millimetre."""
    shelf = [level_disk(3.0 - 1e-3, 4.0)]
    assert floor_radiance(lamps(0.05, 3.0)[kind][0], 3.0, shelf, shift=1000.0).image.max() == 0
    cloud = [level_disk(1000.0 - 1e-3, 1e3)]
    assert floor_radiance(lamps(5.0, 1000.0)[kind][0], 1000.0, cloud).image.max() == 0


def test_a_mesh_hides_its_other_triangles():
    """Two sheets that are one lamp, a millimetre apart: the lower hides the upper."""
    sheet = trimesh.Trimesh(square(0.05, 3.0), [(0, 2, 1), (0, 3, 2)])
    lower, upper = (sheet.copy().apply_translation((0, 0, gap)) for gap in (0.0, 1e-3))
    light = meshed(trimesh.util.concatenate([lower, upper]), bsdf=BLACK, emission=(RADIANCE,))
    assert_mean(floor_radiance(light, 3.0, samples=16384), polygon(square(0.05, 3.0)))


# -- what does not -----------------------------------------------------------------------------------


SAMPLES = {"cube": 65536, "mesh": 65536, "cylinder": 8192}


@pytest.mark.parametrize("kind", KINDS)
def test_a_lamp_does_not_hide_itself(kind):
    """Nor does a ceiling that it all but touches."""
    light, irradiance, top = lamps(0.05, 3.0)[kind]
    ceiling = [level_disk(3.0 + top + 1e-4, 9.0)]
    assert_mean(floor_radiance(light, 3.0, ceiling, samples=SAMPLES.get(kind, 1024)), irradiance)


def test_a_fine_mesh_does_not_hide_itself():
    """Triangles of a millimetre, a hundred metres from the origin.

    One ray of twenty meets a neighbour of the triangle that it was sent to, just before or just behind.
    """
    light, irradiance = geodesic(0.05, 3.0, 5)
    found = floor_radiance(light, 3.0, shift=100.0, samples=65536)
    assert_mean(found, irradiance)


@pytest.mark.parametrize("passable", [False, True], ids=["opaque", "passable"])
def test_a_lamp_that_shines_inwards_is_hidden_by_its_back(passable):
    """From outside it is dark; from inside it is all the sky there is."""
    inwards = lamp("sphere", clvol.translate((0, 0, 3.05)) @ clvol.scale(0.05), flip_normals=True)
    assert floor_radiance(inwards, 3.0, passable=passable).image.max() == 0
    around = lamp("sphere", clvol.scale(40.0), flip_normals=True)
    assert_mean(floor_radiance(around, 3.0, passable=passable, samples=16384), np.pi)
