"""Transfer functions for users: `clvol.transfer`, presets, `volume_scene`, `clvol.show`, labels."""

from __future__ import annotations

import os
import re
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import clvol
from clvol.picture.scenery import Scenery
from clvol.scene.records import GridVolume
from clvol.staging.presets import PRESETS
from clvol.volumes.grid import DenseGrid

DOCS = Path(__file__).parents[2] / "docs" / "science.md"
SMALL: dict[str, Any] = {"size": (24, 20), "spp": 2}


def scan() -> np.ndarray:
    """A ball of bone in muscle in air, in Hounsfield units."""
    z, y, x = np.meshgrid(*(np.linspace(-1, 1, n) for n in (18, 15, 16)), indexing="ij")
    radius = np.sqrt(x**2 + y**2 + z**2)
    return np.select([radius < 0.45, radius < 0.85], [900.0, 40.0], -1000.0).astype(np.int16)


def placed() -> DenseGrid:
    """The scan with voxels of 2 mm."""
    values = scan()[..., None].astype(np.float32)
    to_world = np.diag([2.0, 2, 2, 1])
    to_world[:3, 3] = -10, 5, 7
    return DenseGrid(values, np.array([[0.0] * 3, [1] * 3]), "scan", "", to_world, "mm")


def medium_of(scene: clvol.Scene) -> Any:
    return scene.shapes[0].interior


def loaded(medium: dict[str, Any]) -> Any:
    body = {"type": "cube", "bsdf": {"type": "null"}, "interior": medium}
    return medium_of(clvol.load_dict({"type": "scene", "sensor": {"type": "perspective"}, "body": body}))


def test_a_medium_is_made_of_points() -> None:
    opacity, colour = [(0, 0), (100, 2.5)], [(0, (1, 0.5, 0)), (900, (0.2, 0.2, 1))]
    medium = loaded(clvol.transfer(scan(), opacity=opacity, colour=colour, emission=[(0, 0), (900, 3)]))
    assert medium.transfers.sigma_t.points() == opacity
    assert medium.transfers.albedo.points() == [(0, (1, 0.5, 0)), (900, (0.2, 0.2, 1))]
    assert medium.transfers.emission.points() == [(0, 0), (900, 3)]
    assert medium.scale == (1.0,) and medium.albedo is medium.sigma_t is medium.emission


def test_colour_maps_span_the_values_of_the_opacity() -> None:
    matplotlib = pytest.importorskip("matplotlib", reason="matplotlib is not installed")
    medium = loaded(clvol.transfer(scan(), opacity=[(-200, 0), (600, 1)], colour="bone", emission=2.0))
    albedo = medium.transfers.albedo
    assert albedo.values[0] == -200 and albedo.values[-1] == 600
    encoded = np.array(matplotlib.colormaps["bone"](0.5)[:3])
    linear = np.where(encoded <= 0.04045, encoded / 12.92, ((encoded + 0.055) / 1.055) ** 2.4)
    assert np.allclose(albedo(np.array(200.0)), linear, atol=5e-3)
    assert np.allclose(medium.transfers.emission.colours, 2 * albedo.colours)


def test_a_value_that_is_the_same_everywhere_is_classified_too() -> None:
    constant = {
        "type": "classified",
        "values": {"type": "constvolume", "value": 5.0},
        "opacity": "0: 0, 10: 4",
    }
    medium = loaded(constant | {"albedo": [(0, (0, 0, 0)), (10, (1, 0.5, 0))], "emission": 2.0})
    assert medium.transfers is None
    assert medium.sigma_t.value == (2.0,) and medium.albedo.value == (0.5, 0.25, 0.0)


@pytest.mark.parametrize("name", PRESETS)
def test_every_preset_is_a_medium(name: str) -> None:
    medium = loaded(clvol.transfer(placed(), name))
    values = medium.transfers.sigma_t.values
    if PRESETS[name].relative:
        assert values[0] >= -1000 and values[-1] == pytest.approx(900)
    longest = 36.0  # 18 voxels of 2 mm
    assert medium.scale[0] == pytest.approx(50 / longest)
    assert 0.3 < medium.transfers.sigma_t.largest <= 1


def test_a_volume_scene_takes_a_transfer_function() -> None:
    preset = medium_of(clvol.volume_scene(placed(), transfer="muscle", **SMALL))
    assert preset.transfers is not None and preset.scale[0] != 1
    own = {"opacity": [(0, 0), (500, 0.3)], "colour": (0.9, 0.5, 0.1)}
    medium = medium_of(clvol.volume_scene(placed(), transfer=own, **SMALL))
    assert medium.scale == (1.0,), "a user's own extinctions are what they are"
    assert np.allclose(medium.transfers.albedo.colours, (0.9, 0.5, 0.1))


def test_a_scan_in_hounsfield_units_shows_its_bone() -> None:
    """Its values are no densities: air is at -1000."""
    medium = medium_of(clvol.volume_scene(placed(), **SMALL))
    assert medium.transfers.sigma_t.points()[0] == PRESETS["bone"].opacity[0]


@pytest.mark.parametrize(
    ("given", "says"),
    [
        ({"preset": "bones"}, "did you mean 'bone'"),
        ({}, "needs an opacity"),
        ({"opacity": [(1, 0), (0, 1)]}, "must not fall"),
        ({"opacity": [(0, (1, 0, 0))]}, "one number for each value"),
        ({"opacity": [(0, 1)], "colour": "no_such_map"}, "no colour map"),
        ({"opacity": [(0, 1)], "colour": [(0, 1.5)]}, "at most 1"),
        ({"opacity": [(0, 1)], "emission": -1.0}, "at least 0"),
        ({"preset": "fire", "opacity": [(0, 1)]}, "values of its own"),
    ],
)
def test_what_is_no_transfer_function_is_said(given: dict[str, Any], says: str) -> None:
    with pytest.raises(clvol.OptionError, match=says):
        clvol.transfer(scan(), **given)
    if given:
        with pytest.raises(clvol.OptionError, match=says):
            clvol.volume_scene(scan(), transfer=given)


@pytest.mark.parametrize("other", [{"albedo": 0.5}, {"temperature": "heat"}, {"emission_scale": 2.0}])
def test_what_a_transfer_function_decides_cannot_be_given_too(other: dict[str, Any]) -> None:
    volume = {"density": scan(), "heat": np.abs(scan())}
    with pytest.raises(clvol.OptionError, match="exclude each other"):
        clvol.volume_scene(volume, transfer="bone", **other)
    assert not medium_of(clvol.volume_scene(volume, transfer="bone", **SMALL)).emits


@pytest.fixture(scope="module")
def shown() -> clvol.Result:
    return clvol.show(placed(), transfer="bone", view="front", size=(40, 32), spp=4)


def test_show_is_a_picture_in_one_line(shown: clvol.Result) -> None:
    assert shown.image.shape == (32, 40, 3) and shown._repr_png_().startswith(b"\x89PNG")
    with pytest.raises(TypeError, match=r"unexpected keyword argument 'tranfer'"):
        clvol.show(scan(), tranfer="bone")


def test_labels_lie_where_the_volume_is(shown: clvol.Result) -> None:
    """The box's middle is where the ball of bone is in the picture, and units are the file's."""
    pytest.importorskip("matplotlib", reason="matplotlib is not installed")
    scenery = shown.scenery
    assert scenery is not None and scenery.unit == "mm"
    assert scenery.corner.tolist() == [-11, 4, 6]
    assert [scenery.extent(side) for side in range(3)] == [("x", -11, 21), ("y", 4, 34), ("z", 6, 42)]
    brown = shown.image[..., 0] - shown.image[..., 2] > 0.02  # bone, before a blue sky
    rows, columns = np.nonzero(brown)
    found = np.array([columns.mean() + 0.5, rows.mean() + 0.5])
    assert np.abs(scenery.project(scenery.middle[None])[0] - found).max() < 1.5
    figure = shown.plot(scale_bar=20)
    words = [text.get_text() for text in figure.axes[0].texts]
    assert {"x (mm)", "y (mm)", "z (mm)", "20 mm"} <= set(words)
    low, high = figure.axes[1].get_ylim()
    assert (low, high) == (180, 1500)


def test_a_camera_in_the_volume_has_no_endless_axes(shown: clvol.Result) -> None:
    """What is next to the camera's plane is seen a million pixels away, or nowhere."""
    pytest.importorskip("matplotlib", reason="matplotlib is not installed")
    assert shown.scenery is not None
    usual = shown.plot()
    for near in (1e-6, 1e-30, 0.0):
        inside = shown.scenery.corner + near * shown.scenery.edges.sum(axis=0)
        figure = replace(shown, scenery=replace(shown.scenery, start=inside)).plot()
        assert max(figure.get_size_inches()) < 4 * max(usual.get_size_inches())
        assert len(figure.axes[0].texts) < 80


def test_labels_that_cannot_be_are_refused(shown: clvol.Result, tmp_path: Path) -> None:
    pytest.importorskip("matplotlib", reason="matplotlib is not installed")
    for wrong in (-1, 0, 1e6, "long", float("nan"), np.zeros(2)):
        with pytest.raises(clvol.OptionError):
            shown.plot(scale_bar=wrong)  # type: ignore[arg-type]
    for name in ("axes", "box", "scalar_bar"):
        with pytest.raises(clvol.OptionError, match=f"{name}='no' is neither True nor False"):
            shown.plot(**{name: "no"})  # type: ignore[arg-type]
    bare = replace(shown, scenery=None)
    with pytest.raises(clvol.OptionError, match="knows no volume"):
        bare.plot()
    assert bare.plot(axes=False, box=False) is not None


def test_a_picture_from_a_file_has_its_labels(shown: clvol.Result, tmp_path: Path) -> None:
    pytest.importorskip("matplotlib", reason="matplotlib is not installed")
    shown.save(tmp_path / "a.exr")
    again = clvol.load_result(tmp_path / "a.exr")
    for one in (again, clvol.merge([again])):
        assert one.scenery is not None and shown.scenery is not None
        assert one.scenery.described() == shown.scenery.described()
        words = [[t.get_text() for t in r.plot(scale_bar=20).axes[0].texts] for r in (one, shown)]
        assert words[0] == words[1]
    for wrong in (
        {"start": [0, 0]},
        {"rows": "x"},
        {"corner": [0, 0, float("inf")]},
        {"transfers": {"a": "b"}},
    ):
        with pytest.raises((KeyError, TypeError, ValueError)):
            Scenery.read(shown.scenery.described() | wrong)


@pytest.mark.parametrize("size", [(40, 32), (64, 20), (20, 64)])
def test_letters_are_whole_and_lie_apart(size: tuple[int, int]) -> None:
    pytest.importorskip("matplotlib", reason="matplotlib is not installed")
    result = clvol.render(clvol.volume_scene(placed(), transfer="bone", size=size), spp=1)
    figure = result.plot(scale_bar=True)
    place, renderer = figure.axes[0], figure.canvas.get_renderer()
    boxes = [t.get_window_extent(renderer) for t in place.texts if t.get_visible()]
    assert len(boxes) > 4
    assert not any(one.overlaps(two) for n, one in enumerate(boxes) for two in boxes[:n])
    for box in [*boxes, figure.axes[1].get_tightbbox(renderer)]:
        assert box.x0 >= -2 and box.y0 >= -2
        assert box.x1 <= figure.bbox.x1 + 2 and box.y1 <= figure.bbox.y1 + 2
    near = clvol.render(clvol.volume_scene(placed(), size=size, distance=0.3), spp=1).plot()
    assert max(near.get_size_inches()) < 4 * max(figure.get_size_inches())


def test_the_lines_of_the_documentation_run(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    sitk = pytest.importorskip("SimpleITK", reason="SimpleITK is not installed")
    pytest.importorskip("matplotlib", reason="matplotlib is not installed")
    image = sitk.GetImageFromArray(scan())
    image.SetSpacing((2, 2, 2))
    sitk.WriteImage(image, str(tmp_path / "scan.nii.gz"))
    monkeypatch.chdir(tmp_path)
    blocks = re.findall(r"```python\n(.*?)```", DOCS.read_text(encoding="utf-8"), re.DOTALL)
    assert len(blocks) == 4
    text = "\n".join(blocks).replace('transfer="bone"', 'transfer="bone", size=(24, 20), spp=2')
    text = text.replace("    scan,\n", "    scan,\n    size=(24, 20),\n").replace("spp=16", "spp=2")
    names: dict[str, Any] = {"scan": placed()}
    exec(compile(text, str(DOCS), "exec"), names)
    assert isinstance(names["scene"].shapes[0].interior.sigma_t, GridVolume)
    assert {path.name for path in tmp_path.glob("*.png")} == {"from-100.png", "from-200.png", "from-400.png"}


@pytest.mark.contract
@pytest.mark.skipif("CLVOL_DATA" not in os.environ, reason="CLVOL_DATA names no folder of volumes")
def test_the_wires_of_a_stent_are_seen() -> None:
    """A scan in one line: its metal is brighter than the vessel and the bone round it are opaque."""
    stent = Path(os.environ["CLVOL_DATA"]) / "stent.npz"
    metal = {"opacity": [(1100, 0), (1400, 300)], "colour": 0.9}
    result = clvol.show(stent, transfer=metal, view="front", size=(48, 72), spp=4, background="black")
    seen = result.image.mean(axis=2)[12:60, 16:40] > 0.02
    assert 0.02 < seen.mean() < 0.6
