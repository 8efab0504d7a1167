"""PBRT-v4 scenes: what statements and parameters mean in the records of a scene."""

from __future__ import annotations

import gzip

import numpy as np
import pytest
from click.testing import CliRunner

import clvol
from clvol.cli.main import main
from clvol.scene.materials import Blend, Dielectric, NormalMap, TwoSided
from clvol.scene.records import ConstantEmitter, ConstVolume, GridVolume

CAMERA = """
LookAt 0 0 -5  0 0 0  0 1 0
Camera "perspective" "float fov" 40
Film "rgb" "integer xresolution" 60 "integer yresolution" 40
PixelFilter "box"
"""


@pytest.fixture
def load(tmp_path):
    """Loads a scene of this text, with a camera and a world around it."""

    def load(world: str, before: str = CAMERA):
        path = tmp_path / "scene.pbrt"
        path.write_text(f"{before}\nWorldBegin\n{world}\n")
        return clvol.load_file(path)

    return load


def projected(scene, point):
    """Column and row of a point in the picture, by the camera's record alone."""
    x, y, z, _ = np.linalg.inv(scene.sensor.to_world) @ [*point, 1]
    half = np.tan(np.deg2rad(scene.sensor.fov) / 2)
    width, height = scene.film.width, scene.film.height
    left, up = np.array([x, y]) / z / half  # local +x is the picture's left
    return (1 - left) * width / 2, height / 2 - up * width / 2


def test_a_picture_is_not_mirrored(load):
    """It is left-handed: with the eye at -5, y up, +x is on the right, and fov 40 is the shorter side's."""
    scene = load('Shape "sphere"')
    unit = 20 / np.tan(np.deg2rad(20))  # pixels at depth 1
    assert projected(scene, (1, 0.5, 0)) == pytest.approx((30 + unit / 5, 20 - unit / 10))


def test_a_mirrored_camera_mirrors(load):
    scene = load('Shape "sphere"', "Scale -1 1 1" + CAMERA)
    assert projected(scene, (1, 0, 0))[0] < 30


def test_a_screen_window_moves_and_crops(load):
    camera = CAMERA.replace('"float fov" 40', '"float fov" 90 "float screenwindow" [0 3 -1 1]')
    scene = load('Shape "sphere"', camera)
    assert scene.sensor.principal_point_offset == pytest.approx((0.5, 0.0))
    assert scene.sensor.fov == pytest.approx(2 * np.rad2deg(np.arctan(1.5)))


@pytest.mark.parametrize(
    ("given", "expected"), [("", 6), ('"integer maxdepth" 0', 1), ('"integer maxdepth" 7', 8)]
)
def test_depth_counts_segments_and_not_scatterings(load, given, expected):
    scene = load('Shape "sphere"', f'{CAMERA} Integrator "volpath" {given}')
    assert scene.integrator.max_depth == expected


def test_transforms_go_from_the_inside_out(load):
    scene = load('Translate 1 2 3 Rotate 90 0 0 1 Scale 2 2 2 Shape "sphere" "float radius" .5')
    moved = scene.shapes[0].to_world @ [1, 0, 0, 1]
    assert moved[:3] == pytest.approx([1, 3, 3])


def test_a_matrix_is_written_by_columns_and_blocks_restore(load):
    scene = load(
        'AttributeBegin Transform [1 0 0 0  0 1 0 0  0 0 1 0  4 5 6 1] Shape "sphere" AttributeEnd '
        'Shape "sphere"'
    )
    places = [shape.to_world[:3, 3].tolist() for shape in scene.shapes]
    assert places == [[4, 5, 6], [0, 0, 0]]


@pytest.mark.parametrize(
    ("block", "end"), [("Attribute", "Attribute"), ("Transform", "Transform"), ("Transform", "Attribute")]
)
def test_what_blocks_change_ends_with_them(load, block, end):
    """The moments that transforms are for too; PBRT-v4 takes Transform blocks for Attribute blocks."""
    inside = 'ActiveTransform EndTime Translate 9 0 0 Material "conductor" ReverseOrientation'
    scene = load(f'{block}Begin {inside} {end}End Translate 1 2 3 Shape "sphere"')
    assert scene.shapes[0].to_world[:3, 3] == pytest.approx([1, 2, 3])
    assert type(scene.shapes[0].bsdf).__name__ == "TwoSided"
    assert not scene.shapes[0].flip_normals


def test_instances_stand_under_their_own_transform(load):
    scene = load(
        'ObjectBegin "a" Translate 1 0 0 Shape "sphere" ObjectEnd '
        'Scale 2 2 2 ObjectInstance "a" Translate 0 1 0 ObjectInstance "a"'
    )
    assert [shape.to_world[:3, 3].tolist() for shape in scene.shapes] == [[2, 0, 0], [2, 2, 0]]


@pytest.mark.parametrize(
    "shape",
    [
        'Shape "trianglemesh" "point3 P" [0 0 0 1 0 0 0 1 0] "integer indices" [0 1 2]',
        'Shape "bilinearmesh" "point3 P" [0 0 0 1 0 0 0 1 0 1 1 0]',
        'Shape "loopsubdiv" "integer levels" 1 "point3 P" [0 0 0 1 0 0 0 1 0] "integer indices" [0 1 2]',
        'Shape "plymesh" "string filename" "a.ply"',
    ],
    ids=lambda shape: shape.split('"')[1],
)
def test_meshes_have_any_number_of_instances(load, tmp_path, shape):
    ply = "ply\nformat ascii 1.0\nelement vertex 3\nproperty float x\nproperty float y\nproperty float z\n"
    ply += (
        "element face 1\nproperty list uchar int vertex_indices\nend_header\n0 0 0\n1 0 0\n0 1 0\n3 0 1 2\n"
    )
    (tmp_path / "a.ply").write_text(ply)
    placed = 'ObjectInstance "a" Translate 0 1 0 ObjectInstance "a" Scale -1 1 1 ObjectInstance "a"'
    scene = load(f'ObjectBegin "a" {shape} ObjectEnd {placed}')
    first, second, mirrored = scene.shapes
    assert first.mesh is second.mesh
    assert (second.to_world - first.to_world)[:3, 3].tolist() == [0, 1, 0]
    assert len(mirrored.mesh.faces) == len(first.mesh.faces)
    with pytest.raises(clvol.SceneError, match="did you mean"):
        load(f'ObjectBegin "a" {shape} "float alpa" 1 ObjectEnd {placed}')


@pytest.mark.parametrize("reverse", [False, True])
@pytest.mark.parametrize("mirror", [1, -1])
def test_normals_keep_their_side_under_a_mirror(load, reverse, mirror):
    """Triangles face the same way as without the mirror; ReverseOrientation turns them."""
    scene = load(
        f"{'ReverseOrientation' if reverse else ''} Scale {mirror} 1 1 "
        'Shape "trianglemesh" "point3 P" [0 0 0 1 0 0 0 1 0] "integer indices" [0 1 2]'
    )
    shape = scene.shapes[0]
    corners = (shape.to_world[:3, :3] @ shape.mesh.vertices[shape.mesh.faces[0]].T).T
    normal = np.cross(corners[1] - corners[0], corners[2] - corners[0])
    assert (normal[2] > 0) == (not reverse)


def test_vertex_normals_say_where_a_triangle_faces(load):
    scene = load(
        'Shape "trianglemesh" "point3 P" [0 0 0 1 0 0 0 1 0] "normal N" [0 0 -1 0 0 -1 0 0 -1] '
        '"integer indices" [0 1 2]'
    )
    mesh = scene.shapes[0].mesh
    a, b, c = mesh.vertices[mesh.faces[0]]
    assert np.cross(b - a, c - a)[2] < 0


def test_files_are_included_and_unpacked(load, tmp_path):
    (tmp_path / "more.pbrt").write_text('Translate 1 0 0 MakeNamedMedium "m" "string type" "homogeneous"')
    ply = b"ply\nformat ascii 1.0\nelement vertex 3\nproperty float x\nproperty float y\nproperty float z\n"
    ply += (
        b"element face 1\nproperty list uchar int vertex_indices\nend_header\n0 0 0\n1 0 0\n0 1 0\n3 0 1 2\n"
    )
    (tmp_path / "a.ply.gz").write_bytes(gzip.compress(ply))
    scene = load(
        'Include "more.pbrt" "rgb sigma_a" [1 2 3] "rgb sigma_s" [0 2 1]\n'  # goes on after the file's end
        'AttributeBegin MediumInterface "m" "" Material "interface" Shape "sphere" AttributeEnd '
        'Shape "plymesh" "string filename" "a.ply.gz"'
    )
    medium = scene.shapes[0].interior
    assert medium.sigma_t.value == pytest.approx((1, 4, 4))
    assert medium.albedo.value == pytest.approx((0, 0.5, 0.25))
    assert scene.shapes[0].to_world[0, 3] == 1
    assert len(scene.shapes[1].mesh.faces) == 1
    assert str(tmp_path / "a.ply.gz") in scene.files


def test_a_grid_lies_in_its_box_and_fades_at_the_border(load):
    scene = load(
        'Translate 10 0 0 MakeNamedMedium "m" "string type" "uniformgrid" "integer nx" 2 "integer ny" 1 '
        '"integer nz" 1 "float density" [1 3] "point3 p1" [2 1 1] "rgb sigma_a" [1 1 1] '
        '"rgb sigma_s" [3 3 3] '
        '"float scale" 2 "float g" .5 "rgb Le" [1 2 3] "float Lescale" [0 2] '
        'MediumInterface "m" "" Material "interface" Shape "sphere"'
    )
    medium = scene.shapes[0].interior
    assert isinstance(medium.sigma_t, GridVolume) and medium.phase.g == 0.5
    assert medium.scale == (8.0,) and medium.albedo.value == (0.75,)
    values = medium.sigma_t.grid.values[..., 0]
    assert values.shape == (3, 3, 4) and values[1, 1].tolist() == [0, 1, 3, 0]
    second = medium.sigma_t.index_to_world @ [2, 1, 1, 1]
    assert second[:3] == pytest.approx([11.5, 0.5, 0.5])
    assert medium.emission.grid.values[1, 1, :, 0].tolist() == [0, 0, 2, 0]
    assert medium.emission_scale == pytest.approx((1, 2, 3))


def test_an_rgb_light_is_the_colour_of_the_picture(load):
    """Its luminance and the sensor's integral cancel; spectra and black bodies are of luminance 1."""
    weights = np.array([0.2126, 0.7152, 0.0722])
    scene = load('LightSource "infinite" "rgb L" [1 2 3] "float scale" 2 Shape "sphere"')
    assert scene.emitters == (ConstantEmitter((2.0, 4.0, 6.0)),)
    for spectrum in ('"spectrum L" [300 7 900 7]', '"blackbody L" 3000', ""):
        light = load(f'LightSource "infinite" {spectrum} Shape "sphere"').emitters[0]
        assert weights @ np.broadcast_to(light.radiance, 3) == pytest.approx(1, abs=2e-3)


def test_exposure_scales_all_that_emits(load):
    camera = CAMERA.replace('Film "rgb"', 'Film "rgb" "float iso" 200 "float exposuretime" 2')
    scene = load(
        'LightSource "point" "power" 1'.replace('"power"', '"float power"') + ' Shape "sphere"', camera
    )
    assert scene.emitters[0].intensity == pytest.approx((4 / (4 * np.pi),))


@pytest.mark.parametrize(
    ("shutter", "factor"),
    [
        ('"float shutterclose" 0.25', 0.25),
        ('"float shutteropen" 1 "float shutterclose" 4', 3),
        ('"float shutteropen" 0.5', 0.5),
    ],
)
def test_the_time_that_the_shutter_is_open_is_that_of_the_exposure(load, shutter, factor):
    """BasicScene::SetOptions of PBRT-v4 takes it from the camera and gives it to the film's sensor."""
    camera = CAMERA.replace('"float fov" 40', f'"float fov" 40 {shutter}')
    scene = load('LightSource "infinite" "rgb L" [2 2 2] Shape "sphere"', camera)
    assert scene.emitters[0].radiance == pytest.approx((2 * factor,))


def test_a_shutter_that_does_not_open_is_told(load):
    camera = CAMERA.replace('"float fov" 40', '"float fov" 40 "float shutterclose" 0')
    with pytest.raises(clvol.SceneError, match="the shutter does not open"):
        load('Shape "sphere"', camera)


def test_options_are_a_name_and_a_value(load, caplog):
    options = 'Option "seed" 7 Option "disable-wavelength-jitter" true Option "rendercoordsys" "world"'
    scene = load('Shape "sphere"', f'{options} Option "disablepixeljitter" true {CAMERA}')
    assert scene.seed == 7
    assert "not in their middles" in caplog.text
    with pytest.raises(clvol.SceneError, match="'forcediffuse', by which every surface is diffuse"):
        load('Shape "sphere"', f'Option "forcediffuse" true {CAMERA}')


def test_parallel_light_travels_from_from_to_to(load):
    scene = load(
        'Rotate 90 0 0 1 LightSource "distant" "point3 from" [1 0 0] "point3 to" [0 0 0] Shape "sphere"'
    )
    assert scene.emitters[0].direction == pytest.approx((0, -1, 0))


def test_media_round_the_camera_and_without_a_boundary(load):
    scene = load(
        'MakeNamedMedium "fog" "string type" "homogeneous" "rgb sigma_a" [0 0 0] "rgb sigma_s" [.1 .1 .1] '
        'Material "diffuse" Shape "sphere"',
        f'MediumInterface "" "fog" {CAMERA}',
    )
    assert isinstance(scene.sensor.medium.sigma_t, ConstVolume)
    assert scene.shapes[0].interior is None and scene.shapes[0].exterior is scene.sensor.medium


@pytest.mark.parametrize(
    ("name", "scattering", "g", "absorption"),  # red, of the papers' tables
    [
        ("Skin1", 0.74, 0.0, 0.032),
        ("Lowfat Milk", 13.1157, 0.932, 0.00287),
        ("Head & Shoulders Shampoo", 0.26747, 0.911, 0.08462),
        ("Suisse Mocha Powder", 30.0848, 0.907, 17.5020),
    ],
)
def test_measured_media_have_the_papers_reduced_coefficients(load, name, scattering, g, absorption):
    scene = load(
        f'MakeNamedMedium "m" "string type" "homogeneous" "string preset" "{name}" "float scale" 2 '
        'MediumInterface "m" "" Material "interface" Shape "sphere"'
    )
    medium, reduced = scene.shapes[0].interior, scattering * (1 - g)
    assert 2 * (reduced + absorption) == pytest.approx(medium.sigma_t.value[0] * medium.scale[0], rel=2e-3)
    assert medium.albedo.value[0] == pytest.approx(reduced / (reduced + absorption), rel=2e-3)


def test_a_boundary_without_media_is_nothing_and_path_sees_none(load):
    medium = 'MakeNamedMedium "m" "string type" "homogeneous" MediumInterface "m" ""'
    assert not load('Material "interface" Shape "sphere"').shapes
    scene = load(f'{medium} Material "diffuse" Shape "sphere"', f'{CAMERA} Integrator "path"')
    assert scene.shapes[0].interior is None and "media are left out" in "".join(scene.approximated)


def test_a_mix_is_a_blend_of_its_two_materials(load):
    named = 'MakeNamedMaterial "a" "string type" "diffuse" MakeNamedMaterial "b" "string type" "dielectric" '
    for amount, weight in (("", (0.5,)), ('"float amount" 0.25', (0.25,))):
        mix = load(f'{named} Material "mix" "string materials" ["a" "b"] {amount} Shape "sphere"')
        blend = mix.shapes[0].bsdf
        assert isinstance(blend, Blend) and blend.weight == weight
        assert isinstance(blend.first, TwoSided) and isinstance(blend.second, Dielectric)
    alone = load(f'{named} Material "mix" "string materials" ["a" "b"] "float amount" 1 Shape "sphere"')
    assert isinstance(alone.shapes[0].bsdf, Dielectric)


@pytest.mark.parametrize(
    ("given", "expected"),
    [
        ("", lambda texels: texels),
        ('"float scale" .5', lambda texels: texels / 2),
        ('"bool invert" true', lambda texels: 1 - texels),
        ('"bool invert" true "float scale" .5', lambda texels: 1 - texels / 2),
        ('"bool invert" true "float scale" 3', lambda texels: np.clip(1 - 3 * texels, 0, 1)),
    ],
)
def test_a_picture_is_scaled_before_it_is_inverted(load, tmp_path, given, expected):
    """As `Evaluate` of pbrt's image textures has it; the last row of the file is at v = 0."""
    texels = np.array([[0.1, 0.2], [0.4, 0.8]], np.float32)
    pixels = np.repeat(texels[..., None], 3, axis=2)
    (tmp_path / "a.pfm").write_bytes(b"PF\n2 2\n-1\n" + pixels[::-1].tobytes())  # from the bottom up
    picture = (
        f'Texture "a" "spectrum" "imagemap" "string filename" "a.pfm" "string encoding" "linear" {given}'
    )
    scene = load(f'{picture} Material "diffuse" "texture reflectance" "a" Shape "cylinder"')
    found = scene.shapes[0].bsdf.front.reflectance
    assert found.pixels[..., 1] == pytest.approx(expected(texels))
    assert (found.to_uv @ [0.25, 0.25, 1])[:2] == pytest.approx([0.25, 0.75])


@pytest.mark.parametrize("reverse", [False, True])
@pytest.mark.parametrize("side", [1.0, -1.0])
@pytest.mark.parametrize("row", [0, 1])
def test_a_normalmap_bends_about_the_surfaces_own_frame(load, tmp_path, row, side, reverse):
    """As pbrt's `NormalMap`: x along dp/du, y = n x x, the file's last row at v = 0; both sides alike."""
    normals = np.array([[0.5, 0.3, 0.8], [-0.2, 0.45, 0.9]])
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    pixels = ((normals[:, None] + 1) / 2).astype(np.float32)
    (tmp_path / "n.pfm").write_bytes(b"PF\n1 2\n-1\n" + pixels[::-1].tobytes())  # from the bottom up
    place, sun = np.array([0.2, (0.5, -0.5)[row], 0.0]), np.array([0.1, -0.25, 1.0])
    eye = place + np.array([0.3, 0.2, 4.0])
    eye[2] *= side
    sun[2] *= side
    camera = f"""
        LookAt {" ".join(map(str, eye))}  {" ".join(map(str, place))}  0 1 0
        Camera "perspective" "float fov" 0.02
        Film "rgb" "integer xresolution" 4 "integer yresolution" 4
        Integrator "path" "integer maxdepth" 1"""
    scene = load(
        f"""LightSource "distant" "rgb L" [1 1 1] "point3 to" [0 0 0]
            "point3 from" [{" ".join(map(str, sun))}]
        {"ReverseOrientation" if reverse else ""}
        Material "diffuse" "rgb reflectance" [.6 .6 .6] "string normalmap" "n.pfm"
        Shape "trianglemesh" "point3 P" [-1 -1 0 1 -1 0 1 1 0 -1 1 0] "point2 uv" [0 0 1 0 1 1 0 1]
        "integer indices" [0 1 2 0 2 3]""",
        camera,
    )
    assert isinstance(scene.shapes[0].bsdf, NormalMap)
    n, x = np.array([0.0, 0, -1 if reverse else 1]), np.array([1.0, 0, 0])
    bent = normals[row] @ [x, np.cross(n, x), n]
    expected = 0.6 / np.pi * abs(bent @ sun) / np.linalg.norm(sun)
    assert clvol.render(scene, spp=16).image == pytest.approx(expected, rel=2e-3)


def test_a_normalmap_of_a_mix_is_refused_and_one_that_is_missing_told(load):
    named = 'MakeNamedMaterial "a" "string type" "diffuse" '
    mix = 'Material "mix" "string materials" ["a" "a"] "string normalmap" "n.pfm" Shape "sphere"'
    with pytest.raises(clvol.SceneError, match="the normalmap of a mix cannot be rendered"):
        load(named + mix)
    with pytest.raises(clvol.SceneError, match=r"n\.pfm"):
        load('Material "diffuse" "string normalmap" "n.pfm" Shape "sphere"')


def test_a_scaled_texture_is_a_product(load, tmp_path):
    (tmp_path / "a.pfm").write_bytes(b"PF\n1 1\n-1\n" + np.full(3, 0.5, np.float32).tobytes())
    picture = (
        'Texture "a" "spectrum" "imagemap" "string filename" "a.pfm" "bool invert" true "float scale" .4'
    )
    product = 'Texture "b" "spectrum" "scale" "texture tex" "a" "float scale" .5'
    scene = load(f'{picture} {product} Material "diffuse" "texture reflectance" "b" Shape "sphere"')
    assert scene.shapes[0].bsdf.front.reflectance.pixels == pytest.approx(0.5 * (1 - 0.4 * 0.5))


def rows_of(*values):
    """A picture one pixel wide, from the top, as .pfm, which begins at the bottom."""
    pixels = np.repeat(np.float32(values[::-1]), 3)
    return b"PF\n1 %d\n-1\n" % len(values) + pixels.tobytes()


PICTURE = 'Texture "p" "spectrum" "imagemap" "string filename" "p.pfm" "string filter" "point" '
PICTURED = PICTURE + 'Material "diffuse" "texture reflectance" "p" '


@pytest.mark.parametrize("stretch", ["", "Scale 1 1 1.0001"], ids=["quadric", "mesh"])
def test_the_top_of_a_picture_is_at_the_north_pole_of_a_sphere(load, tmp_path, stretch):
    """In pbrt v is 0 where z is least, and pictures begin at v = 1."""
    (tmp_path / "p.pfm").write_bytes(rows_of(0.9, 0.1))
    camera = CAMERA.replace("LookAt 0 0 -5  0 0 0  0 1 0", "LookAt 0 -5 0  0 0 0  0 0 1")
    scene = load(f'LightSource "infinite" "rgb L" [1 1 1] {PICTURED} {stretch} Shape "sphere"', camera)
    picture = clvol.render(scene, spp=4, size=(15, 10)).image[..., 0]
    assert picture[3, 7] == pytest.approx(0.9, abs=1e-3)
    assert picture[6, 7] == pytest.approx(0.1, abs=1e-3)


def test_shapes_share_a_material_each_with_its_own_places(load, tmp_path):
    """A disk's u is the angle, and its v falls to 0 at the rim; mixtures have places too."""
    (tmp_path / "p.pfm").write_bytes(rows_of(0.9, 0.1))
    plain = 'MakeNamedMaterial "a" "string type" "diffuse" "texture reflectance" "p" '
    plain += 'MakeNamedMaterial "b" "string type" "conductor" '
    mixed = 'MakeNamedMaterial "m" "string type" "mix" "string materials" ["a" "b"] NamedMaterial "m" '
    triangle = 'Shape "trianglemesh" "point3 P" [0 0 0 1 0 0 0 1 0] "point2 uv" [0 0 1 0 0 1] '
    shapes = f'Shape "disk" {triangle} Shape "sphere" Shape "cylinder" '
    scene = load(f'{PICTURE}{plain}{mixed}{shapes} NamedMaterial "b" {shapes}')
    disk, mesh, sphere, cylinder, *metals = (one.bsdf for one in scene.shapes)
    assert len({id(one) for one in metals}) == 1
    places = [one.first.front.reflectance.to_uv for one in (disk, mesh, sphere, cylinder)]
    r, turn = 0.3, 0.2
    assert places[0] @ [r, turn, 1] == pytest.approx([turn, 1 - (1 - r), 1])
    np.testing.assert_array_equal(places[1], places[3])
    assert places[1] @ [0.2, 0.3, 1] == pytest.approx([0.2, 0.7, 1])
    assert places[2] @ [0.2, 0.3, 1] == pytest.approx([0.2, 0.3, 1])


@pytest.mark.parametrize("reverse", ["", "ReverseOrientation"])
def test_triangles_without_places_have_pbrts(load, tmp_path, reverse):
    """(0, 0), (1, 0), (1, 1) of each triangle's corners, in their order, whichever way it is turned."""
    (tmp_path / "p.pfm").write_bytes(rows_of(0.9, 0.1))
    quad = '"point3 P" [0 0 0 1 0 0 1 1 0 0 1 0] "integer indices" [0 1 2 0 2 3]'
    plain, textured = load(
        f'{reverse} Shape "trianglemesh" {quad} {PICTURED} Shape "trianglemesh" {quad}'
    ).shapes
    assert plain.mesh.uvs is None
    mesh = textured.mesh
    corners = {(0, 0), (1, 0), (1, 1)}
    for face in mesh.faces:
        places = {
            tuple(uv): tuple(point[:2]) for uv, point in zip(mesh.uvs[face], mesh.vertices[face], strict=True)
        }
        assert set(places) == corners
        middle = (1, 0) if places[1, 1] == (1, 1) else (1, 1)
        assert places[0, 0] == (0, 0) and places[1, 0] == middle


def test_files_are_found_from_a_folder_beside(load, tmp_path, monkeypatch):
    """By a relative name of the scene too."""
    (tmp_path / "p.pfm").write_bytes(rows_of(0.5))
    load(f'{PICTURED} Shape "sphere"')
    monkeypatch.chdir(tmp_path.parent)
    assert len(clvol.load_file(f"{tmp_path.name}/scene.pbrt").shapes) == 1


def test_what_cannot_be_rendered_is_told_at_once(load):
    with pytest.raises(clvol.SceneError) as caught:
        load('Shape "curve"\nShape "sphere" "float phimax" 90\nLightSource "projection"')
    assert [f"scene.pbrt:{line}: " in str(caught.value) for line in (8, 9, 10)] == [True] * 3
    with clvol.skip_unsupported():
        assert not load('Shape "curve"\nShape "sphere" "float phimax" 90').shapes


@pytest.mark.parametrize(
    ("world", "told"),
    [
        ('Shape "sphere" "float radiu" 2', "did you mean 'radius'"),
        ('Shape "sphere" "float radius" "two"', "takes numbers"),
        ('Shape "sphere" "float radius" nan', "'radius' has no value"),
        ('Shape "sphere" "float radius" [nan]', "must be finite"),
        ('Shape "sphere" "float radius" [1 true]', "'true' is not a number"),
        ('Shape "sphere" "float radius" [true 1x]', "'1x' is not a number"),
        ('Shapes "sphere"', "did you mean 'Shape'"),
        ('NamedMaterial "m" Shape "sphere"', "no material 'm'"),
        ('MediumInterface "m" "" Shape "sphere"', "no medium 'm'"),
        ('Include "scene.pbrt"', "includes itself"),
        ("AttributeBegin", "without its end"),
        ("AttributeEnd", "without its AttributeBegin"),
        ('Camera "perspective"', "Camera after WorldBegin"),
        ("WorldBegin", "a second WorldBegin"),
        ('Option "disablepixeljiter" true', "did you mean 'disablepixeljitter'"),
        ('Option "seed" "a"', "'seed' is a whole number"),
        ('Option "wavefront" 1', "'wavefront' is true or false"),
        ('Shape "trianglemesh" "point3 P" [0 0 0 1 0 0 0 1 0] "integer indices" [0 1 9]', "vertex 9 of 3"),
        (
            'Texture "t" "float" "scale" "texture tex" "t" Shape "sphere" "texture alpha" "t"',
            "made of itself",
        ),
        ('Scale 0 1 1 Shape "sphere"', "flattens space"),
        ('Shape "sphere" "float radius" [1', "without its ']'"),
        ('Shape "sphere', "a string without its end"),
        ('Shape "sphere" WorldEnd', "WorldEnd is of scenes before PBRT-v4; `pbrt --upgrade"),
    ],
)
def test_mistakes_are_told_where_they_are(load, world, told):
    with pytest.raises(clvol.SceneError) as caught:
        load(world)
    assert told in str(caught.value) and "scene.pbrt:" in str(caught.value)


def test_a_mark_of_the_byte_order_is_no_statement(tmp_path):
    path = tmp_path / "scene.pbrt"
    path.write_text(f'{CAMERA} WorldBegin Shape "sphere"', encoding="utf-8-sig")
    assert len(clvol.load_file(path).shapes) == 1


@pytest.mark.parametrize("statement", ['Shape "sphere"', 'LightSource "infinite"', "AttributeBegin"])
def test_the_world_does_not_begin_before_it_does(load, statement):
    with pytest.raises(clvol.SceneError, match=f"{statement.split()[0]} before WorldBegin"):
        load("", f"{CAMERA} {statement}")


@pytest.mark.parametrize("text", ["", "# nothing\n", CAMERA])
def test_a_file_that_stops_before_its_world_is_no_scene(tmp_path, text):
    (tmp_path / "scene.pbrt").write_text(text)
    with pytest.raises(clvol.SceneError, match=r"scene.pbrt.*without WorldBegin.*cut short"):
        clvol.load_file(tmp_path / "scene.pbrt")


def test_info_tells_of_a_scene(load, tmp_path):
    load('Shape "sphere" LightSource "infinite"')
    told = str(clvol.info(tmp_path / "scene.pbrt"))
    assert "60 x 40" in told
    run = CliRunner().invoke(main, ["info", str(tmp_path / "scene.pbrt")])
    assert run.exit_code == 0 and "60 x 40" in run.output
