"""Writes files with OpenVDB's own module, and what OpenVDB finds in them; run by a Python that has `bpy`.

    PYTHON tests/helpers/openvdb_worker.py FOLDER

For each of VARIANTS FOLDER/NAME.vdb is written; and for these and the files that are there already
FOLDER/NAME.json with the facts of the grids, in the order in which they were written, and FOLDER/NAME.npz
with values and states of voxels in and round them.
"""

from __future__ import annotations

import json
import sys
from pathlib import Path
from typing import Any

import numpy as np

PROBES = 6000
RNG = np.random.default_rng(11)
Grids = list[Any]

vdb: Any = None
"""OpenVDB's module, once `load_openvdb` has run: the names of VARIANTS can be had without it."""


def load_openvdb() -> None:
    """Import OpenVDB's module, which `bpy` keeps in a folder of its own."""
    global vdb
    import bpy

    site = Path("python", "lib", f"python3.{sys.version_info[1]}", "site-packages")
    sys.path.extend(str(folder / site) for folder in Path(bpy.__file__).parents if (folder / site).is_dir())
    import openvdb

    vdb = openvdb


def cloud(kind: str = "FloatGrid", name: str = "density", seed: int = 0, background: float = 0) -> Any:
    """Leaves at both sides of the origin, two thirds of their voxels active."""
    grid = getattr(vdb, kind)(background)
    grid.name = name
    values = np.random.default_rng(seed).integers(-40, 80, (21, 17, 30))
    values = np.where(values > 0, values, background)
    grid.copyFromArray(values.astype(int) if kind.startswith("Int") else values / 64, ijk=(-9, 3, -20))
    return grid


def halved(grid: Any) -> Any:
    grid.saveFloatAsHalf = True
    return grid


def tiles() -> Grids:
    """Active and inactive tiles of both sizes, and leaves among them."""
    grid = cloud(background=2)
    grid.fill((-512, -256, 0), (-1, -1, 255), 0.5, True)
    grid.fill((256, 256, 256), (383, 511, 383), 7.0, False)
    grid.fill((40, 40, 40), (103, 71, 55), 0.25, True)
    grid.fill((-104, 40, 40), (-89, 71, 55), 3.0, False)
    grid.fill((-300, -100, 50), (-290, -90, 60), 9.0, True)
    grid.prune()
    return [grid]


def root_tile() -> Grids:
    grid = vdb.FloatGrid()
    grid.name = "density"
    grid.fill((-4096, 0, 0), (-1, 4095, 4095), 0.5, True)
    grid.prune()
    return [grid]


def inactive(*values: float, background: float = 2, half: bool = False) -> Grids:
    """Inactive voxels that hold `values` by turns: each way of storing them."""
    grid = cloud(background=background)
    for number, item in enumerate(item for item in grid.iterOffValues() if item.count == 1):
        item.value = values[number % len(values)]
    grid.saveFloatAsHalf = half
    return [grid]


def moved(*steps: tuple[str, Any]) -> Any:
    """A transform after OpenVDB's own operations."""
    transform = vdb.createLinearTransform()
    for name, arguments in steps:
        getattr(transform, name)(*arguments)
    return transform


def placed(transform: Any) -> Grids:
    grid = cloud()
    grid.transform = transform
    return [grid]


def named(*names: str, share: bool = False) -> Grids:
    """Grids of these names, of different values; or all of one tree, under different transforms."""
    first = cloud(name=names[0])
    grids = [first]
    for number, name in enumerate(names[1:], 1):
        grid = first.copy() if share else cloud(name=name, seed=number)
        grid.name = name
        grid.transform = vdb.createLinearTransform(1.0 + number)
        grids.append(grid)
    return grids


def stray() -> Grids:
    grid = vdb.FloatGrid()
    grid.name = "density"
    for place in ((5, 6, 7), (1000, -900, 3), (0, 0, 0)):
        grid.getAccessor().setValueOn(place, 0.75)
    return [grid]


def broken() -> Grids:
    grid = cloud()
    for place, value in (((0, 4, 0), np.nan), ((1, 5, 0), np.inf), ((2, 6, 1), -1.0)):
        grid.getAccessor().setValueOn(place, value)
    return [grid]


def others() -> Grids:
    """What cannot be rendered, with something that can among it."""
    grids = [cloud(name="before")]
    for kind, name, value in (
        (vdb.BoolGrid, "bool", True),
        (vdb.Vec3SGrid, "vec3s", (1.0, 2.0, 3.0)),
        (vdb.Vec3IGrid, "vec3i", (1, 2, 3)),
        (vdb.Vec3DGrid, "vec3d", (1.0, 2.0, 3.0)),
    ):
        grid = kind()
        grid.name = name
        grid.fill((-3, -3, -3), (20, 9, 9), value)
        grids.append(grid)
    points = vdb.PointDataGrid()
    points.name = "points"
    frustum = cloud(name="frustum")
    frustum.transform = vdb.createFrustumTransform((0, 0, 0), (32, 32, 32), taper=0.5, depth=10.0)
    return [*grids, points, frustum, cloud(name="after", seed=5)]


def colours(kind: str) -> Any:
    """Vectors at random, some of them inactive, and a tile."""
    grid = getattr(vdb, kind)((0.5, 0.25, 2.0))
    grid.name = "Cd"
    values = RNG.random((21, 17, 30, 3))
    grid.copyFromArray(values, ijk=(-9, 4, 120), tolerance=(0.0, 0.0, 0.0))
    grid.fill((64, 0, 0), (71, 7, 7), (1.0, 0.5, 0.125))
    for number, item in enumerate(grid.iterOffValues()):
        if item.count == 1:
            item.value = (0.5, 0.25, 2.0) if number % 3 else (0.25, 0.5, 1.0)
    return grid


def emptied(background: float) -> Grids:
    grid = vdb.FloatGrid(background)
    grid.name = "density"
    return [grid]


def annotated() -> Grids:
    grid = cloud()
    grid.gridClass = vdb.GridClass.FOG_VOLUME
    grid.creator = "a program"
    grid["text"], grid["number"], grid["vector"] = "x" * 5000, 3.5, (1.0, 2.0, 3.0)
    return [grid]


def sphere() -> Grids:
    grid = vdb.createLevelSetSphere(radius=9.0, voxelSize=0.5, halfWidth=3.0)
    grid.name = "surface"
    return [grid]


def rotated(*steps: tuple[str, Any]) -> Grids:
    return placed(moved(("preRotate", (0.7, vdb.Axis.Y)), *steps))


VARIANTS = {
    "float": lambda: [cloud()],
    "half": lambda: [halved(cloud())],
    "double": lambda: [cloud("DoubleGrid")],
    "double half": lambda: [halved(cloud("DoubleGrid", background=0.5))],
    "int32": lambda: [cloud("Int32Grid")],
    "int64": lambda: [cloud("Int64Grid", background=3)],
    "int32 half": lambda: [halved(cloud("Int32Grid"))],
    "int64 half": lambda: [halved(cloud("Int64Grid", background=3))],
    "vec3s": lambda: [colours("Vec3SGrid")],
    "vec3s half": lambda: [halved(colours("Vec3SGrid"))],
    "vec3d": lambda: [colours("Vec3DGrid")],
    "vec3d half": lambda: [halved(colours("Vec3DGrid"))],
    "tiles": tiles,
    "half tiles": lambda: [halved(tiles()[0])],
    "root tile": root_tile,
    "level set": sphere,
    "half level set": lambda: [halved(sphere()[0])],
    "inactive minus background": lambda: inactive(-2),
    "inactive one value": lambda: inactive(1),
    "inactive both backgrounds": lambda: inactive(2, -2),
    "inactive one and background": lambda: inactive(1, 2),
    "inactive two values": lambda: inactive(1, 3),
    "inactive many values": lambda: inactive(1, 2, 3),
    "half with a background": lambda: inactive(0.1, background=0.1, half=True),
    "half inactive one and background": lambda: inactive(0.1, 2, half=True),
    "half inactive two values": lambda: inactive(0.1, 0.3, half=True),
    "half inactive many values": lambda: inactive(0.1, 0.2, 0.3, half=True),
    "uniform scale": lambda: placed(vdb.createLinearTransform(0.25)),
    "scale": lambda: placed(moved(("preScale", ((2.0, 3.0, 4.0),)))),
    "translation": lambda: placed(moved(("postTranslate", ((5.0, 6.0, 7.0),)))),
    "uniform scale and translation": lambda: placed(
        moved(("preScale", (0.5,)), ("postTranslate", ((5.0, 6.0, 7.0),)))
    ),
    "scale and translation": lambda: placed(
        moved(("preScale", ((2.0, 3.0, 4.0),)), ("postTranslate", ((5.0, 6.0, 7.0),)))
    ),
    "rotation": rotated,
    "rotation, scale and shear": lambda: rotated(
        ("preScale", ((2.0, 3.0, 4.0),)), ("postShear", (0.5, vdb.Axis.X, vdb.Axis.Z))
    ),
    "one name": lambda: named("density", "density", "density"),
    "one name among others": lambda: named("heat", "density", "fuel", "density"),
    "no names": lambda: named("", "", "density"),
    "hostile names": lambda: named("a[7]", "a", "a", "雲 \x1b[2J", "x" * 3000),
    "instances": lambda: named("density", "heat", "fuel", share=True),
    "instances of one name": lambda: named("density", "density", "density", share=True),
    "instances of no name": lambda: named("", "", "", share=True),
    "half instances": lambda: [halved(grid) for grid in named("density", "heat", share=True)],
    "empty": lambda: emptied(0),
    "empty with a background": lambda: emptied(0.5),
    "nothing": lambda: [],
    "stray voxels": stray,
    "not finite": broken,
    "other types": others,
    "metadata": annotated,
}


def facts(grid: Any) -> dict[str, Any]:
    """What OpenVDB says of a grid; only its name and type where its values are no numbers."""
    known = {"name": grid.name, "type": grid.valueTypeName, "linear": grid.transform.isLinear}
    if (
        not isinstance(grid.background, int | float | tuple)
        or isinstance(grid.background, bool)
        or not known["linear"]
    ):
        return known
    corners = np.array([grid.transform.indexToWorld(p) for p in np.vstack([np.zeros(3), np.eye(3)])])
    matrix = np.eye(4)
    matrix[:3, 3], matrix[:3, :3] = corners[0], (corners[1:] - corners[0]).T
    box = grid.evalActiveVoxelBoundingBox() if grid.activeVoxelCount() else None
    return known | {
        "active": grid.activeVoxelCount(),
        "box": box and [list(corner) for corner in box],
        "background": grid.background,
        "matrix": matrix.tolist(),
    }


def probe(grid: Any, box: list[list[int]]) -> dict[str, np.ndarray]:
    """Values and states of voxels in a box, and a little round it."""
    places = RNG.integers(np.array(box[0]) - 9, np.array(box[1]) + 10, (PROBES, 3))
    found = [grid.getConstAccessor().probeValue(tuple(map(int, place))) for place in places]
    return {"places": places, "values": [v for v, _ in found], "active": [a for _, a in found]}


def report(path: Path, grids: Grids) -> None:
    """Write what OpenVDB finds in the grids of a file."""
    stored, about = {}, [facts(grid) for grid in grids]
    for number, (grid, known) in enumerate(zip(grids, about, strict=True)):
        if known.get("box"):
            stored |= {f"{number}_{key}": values for key, values in probe(grid, known["box"]).items()}
    path.with_suffix(".json").write_text(json.dumps(about))
    np.savez(path.with_suffix(".npz"), **stored)


def main(folder: Path) -> None:
    for path in folder.glob("*.vdb"):
        report(path, vdb.readAll(str(path))[0])
    for name, make in VARIANTS.items():
        path, grids = folder / f"{name}.vdb", make()
        vdb.write(str(path), grids)
        names = [grid.name for grid in grids]
        for number, grid in enumerate(grids):
            if grid.name and names.count(grid.name) == 1:
                grids[number] = vdb.read(str(path), grid.name)  # rounded to half, as stored
        report(path, grids)


if __name__ == "__main__":
    load_openvdb()
    main(Path(sys.argv[1]))
