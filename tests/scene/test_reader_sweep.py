"""Nothing that a scene says is dropped.

Every parameter of every plugin changes what is made of the scene, is known to change no expected image, or is
refused; and so is every plugin inside of another.

`plugin_parameters` has a table of every plugin in `clvol.scene.loader.PLUGINS`.  Who adds a plugin says there
what each parameter does: another value that must show in the records, or that it is silent.
"""

import numpy as np
import OpenImageIO as oiio  # noqa: N813
import pytest
import trimesh
from mesh_files import serialized, serialized_mesh
from plugin_parameters import CELLS, CORNERS, FACES, INSTEAD, PARAMETERS, RGB, SKY, Silent
from vdb_writer import GridSpec, write_vdb

from clvol.errors import Error
from clvol.scene import load_dict, load_file, reader
from clvol.scene.digest import scene_digest
from clvol.scene.loader import PLUGINS
from clvol.volumes import write_vol

# -- scenes --------------------------------------------------------------------------------------------

KIND_OF = {name: kind for kind, names in PLUGINS.items() for name in names}
AREA = ("area", "directionalarea")
SIMPLEST = {
    **{kind: {"type": next(iter(names))} for kind, names in PLUGINS.items()},
    "film": {"type": "hdrfilm", "width": 5},
    "sampler": {"type": "independent", "seed": 3},
    "phase": {"type": "hg"},
    "emitter": {"type": "point"},
    "texture": {"type": "checkerboard"},
    "volume": {"type": "constvolume"},
}


@pytest.fixture(scope="module", autouse=True)
def files(tmp_path_factory):
    """The files that the table names, two of each kind, in the working folder."""
    folder = tmp_path_factory.mktemp("sweep")
    with pytest.MonkeyPatch.context() as patch:
        patch.chdir(folder)
        for name, radius in ("a", 1.0), ("b", 2.0):
            ball = trimesh.creation.icosphere(1, radius)
            corners = radius * np.array([(0, 0, 0), (1, 0, 0), (0, 1, 0), (0, 0, 1)])
            lines = [f"v {x} {y} {z}" for x, y, z in corners] + ["vt 0.1 0.2", "vt 0.9 0.2", "vt 0.3 0.8"]
            lines += ["vn 0.6 0 0.8", *(f"f {a}/1/1 {b}/2/1 {c}/3/1" for a, b, c in ((1, 3, 2), (1, 2, 4)))]
            (folder / f"{name}.obj").write_text("\n".join(lines))
            ball.export(folder / f"{name}.ply", vertex_normal=True)
            one, two = (serialized_mesh(scale * ball.vertices, ball.faces) for scale in (1, 3))
            (folder / f"{name}.serialized").write_bytes(serialized(one, two))
            ball.export(folder / f"{name}.stl")
            (folder / f"{name}.txt").write_text("".join(f"{x} 0 0 {radius}\n" for x in (0, 3, 6, 9)))
            ball.export(folder / f"{name}.glb", include_normals=True)
            for part, data in trimesh.exchange.gltf.export_gltf(
                trimesh.Scene(ball), include_normals=True, embed_buffers=True
            ).items():
                (folder / (f"{name}.gltf" if part.endswith("gltf") else part)).write_bytes(data)
            write_vol(
                f"{name}.vol",
                (radius * CELLS[..., None]).astype(np.float32),
                np.array([[0, 0, 0], [1, 2, 3]]),
            )
        for name, value in ("fog", 1.0), ("other", 2.0):
            leaf = {(0, 0, 0): (np.full((8, 8, 8), value), np.ones((8, 8, 8), bool))}
            write_vdb(
                folder / f"{name}.vdb", [GridSpec(leaves=leaf), GridSpec("heat", leaves=leaf, background=0.5)]
            )
        output = oiio.ImageOutput.create("sky.exr")
        output.open("sky.exr", oiio.ImageSpec(4, 3, 3, "float"))
        output.write_image(SKY / 2)
        output.close()
        yield


PAINTED = {
    "type": "mesh",
    "vertex_positions": CORNERS,
    "faces": FACES,
    "vertex_a": np.linspace(0, 1, 4),
    "face_a": np.linspace(0, 1, 4),
}


def scene_of(plugin):
    """A scene that a plugin stands in where its kind belongs."""
    kind, light = KIND_OF[plugin["type"]], {}
    if plugin["type"] == "shapegroup":
        plugin = {"type": "instance", "group": plugin}
    if kind in ("integrator", "shape") or (kind == "emitter" and plugin["type"] not in AREA):
        light = {"plugin": plugin}
    film = {"type": "hdrfilm", "rfilter": plugin} if kind == "rfilter" else {"type": "hdrfilm"}
    inside = {"film": plugin if kind == "film" else film} | ({"sampler": plugin} if kind == "sampler" else {})
    sensors = {"sensor": plugin if kind == "sensor" else {"type": "perspective", "fov": 40.0, **inside}}
    texture = {"type": "diffuse", "reflectance": plugin} if kind == "texture" else {"type": "diffuse"}
    wall = PAINTED if plugin["type"] == "mesh_attribute" else {"type": "rectangle"}
    wall = wall | {"bsdf": plugin if kind == "bsdf" else texture}
    if plugin["type"] in AREA:
        wall["emitter"] = plugin
    if plugin["type"] == "irradiancemeter":
        wall |= sensors
        sensors = {}
    medium = {"type": "heterogeneous"}
    if kind in ("volume", "phase"):
        medium[{"volume": "sigma_t"}.get(kind, kind)] = plugin
    fog = {"type": "cube", "bsdf": {"type": "null"}, "interior": plugin if kind == "medium" else medium}
    without_media = kind == "integrator" and not plugin["type"].startswith("vol")
    return {"type": "scene", "wall": wall} | sensors | light | ({} if without_media else {"fog": fog})


def fingerprint(plugin):
    scene = load_dict(scene_of(plugin))
    return scene_digest(scene), scene.spp, scene.seed, str(scene.integrator.choices)


def all_cases():
    for name, (needs, parameters) in PARAMETERS.items():
        for parameter, value in parameters.items():
            yield name, parameter, needs, value
    for (name, parameter), (needs, value) in INSTEAD.items():
        yield name, parameter, needs, value


CASES = list(all_cases())


def to_xml(plugin, name=""):
    """A plugin without arrays and transforms as XML; those under "extra" have no name there."""
    kind = KIND_OF.get(plugin["type"], "scene")
    about = f' name="{name}"' if name and name != "extra" and kind != "scene" else ""
    parts = []
    for key, value in plugin.items():
        if isinstance(value, dict):
            parts.append(to_xml(value, "" if kind == "scene" else key))
        elif key != "type":
            tag = {float: "float", int: "integer", str: "string", bool: "boolean"}[type(value)]
            parts.append(f'<{tag} name="{key}" value="{value}"/>')
    start = '<scene version="3.0.0">' if kind == "scene" else f'<{kind} type="{plugin["type"]}"{about}>'
    return start + "\n".join(parts) + f"</{kind}>"


# -- tests ---------------------------------------------------------------------------------------------


def test_the_table_has_every_plugin():
    assert set(PARAMETERS) == set(KIND_OF)


@pytest.mark.parametrize(
    ("name", "parameter", "needs", "value"), CASES, ids=lambda v: v if isinstance(v, str) else ""
)
def test_a_parameter_shows_in_the_records_or_is_known_to_change_nothing(name, parameter, needs, value):
    base = {"type": name} | needs
    silent = isinstance(value, Silent)
    changed = base | {parameter: value.value if silent else value}
    plain = fingerprint(base if needs or not PARAMETERS[name][0] else {"type": name} | PARAMETERS[name][0])
    assert (fingerprint(changed) == plain) == silent


@pytest.mark.parametrize("name", PARAMETERS)
def test_the_table_has_every_parameter_that_the_reader_asks_for(name, monkeypatch):
    """So that the author of a new one must say what it does."""
    asked, kinds = set(), set()

    class Watched(reader.Reader):
        def finish(self):
            if self.type == name:
                asked.update(self._asked)
            super().finish()

        def children(self, kind, key=""):
            if self.type == name and not key:
                kinds.add(kind)
            return super().children(kind, key)

    monkeypatch.setattr("clvol.scene.reader.Reader", Watched)
    given = {name: {"type": name} | PARAMETERS[name][0]}
    for other, parameter, needs, value in CASES:
        if other == name:
            given[parameter] = {"type": name} | needs | {parameter: getattr(value, "value", value)}
    for plugin in given.values():
        load_dict(scene_of(plugin))
    told = set(PARAMETERS[name][0]) | {p for n, p, _, _ in CASES if n == name}
    assert asked <= told, f"{name} reads {asked - told}: say in PARAMETERS what they do"
    values = [getattr(v, "value", v) for p in given.values() for v in p.values()]
    found = {KIND_OF.get(v["type"]) for v in values if isinstance(v, dict)}
    assert kinds <= found, f"{name} takes a {kinds - found}: say in PARAMETERS what it does"


@pytest.mark.parametrize("name", PARAMETERS)
@pytest.mark.parametrize("value", [1.0, "text", True, RGB], ids=str)
def test_an_unknown_parameter_is_an_error_that_names_it(name, value):
    with pytest.raises(Error, match="no_such") as caught:
        load_dict(scene_of({"type": name, "no_such": value} | PARAMETERS[name][0]))
    assert f"'{name}'" in str(caught.value)


@pytest.mark.parametrize("name", PARAMETERS)
def test_a_plugin_inside_that_shows_nowhere_is_an_error_that_names_it(name):
    """Of every kind: a second one of a kind that is taken once too."""
    base = {"type": name} | PARAMETERS[name][0]
    plain = fingerprint(base)
    for kind, inner in SIMPLEST.items():
        for keys in ("extra",), ("extra", "more"):
            message = ""
            try:
                changed = fingerprint(base | dict.fromkeys(keys, inner))
            except Error as error:
                message = str(error)
            else:
                silent = kind == "medium" and KIND_OF[name] == "emitter" and keys == ("extra",)
                many = (kind == "shape" and name in ("shapegroup", "merge")) or (kind, name) == (
                    "sensor",
                    "batch",
                )
                assert silent or (changed != plain and (many or len(keys) == 1)), f"{kind} in {name}"
            assert not message or "extra" in message or "more" in message, f"{kind} in {name}: {message}"


@pytest.mark.parametrize("kind", [kind for kind in PLUGINS if kind != "volume"])
def test_xml_refuses_what_dicts_refuse(kind, tmp_path):
    """A plugin without a name inside each kind of plugin: an error with its line, or it shows."""
    path, outer = tmp_path / "scene.xml", SIMPLEST[kind]

    def load(plugin):
        path.write_text(to_xml(scene_of(plugin)))
        return scene_digest(load_file(path))

    plain = load(outer)
    for inner_kind, inner in SIMPLEST.items():
        try:
            changed = load(outer | {"extra": inner})
        except Error as error:
            assert "scene.xml:" in str(error), f"{inner_kind} in {kind}: {error}"
            assert not fits_in(outer, inner), f"{inner_kind} in {kind}: {error}"
        else:
            silent = (inner_kind, kind) == ("medium", "emitter")
            assert silent or changed != plain or inner_kind == "sampler", f"{inner_kind} in {kind}"


def fits_in(outer, inner):
    """Whether a dict may have it there."""
    try:
        load_dict(scene_of(outer | {"extra": inner}))
    except Error:
        return False
    return True
