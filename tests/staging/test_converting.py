"""`clvol scene` of a scene: what it writes of a .pbrt, or of an old Mitsuba scene, is that scene."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import pytest
from click.testing import CliRunner
from mesh_files import ascii_ply
from mitsuba_scenes import write_image
from nvdb_writer import write_nvdb
from sparse_grids import dense_of, lumps
from vdb_writer import GridSpec
from volume_samples import samples_in_box

import clvol
from clvol.cli.main import main
from clvol.errors import OptionError
from clvol.scene.digest import scene_digest
from clvol.scene.mesh import RawMesh, build_mesh
from clvol.scene.ply import read_ply
from clvol.scene.ply_writing import encode_ply
from clvol.staging.converting import convert_scene
from clvol.volumes.filled import filled

if TYPE_CHECKING:
    from pathlib import Path

PBRT = """
LookAt 0 1 -5  0 0 0  0 1 0
Camera "perspective" "float fov" 40
Film "rgb" "integer xresolution" 12 "integer yresolution" 8 "float iso" 90
Sampler "independent" "integer pixelsamples" 4 "integer seed" 7
Integrator "volpath" "integer maxdepth" 6
WorldBegin
LightSource "infinite" "string filename" "map.exr" "float scale" .3
LightSource "spot" "point3 from" [-3 4 -1] "point3 to" [0 0 0] "blackbody I" 5000 "float power" 100
MakeNamedMedium "the $fog & mist" "string type" "uniformgrid" "integer nx" 2 "integer ny" 2 "integer nz" 3
  "float density" [1 2 3 4 5 6 1 2 .5 .1 1 2] "rgb sigma_a" [.1 .2 .3] "rgb sigma_s" [.7 .5 .3]
  "float g" .3 "rgb Le" [.3 .2 .1] "float Lescale" [1 0 1 0 0 0 0 1 1 1 0 0]
MakeNamedMedium "ink" "string type" "homogeneous" "spectrum sigma_a" [400 .1 600 .7 700 .2]
Texture "paint" "spectrum" "imagemap" "string filename" "picture.png" "float scale" .7 "float uscale" 2
Texture "plain" "spectrum" "imagemap" "string filename" "picture.png" "string filter" "point"
MakeNamedMaterial "wall" "string type" "diffuse" "texture reflectance" "paint"
MakeNamedMaterial "gold" "string type" "conductor" "float roughness" .2
MakeNamedMaterial "both" "string type" "mix" "string materials" ["wall" "gold"] "float amount" .3
NamedMaterial "wall"
AttributeBegin
 Translate 0 -1.3 0 Scale 3 1 -3
 Shape "bilinearmesh" "point3 P" [-1 0 -1  1 0 -1  -1 0 1  1 0 1]
AttributeEnd
AttributeBegin
 NamedMaterial "both"
 Translate 1.2 0.5 0.3 Rotate 30 1 2 3
 Shape "trianglemesh" "point3 P" [0 0 0  .5 0 0  0 .5 0  0 0 .5]
   "normal3 N" [-1 -2 -1  1 0 .1  0 1 .3  .1 0 1]
   "integer indices" [0 2 1  0 1 3  0 3 2  1 2 3]
 Translate -2.4 0 0
 Shape "plymesh" "string filename" "tetra.ply"
 Material "diffuse" "texture reflectance" "plain"
 AreaLightSource "diffuse" "rgb L" [3 2 1]
 Shape "disk" "float radius" .2 "float height" 1
AttributeEnd
AttributeBegin
 MediumInterface "the $fog & mist" "ink"
 Material "interface"
 Shape "sphere" "float radius" 1
AttributeEnd
"""


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    """A folder with the scene as `from/scene.pbrt`, the files that it names, and another folder `to`."""
    here = tmp_path / "from"
    here.mkdir()
    (tmp_path / "to").mkdir()
    rng = np.random.default_rng(1)
    write_image(here / "map.exr", rng.uniform(0, 1, (6, 6, 3)).astype(np.float32))
    write_image(here / "picture.png", rng.integers(0, 255, (5, 7, 3)).astype(np.uint8))
    corners = [(0, 0, 0), (0.4, 0, 0), (0, 0.4, 0), (0, 0, 0.4)]
    (here / "tetra.ply").write_bytes(ascii_ply(corners, [(0, 2, 1), (0, 1, 3), (0, 3, 2), (1, 2, 3)]))
    (here / "scene.pbrt").write_text(PBRT)
    return tmp_path


def same(one, other) -> bool:
    return (scene_digest(one), one.spp, one.seed) == (scene_digest(other), other.spp, other.seed)


def run(*arguments: object):
    return CliRunner().invoke(main, [str(argument) for argument in arguments])


def test_a_pbrt_scene_is_the_same_as_xml(folder: Path) -> None:
    source, output = folder / "from" / "scene.pbrt", folder / "to" / "scene.xml"
    outcome = run("scene", source, "-o", output)
    assert outcome.exit_code == 0, outcome.output
    before, after = clvol.load_file(source), clvol.load_file(output)
    assert same(before, after)
    pictures = [clvol.render(scene).image for scene in (before, after)]
    assert pictures[0].any() and np.array_equal(*pictures)
    lines = output.read_text().splitlines()
    assert lines[0].startswith("<!-- Converted by clvol from scene.pbrt.")
    # everything once: the mesh of the patch and both tetrahedra, what scatters and what glows, map and paint
    written = sorted(file.name for file in (folder / "to").iterdir())
    assert written == [
        "scene.xml",
        *(f"scene_mesh_{n}.ply" for n in (1, 2, 3)),
        *(f"scene_picture_{n}.exr" for n in (1, 2)),
        *(f"scene_volume_{n}.vol" for n in (1, 2)),
    ]


def test_a_scene_that_lost_a_number_is_another(folder: Path) -> None:
    """The comparison of the test above can fail."""
    source, output = folder / "from" / "scene.pbrt", folder / "to" / "scene.xml"
    convert_scene(source, output, {})
    text = output.read_text()
    assert 'value="0.3"' in text
    output.write_text(text.replace('value="0.3"', 'value="0.30000001"', 1))
    assert not same(clvol.load_file(source), clvol.load_file(output))


def test_nothing_is_overwritten_unless_asked_for(folder: Path) -> None:
    source, output = folder / "from" / "scene.pbrt", folder / "to" / "scene.xml"
    (folder / "to" / "scene_mesh_2.ply").write_text("mine")
    outcome = run("scene", source, "-o", output)
    assert outcome.exit_code == 2 and "scene_mesh_2.ply: is there already" in outcome.stderr
    assert [file.name for file in (folder / "to").iterdir()] == ["scene_mesh_2.ply"]
    assert run("scene", source, "-o", output, "--overwrite").exit_code == 0
    assert same(clvol.load_file(source), clvol.load_file(output))
    with pytest.raises(OptionError, match="is there already"):
        convert_scene(source, output, {})


def test_files_of_the_scene_are_spared(folder: Path) -> None:
    source = folder / "from" / "scene.pbrt"
    (folder / "to" / "scene.xml").symlink_to(source)
    outcome = run("scene", source, "-o", folder / "to" / "scene.xml", "--overwrite")
    assert outcome.exit_code == 2 and "would replace a file of the scene" in outcome.stderr
    assert source.read_text() == PBRT


def test_what_cannot_be_rendered_is_not_written(folder: Path) -> None:
    source = folder / "from" / "scene.pbrt"
    source.write_text(PBRT.replace('"sphere"', '"gyroid"'))
    outcome = run("scene", source, "-o", folder / "to" / "scene.xml")
    assert outcome.exit_code == 2 and "gyroid" in outcome.stderr
    assert not list((folder / "to").iterdir())


@pytest.mark.parametrize("options", [["--light", "sun"], ["--size", "9x9"], ["--spp", "3"], ["--ground"]])
def test_options_of_volumes_are_refused(folder: Path, options: list[str]) -> None:
    outcome = run("scene", folder / "from" / "scene.pbrt", "-o", folder / "to" / "a.xml", *options)
    assert outcome.exit_code == 2 and f"{options[0]} is for volumes" in outcome.stderr


OLD = """<scene version="0.6.0">
    <default name="depth" value="4"/>
    <integrator type="adaptive"><integrator type="bdpt"><integer name="maxDepth" value="$depth"/>
        <boolean name="lightImage" value="false"/></integrator></integrator>
    <include filename="parts/sensor.xml"/>
    <medium id="milk" type="homogeneous"><spectrum name="sigmaS" value="1, 2, 3"/>
        <spectrum name="sigmaA" value="1"/></medium>
    <texture type="bitmap" id="paint"><string name="filename" value="picture.png"/>
        <float name="uscale" value="2"/></texture>
    <alias id="paint" as="colour"/>
    <shape type="ply" id="tetra"><string name="filename" value="tetra.ply"/>
        <bsdf type="diffuse"><ref name="diffuseReflectance" id="colour"/></bsdf></shape>
    <shape type="cube"><transform name="toWorld"><scale value="2"/></transform>
        <ref name="interior" id="milk"/></shape>
    <shape type="sphere"><point name="center" x="1" y="2" z="0.1"/><float name="radius" value="0.3"/>
        <bsdf type="roughplastic">
            <spectrum name="diffuseReflectance" value="400:0.1, 500:0.7, 700:0.3"/></bsdf>
        <emitter type="area"><spectrum name="radiance" value="2"/></emitter></shape>
    <emitter type="point"><spectrum name="intensity" value="5"/></emitter>
</scene>
"""
SENSOR = """<sensor version="0.6.0" type="perspective"><float name="fov" value="45"/>
    <transform name="toWorld"><lookAt target="0, 0, 0" origin="0, 1, 9"/></transform>
    <sampler type="halton"><integer name="sampleCount" value="16"/></sampler>
    <film type="ldrfilm"><integer name="width" value="9"/><integer name="height" value="8"/></film></sensor>
"""


@pytest.fixture
def old(folder: Path) -> Path:
    """An old Mitsuba scene with an included file."""
    path = folder / "from" / "old.xml"
    path.write_text(OLD)
    (folder / "from" / "parts").mkdir()
    (folder / "from" / "parts" / "sensor.xml").write_text(SENSOR)
    return path


def test_an_old_scene_is_the_same_in_new_words(old: Path, folder: Path) -> None:
    output = folder / "to" / "new.xml"
    outcome = run("scene", old, "-o", output, "-D", "depth=7")
    assert outcome.exit_code == 0, outcome.output
    after = clvol.load_file(output)
    assert same(clvol.load_file(old, depth=7), after)
    assert after.integrator.max_depth == 7 and after.shapes[0].name == "tetra"
    assert not after.approximated  # what was is what is written
    text = output.read_text()
    assert "toWorld" not in text and "bdpt" not in text.split("-->")[1]
    assert "sigma_s" not in text and "sigma_a" not in text  # which Mitsuba 3 has not, nor colours beyond 1
    assert '<volume name="sigma_t" type="constvolume">' in text and after.shapes[1].interior.scale == (1.0,)
    assert after.shapes[1].interior.sigma_t.value == (2.0, 3.0, 4.0)
    assert [file.name for file in (folder / "to").iterdir()] == [
        "new.xml"
    ]  # it names the files that were there


@pytest.mark.parametrize(
    "parts",
    [("1", "0.5"), ("1, 2, 3", "1"), ("400:1, 700:2", "0.5, 1, 2"), ("0", "0"), ("0.5, 0, 0", "0, 0, 0.25")],
)
def test_scattering_and_absorption_of_any_kind_are_added_up(folder: Path, parts: tuple[str, str]) -> None:
    given = '<spectrum name="sigmaS" value="{}"/><spectrum name="sigmaA" value="{}"/>'.format(*parts)
    medium = f'<medium name="interior" type="homogeneous">{given}</medium>'
    text = f'<scene version="0.6.0">{SENSOR}<shape type="sphere">{medium}</shape></scene>'
    source, output = folder / "from" / "kinds.xml", folder / "to" / "kinds.xml"
    source.write_text(text.replace('<sensor version="0.6.0"', "<sensor"))
    convert_scene(source, output, {})
    assert same(clvol.load_file(source), clvol.load_file(output))
    assert "sigma_s" not in output.read_text()


def test_a_scene_of_version_3_is_one_already(old: Path, folder: Path) -> None:
    first, second = folder / "to" / "new.xml", folder / "to" / "newer.xml"
    assert run("scene", old, "-o", first, "--quiet").output == ""
    outcome = run("scene", first, "-o", second)
    assert outcome.exit_code == 2 and "is a scene already, not a volume" in outcome.stderr
    assert not second.exists()
    assert "does not exist" in run("scene", folder / "none.xml", "-o", second).stderr


def test_hot_gas_of_a_sparse_file_is_written_densely(folder: Path) -> None:
    rng = np.random.default_rng(2)
    active = np.ones((8, 8, 8), bool)
    places = [(0, 0, 0), (8, 0, 0), (8, 8, -8)]
    grids = [
        GridSpec(name, leaves={place: (rng.uniform(low, high, (8, 8, 8)), active) for place in places})
        for name, low, high in (("density", 0.1, 2), ("temperature", 500, 3000))
    ]
    write_nvdb(folder / "from" / "fire.nvdb", grids)
    begin = PBRT[: PBRT.index("LightSource")]
    medium = 'MakeNamedMedium "fire" "string type" "nanovdb" "string filename" "fire.nvdb"'
    shape = 'MediumInterface "fire" "" Material "interface" Shape "sphere" "float radius" 40'
    source, output = folder / "from" / "fire.pbrt", folder / "to" / "fire.xml"
    source.write_text(f"{begin}\n{medium}\n{shape}")
    convert_scene(source, output, {})
    before, after = (clvol.load_file(path).shapes[0].interior for path in (source, output))
    assert after.sigma_t.source.endswith("from/fire.nvdb:density")
    grid = before.emission.grid
    lower, upper = grid.active_box[0] - 1, grid.active_box[1] + 1
    wanted = samples_in_box(grid, lower, upper).transpose(2, 1, 0, 3)
    assert np.array_equal(after.emission.grid.values, wanted) and wanted.any()
    to_old = np.linalg.inv(before.emission.index_to_world) @ after.emission.index_to_world
    assert to_old[:3, 3] == pytest.approx(lower) and to_old[:3, :3] == pytest.approx(np.eye(3))


@pytest.mark.parametrize("tiles", [(), [((16, 0, 0), 8, 0.3), ((-128, 0, 0), 128, 0.0)]])
def test_sparse_grids_are_filled_as_they_are_read(tiles) -> None:
    grid = lumps(tiles=tiles)
    values, lower = filled(grid)
    assert np.array_equal(lower, grid.active_box[0] - 1)
    assert np.array_equal(values, dense_of(grid)[..., None])


def test_a_mesh_that_is_written_is_the_same_when_it_is_read() -> None:
    rng = np.random.default_rng(4)
    vertices, faces = rng.normal(size=(300, 3)), rng.integers(0, 300, (200, 3))
    faces = faces[[len(set(face)) == 3 for face in faces.tolist()]]
    for normals, uvs in ((None, None), (rng.normal(size=(300, 3)), rng.uniform(size=(300, 2)))):
        mesh, _ = build_mesh(RawMesh(vertices, faces, normals, uvs), "", normals is not None)
        again, origin = build_mesh(read_ply(encode_ply(mesh)), "", normals is not None)
        assert not origin.any()
        for name in ("vertices", "faces", "normals", "uvs"):
            assert np.array_equal(getattr(mesh, name), getattr(again, name))
