"""Several sensors side by side on one film: each part has the bits of a render of its own."""

import signal

import numpy as np
import pytest
from signals import press_key
from tiers import quick_first

import clvol
from clvol import OptionError, SceneError, load_dict
from clvol.cluster.job import seed_of_part
from clvol.scene.digest import scene_digest
from clvol.scene.views import seen_by
from clvol.viewer.subject import Subject

FILM = {"type": "hdrfilm", "width": 18, "height": 5}
FRONT = clvol.look_at((0, 0, 5), (0, 0, 0), (0, 1, 0))
SIDE = clvol.look_at((5, 1, 0), (0, 0, 0), (0, 1, 0))
CAMERAS = {
    "one": {"type": "perspective", "fov": 40, "to_world": FRONT, "film": {"type": "hdrfilm", "width": 9}},
    "two": {"type": "orthographic", "to_world": SIDE},
    "three": {"type": "perspective", "fov": 25, "to_world": SIDE},
}
OPTIONS = {"spp": 12, "seed": 5}


def described(cameras=CAMERAS, film=FILM, **more):
    """A grid of smoke under a sky and a sun."""
    values = np.random.default_rng(1).random((5, 5, 5))
    cell = clvol.translate((-1, -1, -1)) @ clvol.scale(2)
    smoke = {
        "type": "heterogeneous",
        "sigma_t": {"type": "gridvolume", "data": values, "to_world": cell},
        "scale": 3.0,
        "albedo": 0.9,
    }
    return {
        "type": "scene",
        "camera": {"type": "batch", "film": film, **cameras},
        "sky": {"type": "constant", "radiance": 0.5},
        "sun": {"type": "directional", "direction": (0.3, -1, 0.2), "irradiance": 2.0},
        "box": {"type": "cube", "bsdf": {"type": "null"}, "interior": smoke},
        **more,
    }


@pytest.fixture(scope="module", autouse=True)
def short_ranges():
    """Pictures of these tests are small, and cut into ranges nevertheless."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("clvol.cluster.ranges.LEAST_PATHS", 1)
        yield


@pytest.fixture(scope="module")
def scene():
    return load_dict(described())


def assert_parts_are(result, singles):
    """The pictures beside each other are these."""
    at = 0
    for one in singles:
        columns = slice(at, at + one.image.shape[1])
        assert one.image.tobytes() == result.image[:, columns].tobytes()
        assert one.variance.tobytes() == result.variance[:, columns].tobytes()
        for name in one.aovs:
            np.testing.assert_array_equal(one.aovs[name], result.aovs[name][:, columns], name)
        at = columns.stop
    assert at == result.image.shape[1]
    for name in ("lookups", "paths", "shadow_rays"):
        assert result.stats[name] == sum(one.stats[name] for one in singles)


@quick_first("sampler", ["joint", "independent"])
def test_each_part_has_the_bits_of_its_sensor_alone(scene, sampler):
    options = OPTIONS | {"sampler": sampler, "aov": ["depth"]}
    result = clvol.render(scene, **options)
    assert result.image.shape == (5, 18, 3) and result.samples == (0, 12)
    singles = [
        clvol.render(scene, sensor=1 + n, device=[0], **options | {"seed": seed_of_part(5, n)})
        for n in range(3)
    ]
    assert_parts_are(result, singles)
    assert result.metadata["digest"] == scene_digest(scene) and result.metadata["seed"] == 5
    assert result.stats["uploaded_bytes"] < 1.5 * max(one.stats["uploaded_bytes"] for one in singles)
    again = clvol.render(scene, pool=64, **options)
    assert again.image.tobytes() == result.image.tobytes()


@pytest.mark.contract
def test_shapes_stand_for_the_irradiancemeters_in_them():
    """A plate of the scene, which is seen as well, and one that is only measured."""
    meter = {"type": "irradiancemeter", "film": {"type": "hdrfilm", "width": 2, "height": 1}}
    up = clvol.translate((0, -1.2, 0)) @ clvol.rotate((1, 0, 0), -90)
    plate = {"type": "rectangle", "to_world": up, "meter": meter}
    lifted = plate | {"to_world": clvol.translate((0, 4, 0)) @ up}
    batch = {"one": CAMERAS["one"], "below": {"type": "ref", "id": "plate"}, "above": lifted}
    scene = load_dict(described(batch, plate=plate))
    assert scene.sensor.names == ("one", "plate", "above") and len(scene.shapes) == 2
    assert scene.sensor.parts[1].shape is scene.shapes[1]
    result = clvol.render(scene, **OPTIONS)
    singles = [
        clvol.render(scene, sensor=2 + n, device=[0], **OPTIONS | {"seed": seed_of_part(5, n)})
        for n in range(3)
    ]
    assert_parts_are(result, singles)
    below, above = (clvol.render(scene, sensor=3 + n, spp=1024, seed=1).image.mean() for n in range(2))
    assert above == pytest.approx(0.5 * np.pi)  # no ray meets the sun, as in Mitsuba
    assert abs(below / above - 1) > 0.05


def test_the_same_camera_twice_is_noisy_in_two_ways():
    twins = {"left": CAMERAS["one"], "right": CAMERAS["one"]}
    image = clvol.render(load_dict(described(twins, FILM | {"width": 12})), spp=256, seed=1).image
    left, right = image[:, :6], image[:, 6:]
    assert (left != right).any(axis=-1).mean() > 0.5
    assert abs(left.mean() - right.mean()) < 0.1 * left.mean()


def test_samples_merge_and_a_render_goes_on(scene, tmp_path):
    whole = clvol.render(scene, spp=8, seed=5, sampler="joint")
    first = clvol.render(scene, samples=(0, 4), seed=5, sampler="joint")
    more = clvol.render(scene, samples=(4, 4), seed=5, sampler="joint")
    np.testing.assert_allclose(clvol.merge([more, first]).image, whole.image, rtol=1e-6)
    first.save(tmp_path / "a.exr")
    further = clvol.render(scene, spp=8, seed=5, sampler="joint", resume=tmp_path / "a.exr")
    assert further.samples == (0, 8)
    np.testing.assert_allclose(further.image, whole.image, rtol=1e-5)
    alone = clvol.render(scene, sensor=1, size=(18, 5), samples=(4, 4), seed=5, sampler="joint")
    with pytest.raises(OptionError, match="different scenes"):
        clvol.merge([first, alone])


@pytest.mark.contract
def test_an_end_leaves_all_parts_the_same_samples(scene, ctrl_c):
    pressed = []

    def once(record):
        if not pressed and record.samples_done >= 1:
            pressed.append(press_key(signal.SIGINT))

    result = clvol.render(scene, spp=1_000_000, seed=5, sampler="independent", progress=once)
    assert result.stats["interrupted"] and 0 < result.samples[1] < 1_000_000
    assert result.estimate.count == result.samples[1]
    assert result.stats["paths"] == 90 * result.samples[1]
    limited = clvol.render(scene, time_limit=0.1, seed=5)
    assert limited.samples[1] > 0 and np.isfinite(limited.image).all()


def test_frames_and_target_errors(scene):
    frames = list(clvol.progressive(scene, spp=70, seed=5, interval=0))
    assert len(frames) > 1 and frames[-1].is_last and frames[-1].image.shape == (5, 18, 3)
    result = clvol.render(scene, target_error=0.05, seed=5)
    assert result.noise < 1.1 * 0.05 and result.metadata["target_error"] == 0.05


def test_a_batch_is_one_sensor_and_those_inside_have_the_numbers_after_it():
    single = {"type": "perspective", "fov": 30, "to_world": FRONT}
    both = {"alone": single} | described(sampler={"type": "independent", "sample_count": 9})
    both["camera"]["sampler"] = both.pop("sampler")
    scene = load_dict({"type": "scene"} | both)
    cameras = [type(seen_by(scene, n).sensor).__name__ for n in range(5)]
    assert cameras == ["Perspective", "Batch", "Perspective", "Orthographic", "Perspective"]
    second = seen_by(scene, 3)
    assert (second.film.width, second.film.height, second.spp) == (6, 5, 9)
    with pytest.raises(OptionError, match="no sensor 5: the scene has 5 sensors"):
        seen_by(scene, 5)


def test_a_field_of_view_is_that_on_the_sensors_own_film():
    """Mitsuba reads it before the film is shared: 60 degrees along y of 20 x 10 pixels."""
    own = {
        "type": "perspective",
        "fov": 60,
        "fov_axis": "y",
        "film": {"type": "hdrfilm", "width": 20, "height": 10},
    }
    camera = seen_by(load_dict(described({"one": own})), 1).sensor
    assert camera.fov_axis == "x"
    assert camera.fov == pytest.approx(2 * np.degrees(np.arctan(2 * np.tan(np.radians(30)))))


def test_parameters_have_mitsubas_names_and_change_the_picture(scene):
    changed = load_dict(described())
    found = clvol.traverse(changed)
    assert {"camera.one.x_fov", "camera.two.to_world", "camera.film.size"} <= set(found)
    found["camera.three.x_fov"] = 50.0
    found["camera.film.size"] = (9, 3)
    found.update()
    result = clvol.render(changed, **OPTIONS)
    assert result.image.shape == (3, 9, 3)
    wider = load_dict(described(CAMERAS | {"three": CAMERAS["three"] | {"fov": 50}}))
    assert clvol.render(wider, size=(9, 3), **OPTIONS).image.tobytes() == result.image.tobytes()
    found["camera.film.size"] = (10, 3)
    found.update()
    with pytest.raises(SceneError, match="multiple of its 3 sensors"):
        clvol.render(changed, **OPTIONS)


def test_sensors_of_one_pixel_make_a_row():
    meters = {
        name: {"type": "radiancemeter", "origin": [x, 0, 5], "direction": [0, 0, -1],
               "film": {"type": "hdrfilm", "width": 1, "height": 1}}
        for name, x in (("a", 0.0), ("b", 9.0))
    }  # fmt: skip
    film = {"type": "hdrfilm", "width": 2, "height": 1, "rfilter": {"type": "mitchell"}}
    result = clvol.render(load_dict(described(meters, film)), spp=64, seed=2)
    assert result.image[0, 1] == pytest.approx(0.5) and abs(result.image[0, 0] - 0.5).max() > 1e-3


@pytest.mark.parametrize(
    ("cameras", "film", "message"),
    [
        ({}, FILM, "at least one sensor"),
        (CAMERAS, FILM | {"width": 5}, "multiple of its 3 sensors"),
        (CAMERAS, FILM | {"crop_width": 3}, "no crop window"),
        ({"inner": {"type": "batch", "film": FILM, **CAMERAS}}, FILM, "no other batch"),
    ],
)
def test_what_cannot_stand_side_by_side_is_said(cameras, film, message):
    with pytest.raises(SceneError, match=message):
        load_dict(described(cameras, film))


def test_what_is_of_one_sensor_alone_says_so(scene, tmp_path):
    for options in (
        {"checkpoint": tmp_path / "a.npz"},
        {"profile": True},
        {"technique": "auto:pilot"},
        {"resume": tmp_path / "a.npz"},
    ):
        with pytest.raises(OptionError, match="a batch of sensors"):
            clvol.render(scene, **OPTIONS, **options)
    with pytest.raises(OptionError, match="multiple of its 3 sensors"):
        clvol.render(scene, size=(20, 5), **OPTIONS)
    with pytest.raises(OptionError, match="a batch is a picture of several sensors"):
        clvol.trace_ray(scene, 0, 0)
    with pytest.raises(OptionError, match="sensor 1 is inside of a batch"):
        Subject(scene, sensor=1)
    assert "camera" in str(clvol.info(scene)) and clvol.plan(scene).features.volumes == 1
    assert clvol.render(scene, sensor=[0, 1], spp=1)[0].image.shape == (5, 18, 3)
