"""Instances and merged shapes are the shapes that they stand for."""

import numpy as np
import pytest

import clvol
from clvol.errors import SceneError
from clvol.scene import load_dict
from clvol.tables import surfaces

FILM = {"type": "hdrfilm", "width": 3, "height": 3, "rfilter": {"type": "box"}}
STRETCH = clvol.translate([0, 0.2, 0]) @ clvol.scale([1, 3, -1])


def group(**shapes):
    return {"type": "shapegroup"} | shapes


def instance(to_world=None, name="group"):
    placed = {} if to_world is None else {"to_world": to_world}
    return {"type": "instance", "of": {"type": "ref", "id": name}} | placed


def load(**parts):
    place = clvol.look_at((0, 0, 5), (0, 0, 0), (0, 1, 0))
    camera = {"type": "orthographic", "film": FILM, "to_world": place}
    return load_dict({"type": "scene", "camera": camera} | parts)


def error_of(**parts):
    with pytest.raises(SceneError) as caught:
        load(**parts)
    return str(caught.value)


CUBE = {"type": "cube", "to_world": clvol.rotate([1, 2, 3], 30)}
FOGGY = {"type": "sphere", "bsdf": {"type": "null"}, "interior": {"type": "homogeneous"}}


def test_instances_share_what_their_group_holds():
    scene = load(group=group(a=CUBE, b=FOGGY), one=instance(), two=instance(STRETCH))
    assert [shape.name for shape in scene.shapes] == ["one", "one", "two", "two"]
    one_a, one_b, two_a, two_b = scene.shapes
    assert one_b.interior is two_b.interior
    assert one_a.bsdf is two_a.bsdf
    np.testing.assert_allclose(two_a.to_world, STRETCH @ CUBE["to_world"])


def test_a_group_alone_is_not_seen_and_a_single_shape_has_the_instances_name():
    assert load(group=group(a=CUBE)).shapes == ()
    assert [shape.name for shape in load(group=group(a=CUBE), one=instance()).shapes] == ["one"]
    assert load(group=group(), one=instance()).shapes == ()


def test_merged_shapes_are_those_inside_in_groups_too():
    merged = {"type": "merge", "a": CUBE, "b": {"type": "rectangle"}}
    assert [shape.kind for shape in load(m=merged).shapes] == ["cube", "rectangle"]
    assert len(load(group=group(m=merged), one=instance(), two=instance(STRETCH)).shapes) == 4


def test_a_stretched_mirrored_sphere_is_an_ellipsoid_that_faces_outwards():
    """Its normals lead outwards in Mitsuba's instances too."""
    place = clvol.look_at((0.5, 1.2, 5), (0.5, 1.2, 0), (0, 1, 0)) @ clvol.scale([1e-4, 1e-4, 1])
    camera = {"type": "orthographic", "film": FILM, "to_world": place}
    scene = load(group=group(a={"type": "sphere"}), one=instance(STRETCH), camera=camera)
    result = clvol.render(scene, spp=4, seed=1, aov=("depth", "normal"))
    z = np.sqrt(1 - 0.5**2 - ((1.2 - 0.2) / 3) ** 2)
    normal = np.array([0.5, (1.2 - 0.2) / 9, z])
    np.testing.assert_allclose(result.aovs["depth"], 5 - z, atol=2e-4)
    np.testing.assert_allclose(
        result.aovs["normal"] - normal / np.linalg.norm(normal), np.zeros((3, 3, 3)), atol=2e-4
    )


@pytest.mark.parametrize(
    ("parts", "message"),
    [
        ({"group": group(a={"type": "sphere", "light": {"type": "area"}})}, "cannot emit"),
        ({"group": group(a=CUBE), "other": group(b=instance())}, "holds no instances"),
        ({"group": group(a={"type": "diffuse"})}, "scene.group"),
        ({"one": {"type": "instance"}}, "needs one shapegroup"),
        ({"one": {"type": "instance", "of": CUBE}}, "needs one shapegroup"),
        ({"one": {"type": "instance", "a": group(), "b": group()}}, "needs one shapegroup"),
        ({"one": instance() | {"bsdf": {"type": "diffuse"}}, "group": group(a=CUBE)}, "takes no bsdf"),
        ({"one": instance() | {"flip_normals": True}, "group": group(a=CUBE)}, "unknown parameter"),
        ({"one": instance(clvol.scale(1e30)), "group": group(a=CUBE)}, "scene.one.to_world"),
        ({"m": {"type": "merge", "a": CUBE, "to_world": STRETCH}}, "unknown parameter 'to_world'"),
    ],
)
def test_other_groups_are_errors(parts, message):
    assert message in error_of(**parts)


def test_a_group_that_holds_itself_is_an_error():
    assert "without end" in error_of(group=group(a={"type": "merge", "b": {"type": "ref", "id": "group"}}))


def test_more_instances_than_memory_holds_are_an_error(monkeypatch):
    monkeypatch.setattr(surfaces, "available_memory", lambda: 10_000)
    many = {f"i{n}": instance(clvol.translate([3 * n, 0, 0])) for n in range(10)}
    scene = load(group=group(a=CUBE), **many)
    with pytest.raises(SceneError, match=r"120 triangles, which take .* and 9\.766 KiB are free"):
        clvol.render(scene, spp=1)
