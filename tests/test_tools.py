"""The tools that developers repeat: kernels written out for reading, and the benchmark's arithmetic."""

from __future__ import annotations

import importlib
import math
import re
import subprocess
import sys
from pathlib import Path
from types import ModuleType

import click
import numpy as np
import pytest

import clvol
from clvol.scene.mesh import mesh_flaws
from clvol.scene.records import GridVolume, Mesh

ROOT = Path(__file__).resolve().parent.parent
TOOLS = ROOT / "tools"
CLOUD = str(ROOT / "scenes" / "cloud.xml")


@pytest.fixture
def tool(monkeypatch: pytest.MonkeyPatch):
    """Import a module of tools/ by name."""
    monkeypatch.syspath_prepend(TOOLS)

    def load(name: str) -> ModuleType:
        return importlib.import_module(name)

    return load


# --- dump_kernel -----------------------------------------------------------------------------------


@pytest.mark.parametrize("majorant", ["global", "grid", "kdtree"])
def test_dump_writes_every_stage_as_a_self_contained_unit(tool, tmp_path: Path, majorant: str) -> None:
    config = tool("scene_options").open_scene(CLOUD, {}, {"majorant": majorant}).config()
    written = tool("dump_kernel").dump(config, tmp_path / "kernels")
    assert [path.stem for path in written] == [*config.stages, "accumulate"]
    for path in written:
        text = path.read_text(encoding="utf-8")
        assert re.search(rf"__kernel.*\b{path.stem}_kernel\(", text)
        assert not re.search(r"^\s*#\s*include", text, re.MULTILINE)
    walks = (tmp_path / "kernels" / "medium_sample.cl").read_text(encoding="utf-8")
    assert re.findall(r'#line 1 "majorant/(\w+)\.h"', walks) == [majorant]


@pytest.mark.parametrize(
    ("arguments", "told"),
    [
        (["missing.xml"], "missing.xml"),
        ([CLOUD, "--majorant", "octree"], "unknown majorant 'octree'"),
        ([CLOUD, "-D", "size=3"], "size"),
    ],
)
def test_dump_tells_a_mistake_in_one_line(arguments: list[str], told: str, tmp_path: Path) -> None:
    command = [sys.executable, str(TOOLS / "dump_kernel.py"), *arguments, "-o", str(tmp_path / "kernels")]
    outcome = subprocess.run(command, capture_output=True, text=True)
    assert outcome.returncode == 2
    assert len(outcome.stderr.splitlines()) == 1 and told in outcome.stderr
    assert not (tmp_path / "kernels").exists()


# --- bench: efficiency -----------------------------------------------------------------------------


def made_up_rounds(tool, deviation: float, cpu: float, spp: int, seed: int, bias: float = 0.0):
    """Eight rounds of 64 x 64 pixels whose single samples have this deviation round 1 + bias."""
    noise = np.random.default_rng(seed).normal(0, deviation / math.sqrt(spp), (8, 64, 64, 1))
    return tool("efficiency").Rounds(np.repeat(1 + bias + noise, 3, axis=-1), np.full(8, cpu), spp)


def test_variance_per_sample_is_the_one_between_rounds_times_spp(tool) -> None:
    images = np.zeros((2, 1, 2, 3))
    images[1, 0, 0] = 2.0  # one pixel is 0 and then 2: variance 2; the other is sure
    rounds = tool("efficiency").Rounds(images, np.array([1.0, 4.0]), spp=3)
    np.testing.assert_allclose(tool("efficiency").pixel_variance(rounds), [[6, 0]])
    np.testing.assert_allclose(tool("efficiency").efficiencies(rounds), [6 / 3, 6 / 12])  # 6 paths a round


def test_mean_and_its_error_are_those_of_independent_pixels(tool) -> None:
    images = np.zeros((2, 1, 2, 3))
    images[1, 0, 0] = 2.0
    mean, error = tool("efficiency").image_mean(tool("efficiency").Rounds(images, np.ones(2), 3))
    assert mean == 0.5
    assert error == math.sqrt(2 / 2) / 2


def test_samples_per_round_do_not_change_the_efficiency(tool) -> None:
    few = made_up_rounds(tool, 0.3, cpu=1.0, spp=4, seed=1)
    many = made_up_rounds(tool, 0.3, cpu=25.0, spp=100, seed=2)
    ratio = tool("efficiency").efficiency_ratio(few, many)
    assert ratio["low"] < 1 < ratio["high"]
    assert ratio["median"] == pytest.approx(1, abs=0.05)


def test_twice_the_noise_at_a_tenth_of_the_time_is_two_and_a_half_times_as_efficient(tool) -> None:
    ours = made_up_rounds(tool, 0.6, cpu=1.0, spp=50, seed=1)
    theirs = made_up_rounds(tool, 0.3, cpu=10.0, spp=50, seed=2)
    ratio = tool("efficiency").efficiency_ratio(ours, theirs)
    assert ratio["low"] < 2.5 < ratio["high"]
    assert ratio["high"] - ratio["low"] < 0.4


def test_equal_means_agree_and_a_bias_of_one_percent_is_seen(tool) -> None:
    efficiency = tool("efficiency")
    mean = efficiency.image_mean(made_up_rounds(tool, 0.3, 1.0, 50, seed=1))
    same = efficiency.image_mean(made_up_rounds(tool, 0.5, 1.0, 20, seed=2))
    biased = efficiency.image_mean(made_up_rounds(tool, 0.5, 1.0, 20, seed=2, bias=0.01))
    assert abs(efficiency.z_score(mean, same)) < 4
    assert abs(efficiency.z_score(mean, biased)) > 4
    assert efficiency.z_score((1.0, 0.0), (1.0, 0.0)) == 0
    assert efficiency.z_score((2.0, 0.0), (1.0, 0.0)) == math.inf


def test_spread_is_median_least_and_greatest(tool) -> None:
    assert tool("efficiency").spread([3.0, 1.0, 9.0]) == {"median": 3.0, "least": 1.0, "greatest": 9.0}


def test_targets_are_met_on_the_right_side(tool) -> None:
    against = tool("bench_tables").against
    assert against(2.9, 3.0).endswith("met") and against(3.1, 3.0).endswith("MISSED")
    assert against(8.1, 8.0, at_least=True).endswith("met")
    assert against(7.9, 8.0, at_least=True).endswith("MISSED")


# --- bench: grids ----------------------------------------------------------------------------------


@pytest.mark.parametrize("kind", ["cloud_slabs", "noise_slabs"])
def test_bench_grids_are_seeded_coefficients_that_load(tool, tmp_path: Path, kind: str) -> None:
    grids, size = tool("big_grids"), 40  # one full slab and a part of one
    for name in ("a", "b"):
        grids.write_npy(tmp_path / f"{name}.npy", getattr(grids, kind)(size), size)
    values = np.load(tmp_path / "a.npy")
    assert values.shape == (size, size, size) and values.dtype == np.float32
    assert np.isfinite(values).all() and values.min() >= 0 and values.max() <= 1
    assert len(np.unique(values[values > 0])) > 1000
    np.testing.assert_array_equal(values, np.load(tmp_path / "b.npy"))
    scene = clvol.load_dict(tool("bench_costs").grid_scene(tmp_path / "a.npy", 8))
    assert isinstance(scene.shapes[0].interior.sigma_t, GridVolume)


# --- bench: rays and room --------------------------------------------------------------------------


def test_embree_is_taken_from_this_python_where_it_is(tool, monkeypatch: pytest.MonkeyPatch) -> None:
    rays = tool("bench_rays")
    monkeypatch.setattr(rays.importlib.util, "find_spec", lambda name: object())
    assert rays.embree_environment() == {}


def test_a_missing_embree_is_installed_or_told(
    tool, monkeypatch: pytest.MonkeyPatch, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    rays = tool("bench_rays")
    monkeypatch.setattr(rays.importlib.util, "find_spec", lambda name: None)
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    failed = subprocess.CompletedProcess([], returncode=1)
    monkeypatch.setattr(rays.subprocess, "run", lambda *args, **kwargs: failed)
    with pytest.raises(click.ClickException, match="embreex"):
        rays.embree_environment()
    assert str(tmp_path) in capsys.readouterr().err
    (tmp_path / "clvol" / "embreex" / "embreex").mkdir(parents=True)
    assert rays.embree_environment()["PYTHONPATH"].startswith(str(tmp_path / "clvol" / "embreex"))


@pytest.mark.parametrize(("z", "status"), [(1.0, 0), (-5.0, 1)])
def test_pictures_that_differ_are_the_exit_status(tool, z: float, status: int) -> None:
    finish = tool("bench").finish
    assert finish((None, {"cloud": {"z": 0.0}, "room": {"z": z}})) == status


def test_ray_meshes_are_closed_and_of_the_size_asked_for(tool) -> None:
    vertices, faces = tool("bench_rays").knobbly_sphere(3000)
    assert abs(len(faces) - 3000) < 200
    a, b, c = vertices[faces].swapaxes(0, 1)
    assert np.linalg.norm(np.cross(b - a, c - a), axis=1).min() > 0


# --- make_scenes -----------------------------------------------------------------------------------


def test_the_plume_is_the_committed_one_and_empty_at_its_border(tool) -> None:
    plume = tool("make_scenes").make_plume()
    committed = np.frombuffer((ROOT / "scenes" / "plume.vol").read_bytes(), "<f4", offset=48)
    np.testing.assert_allclose(committed.reshape(plume.shape), plume, atol=1.01 / 255)  # sines may differ
    inner = plume.copy()
    inner[1:-1, 1:-1, 1:-1] = 0
    assert not inner.any() and plume.max() <= 1


def test_the_knot_is_the_committed_one_and_a_closed_outward_surface(tool) -> None:
    vertices, normals, faces = tool("make_scenes").make_knot()
    mesh = clvol.load_file(ROOT / "scenes" / "jade.xml").shapes[-1].mesh
    np.testing.assert_allclose(mesh.vertices, vertices, atol=1e-5)
    assert not mesh_flaws(Mesh(vertices, faces, normals))
