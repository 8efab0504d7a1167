"""What each plugin's parameters mean, with Mitsuba's defaults and conventions; and what is refused.

Numbers called Mitsuba's were printed by version 3.9.1 (scalar_rgb).
"""

import os
import warnings
from pathlib import Path

import numpy as np
import OpenImageIO as oiio  # noqa: N813
import pytest
from places import SCENES

from clvol.errors import Error, SceneError, VolumeError
from clvol.scene import load_dict, load_file, rotate, scale, translate
from clvol.scene.materials import Diffuse
from clvol.scene.records import ConstantEmitter, ConstVolume, Film, Integrator, Phase, ReconstructionFilter
from clvol.volumes import SparseGrid, write_vol

DATA = Path(os.environ.get("CLVOL_DATA", "no such folder"))


def load(camera=None, **plugins):
    """A scene of a camera (fov 40, and what is given) and `plugins`."""
    sensor = {"type": "perspective", "fov": 40} | (camera or {})
    return load_dict({"type": "scene", "camera": sensor} | plugins)


def error_of(camera=None, **plugins):
    with pytest.raises(Error) as caught:
        load(camera, **plugins)
    return str(caught.value)


def interior(**parameters):
    medium = {"type": "heterogeneous"} | parameters
    return load(cube={"type": "cube", "bsdf": {"type": "null"}, "interior": medium}).shapes[0].interior


def medium_error(**parameters):
    with pytest.raises(Error) as caught:
        interior(**parameters)
    return str(caught.value)


def emitter(**parameters):
    return load(light=parameters).emitters[0]


def corners(volume):
    """World positions of the corners `lower` and `upper` of a volume's box."""
    ends = np.stack([volume.lower, volume.upper])
    return ends @ volume.index_to_world[:3, :3].T + volume.index_to_world[:3, 3]


# -- sensor, film, sampler, integrator -------------------------------------------------------------


def x_fov(camera, width, height):
    """The horizontal field of view in degrees that a record's fov and axis mean for a film."""
    axes = {"x": width, "y": height, "diagonal": np.hypot(width, height)}
    axes |= {"smaller": min(width, height), "larger": max(width, height)}
    half = np.tan(np.deg2rad(camera.fov / 2)) * width / axes[camera.fov_axis]
    return 2 * np.rad2deg(np.arctan(half))


@pytest.mark.parametrize(
    ("axis", "wide", "tall"),
    [
        ("x", 40.0, 40.0),
        ("y", 72.10477447509766, 20.628210067749023),
        ("diagonal", 36.064788818359375, 18.49018669128418),
        ("smaller", 72.10477447509766, 40.0),
        ("larger", 40.0, 20.628210067749023),
    ],
)
def test_fov_axes_are_mitsubas(axis, wide, tall):
    camera = load({"fov_axis": axis}).sensor
    assert x_fov(camera, 400, 200) == pytest.approx(wide, rel=1e-6)
    assert x_fov(camera, 200, 400) == pytest.approx(tall, rel=1e-6)


@pytest.mark.parametrize(
    ("given", "mitsuba"),
    [
        ({}, 42.31171417236328),
        ({"focal_length": "50mm"}, 42.31171417236328),
        ({"focal_length": "85"}, 25.648573),
    ],
)
def test_focal_lengths_are_for_35_mm_film(given, mitsuba):
    camera = load_dict({"type": "scene", "camera": {"type": "perspective"} | given}).sensor
    assert x_fov(camera, 400, 200) == pytest.approx(mitsuba, rel=1e-6)


def test_defaults_are_mitsubas():
    scene = load()
    assert scene.film == Film(768, 576, ReconstructionFilter("gaussian", 2.0, 0.5), False)
    assert scene.integrator == Integrator(-1, 5, False, {})
    assert (scene.spp, scene.seed) == (4, 0)
    assert (scene.sensor.near_clip, scene.sensor.far_clip) == (0.01, 1e4)
    medium = interior(type="homogeneous")
    assert (medium.sigma_t.value, medium.albedo.value, medium.scale) == ((1.0,), (0.75,), (1.0,))
    assert (medium.phase, medium.sample_emitters, medium.homogeneous) == (Phase("isotropic"), True, True)
    assert interior(phase={"type": "hg"}).phase == Phase("hg", 0.8)
    assert emitter(type="constant") == ConstantEmitter((1.0,))


@pytest.mark.parametrize(
    ("given", "expected"),
    [
        ({"type": "box"}, ReconstructionFilter("box", 0.5, 0.0)),
        ({"type": "tent"}, ReconstructionFilter("tent", 1.0, 0.0)),
        ({"type": "tent", "radius": 2.0}, ReconstructionFilter("tent", 2.0, 0.0)),
        ({"type": "gaussian", "stddev": 0.7}, ReconstructionFilter("gaussian", 2.8, 0.7)),
        ({"type": "mitchell"}, ReconstructionFilter("mitchell", 2.0, 0.0, 1 / 3, 1 / 3)),
        ({"type": "mitchell", "B": 1, "C": 0}, ReconstructionFilter("mitchell", 2.0, 0.0, 1.0, 0.0)),
        ({"type": "catmullrom"}, ReconstructionFilter("mitchell", 2.0, 0.0, 0.0, 0.5)),
        ({"type": "lanczos"}, ReconstructionFilter("lanczos", 3.0, 0.0)),
    ],
)
def test_filter_radii_are_mitsubas(given, expected):
    assert load({"film": {"type": "hdrfilm", "rfilter": given}}).film.rfilter == expected


def test_the_integrator_carries_choices():
    choices = {"technique": "delta", "majorant": "grid", "probability": "history", "control": "mean"}
    loaded = load(integrator={"type": "volpath", "rr_depth": 9} | choices).integrator
    assert loaded == Integrator(-1, 9, False, choices)


def test_path_and_moment_are_volpath_where_they_can_be():
    limits = {"max_depth": 7, "rr_depth": 3, "hide_emitters": True}
    path = {"type": "path"} | limits
    assert load(integrator=path).integrator == Integrator(7, 3, True, {})
    assert load(integrator={"type": "moment", "inner": path}).integrator == Integrator(7, 3, True, {})
    medium = {"type": "homogeneous"}
    fog = {"type": "cube", "bsdf": {"type": "null"}, "exterior": medium}
    for integrator in (path, {"type": "moment", "inner": path}):
        message = error_of(integrator=integrator, fog=fog)
        assert "scene.integrator: integrator 'path' sees no media" in message
        assert "(shape 'fog'); use volpath" in message
    load(integrator={"type": "moment", "inner": {"type": "volpath"}}, fog=fog)
    assert "holds another one, this one is empty" in error_of(integrator={"type": "moment"})
    two = {"type": "moment", "a": {"type": "path"}, "b": {"type": "volpath"}}
    assert "takes one integrator, got 2" in error_of(integrator=two)
    assert "unknown parameter 'technique'" in error_of(integrator={"type": "path", "technique": "delta"})


def test_thin_lenses_are_perspective_cameras_with_an_aperture():
    lens = load({"type": "thinlens", "aperture_radius": 0.2, "far_clip": 50, "fov_axis": "y"}).sensor
    assert (lens.aperture_radius, lens.focus_distance) == (0.2, 50.0)  # Mitsuba: in focus at the far plane
    assert (lens.fov, lens.fov_axis, lens.near_clip) == (40.0, "y", 0.01)
    assert load({"type": "thinlens", "aperture_radius": 0, "focus_distance": 3}).sensor.aperture_radius == 0


def test_a_crop_is_a_window_of_the_film():
    crop = {"crop_offset_x": 2, "crop_offset_y": 1, "crop_width": 3, "crop_height": 2}
    film = load({"film": {"type": "hdrfilm", "width": 6, "height": 4} | crop}).film
    assert (film.width, film.height, film.crop, film.window) == (6, 4, (2, 1, 3, 2), (2, 1, 3, 2))
    assert load({"film": {"type": "hdrfilm", "width": 6, "height": 4, "crop_width": 5}}).film.crop == (
        0,
        0,
        5,
        4,
    )
    whole = load({"film": {"type": "hdrfilm", "width": 6, "height": 4, "crop_width": 6}}).film
    assert (whole.crop, whole.window) == (None, (0, 0, 6, 4))


@pytest.mark.parametrize(
    ("camera", "message"),
    [
        ({"fov": 0}, "scene.camera.fov: 'fov' of sensor 'perspective' must be in (0, 180)"),
        ({"fov": 180.0}, "must be in (0, 180)"),
        ({"fov": True}, "must be a number"),
        ({"near_clip": 10**400}, "must be finite"),
        ({"focal_length": "50mm"}, "not both"),
        ({"fov_axis": "z"}, "supported: x, y, diagonal, smaller, larger"),
        ({"near_clip": 0}, "must be finite and > 0"),
        ({"far_clip": 0.001}, "beyond near_clip"),
        ({"to_world": scale(2)}, "must not scale"),
        ({"to_world": np.zeros((4, 4))}, "last row"),
        ({"shutter": 0.0}, "unknown parameter 'shutter'"),
        ({"film": {"type": "hdrfilm", "width": 0}}, "from 1 to 65536, got 0"),
        ({"film": {"type": "hdrfilm", "height": -4}}, "from 1 to 65536, got -4"),
        ({"film": {"type": "hdrfilm", "width": 65537}}, "from 1 to 65536"),
        ({"film": {"type": "hdrfilm", "width": 65536, "height": 65536}}, "too large"),
        ({"film": {"type": "hdrfilm", "width": 64.0}}, "must be an integer"),
        ({"film": {"type": "hdrfilm", "crop_width": 769}}, "crop_width 769 exceed its width 768"),
        ({"film": {"type": "hdrfilm", "crop_offset_y": 1}}, "crop_offset_y: the crop window reaches beyond"),
        ({"film": {"type": "hdrfilm", "crop_height": 0}}, "from 1 to"),
        ({"film": {"type": "hdrfilm", "crop_offset_x": -1}}, "from 0 to"),
        ({"film": {"type": "hdrfilm", "pixel_format": "xyz"}}, "rgb, rgba"),
        (
            {"film": {"type": "hdrfilm", "rfilter": {"type": "mitchell", "B": 1.5}}},
            "'B' of rfilter 'mitchell' must be in [0, 1]",
        ),
        (
            {"film": {"type": "hdrfilm", "rfilter": {"type": "mitchell", "b": 0.5}}},
            "unknown parameter 'b'",
        ),
        ({"film": {"type": "hdrfilm", "rfilter": {"type": "lanczos", "lobes": 0}}}, "from 1 to 16"),
        ({"type": "thinlens"}, "a thinlens needs an aperture_radius"),
        ({"type": "thinlens", "aperture_radius": -1}, "finite and >= 0"),
        ({"type": "thinlens", "aperture_radius": 1, "focus_distance": 0}, "finite and > 0"),
        (
            {"type": "thinlens", "aperture_radius": 1, "principal_point_offset_x": 0.1},
            "unknown parameter 'principal_point_offset_x'",  # as in Mitsuba
        ),
        (
            {"film": {"type": "hdrfilm", "rfilter": {"type": "box", "radius": 2.0}}},
            "unknown parameter 'radius'",
        ),
        ({"sampler": {"type": "independent", "sample_count": 0}}, "from 1"),
        ({"sampler": {"type": "multijitters"}}, "scene.camera.sampler: unknown plugin 'multijitters'; did"),
        ({"a": {"type": "hdrfilm"}, "b": {"type": "hdrfilm"}}, "takes one film"),
        ({"bsdf": {"type": "null"}}, "takes no bsdf"),
    ],
)
def test_impossible_cameras_are_errors(camera, message):
    fov = {} if "focal_length" not in camera else {"fov": 40}
    assert message in error_of(fov | camera)


# -- volumes and media -----------------------------------------------------------------------------


def test_gridvolume_samples_are_cell_centres_of_the_unit_cube():
    values = np.arange(24.0).reshape(2, 3, 4)  # [z, y, x]
    volume = interior(
        sigma_t={"type": "gridvolume", "grid": values, "to_world": translate([1, 2, 3]) @ scale([4, 3, 2])}
    ).sigma_t
    np.testing.assert_allclose(volume.index_to_world @ [0, 0, 0, 1], [1.5, 2.5, 3.5, 1])
    np.testing.assert_allclose(volume.index_to_world @ [3, 2, 1, 1], [4.5, 4.5, 4.5, 1])
    np.testing.assert_allclose(corners(volume), [[1, 2, 3], [5, 5, 5]])  # Mitsuba's bounding box
    assert volume.grid.values[1, 2, 3, 0] == 23.0
    assert (volume.filter_type, volume.wrap_mode, volume.clipped) == ("trilinear", "clamp", True)


def test_use_grid_bbox_puts_samples_into_the_files_box(tmp_path):
    path = tmp_path / "fog.vol"
    write_vol(path, np.ones((2, 2, 2, 1), np.float32), np.array([[-1.0, 0, 0], [1, 2, 8]]))
    sigma_t = {"type": "gridvolume", "filename": str(path)}
    np.testing.assert_allclose(corners(interior(sigma_t=sigma_t).sigma_t), [[0, 0, 0], [1, 1, 1]])
    boxed = interior(sigma_t=sigma_t | {"use_grid_bbox": True, "to_world": scale(10)}).sigma_t
    np.testing.assert_allclose(corners(boxed), [[-10, 0, 0], [10, 20, 80]])


def test_one_file_is_read_once(tmp_path):
    np.save(tmp_path / "fog.npy", np.ones((2, 2, 2)))
    volume = {"type": "gridvolume", "filename": str(tmp_path / "fog.npy")}
    moved = volume | {"to_world": translate([2, 0, 0])}
    scene = load(
        a={"type": "heterogeneous", "sigma_t": volume}, b={"type": "heterogeneous", "sigma_t": moved}
    )
    assert not scene.shapes
    medium = interior(sigma_t=volume, albedo=moved)
    assert medium.sigma_t.grid is medium.albedo.grid


@pytest.fixture
def vdb(tmp_path, monkeypatch):
    """A file name for which the OpenVDB reader gives a small sparse grid of the background asked for."""
    path = tmp_path / "fog.vdb"
    path.touch()

    def give(background=0.0):
        grid = SparseGrid(
            leaf_origins=np.array([[0, 0, 0]], np.int32),
            leaf_values=np.ones((1, 8, 8, 8, 1), np.float32),
            leaf_active=np.full((1, 64), 255, np.uint8),
            tile_origins=np.zeros((0, 3), np.int32),
            tile_sizes=np.zeros(0, np.int32),
            tile_values=np.zeros((0, 1), np.float32),
            tile_active=np.zeros(0, bool),
            background=np.array([background], np.float32),
            index_to_world=translate([0, 0, 5]) @ scale(0.1),
            active_box=np.array([[0, 0, 0], [7, 7, 7]], np.int32),
            source="fog.vdb",
        )
        monkeypatch.setattr("clvol.scene.volume.read_sparse", lambda path, name: grid)
        monkeypatch.setattr("clvol.scene.volume.read_volume", lambda path, name: grid)
        return str(path)

    return give


def test_vdb_samples_sit_at_index_positions_under_the_files_transform(vdb):
    name = vdb()
    volume = interior(sigma_t={"type": "vdbvolume", "filename": name, "to_world": scale(2)}).sigma_t
    np.testing.assert_allclose(volume.index_to_world @ [1, 2, 3, 1], [0.2, 0.4, 10.6, 1])
    np.testing.assert_array_equal(volume.lower, [-1, -1, -1])  # the active box, one sample beyond
    np.testing.assert_array_equal(volume.upper, [8, 8, 8])
    assert volume.clipped
    same = interior(sigma_t={"type": "gridvolume", "filename": name, "to_world": scale(2)}).sigma_t
    np.testing.assert_array_equal(same.index_to_world, volume.index_to_world)
    np.testing.assert_array_equal(same.lower, volume.lower)


@pytest.mark.skipif(not DATA.is_dir(), reason="CLVOL_DATA is not set")
def test_the_boxes_of_real_vdb_files():
    fire = interior(sigma_t={"type": "vdbvolume", "filename": str(DATA / "fire.vdb")}).sigma_t
    assert (fire.lower.tolist(), fire.upper.tolist()) == ([4, 2, 6], [76, 75, 126])
    fog = interior(sigma_t={"type": "vdbvolume", "filename": str(DATA / "box_fog.vdb")}).sigma_t
    assert (fire.clipped, fog.clipped) == (True, False)
    assert "smoke" in medium_error(
        sigma_t={"type": "vdbvolume", "filename": str(DATA / "fire.vdb"), "grid": "smoke"}
    )


@pytest.mark.skipif(not DATA.is_dir(), reason="CLVOL_DATA is not set")
def test_real_environments_load():
    assert emitter(type="envmap", filename=str(DATA / "sunset.exr")).radiance.max() == 6248.0


def test_a_vdb_with_a_background_reaches_beyond_its_box(vdb):
    assert not interior(sigma_t={"type": "vdbvolume", "filename": vdb(1.0)}).sigma_t.clipped


def test_a_sparse_grid_cannot_be_repeated_and_its_background_is_checked(vdb):
    volume = {"type": "gridvolume", "filename": vdb(1.5)}
    assert "no wrap_mode" in medium_error(sigma_t=volume | {"wrap_mode": "mirror"})
    assert "reaches 1.5" in medium_error(albedo=volume)


def test_equal_components_collapse_to_grey():
    rgb = {"type": "rgb", "value": [2.0, 2.0, 2.0]}
    assert interior(sigma_t=rgb).sigma_t.value == (2.0,)
    assert interior(sigma_t={"type": "rgb", "value": [2.0, 2.0, 3.0]}).sigma_t.value == (2.0, 2.0, 3.0)
    const = interior(sigma_t={"type": "constvolume", "value": rgb, "to_world": scale(3)}).sigma_t
    assert isinstance(const, ConstVolume)
    assert const.value == (2.0,)
    np.testing.assert_array_equal(const.to_world, scale(3))


def test_a_constant_spectrum_is_grey_in_media_and_equal_energy_white_in_lights():
    spectrum = {"type": "spectrum", "value": 1.0}
    assert interior(sigma_t=spectrum).sigma_t.value == (1.0,)
    assert emitter(type="constant", radiance=spectrum).radiance == pytest.approx(
        (1.204794, 0.948291, 0.908916)
    )


def test_a_spectrum_out_of_the_gamut_of_albedos_is_cut():
    bright = {"type": "spectrum", "value": [(400, 1), (500, 2), (600, 3), (700, 1)]}
    assert interior(albedo=bright).albedo.value == (1.0,)
    assert interior(sigma_t=bright).sigma_t.value == pytest.approx((2.778642, 2.476576, 1.409857), rel=3e-5)


ONES = np.ones((2, 2, 2))


@pytest.mark.parametrize(
    ("parameters", "message"),
    [
        ({"albedo": 1.5}, "scene.cube.interior.albedo: 'albedo' of medium 'heterogeneous' must be in [0, 1]"),
        ({"albedo": -0.1}, "must be in [0, 1]"),
        ({"albedo": {"type": "rgb", "value": [0.5, 0.5, 1.1]}}, "must be in [0, 1]"),
        ({"albedo": {"type": "constvolume", "value": 1.5}}, "at most 1"),
        (
            {"albedo": {"type": "gridvolume", "data": ONES * 1.5}},
            "scene.cube.interior.albedo: 'albedo' must be at",
        ),
        ({"sigma_t": -1.0}, "finite and >= 0"),
        ({"sigma_t": float("inf")}, "finite and >= 0"),
        ({"sigma_t": [1, 2, 3]}, "must be a number, an rgb or a spectrum"),
        ({"sigma_t": "thick"}, "must be a number, an rgb or a spectrum"),
        ({"sigma_t": {"type": "rgb", "value": [1, 2]}}, "one or three numbers"),
        ({"sigma_t": {"type": "rgb", "val": [1, 2, 3]}}, "unknown 'val'"),
        ({"sigma_t": {"type": "hg"}}, "must be a number, a colour or a volume, got a 'hg'"),
        ({"sigma_t": {"type": "gridvolume", "data": ONES * -1}}, "negative"),
        ({"sigma_t": {"type": "gridvolume", "data": ONES * np.nan}}, "scene.cube.interior.sigma_t.data"),
        ({"sigma_t": {"type": "gridvolume", "data": ONES[0]}}, "axes"),
        ({"sigma_t": {"type": "gridvolume", "data": np.ones((0, 2, 2))}}, "no samples"),
        ({"sigma_t": {"type": "gridvolume", "data": "ones"}}, "must be an array of numbers"),
        ({"sigma_t": {"type": "gridvolume"}}, "needs one of filename, grid (array) and data"),
        ({"sigma_t": {"type": "gridvolume", "data": ONES, "grid": ONES}}, "data and grid"),
        (
            {"sigma_t": {"type": "gridvolume", "filename": "no.vol"}},
            "sigma_t.filename: file 'no.vol' does not",
        ),
        ({"sigma_t": {"type": "gridvolume", "filename": "\0" * 9000}}, "does not exist"),
        ({"sigma_t": {"type": "gridvolume", "data": ONES, "wrap_mode": "wrap"}}, "supported: clamp, repeat"),
        ({"sigma_t": {"type": "gridvolume", "data": ONES, "to_world": scale([1, 1, 0])}}, "singular"),
        (
            {"sigma_t": {"type": "gridvolume", "data": ONES, "filter": "nearest"}},
            "did you mean 'filter_type'?",
        ),
        ({"sigma_t": {"type": "vdbvolume"}}, "needs a filename"),
        ({"sigma_t2": {"type": "constvolume"}}, "unknown parameter 'sigma_t2' of medium"),
        ({"type": "homogeneous", "sigma_t": {"type": "gridvolume", "data": ONES}}, "use the heterogeneous"),
        ({"scale": -1.0}, "finite and >= 0"),
        ({"scale": {"type": "rgb", "value": [1, -2, 3]}}, "finite and >= 0"),
        ({"scale": {"type": "constvolume"}}, "'scale' of medium 'heterogeneous' must be a number, an rgb"),
    ],
)
def test_impossible_media_are_errors(parameters, message):
    assert message in medium_error(**parameters)


def test_broken_voxels_are_volume_errors():
    with pytest.raises(VolumeError):
        interior(sigma_t={"type": "gridvolume", "data": ONES * np.nan})


# -- shapes ----------------------------------------------------------------------------------------


def test_a_spheres_center_and_radius_apply_before_to_world():
    sphere = {"type": "sphere", "center": [1, 2, 3], "radius": 2, "bsdf": {"type": "null"}}
    shape = load(ball=sphere | {"to_world": translate([10, 0, 0]) @ scale(3)}).shapes[0]
    np.testing.assert_allclose(shape.to_world @ [0, 0, 0, 1], [13, 6, 9, 1])  # Mitsuba's centre
    np.testing.assert_allclose(shape.to_world @ [1, 0, 0, 1], [19, 6, 9, 1])  # and radius, 6
    assert (shape.kind, shape.name, shape.interior) == ("sphere", "ball", None)


@pytest.mark.parametrize(
    ("shape", "message"),
    [
        (
            {"type": "cube", "bsdf": {"type": "measured"}},
            "scene.s.bsdf: bsdf 'measured' is not supported",
        ),
        ({"type": "cube", "bsdf": {"type": "nul"}}, "unknown plugin 'nul'; did you mean 'null'?"),
        (
            {"type": "sdfgrid", "filename": "a.vol"},
            "shape 'sdfgrid' is not supported in this version; take a mesh of it, as .ply",
        ),
        ({"type": "torus"}, "scene.s: unknown plugin 'torus'"),
        ({"type": "cube", "inside": {"type": "homogeneous"}}, "must be its 'interior' or 'exterior'"),
        ({"type": "cube", "light": {"type": "point"}}, "scene.s.light: a shape takes no emitter 'point'"),
        ({"type": "cube", "a": {"type": "area"}, "b": {"type": "area"}}, "takes one emitter, got 2"),
        ({"type": "cube", "light": {"type": "area", "to_world": scale(2)}}, "unknown parameter 'to_world'"),
        ({"type": "cube", "light": {"type": "area", "radiance": -1.0}}, "must be in [0, 1e+15]"),
        (
            {"type": "cube", "eye": {"type": "perspective"}},
            "a shape takes no sensor 'perspective'; irradiancemeters go into shapes",
        ),
        ({"type": "cube", "a": {"type": "null"}, "b": {"type": "null"}}, "takes one bsdf, got 2"),
        ({"type": "cube", "flip_normals": 1}, "must be true or false"),
        ({"type": "disk", "face_normals": True}, "unknown parameter 'face_normals'"),  # as in Mitsuba
        ({"type": "cylinder", "radius": 0}, "must be finite and > 0"),
        ({"type": "cylinder", "p1": [0, 0, 0]}, "scene.s.p1: p0 and p1 are the same point"),
        (
            {"type": "cylinder", "to_world": scale([2, 1, 1]), "light": {"type": "area"}},
            "to_world of a cylinder that emits must not stretch",
        ),
        ({"type": "sphere", "radius": 0}, "must be finite and > 0"),
        ({"type": "sphere", "radius": -1}, "must be finite and > 0"),
        ({"type": "sphere", "center": [1, 2]}, "three finite numbers"),
        ({"type": "sphere", "to_world": scale([1, 2, 1])}, "must not stretch"),
        ({"type": "cube", "to_world": "left"}, "expected a transform"),
        ({"size": 3}, "scene.s: a dict without a 'type'"),
    ],
)
def test_other_shapes_are_errors(shape, message):
    assert message in error_of(s=shape)


@pytest.mark.parametrize(
    ("ends", "uv", "hit"),  # where rays hit Mitsuba's cylinders of radius ½
    [
        (([1, 0, 0], [3, 0, 0]), (0.4345, 0.5), (2, 0.2, 0.45825757)),
        (([0, 0, 0], [0, 2, 0]), (0.7820, 0.1), (0.1, 0.2, 0.48989795)),
        (([0, 0, 2], [0, 0, 0]), (0.7820, 0.9), (0.1, 0.48989795, 0.2)),
    ],
)
def test_cylinders_run_from_p0_to_p1_with_mitsubas_seam(ends, uv, hit):
    shape = load(s={"type": "cylinder", "p0": ends[0], "p1": ends[1], "radius": 0.5}).shapes[0]
    angle = 2 * np.pi * uv[0]
    on_unit_cylinder = [np.cos(angle), np.sin(angle), uv[1], 1]
    np.testing.assert_allclose((shape.to_world @ on_unit_cylinder)[:3], hit, atol=3e-4)


def test_cylinders_that_emit_may_be_scaled_and_others_stretched():
    light = {"light": {"type": "area"}}
    load(s={"type": "cylinder", "p1": [1, 1, 0], "to_world": rotate([1, 2, 3], 50) @ scale(3)} | light)
    load(s={"type": "cylinder", "to_world": scale([2, 2, 5])} | light)
    stretched = load(s={"type": "cylinder", "to_world": scale([2, 1, 1])}).shapes[0]
    np.testing.assert_array_equal(stretched.to_world, scale([2, 1, 1]))


def reflectance(shape):
    """Of a shape that is diffuse."""
    assert isinstance(shape.bsdf, Diffuse)
    return shape.bsdf.reflectance


@pytest.mark.parametrize("kind", ["sphere", "cube", "rectangle", "disk", "cylinder"])
def test_shapes_are_diffuse_unless_told_otherwise(kind, caplog):
    """As Mitsuba has it: also those with a medium, and black those that emit."""
    plain = load(s={"type": kind, "to_world": scale(2), "flip_normals": True}).shapes[0]
    assert (plain.kind, reflectance(plain), plain.emission) == (kind, (0.5,), None)
    assert plain.flip_normals
    np.testing.assert_array_equal(plain.to_world, scale(2))
    assert not caplog.text
    fog = {"type": "homogeneous"}
    full = load(s={"type": kind, "interior": fog, "exterior": fog | {"sigma_t": 3.0}}).shapes[0]
    assert reflectance(full) == (0.5,)
    assert (full.interior.sigma_t.value, full.exterior.sigma_t.value) == ((1.0,), (3.0,))
    assert "scene.s: the shape has a medium but no BSDF, so it is diffuse and hides the medium" in caplog.text


def test_a_faulty_bsdf_is_not_told_to_be_missing(caplog):
    bent = {"type": "bumpmap", "heights": {"type": "checkerboard"}, "nested": {"type": "null"}}
    assert "no slope" in error_of(s={"type": "cube", "bsdf": bent, "interior": {"type": "homogeneous"}})
    assert not caplog.text


def test_an_area_emitter_makes_its_shape_a_light():
    light = {"type": "area", "radiance": {"type": "rgb", "value": [1, 2, 3]}}
    lamp = load(s={"type": "disk", "light": light}).shapes[0]
    assert (lamp.emission, reflectance(lamp)) == ((1.0, 2.0, 3.0), (0.0,))
    white = load(s={"type": "disk", "light": {"type": "area"}, "bsdf": {"type": "diffuse"}}).shapes[0]
    assert (white.emission, reflectance(white)) == ((1.0,), (0.5,))
    assert error_of(light=light) == (
        "scene.light: an area emitter outside a shape lights nothing; put it into the shape that emits"
    )


# -- emitters --------------------------------------------------------------------------------------


def test_spots_fade_from_three_quarters_of_their_cutoff():
    spot = emitter(type="spot", cutoff_angle=40, intensity=5, to_world=translate([1, 2, 3]) @ scale(2))
    assert (spot.cutoff_angle, spot.beam_width, spot.intensity) == (40.0, 30.0, (5.0,))
    np.testing.assert_array_equal(spot.to_world @ [0, 0, 0, 1], [1, 2, 3, 1])
    plain = emitter(type="spot")
    assert (plain.cutoff_angle, plain.beam_width, plain.intensity) == (20.0, 15.0, (1.0,))
    assert emitter(type="spot", beam_width=20).beam_width == 20.0


def test_light_travels_along_local_z_or_the_direction():
    turned = emitter(type="directional", to_world=rotate([1, 0, 0], 90))
    assert turned.direction == pytest.approx((0, -1, 0), abs=1e-15)
    assert emitter(type="directional", direction=[0, 3, 4]).direction == pytest.approx((0, 0.6, 0.8))
    assert emitter(type="point", to_world=translate([1, 2, 3])).position == (1.0, 2.0, 3.0)
    assert emitter(type="point", position=[1, 2, 3], intensity=5).intensity == (5.0,)


def test_envmaps_are_linear_rgb_times_scale(tmp_path):
    sky = np.linspace(0, 3, 24, dtype=np.float32).reshape(4, 2, 3)
    np.testing.assert_array_equal(emitter(type="envmap", bitmap=sky, scale=2.0).radiance, 2 * sky)
    path = str(tmp_path / "sky.exr")
    output = oiio.ImageOutput.create(path)
    output.open(path, oiio.ImageSpec(2, 4, 3, "float"))
    output.write_image(sky)
    output.close()
    loaded = emitter(type="envmap", filename=path, scale=0.5).radiance
    np.testing.assert_array_equal(loaded, 0.5 * sky)
    assert (loaded.dtype, loaded.shape) == (np.float32, (4, 2, 3))


def test_a_stretched_environment_is_an_error():
    """Its solid angles would no longer be those the light is sampled with."""
    sky = np.ones((3, 4, 3))
    assert "must not stretch" in error_of(e={"type": "envmap", "bitmap": sky, "to_world": scale([1, 3, 1])})
    emitter(type="envmap", bitmap=sky, to_world=rotate([0, 1, 0], 30) @ scale(2))


def test_other_integrator_parameters_are_unknown():
    assert "unknown parameter 'majorant_scale'" in error_of(
        integrator={"type": "volpath", "majorant_scale": 2.0}
    )


def test_an_envmap_beyond_single_precision_is_one_clear_error():
    """Also times 0, which makes no number of it."""
    for value, factor in ((1e30, 1e300), (np.inf, 0.0)):
        sky = np.full((3, 4, 3), value, np.float32)
        with warnings.catch_warnings():
            warnings.simplefilter("error")
            assert "radiance must be finite" in error_of(e={"type": "envmap", "bitmap": sky, "scale": factor})


def test_rounding_below_zero_in_an_envmap_becomes_zero():
    sky = np.full((3, 4, 3), 1000.0)
    sky[0, 0] = -1e-3
    assert emitter(type="envmap", bitmap=sky).radiance.min() == 0.0


def test_8_bit_envmaps_are_srgb_decoded(tmp_path):
    grey = np.full((3, 4, 3), 127, np.uint8)
    path = str(tmp_path / "sky.png")
    output = oiio.ImageOutput.create(path)
    output.open(path, oiio.ImageSpec(4, 3, 3, "uint8"))
    output.write_image(grey)
    output.close()
    mitsuba = 0.21223068
    for given in ({"bitmap": grey}, {"filename": path}):
        np.testing.assert_allclose(emitter(type="envmap", **given).radiance, mitsuba, rtol=1e-6)
    assert emitter(type="envmap", bitmap=np.full((3, 4), 0.25)).radiance[0, 0].tolist() == [0.25] * 3


@pytest.mark.parametrize(
    ("light", "message"),
    [
        (
            {"type": "constant", "radiance": -1.0},
            "scene.light.radiance: 'radiance' of emitter 'constant' must be",
        ),
        ({"type": "constant", "radiance": {"type": "rgb", "value": [1, -1, 1]}}, "must be in [0, 1e+15]"),
        ({"type": "envmap"}, "either a filename or a bitmap"),
        ({"type": "envmap", "filename": "no.exr"}, "file 'no.exr' does not exist"),
        ({"type": "envmap", "bitmap": np.ones((2, 2, 3))}, "at least 2 x 3 pixels"),
        (
            {"type": "envmap", "bitmap": np.full((3, 3, 3), np.nan)},
            "finite and >= 0; it is not at row 0, column 0",
        ),
        ({"type": "envmap", "bitmap": np.full((3, 3, 3), -1.0)}, "finite and >= 0"),
        ({"type": "envmap", "bitmap": np.ones((3, 3, 5))}, "got shape (3, 3, 5)"),
        ({"type": "envmap", "bitmap": np.ones((3, 3, 3), int)}, "uint8 or uint16"),
        ({"type": "directional", "direction": [0, 0, 0]}, "direction is zero"),
        ({"type": "directional", "direction": [0, 0, 1], "to_world": np.eye(4)}, "not both"),
        ({"type": "point", "position": [0, 0, np.nan]}, "three finite numbers"),
        ({"type": "point", "position": [0, 0, 1], "to_world": np.eye(4)}, "not both"),
        ({"type": "projecter"}, "did you mean 'projector'"),
        ({"type": "spot", "cutoff_angle": 0}, "leaves no light"),
        ({"type": "spot", "cutoff_angle": 200}, "in [0, 180]"),
        ({"type": "spot", "beam_width": 21}, "beam_width (21) must not exceed cutoff_angle (20)"),
        ({"type": "spot", "to_world": scale([1, 1, 2])}, "must not stretch"),
        (
            {"type": "spot", "texture": 0.5},
            "the texture of a spot must be a bitmap or a checkerboard",
        ),
        (
            {"type": "constant", "radiance": {"type": "checkerboard"}},
            "must be a number, an rgb",
        ),
    ],
)
def test_impossible_lights_are_errors(light, message):
    assert message in error_of(light=light)


def test_a_file_that_is_no_image_is_an_error(tmp_path):
    path = tmp_path / "sky.exr"
    path.write_bytes(b"not an image")
    assert "cannot read image" in error_of(light={"type": "envmap", "filename": str(path)})


# -- the scene -------------------------------------------------------------------------------------


def test_a_scene_has_a_sensor_one_integrator_and_one_environment():
    with pytest.raises(SceneError, match="no sensor"):
        load_dict({"type": "scene"})
    assert "takes one integrator" in error_of(a={"type": "volpath"}, b={"type": "volpathmis"})
    two = error_of(a={"type": "constant"}, b={"type": "constant"})
    assert (
        two == "scene.b: a scene takes one environment emitter, this is the second; the first is at scene.a"
    )


@pytest.mark.parametrize(
    "scene",
    [
        {"type": "sphere"},
        {"type": "scene", 3: 4},
        {"type": "scene", "a": 4},
        {"type": "scene", "a": {"type": "ref"}},
        {"type": "scene", "a": {"type": "ref", "id": ["b"]}},
        {"type": "scene", "a": {"type": "rgb", "value": 1}},
        {"type": "scene", "a": {"type": "scene"}},
        {"type": "scene", "a": {"type": "path"}},
        {},
        [],
        None,
    ],
)
def test_what_is_no_scene_is_an_error(scene):
    with pytest.raises(SceneError):
        load_dict(scene)


def test_a_dict_inside_itself_is_an_error():
    scene = {"type": "scene"}
    scene["self"] = scene
    with pytest.raises(SceneError, match="nested"):
        load_dict(scene)


def test_unused_plugins_are_checked_too():
    assert "bsdf 'measured' is not supported" in error_of(paint={"type": "measured"})


def test_parameters_without_effect_are_accepted():
    medium = {"type": "homogeneous", "has_spectral_extinction": False}
    load(
        {"film": {"type": "hdrfilm", "banner": False, "file_format": "openexr"}, "medium": medium},
        integrator={"type": "volpath", "block_size": 32},
        light={
            "type": "envmap",
            "bitmap": np.ones((3, 3, 3)),
            "mis_compensation": True,
            "sampling_weight": 2.0,
        },
        cube={"type": "cube", "bsdf": {"type": "null"}, "interior": medium, "face_normals": True},
    )


def test_the_slab_scene_is_van_de_hulsts():
    scene = load_file(SCENES / "slab.xml", spp=8, res=64)
    slab = scene.shapes[0]
    medium = slab.interior
    assert (medium.albedo.value, medium.phase) == ((0.9,), Phase("hg", 0.75))
    thickness = 2 * slab.to_world[1, 1]
    assert medium.sigma_t.value[0] * medium.scale[0] * thickness == 2.0
    assert (scene.film.width, scene.film.height, scene.spp) == (64, 64, 8)
