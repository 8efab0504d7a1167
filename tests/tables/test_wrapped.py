"""Volumes of media that repeat or mirror beyond their box have its samples again."""

import itertools

import numpy as np
import pytest

import clvol
from clvol.errors import SceneError
from clvol.scene import scale, translate
from clvol.tables import wrapped
from clvol.tables.prepare import prepare
from clvol.tables.wrapped import Reach

VALUES = np.random.default_rng(5).uniform(0.1, 1, (2, 3, 4)).astype(np.float32)
TILES = 3
"""Boxes on each side of the origin that hold all of the media here."""


def tiled(values, mode):
    """The samples of the boxes from -TILES to TILES along each axis."""
    for axis in range(3):
        other = np.flip(values, axis) if mode == "mirror" else values
        boxes = [values if number % 2 == 0 else other for number in range(-TILES, TILES)]
        values = np.concatenate(boxes, axis)
    return values


def grid(values=VALUES, **parameters):
    return {"type": "gridvolume", "data": values, **parameters}


def large(mode, **parameters):
    """The same field in one box, without a wrap mode."""
    matrix = translate((-TILES, -TILES, -TILES)) @ scale(2 * TILES)
    return grid(tiled(VALUES, mode), to_world=matrix, **parameters)


def scene(shape=None, **medium):
    """A medium in a cube of edge 3, off the origin, under a sky that is not grey."""
    medium = {"type": "homogeneous", "sigma_t": 0.7, "albedo": 0.8} | medium
    place = translate((0.4, -0.3, 0.2)) @ scale(1.5)
    solid = {"type": "cube", "bsdf": {"type": "null"}, "interior": medium, "to_world": place}
    return clvol.load_dict(
        {
            "type": "scene",
            "integrator": {"type": "volpath", "max_depth": 4},
            "sensor": {
                "type": "perspective",
                "fov": 40.0,
                "to_world": translate((0.3, 0.2, 9)) @ scale((-1, 1, -1)),
                "film": {"type": "hdrfilm", "width": 12, "height": 10, "rfilter": {"type": "box"}},
            },
            "sky": {"type": "constant", "radiance": {"type": "rgb", "value": (1.0, 0.6, 0.3)}},
            "solid": solid | (shape or {}),
        }
    )


def image(loaded, **options):
    return clvol.render(loaded, spp=16, seed=3, **options).image


@pytest.mark.parametrize("mode", ["repeat", "mirror"])
@pytest.mark.parametrize("first", [(0, 0, 0), (-9, 4, -5), (3, -20, 1)])
def test_samples_beyond_the_box_are_its_own_again(mode, first):
    values = np.arange(2 * 3 * 5.0).reshape(2, 3, 5, 1)
    reach = Reach(first, tuple(low + span for low, span in zip(first, (4, 7, 6), strict=True)))
    found = reach.of(values, mode)
    assert found.shape == (7, 8, 5, 1) and found.size == reach.samples

    def folded(index, size):
        box, inside = divmod(index, size)
        return size - 1 - inside if mode == "mirror" and box % 2 else inside

    for k, j, i in itertools.product(range(7), range(8), range(5)):
        place = [folded(n + low, size) for n, low, size in zip((i, j, k), first, (5, 3, 2), strict=True)]
        assert found[k, j, i] == values[place[2], place[1], place[0]]


@pytest.mark.parametrize("filter_type", ["trilinear", "nearest"])
@pytest.mark.parametrize("mode", ["repeat", "mirror"])
@pytest.mark.parametrize("name", ["albedo", "emission_density"])
def test_a_medium_has_the_picture_of_one_with_all_the_samples(name, mode, filter_type):
    ours = image(scene(**{name: grid(wrap_mode=mode, filter_type=filter_type)}))
    np.testing.assert_allclose(ours, image(scene(**{name: large(mode, filter_type=filter_type)})), rtol=2e-3)
    assert abs(ours.mean() / image(scene(**{name: grid(filter_type=filter_type)})).mean() - 1) > 0.01


@pytest.mark.parametrize("mode", ["repeat", "mirror"])
def test_it_is_looked_up_wherever_a_grid_of_sigma_t_is(mode):
    dense = {"type": "heterogeneous", "scale": 2.0}
    dense["sigma_t"] = grid(to_world=translate((-0.8, -1.2, -0.7)) @ scale(1.9))
    options = {"background": "sampled"}  # "expected" guesses the mean albedo, by the samples that there are
    ours = image(scene(albedo=grid(wrap_mode=mode), **dense), **options)
    np.testing.assert_allclose(ours, image(scene(albedo=large(mode), **dense), **options), rtol=2e-3)


def test_one_volume_of_two_media_has_the_samples_of_both():
    shared = {"type": "gridvolume", "data": VALUES, "wrap_mode": "repeat"}
    found = prepare(scene(albedo=shared, emission_density=large("repeat"), sigma_t=0.5))
    [one] = [volume for volume in found.volumes if volume.volume.wrap_mode == "repeat"]
    index = np.linalg.inv(one.volume.index_to_world)
    corners = np.array(list(itertools.product((-1.1, 1.9), (-1.8, 1.2), (-1.3, 1.7))))
    placed = corners @ index[:3, :3].T + index[:3, 3]
    assert (placed.min(axis=0) >= one.reach.first).all() and (placed.max(axis=0) <= one.reach.last).all()
    assert one.reach.samples < 8 * np.prod(4 * np.array(VALUES.shape))


def test_a_shape_that_grows_has_its_samples_made_anew():
    loaded = scene(albedo=grid(wrap_mode="repeat"))
    before = image(loaded)
    parameters = clvol.traverse(loaded)
    [name] = [key for key in parameters if key.endswith("solid.to_world")]
    parameters[name] = translate((0.4, -0.3, 0.2)) @ scale(2.5)
    parameters.update()
    after = image(parameters.scene)
    fresh = image(scene({"to_world": parameters[name]}, albedo=grid(wrap_mode="repeat")))
    np.testing.assert_array_equal(after, fresh)
    assert abs(after.mean() / before.mean() - 1) > 0.01


def test_what_cannot_be_is_told(monkeypatch):
    everywhere = {"type": "homogeneous", "sigma_t": 1.0, "albedo": grid(wrap_mode="repeat")}
    sensor = {"type": "perspective", "medium": everywhere}
    bodiless = clvol.load_dict({"type": "scene", "sensor": sensor, "lamp": {"type": "point"}})
    with pytest.raises(SceneError, match="'repeat' of the albedo volume, whose medium is everywhere; bound"):
        prepare(bodiless)
    shown = {"type": "diffuse", "reflectance": {"type": "volume", "volume": {"type": "ref", "id": "v"}}}
    volume = grid(wrap_mode="repeat")
    medium = {"type": "homogeneous", "albedo": {"type": "ref", "id": "v"}}
    both = {"type": "scene", "sensor": {"type": "perspective"}, "v": volume}
    both["ball"] = {"type": "sphere", "bsdf": shown, "interior": medium}
    with pytest.raises(SceneError, match="albedo volume, which is a surface's texture too; give it twice"):
        prepare(clvol.load_dict(both))
    monkeypatch.setattr(wrapped, "MAX_SAMPLES", 100)
    with pytest.raises(
        SceneError, match=r"the emission_density volume makes \d+ samples of it in its medium, more"
    ):
        prepare(scene(emission_density=grid(wrap_mode="mirror")))
