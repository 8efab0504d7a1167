"""Textures that look up a volume at the surface's point: values in NumPy, pictures in closed form."""

import logging

import numpy as np
import pytest
from probe import Probe

import clvol
from clvol.scene.materials import Diffuse, Mask
from clvol.scene.records import (
    ConstantEmitter,
    Film,
    Integrator,
    Perspective,
    ReconstructionFilter,
    Scene,
    Shape,
)
from clvol.tables.colours import LUMINANCE

RNG = np.random.default_rng(5)
COLOURS, GREY = RNG.random((3, 4, 5, 3)).astype(np.float32), RNG.random((4, 3, 2)).astype(np.float32)
PLACE = clvol.translate([0.2, -0.1, 0.3]) @ clvol.rotate([1, 2, 3], 25.0) @ clvol.scale([1.5, 1.0, 0.8])


def texture_of(data, **more):
    return {"type": "volume", "volume": {"type": "gridvolume", "data": data, **more}}


def scene_with(*parts, sensor=None, **more):
    sensor = sensor or {"type": "perspective"}
    shapes = {f"part{n}": part for n, part in enumerate(parts)}
    return clvol.load_dict({"type": "scene", "s": sensor, **shapes, **more})


def shown(texture, name="reflectance"):
    """What a diffuse sphere is painted with."""
    bsdf = {"type": "diffuse", "reflectance": texture} if name == "reflectance" else texture
    return getattr(scene_with({"type": "sphere", "bsdf": bsdf}).shapes[0].bsdf, name)


def looked_up(data, places, filter_type, wrap_mode):
    """float64 (n, channels) of an array [z, y, x, channel] at positions (x, y, z) in its samples."""

    def sample(cell):
        index = []
        for axis, count in enumerate(data.shape[2::-1]):
            i = cell[:, axis]
            if wrap_mode == "mirror":
                i = i % (2 * count)
                i = np.where(i < count, i, 2 * count - 1 - i)
            index.append(i % count if wrap_mode == "repeat" else np.clip(i, 0, count - 1))
        return data[index[2], index[1], index[0]].astype(np.float64)

    if filter_type == "nearest":
        return sample(np.floor(places + 0.5).astype(int))
    base = np.floor(places).astype(int)
    total = 0.0
    for corner in np.ndindex(2, 2, 2):
        share = np.where(corner, places - base, 1 - (places - base)).prod(axis=1)
        total = total + share[:, None] * sample(base + corner)
    return total


def bare(*bsdfs):
    """A scene of a sphere for each BSDF."""
    shapes = tuple(Shape("sphere", np.eye(4), bsdf=bsdf) for bsdf in bsdfs)
    film = Film(4, 4, ReconstructionFilter("box", 0.5))
    return Scene(Perspective(np.eye(4), 40.0), film, Integrator(), shapes, (ConstantEmitter(),))


@pytest.mark.parametrize("wrap_mode", ["clamp", "repeat", "mirror"])
@pytest.mark.parametrize("filter_type", ["trilinear", "nearest"])
def test_a_texture_is_its_volume_at_the_point(device, filter_type, wrap_mode):
    ways = {"to_world": PLACE, "filter_type": filter_type, "wrap_mode": wrap_mode}
    coloured, grey = (shown(texture_of(data, **ways)) for data in (COLOURS, GREY))
    probe = Probe(device, bare(Diffuse(coloured), Diffuse(grey), Mask(Diffuse(), coloured)))
    count = 2048
    points = RNG.uniform(-4, 4, (count, 3)) * RNG.choice([0.3, 1.0], (count, 1))
    given = (points - probe.prepared.centre).astype(np.float32)
    body = """
    Scene there = *scene;
    there.texture_point = vload3(i, in0);
    for (int n = 0; n < 3; ++n)
        vstore3(texture_value(&there, n, (float2)(0.25f)), 3 * i + n, out0);
    """
    [found] = probe.run(
        ["texture/texture.h"], body, [np.zeros((count, 3, 3), np.float32)], [given], stage="shade"
    )
    local = (np.linalg.inv(PLACE) @ np.c_[points, np.ones(count)].T)[:3].T
    for n, data in enumerate((COLOURS, GREY[..., None], COLOURS)):
        places = local * data.shape[2::-1] - 0.5
        expected = looked_up(data, places, filter_type, wrap_mode)
        clear = np.ones(count, bool)
        if filter_type == "nearest":
            clear = (np.abs(places + 0.5 - np.round(places + 0.5)) > 1e-3).all(axis=1)
        if n == 2:  # an opacity is a number
            expected = (expected @ LUMINANCE)[:, None]
        assert clear.sum() > 0.9 * count
        assert np.abs(found[:, n] - expected)[clear].max() < 2e-4, (n, data.shape)


ALONG_Z = {
    "type": "orthographic",
    "to_world": clvol.look_at([0, 0, 3], [0, 0, 0], [0, 1, 0]),
    "film": {"type": "hdrfilm", "width": 8, "height": 8, "rfilter": {"type": "box"}},
}
SLOPE = np.zeros((2, 2, 2, 3), np.float32)
SLOPE[..., 0] = [0.1, 0.9]  # along x
SLOPE[..., 1] = np.array([0.2, 0.6])[:, None]  # along y
SLOPE[..., 2] = np.array([0.8, 0.3])[:, None, None]  # along z
# samples at -1 and 1 of each axis: linear between them
SPREAD = clvol.translate(-2) @ clvol.scale(4.0)


def slope_at(p):
    share = np.clip((np.stack(p, axis=-1) + 1) / 2, 0, 1)
    return np.array([0.1, 0.2, 0.8]) + share * [0.8, 0.4, -0.5]


def test_a_tilted_rectangle_shows_a_gradient_of_the_world():
    """Under a white sky a diffuse surface alone is as bright as its reflectance; z = x / 2 on it."""
    to_world = clvol.rotate([0, 1, 0], np.degrees(-np.arctan(0.5))) @ clvol.scale([2.0, 2.0, 1.0])
    bsdf = {
        "type": "twosided",
        "a": {"type": "diffuse", "reflectance": texture_of(SLOPE, to_world=SPREAD)},
    }
    plate = {"type": "rectangle", "to_world": to_world, "bsdf": bsdf}
    scene = scene_with(plate, sensor=ALONG_Z, sky={"type": "constant"})
    result = clvol.render(scene, spp=1024, seed=3)
    x, y = np.meshgrid((np.arange(8) - 3.5) / 4, (3.5 - np.arange(8)) / 4)
    expected = slope_at([x, y, 0.5 * x])
    error = np.sqrt(result.variance)
    assert error.max() < 0.002
    assert (np.abs(result.image - expected) < 5 * error + 1e-4).all()


def test_shadow_rays_and_paths_pass_the_holes_of_a_volume():
    """A sun through a plate of opacity 0.1 + 0.8 (x + 1) / 2, on a white floor that is seen through it."""
    opacity = texture_of(SLOPE[..., :1], to_world=SPREAD)
    black = {"type": "diffuse", "reflectance": 0.0}
    plate = {
        "type": "rectangle",
        "to_world": clvol.translate([0, 0, 1]) @ clvol.scale(5.0),
        "bsdf": {"type": "mask", "opacity": opacity, "a": {"type": "twosided", "b": black}},
    }
    floor = {
        "type": "rectangle",
        "to_world": clvol.scale(5.0),
        "bsdf": {"type": "diffuse", "reflectance": 1.0},
    }
    sun = {"type": "directional", "direction": [0.6, 0.0, -0.8]}
    scene = scene_with(plate, floor, sensor=ALONG_Z, sun=sun, integrator={"type": "path", "max_depth": 2})
    result = clvol.render(scene, spp=1024, seed=3)
    x = (np.arange(8) - 3.5) / 4
    through = 1 - slope_at([x - 0.75, x, x])[:, 0], 1 - slope_at([x, x, x])[:, 0]  # of light, and of sight
    expected = (0.8 / np.pi * through[0] * through[1])[None, :, None]
    error = np.sqrt(result.variance)
    assert error.max() < 0.01
    assert (np.abs(result.image - expected) < 5 * error + 2e-3).all()


def test_a_volume_of_normals_bends_the_frame_of_the_surfaces_coordinates():
    """The same all over a rectangle, which is of two triangles."""
    normal = np.array([0.6, 0.4, 0.6]) / np.linalg.norm([0.6, 0.4, 0.6])
    data = np.broadcast_to((normal + 1) / 2, (1, 1, 1, 3))
    bent = {"type": "normalmap", "normalmap": texture_of(data), "use_shadowing_function": False}
    plate = {"type": "rectangle", "bsdf": bent | {"a": {"type": "diffuse", "reflectance": 0.9}}}
    sun = {"type": "directional", "direction": [-0.6, 0.0, -0.8]}
    scene = scene_with(plate, sensor=ALONG_Z, sun=sun, integrator={"type": "path", "max_depth": 2})
    image = clvol.render(scene, spp=16).image
    np.testing.assert_allclose(image, 0.9 / np.pi * (normal @ [0.6, 0.0, 0.8]), rtol=1e-5)


@pytest.mark.contract
def test_what_needs_a_number_or_a_colour_takes_a_volume():
    grey, coloured = texture_of(GREY), texture_of(COLOURS)
    for bsdf in (
        {"type": "roughconductor", "alpha": coloured},
        {"type": "principled", "base_color": coloured, "roughness": grey},
        {"type": "plastic", "diffuse_reflectance": coloured},
        {"type": "normalmap", "normalmap": coloured, "a": {"type": "roughplastic"}},
        {
            "type": "blendbsdf",
            "weight": coloured,
            "a": {"type": "diffuse"},
            "b": {"type": "dielectric"},
        },
        {"type": "mask", "opacity": grey, "a": {"type": "diffuse", "reflectance": coloured}},
    ):
        scene = scene_with({"type": "cube", "bsdf": bsdf}, sky={"type": "constant"}, sensor=ALONG_Z)
        result = clvol.render(scene, spp=4)
        assert result.stats["non_finite"] == 0 and result.image.mean() > 0.01, bsdf["type"]


def test_a_volume_may_be_a_mediums_and_a_surfaces():
    grid = {"type": "gridvolume", "data": GREY, "to_world": SPREAD}
    medium = {"type": "heterogeneous", "sigma_t": {"type": "ref", "id": "v"}, "albedo": 0.0}
    parts = {
        "v": grid,
        "fog": {"type": "cube", "interior": medium, "bsdf": {"type": "null"}},
        "ball": {
            "type": "sphere",
            "bsdf": {
                "type": "diffuse",
                "reflectance": {"type": "volume", "volume": {"type": "ref", "id": "v"}},
            },
        },
    }
    scene = clvol.load_dict({"type": "scene", "s": ALONG_Z, "sky": {"type": "constant"}, **parts})
    assert scene.shapes[1].bsdf.reflectance.volume is scene.shapes[0].interior.sigma_t
    assert clvol.plan(scene).features.volumes == 2  # by use
    assert clvol.render(scene, spp=4).image.mean() > 0.01


def test_a_scene_without_such_textures_compiles_nothing_of_them():
    plain = scene_with({"type": "sphere", "bsdf": {"type": "diffuse"}})
    assert clvol.plan(plain).macros["CLVOL_HAS_VOLUME_TEXTURES"] == 0
    painted = scene_with({"type": "sphere", "bsdf": {"type": "diffuse", "reflectance": texture_of(GREY)}})
    plan = clvol.plan(painted)
    assert plan.macros["CLVOL_HAS_VOLUME_TEXTURES"] == 1 and plan.macros["CLVOL_HAS_BITMAPS"] == 0
    assert plan.channels == 1


def test_tangents_matter_without_a_texture_too():
    """Of what is anisotropic or bent, on a rectangle, which has texture coordinates."""
    turned = {"type": "principled", "anisotropic": 0.9}
    bent = {"type": "normalmap", "normalmap": texture_of(COLOURS), "a": {"type": "diffuse"}}
    for bsdf, matter in ((turned, True), (bent, True), ({"type": "principled"}, False)):
        features = clvol.plan(scene_with({"type": "rectangle", "bsdf": bsdf})).features
        assert features.vertex_uvs == matter


def test_a_constvolume_is_a_colour_or_the_number_of_its_mean():
    rgb = {"type": "rgb", "value": [0.1, 0.5, 0.3]}
    constant = {"type": "volume", "volume": {"type": "constvolume", "value": rgb}}
    assert shown(constant) == (0.1, 0.5, 0.3)
    assert shown({"type": "roughconductor", "alpha": constant}, "alpha_u") == pytest.approx(0.3)


def test_a_mesh_needs_no_texture_coordinates_for_it(caplog):
    corners, faces = np.eye(4)[:, :3], np.array([(0, 1, 2), (0, 2, 3)])
    mesh = {"type": "mesh", "vertex_positions": corners, "faces": faces}
    with caplog.at_level(logging.WARNING):
        scene_with(mesh | {"bsdf": {"type": "diffuse", "reflectance": texture_of(GREY)}})
    assert "texture coordinates" not in caplog.text


def test_its_samples_are_a_parameter():
    bsdf = {"type": "diffuse", "reflectance": texture_of(GREY)}
    scene = scene_with({"type": "cube", "id": "box", "bsdf": bsdf}, sensor=ALONG_Z, sky={"type": "constant"})
    found = clvol.traverse(scene)
    [name] = [name for name in found if name.endswith("bsdf.reflectance.volume.data")]
    before = clvol.render(scene, spp=16, seed=1).image.mean()
    found[name] = np.full_like(GREY, 0.75)
    found.update()
    after = clvol.render(scene, spp=16, seed=1)
    assert before < 0.4 and np.abs(after.image / 0.75 - 1).max() < 1e-5


@pytest.mark.parametrize(
    ("texture", "message"),
    [
        ({"type": "volume"}, "needs 'volume'"),
        ({"type": "volume", "volume": 0.3}, "must be a volume"),
        (texture_of(GREY) | {"to_world": PLACE}, "unknown parameter 'to_world'"),
        (texture_of(-GREY), "negative"),
        (texture_of(GREY * np.nan), "nan|NaN|finite"),
        (texture_of(2 * GREY), r"values must be in \[0, 1\], the volume reaches 1\.\d+"),
        ({"type": "volume", "volume": {"type": "constvolume", "value": 1.5}}, "the volume has 1.5"),
    ],
    ids=lambda value: "",
)
def test_mistakes_are_named(texture, message):
    with pytest.raises(clvol.Error, match=message):
        shown(texture)


def test_where_it_has_no_place_it_is_refused():
    grey = texture_of(GREY)
    for part, message in (
        ({"type": "spot", "texture": grey}, "must be a bitmap or a checkerboard"),
        (
            {"type": "sphere", "bsdf": {"type": "bumpmap", "t": grey, "a": {"type": "diffuse"}}},
            "has no slope that bends a surface",
        ),
        (
            {"type": "sphere", "bsdf": {"type": "normalmap", "normalmap": grey, "a": {"type": "diffuse"}}},
            "a volume of three channels",
        ),
    ):
        with pytest.raises(clvol.SceneError, match=message):
            scene_with(part)
