"""Which media are one: those alike in every value, where one is named from outside."""

from dataclasses import replace

import numpy as np
import pytest
from pictures import box, gridded, homogeneous, picture, volume

import clvol
from clvol.scene.boundaries import find_boundaries
from clvol.scene.digest import alike, scene_digest
from clvol.scene.materials import Diffuse
from clvol.scene.records import Shape

AIR = """<medium {} type="homogeneous">
<rgb name="sigma_t" value="0.4"/><float name="albedo" value="{}"/></medium>"""
ROOM = """<scene version="3.0.0">
<integrator type="volpath"><integer name="max_depth" value="64"/></integrator>
<sensor type="perspective">
<film type="hdrfilm"><integer name="width" value="8"/><integer name="height" value="8"/></film>
<transform name="to_world"><lookat origin="0.3, 0.2, -5" target="0, 0, 0" up="0, 1, 0"/></transform></sensor>
{shared}
<shape type="cube"><bsdf type="null"/>{inside}</shape>
<shape type="sphere"><float name="radius" value="0.5"/><bsdf type="diffuse"/>{outside}</shape>
<shape type="rectangle"><emitter type="area"><rgb name="radiance" value="9"/></emitter>
<transform name="to_world"><scale value="0.2"/><rotate x="1" angle="90"/><translate y="0.9"/></transform>
{outside}</shape>
</scene>"""


def own(side, albedo=0.9):
    return AIR.format(f'name="{side}"', albedo)


def air_of(side):
    return f'<ref name="{side}" id="air"/>'


def described(found):
    return (
        found.surfaces,
        found.boundaries,
        [(e.shape, e.everywhere, scene_digest(e.medium)) for e in found.entries],
    )


def test_what_shapes_say_of_the_same_air_is_one_medium():
    """Also of a lamp and a ball that stand in it: in place of three that add, two of them without an end."""
    each = clvol.load_string(ROOM.format(shared="", inside=own("interior"), outside=own("exterior")))
    named = clvol.load_string(
        ROOM.format(shared=AIR.format('id="air"', 0.9), inside=air_of("interior"), outside=air_of("exterior"))
    )
    found = find_boundaries(each)
    assert len(found.entries) == 1 and not found.entries[0].everywhere
    assert [boundary.exterior for boundary in found.boundaries] == [0, 0]
    pictures = [clvol.render(scene, spp=64, seed=1) for scene in (each, named)]
    assert (pictures[0].image == pictures[1].image).all() and pictures[0].image.max() > 0


def test_media_that_differ_in_a_value_are_two():
    other = clvol.load_string(ROOM.format(shared="", inside=own("interior"), outside=own("exterior", 0.8)))
    assert [entry.everywhere for entry in find_boundaries(other).entries] == [False, True]


def test_a_parameter_is_of_the_shape_that_it_names():
    scene = clvol.load_string(ROOM.format(shared="", inside=own("interior"), outside=own("exterior")))
    parameters = clvol.traverse(scene)
    keys = [key for key in parameters if key.endswith("sigma_t.value.value")]
    assert len(keys) == 3
    parameters[keys[1]] = 0.7
    parameters.update()
    assert len(find_boundaries(scene).entries) == 2


def test_the_medium_that_a_sensor_describes_is_that_of_the_shape_around_it():
    air = homogeneous(0.3, 0.5)
    around = box((-1, -1, -1), (1, 1, 1), air)
    for named in (air, replace(air), replace(air, name="again")):
        scene = picture([around], [], (0.0, 0.0, 0.0), (0.0, 0.0, 1.0), 30.0, (4, 4))
        scene = replace(scene, sensor=replace(scene.camera, medium=named))
        clvol.plan(scene)
        assert [entry.everywhere for entry in find_boundaries(scene).entries] == [False]


def test_clouds_that_are_alike_add_where_they_overlap():
    """Nothing names them from outside: each is its own."""
    boxes = [box((x, 0, 0), (x + 1, 1, 1), homogeneous(1.0)) for x in (0.0, 0.5)]
    scene = picture(boxes, [], (0.5, 0.5, -3.0), (0.5, 0.5, 0.0), 20.0, (4, 4))
    assert len(find_boundaries(scene).entries) == 2


def test_alike_is_to_the_last_bit():
    """As fingerprints tell: 0 and -0 differ, and a value that is none does not from itself."""
    assert not alike(homogeneous(1.0, 0.0), homogeneous(1.0, -0.0))
    assert not alike(np.array([0.0]), np.array([-0.0])) and alike(np.array([np.nan]), np.array([np.nan]))
    assert not alike(np.zeros(2, np.float32), np.zeros(2)) and not alike((1.0,), (1.0, 1.0))


@pytest.mark.parametrize("edge", [4, 130])
def test_grids_are_alike_to_the_last_sample(edge):
    """Also where fingerprints look at some samples only."""
    values = np.random.default_rng(1).uniform(0, 1, (edge, edge, edge)).astype(np.float32)
    changed = values.copy()
    changed[1, 2, 3] += 0.5

    def cloud(samples):
        return gridded(volume(samples, (0, 0, 0), (1, 1, 1)), 0.9)

    one = cloud(values)
    assert alike(one, cloud(values.copy())) and not alike(one, cloud(changed))
    ball = Shape("sphere", clvol.scale(0.1), bsdf=Diffuse((0.5,)))
    for samples, entries in ((values.copy(), 1), (changed, 2)):
        shapes = [box((0, 0, 0), (1, 1, 1), one), replace(ball, exterior=cloud(samples))]
        scene = picture(shapes, [], (0.5, 0.5, -3.0), (0.5, 0.5, 0.0), 20.0, (4, 4))
        assert len(find_boundaries(scene).entries) == entries
