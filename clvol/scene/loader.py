"""`load_file` and `load_dict`: the table of supported plugins, and the scene as a whole."""

from __future__ import annotations

import logging
import os
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from clvol.base.files import files_noted
from clvol.errors import Error, SceneError, shown
from clvol.scene import (
    bends,
    bsdf,
    classified,
    emitter,
    flakes,
    groups,
    integrator,
    medium,
    phase,
    sensor,
    shape,
    sunsky,
    tabulated,
    texture,
    timed_sunsky,
    volume,
)
from clvol.scene.building import build, build_whole
from clvol.scene.depth_picture import bare
from clvol.scene.faults import MOST_SKIPPED, EnoughError, Faults, LostError, UnsupportedError
from clvol.scene.library import Grids, Library, PluginTable
from clvol.scene.mesh_attributes import mesh_attribute
from clvol.scene.mesh_files import FORMATS
from clvol.scene.nodes import NAMELESS, Node, from_dict
from clvol.scene.pbrt.translation import is_pbrt, read_pbrt
from clvol.scene.records import ConstantEmitter, EnvmapEmitter, Integrator, Scene, Sensor, Shape
from clvol.scene.spectrum_plugins import SPECTRA
from clvol.scene.vocabulary import listed
from clvol.scene.xml import read_xml, read_xml_text

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Mapping

PLUGINS: PluginTable = {
    "integrator": {
        "volpath": integrator.volpath,
        "volpathmis": integrator.volpath,
        "path": integrator.path,
        "depth": integrator.depth,
        "moment": integrator.moment,
        "aov": integrator.aov,
        **dict.fromkeys(integrator.OTHERS, integrator.other),
        **dict.fromkeys(integrator.WRAPPERS, integrator.wrapper),
    },
    "sensor": {
        "perspective": sensor.perspective,
        "thinlens": sensor.thinlens,
        "orthographic": sensor.orthographic,
        "radiancemeter": sensor.radiancemeter,
        "distant": sensor.distant,
        "irradiancemeter": sensor.irradiancemeter,
        "batch": sensor.batch,
    },
    "film": {"hdrfilm": sensor.hdrfilm},
    "rfilter": {
        "box": sensor.box,
        "tent": sensor.tent,
        "gaussian": sensor.gaussian,
        "mitchell": sensor.mitchell,
        "catmullrom": sensor.catmullrom,
        "lanczos": sensor.lanczos,
    },
    "sampler": {
        "independent": sensor.independent,
        **dict.fromkeys(sensor.OTHER_SAMPLERS, sensor.other_sampler),
    },
    "shape": {
        "cube": shape.cube,
        "sphere": shape.sphere,
        "rectangle": shape.rectangle,
        "disk": shape.disk,
        "cylinder": shape.cylinder,
        **dict.fromkeys(FORMATS, shape.mesh),
        "mesh": shape.mesh_of_arrays,
        **dict.fromkeys(("bsplinecurve", "linearcurve"), shape.curve),
        "shapegroup": groups.shapegroup,
        "instance": groups.instance,
        "merge": groups.merge,
    },
    "bsdf": {
        "null": bsdf.null,
        "diffuse": bsdf.diffuse,
        "dielectric": bsdf.dielectric,
        "thindielectric": bsdf.thindielectric,
        "roughdielectric": bsdf.roughdielectric,
        "conductor": bsdf.conductor,
        "roughconductor": bsdf.roughconductor,
        "plastic": bsdf.plastic,
        "roughplastic": bsdf.roughplastic,
        "principled": bsdf.principled,
        "principledthin": bsdf.principledthin,
        "twosided": bsdf.twosided,
        "mask": bsdf.mask,
        "blendbsdf": bsdf.blendbsdf,
        "normalmap": bends.normalmap,
        "bumpmap": bends.bumpmap,
    },
    "medium": {
        "homogeneous": medium.homogeneous,
        "heterogeneous": medium.heterogeneous,
        "classified": classified.classified,
    },
    "volume": {
        "gridvolume": volume.gridvolume,
        "constvolume": volume.constvolume,
        "vdbvolume": volume.vdbvolume,
    },
    "phase": {
        "isotropic": phase.isotropic,
        "hg": phase.hg,
        "rayleigh": phase.rayleigh,
        "blendphase": phase.blendphase,
        "tabphase": tabulated.tabphase,
        "sggx": flakes.sggx,
    },
    "emitter": {
        "constant": emitter.constant,
        "envmap": emitter.envmap,
        "directional": emitter.directional,
        "point": emitter.point,
        "spot": emitter.spot,
        "projector": emitter.projector,
        "area": emitter.area,
        "directionalarea": emitter.directionalarea,
        "sunsky": sunsky.sunsky,
        "timed_sunsky": timed_sunsky.timed_sunsky,
    },
    "texture": {
        **SPECTRA,
        "bitmap": texture.bitmap,
        "checkerboard": texture.checkerboard,
        "mesh_attribute": mesh_attribute,
        "volume": texture.volume,
    },
}
"""Kind -> plugin name -> the function that builds its record."""

_WITH_MESHES: PluginTable = {**PLUGINS, "shape": {**PLUGINS["shape"], "trianglemesh": shape.trianglemesh}}
"""The same with the shape that readers of other formats put their meshes into."""

IN_SCENES = ("integrator", "sensor", "shape", "emitter")
"""Kinds that a scene is made of; the others are parts of these."""

log = logging.getLogger("clvol")


def is_scene_file(path: str | os.PathLike[str]) -> bool:
    """Whether a file's name says that it is a scene."""
    return Path(path).suffix.lower() == ".xml" or is_pbrt(path)


def load_file(path: str | Path, **defaults: object) -> Scene:
    """Read a Mitsuba 3 XML scene, or one of PBRT-v4 (.pbrt, .pbrt.gz).

    Parameters
    ----------
    path : str or Path
        The file.  Files that XML names are looked for in its `<path>`s (the last first), then in its folder.
    **defaults
        Values that replace those of `<default name= value=>`.

    Returns
    -------
    Scene
        What `clvol.render` takes.

    Raises
    ------
    SceneError
        Whatever cannot be understood or is not supported, with file and line; a keyword that no `$name` uses.
    VolumeError
        A volume file that is broken or holds no valid coefficients.
    """
    if not isinstance(path, str | os.PathLike):
        raise SceneError(f"load_file takes a file's name, not {shown(path)}", hint="load_dict takes dicts")
    return load_nodes(path, defaults)[0]


def load_nodes(path: str | os.PathLike[str], defaults: Mapping[str, object]) -> tuple[Scene, Node]:
    """As `load_file`, and the nodes that the scene was made from."""
    nodes: list[Node] = []
    read_file, load = (read_pbrt, _of_pbrt) if is_pbrt(path) else (read_xml, _of_xml)

    def read(faults: Faults) -> Node:
        nodes.append(read_file(Path(path), defaults, faults))
        return nodes[0]

    return load(read, str(path)), nodes[0]


def load_string(text: str, **defaults: object) -> Scene:
    """Read a Mitsuba 3 XML scene from a string.

    Parameters
    ----------
    text : str
        The XML.  Files it names are looked for in its `<path>`s, then in the working directory.
    **defaults
        As for `load_file`.

    Returns
    -------
    Scene
        What `clvol.render` takes.

    Raises
    ------
    SceneError, VolumeError
        As `load_file`.
    """
    if not isinstance(text, str):
        raise SceneError(
            f"load_string takes a string of XML, not {shown(text)}", hint="load_dict takes dicts"
        )
    return _of_xml(lambda faults: read_xml_text(text, defaults, faults))


def load_dict(scene: Mapping[str, object]) -> Scene:
    """Make a scene from nested dicts, as `mi.load_dict` takes them.

    Parameters
    ----------
    scene
        The scene, with ``"type": "scene"``. Arrays serve as grids and bitmaps, 4x4 arrays and objects with
        a 4x4 ``.matrix`` as transforms. File names are relative to the working directory.

    Returns
    -------
    Scene
        What `clvol.render` takes.

    Raises
    ------
    SceneError, VolumeError
        As `load_file`, with a path such as ``scene.shape_1.interior.sigma_t`` for the place.
    """
    return _loaded(lambda _: from_dict(scene))


def load_plugin(plugin: Mapping[str, object], grids: Grids) -> Any:
    """The record of one plugin, such as a volume, described by a dict as inside of a scene.

    grids : volumes that were read before; those read now join them.
    """
    node = from_dict(plugin, "volume")
    return build_whole(node, Library(node, PLUGINS, grids))


def load_staged(scene: Mapping[str, object], source: str, grids: Grids, files: Iterable[str]) -> Scene:
    """As `load_dict`, of a scene made for what `source` names, with volumes that were read from `files`."""
    return _loaded(lambda _: from_dict(scene), source, grids, files)


def load_sensor(given: Mapping[str, object]) -> tuple[Sensor, set[str]]:
    """A sensor from a dict as `load_dict` takes it, and the kinds of plugins that it has inside."""
    root = from_dict({"type": "scene", "sensor": given})
    library, node = Library(root, PLUGINS), root["sensor"]
    if (kind := library.kind_of(node)) != "sensor":
        raise SceneError(f"'{node.type}' is a {kind}, not a sensor", node.where)
    inside = (value for _, value in node.parameters() if isinstance(value, Node) and not value.is_value)
    made = build_whole(node, library)
    if not isinstance(made, Sensor):
        raise SceneError("an irradiancemeter outside a shape measures nothing", node.where, sensor.IN_A_SHAPE)
    return made, {library.kind_of(library.resolve(value)) for value in inside}


def _of_pbrt(read: Callable[[Faults], Node], source: str) -> Scene:
    """As `_loaded`, with the shapes that such files have."""
    return _loaded(read, source, plugins=_WITH_MESHES)


def _of_xml(read: Callable[[Faults], Node], source: str = "") -> Scene:
    """As `_loaded`, where what is wrong is to be mended in XML."""
    try:
        return _loaded(read, source)
    except Error as error:
        for one in (error, *getattr(error, "errors", ())):
            one.in_scene = True
        raise


def _loaded(
    read: Callable[[Faults], Node],
    source: str = "",
    grids: Grids | None = None,
    files: Iterable[str] = (),
    plugins: PluginTable = PLUGINS,
) -> Scene:
    """The scene of the nodes that `read` returns, which knows what files it was read from."""
    faults = Faults()
    with files_noted() as noted:
        try:
            scene = _build(read(faults), source, grids, faults, plugins)
        except EnoughError:
            faults.check()
            raise SceneError(f"more than {MOST_SKIPPED} parts are not supported", source) from None
    return replace(scene, files=tuple(dict.fromkeys((*files, *noted))))


def _build(root: Node, source: str, grids: Grids | None, faults: Faults, plugins: PluginTable) -> Scene:
    if root.type != "scene":
        raise SceneError(f"expected a scene, got a '{root.type}'", root.where)
    library = Library(root, plugins, grids, faults)
    records = _records(root, library)
    sensors = _sensors(root, records, library)
    shapes = groups.all_shapes(record for _, record in records["shape"])
    emitters = _emitters(records["emitter"], library)
    chosen = Integrator()
    try:
        chosen = _integrator(records["integrator"], _what_has_media(sensors, shapes))
        if not faults:  # otherwise what refers to them may be lost
            _check_emitters(emitters)
            _check_used(records, library)
        if not sensors and not faults:
            hint = 'add a <sensor type="perspective">'
            raise SceneError("the scene has no sensor", root.where, hint)
    except SceneError as error:
        faults.note(error)
    faults.check()
    if not sensors:
        raise SceneError("the scene has no sensor that is supported", root.where)
    scene = Scene(
        sensor=sensors[0].camera,
        film=sensors[0].film,
        integrator=chosen,
        shapes=shapes,
        emitters=tuple(replace(record, name=node.id) for node, record in emitters),
        spp=sensors[0].sampler.spp,
        seed=sensors[0].sampler.seed,
        source=source,
        sensors=sensors,
        approximated=tuple(faults.approximated),
        left_out=tuple(faults.left_out),
    )
    return bare(scene) if chosen.shows_depth else scene


def _records(root: Node, library: Library) -> dict[str, list[tuple[Node, Any]]]:
    """By kind, the plugins of a scene and what has been made of them, each once."""
    records: dict[str, list[tuple[Node, Any]]] = {kind: [] for kind in PLUGINS}
    seen: set[int] = set()
    for name, value in root.parameters():
        try:
            if not isinstance(value, Node) or value.is_value:
                what = f"unknown parameter '{name}' of the scene"
                raise UnsupportedError(what, root.place(name), "it holds plugins only")
            node = library.resolve(value)
            kind = library.kind_of(node)
        except LostError:
            continue
        except SceneError as error:
            library.faults.note(error)
            continue
        if id(node) not in seen:
            seen.add(id(node))
            record = build(node, library)
            if record is not None:
                records.setdefault(kind, []).append((node, record))
    return records


def _sensors(
    root: Node, records: Mapping[str, list[tuple[Node, Any]]], library: Library
) -> tuple[Sensor, ...]:
    """The scene's sensors, those in its shapes too, in the order in which they stand there."""
    found: list[tuple[Node, Sensor]] = []
    for node, record in records["sensor"]:
        if isinstance(record, Sensor):
            found.append((node, replace(record, name=node.id)))
        elif id(node) not in library.taken:
            what = "an irradiancemeter outside a shape measures nothing"
            library.faults.note(SceneError(what, node.where, sensor.IN_A_SHAPE))
    for node, record in records["shape"]:
        if isinstance(record, Shape) and record.meter is not None:
            name = f"{record.name}.{record.meter.name or 'sensor'}" if record.name else record.meter.name
            found.append((node, replace(record.meter.on(record), name=name)))
    order = {
        id(library.resolve(value)): n
        for n, (_, value) in enumerate(root.parameters())
        if isinstance(value, Node) and not value.is_value
    }
    return tuple(one for _, one in sorted(found, key=lambda pair: order.get(id(pair[0]), len(order))))


def _emitters(records: list[tuple[Node, Any]], library: Library) -> list[tuple[Node, Any]]:
    """The scene's emitters with their nodes, where a plugin makes several one by one."""
    several = [(node, made if isinstance(made, tuple) else (made,)) for node, made in records]
    lights = [(node, light) for node, made in several for light in made]
    return [(node, light) for node, light in lights if not _is_inside(node, light, library)]


def _is_inside(node: Node, record: object, library: Library) -> bool:
    """Whether it is an area light that stands in the scene so that shapes can refer to it, and one does."""
    return isinstance(record, emitter.AreaLight) and id(node) in library.taken


def _check_used(records: Mapping[str, list[tuple[Node, object]]], library: Library) -> None:
    """What stands in the scene to be referred to must have an id, and should have a ref to it.

    One with a name alone, which has no meaning there, is from a program that writes what a dict had.
    """
    pairs = [pair for kind in records if kind not in IN_SCENES for pair in records[kind]]
    idle = [node for node, _ in pairs if id(node) not in library.taken]
    names = {id(node): name for name, node in library.root.parameters() if not name.startswith(NAMELESS)}
    for node in idle:
        if not node.id and id(node) not in names:
            raise SceneError(
                f"the {library.kind_of(node)} '{node.type}' stands in the scene and belongs to nothing",
                node.where,
                "put it into the plugin that it is for, or give it an id and refer to it",
            )
    if idle:
        some = listed([f"'{node.id or names[id(node)]}'" for node in idle], 5)
        log.warning("defined in the scene and not used: %s", some)


def _check_emitters(emitters: list[tuple[Node, object]]) -> None:
    """At most one environment, and no area emitter outside a shape."""
    environments = [node for node, record in emitters if isinstance(record, ConstantEmitter | EnvmapEmitter)]
    if len(environments) > 1:
        raise SceneError(
            "a scene takes one environment emitter, this is the second",
            environments[1].where,
            f"the first is at {environments[0].where}",
        )
    for node, record in emitters:
        if isinstance(record, emitter.AreaLight):
            raise SceneError(
                "an area emitter outside a shape lights nothing",
                node.where,
                "put it into the shape that emits",
            )


def _what_has_media(sensors: tuple[Sensor, ...], shapes: tuple[Shape, ...]) -> str:
    """The first thing in the scene that names a medium, "" without."""
    if any(sensor.camera.medium is not None for sensor in sensors):
        return "sensor"
    for record in shapes:
        if record.interior or record.exterior:
            return f"shape '{record.name}'" if record.name else "shape"
    return ""


def _integrator(integrators: list[tuple[Node, integrator.Chosen]], with_media: str) -> Integrator:
    """The one integrator, which must see the scene's media if there are any."""
    if not integrators:
        return Integrator()
    if len(integrators) > 1:
        raise SceneError("a scene takes one integrator, this is the second", integrators[1][0].where)
    node, chosen = integrators[0]
    if with_media and not chosen.media:
        raise UnsupportedError(
            f"integrator '{chosen.name}' sees no media, and the scene has some ({with_media})",
            node.where,
            "use volpath",
        )
    return chosen.integrator
