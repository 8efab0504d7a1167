"""The benchmark of six scenes: what it renders, how it takes turns, and what it makes of them."""

from __future__ import annotations

import json
import subprocess
from contextlib import contextmanager
from types import SimpleNamespace
from typing import TYPE_CHECKING, Any

import click
import numpy as np
import pytest
from click.testing import CliRunner

import clvol

if TYPE_CHECKING:
    from collections.abc import Iterator
    from pathlib import Path


# --- scenes ----------------------------------------------------------------------------------------


@pytest.mark.parametrize("name", ["cloud", "thin", "flame", "glow", "rough"])
def test_volumes_are_seeded_coefficients_and_end_before_the_border(tool, name: str) -> None:
    values = tool("benchmarks.volumes").volume(name, 24)
    assert values.shape == (24, 24, 24) and values.dtype == np.float32
    assert values.min() == 0 and 0 < values.max() <= 1
    inner = values.copy()
    inner[1:-1, 1:-1, 1:-1] = 0
    assert not inner.any()
    np.testing.assert_array_equal(values, tool("benchmarks.volumes").volume(name, 24))


def test_thin_volumes_are_nearly_empty_with_spikes_far_above_the_rest(tool) -> None:
    values = tool("benchmarks.volumes").thin(32)
    assert 0.03 < (values > 0).mean() <= 0.05
    assert (values == 1).sum() == 1 and np.sort(values.ravel())[-2] < 0.2


def test_large_volumes_are_made_once(tool, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    volumes = tool("benchmarks.volumes")
    monkeypatch.setattr(volumes.tempfile, "gettempdir", lambda: str(tmp_path))
    monkeypatch.setattr(volumes, "KEPT", 8)
    first = volumes.volume("cloud", 8)
    monkeypatch.setitem(volumes.VOLUMES, "cloud", lambda size: pytest.fail("made again"))
    np.testing.assert_array_equal(volumes.volume("cloud", 8), first)
    assert [path.name for path in (tmp_path / "clvol-bench").iterdir()] == ["cloud-8.npy"]


@pytest.mark.parametrize("name", ["cloud", "cloud_dense", "chroma", "box_smoke", "thin_sparse", "emissive"])
def test_scenes_are_files_that_clvol_reads_and_plans(tool, tmp_path: Path, name: str) -> None:
    described = tool("benchmarks.scenes").SCENES[name]
    scene = clvol.load_file(tool("benchmarks.scenes").write_scene(described, tmp_path, 16), res=8)
    features = clvol.plan(scene).features
    assert (scene.film.width, scene.film.height) == (8, 8)
    assert scene.integrator.max_depth == described.scatterings + 1
    assert features.chromatic_extinction == (name == "chroma")
    assert features.emission == (described.emission is not None)
    assert bool(features.surfaces) == bool(described.quads)
    assert features.emitters == bool(described.sky) + bool(described.sun) + (name == "box_smoke")
    assert not features.coloured_volumes or name == "emissive"
    told = json.loads((tmp_path / "scene.json").read_text())
    assert told["sigma_t"] == list(described.sigma_t) and told["scatterings"] == described.scatterings


def test_quads_lie_where_they_are_said_to_and_face_the_right_way(tool) -> None:
    quad = tool("benchmarks.scenes").Quad((1.0, 2.0, 3.0), (0, 0, 2), (4, 0, 0))
    corners = [quad.to_world() @ (x, y, 0, 1) for x, y in ((-1, -1), (1, -1), (-1, 1))]
    np.testing.assert_allclose(np.array(corners)[:, :3], [[1, 2, 3], [1, 2, 5], [5, 2, 3]])
    np.testing.assert_allclose(quad.to_world()[:3, 2], [0, 1, 0])
    assert np.linalg.det(quad.to_world()[:3, :3]) > 0


def test_cycles_reads_the_volumes_that_are_written(tool, tmp_path: Path) -> None:
    scenes, worker = tool("benchmarks.scenes"), tool("benchmarks.cycles_worker")
    scenes.write_scene(scenes.SCENES["chroma"], tmp_path, 16)
    density = worker.read_vol(tmp_path / "density.vol")
    np.testing.assert_array_equal(density[..., 0], tool("benchmarks.volumes").cloud(16))
    np.testing.assert_allclose(density[..., 1], density[..., 0] / 2, rtol=1e-6)


# --- turns -----------------------------------------------------------------------------------------


class MadeUpWorker:
    """Renders 0.1 s of set-up and `each` seconds a sample, noise of this deviation round `mean`."""

    version, load_cpu, load_wall = "9.9", 0.0, 0.0

    def __init__(self, each: float, deviation: float, mean: float, counts: bool) -> None:
        self.each, self.deviation, self.mean, self.counts = each, deviation, mean, counts
        self.asked: list[tuple[int, int]] = []

    def render(self, spp: int, seed: int) -> SimpleNamespace:
        self.asked.append((spp, seed))
        noise = np.random.default_rng([seed, int(1e6 * self.each)]).normal(0, self.deviation, (32, 32, 1))
        image = np.repeat(self.mean + noise / np.sqrt(spp), 3, axis=-1)
        seconds = {"setup": 0.1, "kernels": 0.0, "render": 2.0, "shade": 1.5, "accumulate": 0.25}
        stats = {"lookups": 6 * spp * 1024, "seconds": seconds, "metadata": {"technique": "delta"}}
        cost = 0.1 + self.each * spp * 1024
        return SimpleNamespace(image=image, cpu=cost, wall=cost, stats=stats if self.counts else {})


class MadeUpPeer:
    def __init__(self, kind: str, worker: MadeUpWorker) -> None:
        self.kind, self.label, self.worker = kind, kind.capitalize(), worker

    def renders(self, scene: Any) -> bool:
        return self.kind != "mitsuba" or scene.emission is None

    @contextmanager
    def open(self, path: Path, res: int, threads: int) -> Iterator[MadeUpWorker]:
        yield self.worker


def measured(tool, monkeypatch: pytest.MonkeyPatch, mean: float = 1.0) -> dict[str, Any]:
    """Scenes by clvol, a Mitsuba of 8 times the cost, a Cycles of twice the noise, an equal clvol."""
    efficiency = tool("benchmarks.scene_efficiency")
    monkeypatch.setattr(efficiency, "bare_loop", lambda threads: 3e8)
    monkeypatch.setattr(efficiency, "write_scene", lambda scene, folder, size: folder)
    workers = {
        "clvol": MadeUpWorker(1e-6, 0.2, 1.0, True),
        "mitsuba": MadeUpWorker(8e-6, 0.2, mean, False),
        "cycles": MadeUpWorker(1.001e-6, 0.4, 1.0, False),
        "against": MadeUpWorker(0.999e-6, 0.2, 1.0, True),
    }
    peers = [MadeUpPeer(kind, worker) for kind, worker in workers.items()]
    figures = efficiency.measure_scenes(
        ["cloud", "emissive"], peers, res=32, rounds=5, seconds=1.0, threads=1
    )
    return figures | {"workers": workers}


def test_efficiency_leaves_set_up_out_and_is_that_of_variance_and_time(tool, monkeypatch) -> None:
    figures = measured(tool, monkeypatch)
    cloud = figures["scenes"]["cloud"]
    ours = cloud["sides"]["clvol"]
    assert ours["microseconds"]["median"] == pytest.approx(1.0)
    assert ours["variance"] == pytest.approx(0.04, rel=0.1)
    assert ours["efficiency"]["median"] == pytest.approx(1e6 / 0.04, rel=0.1)
    assert ours["setup_cpu"] == pytest.approx(0.1, abs=0.01)
    assert cloud["over"]["mitsuba"]["median"] == pytest.approx(8, rel=0.15)
    assert cloud["over"]["cycles"]["median"] == pytest.approx(4, rel=0.15)
    assert cloud["over"]["against"]["median"] == pytest.approx(1, rel=0.15)
    assert max(map(abs, cloud["z"].values())) < 4
    assert list(figures["scenes"]["emissive"]["sides"]) == ["clvol", "cycles", "against"]


def test_sides_take_turns_of_equal_length_and_two_clvols_of_equal_samples(tool, monkeypatch) -> None:
    workers = measured(tool, monkeypatch)["workers"]
    turns = {kind: [spp for spp, seed in w.asked if seed > 3][:2] for kind, w in workers.items()}
    assert turns["clvol"] == turns["against"] == [1024, 1024] and turns["mitsuba"] == [128, 128]


def test_look_ups_are_compared_with_the_bare_loop_and_stages_with_the_render(tool, monkeypatch) -> None:
    ours = measured(tool, monkeypatch)["scenes"]["cloud"]["sides"]["clvol"]
    assert ours["lookups"] == 6.0
    assert ours["lookups_per_second"] == pytest.approx(6e6)
    assert ours["share_of_bare_loop"] == pytest.approx(0.02)
    assert ours["stages"].keys() == {"shade", "accumulate"}
    assert ours["outside_share"] == 0.25


def test_rows_judge_the_least_lead_and_the_largest_difference(tool, monkeypatch) -> None:
    tables = tool("benchmarks.scene_tables")
    rows = tables.scene_rows(measured(tool, monkeypatch))
    assert [row.met for row in rows] == [False, False, True]
    assert "4" in rows[0].measured and "times Cycles 9.9" in rows[0].measured and rows[0].aim == "at least 20"
    apart = tables.scene_rows(measured(tool, monkeypatch, mean=1.01))
    assert not apart[-1].met and "(A, Mitsuba 9.9)" in apart[-1].measured


def test_tables_have_a_column_for_each_program_and_a_row_for_each_side(tool, monkeypatch) -> None:
    figures = measured(tool, monkeypatch)
    tables = tool("benchmarks.scene_tables")
    head, _, cloud, emissive = tables.overview(figures)
    assert head == "| scene | clvol, millions | times Mitsuba 9.9 | times Cycles 9.9 |"
    assert cloud.startswith("| A: a cloud under a white sky | ") and emissive.split(" | ")[2] == "–"
    lines = tables.details(figures)
    assert len(lines) == 2 + 4 + 3 and len({line.count("|") for line in lines}) == 1
    tables.show_scenes(figures)


def test_figures_that_were_kept_become_the_tables_of_the_page_and_the_readme(
    tool, monkeypatch, tmp_path: Path
) -> None:
    docs, figures = tool("docs"), measured(tool, monkeypatch)
    del figures["workers"]
    page, readme, kept = (tmp_path / name for name in ("page.md", "readme.md", "figures.json"))
    page.write_text(f"before\n{docs.FIRST}\n{docs.LAST}\nafter\n")
    readme.write_text("\n".join(docs.IN_README))
    tool("benchmarks.tables").save(kept, {"scenes": figures})
    written = ["--output", str(page), "--readme", str(readme), "--figures", str(kept)]
    outcome = CliRunner().invoke(docs.main, ["performance", *written])
    assert outcome.exit_code == 1 and "MISSED: scene A" in outcome.output
    assert "| A | Mitsuba 9.9 | " in page.read_text() and "300 million steps" in page.read_text()
    assert "| A: a cloud under a white sky | " in readme.read_text()


def test_a_revision_that_is_none_is_told(tool, monkeypatch) -> None:
    peers = tool("benchmarks.peers")
    failed = subprocess.CompletedProcess([], 128, b"", b"fatal: not a valid object name: nowhere\n")
    monkeypatch.setattr(peers.subprocess, "run", lambda *_, **__: failed)
    with pytest.raises(click.UsageError, match=r"nowhere.*not a valid object"), peers.sources_of("nowhere"):
        pass
    with pytest.raises(click.UsageError, match="bpy"):
        peers.other_program("cycles", "python")


def test_a_worker_that_ends_is_told(tool) -> None:
    with pytest.raises(click.ClickException, match="ended"):
        tool("benchmarks.worker").Worker("false", "clvol_worker.py", {})


def test_minutes_are_dealt_to_all_turns(tool) -> None:
    bench = tool("bench")
    assert bench.turn_seconds(10, sides=3) == 600 / (5 * (2 + 2 + 3 * 6))


# --- curves ----------------------------------------------------------------------------------------


@pytest.mark.parametrize("axis", ["film", "grid", "threads", "samples"])
def test_curves_have_a_point_for_each_value(tool, monkeypatch, tmp_path: Path, axis: str) -> None:
    curves, seen = tool("benchmarks.curves"), []
    monkeypatch.setattr(curves, "write_scene", lambda scene, folder: seen.append(scene.size) or folder)

    class Renders(MadeUpWorker):
        def render(self, spp: int, seed: int) -> SimpleNamespace:
            made = super().render(spp, seed)
            made.stats["peak_bytes"] = 1 << 30
            return made

    worker = Renders(1e-6, 0.1, 1.0, True)
    monkeypatch.setattr(curves, "clvol_of", lambda *_: MadeUpPeer("clvol", worker))
    command = [axis, "--rough", "--json", str(tmp_path / "curve.json"), "--plot", str(tmp_path / "curve.svg")]
    outcome = CliRunner().invoke(tool("bench").main, ["curve", *command])
    assert outcome.exit_code == 0, outcome.output
    figures = json.loads((tmp_path / "curve.json").read_text())[f"curve {axis}"]
    assert [int(value) for value in figures["points"]] == list(curves.AXES[axis].values[:2])
    assert (tmp_path / "curve.svg").stat().st_size > 1000
    assert seen == ([32, 64] if axis == "grid" else [128, 128])
    assert all(point["memory"]["median"] == 1024 for point in figures["points"].values())
