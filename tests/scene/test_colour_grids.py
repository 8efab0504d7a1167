"""Vector grids of OpenVDB and NanoVDB as colours: of the albedo, of the emission, of the extinction."""

from __future__ import annotations

import numpy as np
import pytest
from nvdb_writer import BLOSC, write_nvdb
from rich_vdb import times_colour
from vdb_writer import ACTIVE_MASK, ZIP, GridSpec, write_vdb

import clvol

ALL = np.ones((8, 8, 8), bool)
VIEW = clvol.look_at([0.4, 0.3, -3], [0.4, 0.4, 0.4], [0, 1, 0])
UNIT = ("UniformScaleMap", [0.1] * 15)
GREY = np.random.default_rng(4).random((8, 8, 8))
STORED = {
    "vec3s": {},
    "vec3s half": {"half": True},
    "vec3d": {"value_type": "vec3d", "compression": ZIP | ACTIVE_MASK},
    "Vec3f": {},
    "Vec3d": {"value_type": "vec3d"},
}


OTHERS = [pytest.param(way, marks=pytest.mark.contract) for way in STORED if way not in ("vec3s", "Vec3f")]


@pytest.fixture(params=["vec3s", "Vec3f", *OTHERS])
def file(request, tmp_path) -> str:
    """A density, and colours in each way of storing them: halves, quarters and eighths."""
    options = {"value_type": "vec3s", "transform": UNIT} | STORED[request.param]
    grey = np.round(4 * GREY) / 8
    density = GridSpec(leaves={(0, 0, 0): (np.full((8, 8, 8), 3.0), ALL)}, transform=UNIT)
    colour = GridSpec("Cd", leaves={(0, 0, 0): (times_colour(grey), ALL)}, background=(0, 0, 0), **options)
    if request.param.startswith("Vec"):
        for grid in (density, colour):
            grid.transform = ("AffineMap", np.diag([0.1, 0.1, 0.1, 1]).ravel().tolist())
        write_nvdb(tmp_path / "a.nvdb", [density, colour], ["Float", request.param], BLOSC)
        return str(tmp_path / "a.nvdb")
    write_vdb(tmp_path / "a.vdb", [density, colour])
    return str(tmp_path / "a.vdb")


def render(technique: str = "delta", **medium) -> np.ndarray:
    film = {"type": "hdrfilm", "width": 6, "height": 6, "rfilter": {"type": "box"}}
    box = {
        "type": "cube",
        "to_world": clvol.translate([0.35] * 3) @ clvol.scale(0.6),
        "bsdf": {"type": "null"},
        "interior": {"type": "heterogeneous", **medium},
    }
    camera = {"type": "perspective", "fov": 30, "film": film, "to_world": VIEW}
    scene = {"type": "scene", "camera": camera, "sky": {"type": "constant"}, "box": box}
    # background: "expected" guesses the mean albedo, by the samples that there are
    options = {"technique": technique, "majorant": "global", "background": "sampled"}
    return clvol.render(clvol.load_dict(scene), spp=16, seed=2, **options).image


def as_array(vectors: bool) -> dict:
    """The same colours as an array whose samples lie where the file's do, with 0 round them."""
    grey = np.round(4 * GREY) / 8
    values = np.zeros((10, 10, 10, 3))
    values[1:-1, 1:-1, 1:-1] = times_colour(grey).transpose(2, 1, 0, 3)
    to_world = clvol.scale(0.1) @ clvol.translate([-1.5] * 3) @ clvol.scale(10)
    return {"type": "gridvolume", "data": values if vectors else values[..., 0], "to_world": to_world}


@pytest.mark.parametrize("role", ["albedo", "emission"])
def test_a_vector_grid_means_what_the_same_array_means(file, role):
    density = {"type": "vdbvolume", "filename": file}
    colour = {"type": "vdbvolume", "filename": file, "grid": "Cd"}
    picture = render(**{"sigma_t": density, "albedo": 0.5, role: colour})
    expected = render(**{"sigma_t": density, "albedo": 0.5, role: as_array(True)})
    assert np.allclose(picture, expected, rtol=1e-5, atol=1e-6)
    grey = render(**{"sigma_t": density, "albedo": 0.5, role: as_array(False)})
    assert not np.allclose(picture, grey, rtol=1e-2)
    red, green, blue = np.moveaxis(picture, -1, 0)
    assert (green > red).mean() > 0.3 and (red > blue).mean() > 0.3


def test_a_vector_grid_is_a_coloured_extinction(file):
    colour = {"type": "vdbvolume", "filename": file, "grid": "Cd"}
    sparse = render("regular", sigma_t=colour, scale=8.0, albedo=0.0)
    dense = render("regular", sigma_t=as_array(True), scale=8.0, albedo=0.0)
    assert np.allclose(sparse, dense, rtol=1e-4, atol=1e-5)
    red, green, blue = np.moveaxis(sparse, -1, 0)
    assert (green < red).mean() > 0.3 and (red < blue).mean() > 0.3
