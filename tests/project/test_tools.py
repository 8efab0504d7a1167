"""The tools that developers repeat: kernels written out for reading, and the benchmark's arithmetic."""

from __future__ import annotations

import math
import re
import runpy
import subprocess
import sys
from types import SimpleNamespace
from typing import TYPE_CHECKING, Any

import click
import numpy as np
import pytest
from click.testing import CliRunner
from made_up_pilot import made_up
from places import SCENES, TOOLS

import clvol
from clvol.lab.candidates import Candidate, Relative
from clvol.planning import registry
from clvol.planning.choices import Choices
from clvol.scene.mesh import mesh_flaws
from clvol.scene.records import GridVolume, Mesh

if TYPE_CHECKING:
    from pathlib import Path

CLOUD = str(SCENES / "cloud.xml")


COMMANDS = sorted(path.name for path in TOOLS.glob("*.py") if "__main__" in path.read_text(encoding="utf-8"))


@pytest.mark.parametrize("name", COMMANDS)
def test_every_tool_says_what_it_does(
    name: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.syspath_prepend(TOOLS)
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(sys, "argv", [name, "--help"])
    with pytest.raises(SystemExit) as ended:
        runpy.run_path(str(TOOLS / name), run_name="__main__")
    assert not ended.value.code
    shown = capsys.readouterr().out
    assert shown.lower().startswith("usage: ") and len(shown.splitlines()) > 3
    assert not list(tmp_path.iterdir())


# --- dump_kernel -----------------------------------------------------------------------------------


@pytest.mark.parametrize("majorant", ["global", "grid", "kdtree"])
def test_dump_writes_every_stage_as_a_self_contained_unit(tool, tmp_path: Path, majorant: str) -> None:
    plan = tool("scene_options").open_scene(CLOUD, {}, {"majorant": majorant}).plan
    written = tool("dump_kernel").dump(plan, tmp_path / "kernels")
    assert [path.stem for path in written] == [*plan.stages, "accumulate"]
    for path in written:
        text = path.read_text(encoding="utf-8")
        name = "accumulate_kernel" if path.stem == "accumulate" else "STAGE_KERNEL"
        assert re.search(rf"__kernel.*\b{name}\(", text)
        assert name != "STAGE_KERNEL" or f"#define STAGE_KERNEL {path.stem}_kernel\n" in text
        assert not re.search(r"^\s*#\s*include", text, re.MULTILINE)
    walks = (tmp_path / "kernels" / "medium_sample.cl").read_text(encoding="utf-8")
    included = re.findall(r'#line 1 "majorant/(\w+)\.h"', walks)
    assert [name for name in included if name in registry.MAJORANTS] == [majorant]


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
    return tool("benchmarks.efficiency").Rounds(np.repeat(1 + bias + noise, 3, axis=-1), np.full(8, cpu), spp)


def test_variance_per_sample_is_the_one_between_rounds_times_spp(tool) -> None:
    images = np.zeros((2, 1, 2, 3))
    images[1, 0, 0] = 2.0  # one pixel is 0 and then 2: variance 2; the other is sure
    rounds = tool("benchmarks.efficiency").Rounds(images, np.array([1.0, 4.0]), spp=3)
    np.testing.assert_allclose(tool("benchmarks.efficiency").pixel_variance(rounds), [[6, 0]])
    np.testing.assert_allclose(
        tool("benchmarks.efficiency").efficiencies(rounds), [6 / 3, 6 / 12]
    )  # 6 paths a round


def test_mean_and_its_error_are_those_of_independent_pixels(tool) -> None:
    images = np.zeros((2, 1, 2, 3))
    images[1, 0, 0] = 2.0
    mean, error = tool("benchmarks.efficiency").image_mean(
        tool("benchmarks.efficiency").Rounds(images, np.ones(2), 3)
    )
    assert mean == 0.5
    assert error == math.sqrt(2 / 2) / 2


def test_samples_per_round_do_not_change_the_efficiency(tool) -> None:
    few = made_up_rounds(tool, 0.3, cpu=1.0, spp=4, seed=1)
    many = made_up_rounds(tool, 0.3, cpu=25.0, spp=100, seed=2)
    ratio = tool("benchmarks.efficiency").efficiency_ratio(few, many)
    assert ratio["low"] < 1 < ratio["high"]
    assert ratio["median"] == pytest.approx(1, abs=0.05)


def test_twice_the_noise_at_a_tenth_of_the_time_is_two_and_a_half_times_as_efficient(tool) -> None:
    ours = made_up_rounds(tool, 0.6, cpu=1.0, spp=50, seed=1)
    theirs = made_up_rounds(tool, 0.3, cpu=10.0, spp=50, seed=2)
    ratio = tool("benchmarks.efficiency").efficiency_ratio(ours, theirs)
    assert ratio["low"] < 2.5 < ratio["high"]
    assert ratio["high"] - ratio["low"] < 0.4


def test_equal_means_agree_and_a_bias_of_one_percent_is_seen(tool) -> None:
    efficiency = tool("benchmarks.efficiency")
    mean = efficiency.image_mean(made_up_rounds(tool, 0.3, 1.0, 50, seed=1))
    same = efficiency.image_mean(made_up_rounds(tool, 0.5, 1.0, 20, seed=2))
    biased = efficiency.image_mean(made_up_rounds(tool, 0.5, 1.0, 20, seed=2, bias=0.01))
    assert abs(efficiency.z_score(mean, same)) < 4
    assert abs(efficiency.z_score(mean, biased)) > 4
    assert efficiency.z_score((1.0, 0.0), (1.0, 0.0)) == 0
    assert efficiency.z_score((2.0, 0.0), (1.0, 0.0)) == math.inf


def test_spread_is_median_least_and_greatest(tool) -> None:
    assert tool("benchmarks.efficiency").spread([3.0, 1.0, 9.0]) == {
        "median": 3.0,
        "least": 1.0,
        "greatest": 9.0,
    }


def test_aims_are_met_on_the_right_side_by_every_value(tool) -> None:
    tables = tool("benchmarks.tables")
    assert (
        tables.at_most("", "", 3.0, " s", 2.9, 3.0).met and not tables.at_most("", "", 3.0, "", 2.9, 3.1).met
    )
    assert tables.at_least("", "", 8.0, 8.1, 8.0).met and not tables.at_least("", "", 8.0, 8.1, 7.9).met
    lines = tables.markdown([tables.at_most("a", "4 s", 3.0, " s", 4.0), tables.Row("b", "2 times")])
    assert lines[2:] == ["| a | 4 s | at most 3 s: **missed** |", "| b | 2 times | – |"]


# --- bench: grids ----------------------------------------------------------------------------------


@pytest.mark.parametrize("kind", ["cloud_slabs", "noise_slabs"])
def test_bench_grids_are_seeded_coefficients_that_load(tool, tmp_path: Path, kind: str) -> None:
    grids, size = tool("benchmarks.big_grids"), 40  # one full slab and a part of one
    for name in ("a", "b"):
        grids.write_npy(tmp_path / f"{name}.npy", getattr(grids, kind)(size), size)
    values = np.load(tmp_path / "a.npy")
    assert values.shape == (size, size, size) and values.dtype == np.float32
    assert np.isfinite(values).all() and values.min() >= 0 and values.max() <= 1
    assert len(np.unique(values[values > 0])) > 1000
    np.testing.assert_array_equal(values, np.load(tmp_path / "b.npy"))
    scene = clvol.load_dict(tool("benchmarks.costs").grid_scene(tmp_path / "a.npy", 8))
    assert isinstance(scene.shapes[0].interior.sigma_t, GridVolume)


# --- bench: rays and room --------------------------------------------------------------------------


def test_embree_is_taken_from_this_python_where_it_is(tool, monkeypatch: pytest.MonkeyPatch) -> None:
    rays = tool("benchmarks.rays")
    monkeypatch.setattr(rays.importlib.util, "find_spec", lambda name: object())
    assert rays.embree_environment() == {}


def test_a_missing_embree_is_installed_or_told(
    tool, monkeypatch: pytest.MonkeyPatch, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    rays = tool("benchmarks.rays")
    monkeypatch.setattr(rays.importlib.util, "find_spec", lambda name: None)
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    failed = subprocess.CompletedProcess([], returncode=1)
    monkeypatch.setattr(rays.subprocess, "run", lambda *args, **kwargs: failed)
    with pytest.raises(click.ClickException, match="embreex"):
        rays.embree_environment()
    assert str(tmp_path) in capsys.readouterr().err
    (tmp_path / "clvol" / "embreex" / "embreex").mkdir(parents=True)
    assert rays.embree_environment()["PYTHONPATH"].startswith(str(tmp_path / "clvol" / "embreex"))


def planted(z: float = 0.0, ratio: float = 20.0, agree: float = 1.0) -> dict[str, Any]:
    """Figures of a comparison with Mitsuba and of one with Embree, as tools/bench.py keeps them."""
    side = {"spp": 64, "mean": 0.5, "standard_error": 0.01, "version": "3.9.1"}
    ratios = {"median": ratio, "least": ratio, "greatest": ratio}
    cloud = {"scene": "cloud.xml", "res": 128, "clvol": side, "mitsuba": side, "ratio": ratios, "z": z}
    rate = {"ratio": dict.fromkeys(ratios, 1.0), "agree": agree}
    build = {"triangles": 1000, "seconds": 1.0, "peak": 6.0, "mesh": 1.0}
    rates = {"1000 incoherent": {**rate, "agree": 1.0}, "1000 coherent": rate}
    return {"cloud": cloud, "rays": {"rates": rates, "build": build}}


@pytest.mark.parametrize(
    ("wrong", "told"),
    [
        ({}, ""),
        ({"z": -5.0}, "5.0 standard errors apart"),
        ({"ratio": 7.9}, "7.9 (7.9 to 7.9) times"),
        ({"agree": 0.9989}, "0.998900"),
    ],
)
def test_a_missed_aim_is_told_and_the_exit_status(
    tool, capsys: pytest.CaptureFixture[str], wrong: dict[str, float], told: str
) -> None:
    assert tool("bench").finish((None, planted(**wrong))) == (1 if wrong else 0)
    missed = capsys.readouterr().err.splitlines()
    assert len(missed) == len(wrong) and all(line.startswith("MISSED") and told in line for line in missed)


def test_what_cannot_be_measured_is_left_out_and_told(tool, monkeypatch: pytest.MonkeyPatch) -> None:
    bench, kept = tool("bench"), planted()["rays"]

    def unavailable(*_: object) -> None:
        raise tool("benchmarks.tables").Unavailable("no Mitsuba here", "give one")

    monkeypatch.setattr(bench, "mitsuba_here", unavailable)
    monkeypatch.setattr(bench.rays, "callback", lambda **_: (None, {"rays": kept}))
    for command in (bench.scenes, bench.startup, bench.load, bench.memory, bench.chromatic.main, bench.pool):
        monkeypatch.setattr(command, "callback", lambda **_: (None, {}))
    outcome = CliRunner().invoke(bench.main, ["all"])
    assert outcome.exit_code == 1 and "at least 0.999" in outcome.output
    assert outcome.output.startswith("cloud: no Mitsuba here; give one\n")
    assert "LEFT OUT: cloud: no Mitsuba here\nLEFT OUT: room: no Mitsuba here" in outcome.output


def test_workers_scale_by_their_medians_and_are_not_more_than_cores(tool, monkeypatch) -> None:
    scaling = tool("benchmarks.scaling")
    taken = {1: iter([16.0, 10.0, 30.0]), 2: iter([8.0, 8.0, 2.0])}
    monkeypatch.setattr(scaling, "turn", lambda *arguments: next(taken[arguments[3]]))
    monkeypatch.setattr(scaling.os, "sched_getaffinity", lambda _: {0, 1})
    figures = scaling.measure_scaling("cloud.xml", 16, 4, 2, 3)
    [row] = scaling.scaling_rows(figures)
    assert row.measured == "2.00 times" and row.met and row.aim == "at least 1.8"
    figures["seconds"]["2"]["median"] = 9.0
    assert not scaling.scaling_rows(figures)[0].met
    with pytest.raises(click.ClickException, match="3 workers would share 2 cores"):
        scaling.measure_scaling("cloud.xml", 16, 4, 3, 3)


def test_ray_meshes_are_closed_and_of_the_size_asked_for(tool) -> None:
    vertices, faces = tool("benchmarks.rays").knobbly_sphere(3000)
    assert abs(len(faces) - 3000) < 200
    a, b, c = vertices[faces].swapaxes(0, 1)
    assert np.linalg.norm(np.cross(b - a, c - a), axis=1).min() > 0


# --- docs ------------------------------------------------------------------------------------------


def test_performance_replaces_what_is_between_the_markers(
    tool, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    docs, page = tool("docs"), tmp_path / "performance.md"
    figures = planted() | {"left_out": {"room": "no Mitsuba here"}}
    monkeypatch.setattr(docs.bench.everything, "callback", lambda **_: (None, figures))
    page.write_text(f"before\n{docs.FIRST}\n| room | 15 times | of last year |\n{docs.LAST}\nafter\n")
    outcome = CliRunner().invoke(docs.main, ["performance", "--output", str(page)])
    assert outcome.exit_code == 1 and "LEFT OUT: room: no Mitsuba here" in outcome.output
    text = page.read_text()
    assert text.startswith(f"before\n{docs.FIRST}\n") and text.endswith(f"\n{docs.LAST}\nafter\n")
    assert "last year" not in text and "Not measured: `room`, no Mitsuba here." in text
    assert "| 20 (20 to 20) times" in text and "| at least 8 |" in text
    assert list(tmp_path.iterdir()) == [page]


def test_the_table_of_transitions_is_what_the_contracts_of_the_stages_say(tool) -> None:
    docs = tool("docs")
    text = docs.ARCHITECTURE.read_text(encoding="utf-8")
    written = text.split(docs.TRANSITIONS[0])[1].split(docs.TRANSITIONS[1])[0]
    assert written.strip() == docs.transitions_part().strip(), "run: python tools/docs.py transitions"


@pytest.mark.parametrize("text", ["no markers", "{last} {first}", "{first} {last} {first} {last}"])
def test_a_file_without_its_markers_is_refused_before_measuring(
    tool, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, text: str
) -> None:
    docs, page = tool("docs"), tmp_path / "performance.md"
    monkeypatch.setattr(docs.bench.everything, "callback", lambda **_: pytest.fail("measured"))
    page.write_text(text.format(first=docs.FIRST, last=docs.LAST))
    outcome = CliRunner().invoke(docs.main, ["performance", "--output", str(page)])
    assert outcome.exit_code == 2 and outcome.output.count("\n") == 1 and docs.FIRST in outcome.output


def test_all_runs_every_part_in_order_and_hands_mitsuba_on(tool, monkeypatch: pytest.MonkeyPatch) -> None:
    docs, done = tool("docs"), []
    monkeypatch.setattr(docs, "enclosed", lambda path: ("", ""))
    monkeypatch.setattr(tool("benchmarks.cloud"), "has_mitsuba", lambda python: True)
    for part in (docs.pictures, docs.profile, docs.techniques, docs.pilot, docs.recipes, docs.performance):
        status = 1 if part is docs.pilot else None
        note = lambda *_, part=part, status=status, **options: done.append((part.name, options)) or status  # noqa: E731
        monkeypatch.setattr(part, "callback", note)
    outcome = CliRunner().invoke(docs.main, ["all", "--mitsuba", "their/python"])
    assert outcome.exit_code == 1, outcome.output
    assert [name for name, _ in done] == [
        "pictures",
        "profile",
        "techniques",
        "pilot",
        "recipes",
        "performance",
    ]
    assert done[-1][1]["mitsuba"] == "their/python" and done[-1][1]["output"] == docs.PERFORMANCE


# --- pilot -----------------------------------------------------------------------------------------


def outcome_of_pilot(tool, to_best: Relative):
    """A pilot that was tested, with this ratio to the best."""
    found = SimpleNamespace(names={"technique": "delta"}, seconds=1.0, kernel_seconds=2.0)
    best = Candidate("regular", None)
    return tool("pilot").Tested("cloud", found, [best], [], 0, best, to_best, Relative(1.0, 1.0, 1.0))


@pytest.mark.parametrize(("high", "word", "status"), [(0.8, "yes", 0), (0.79, "**NO**", 1)])
def test_a_choice_too_far_from_the_best_is_told_and_the_exit_status(
    tool, monkeypatch: pytest.MonkeyPatch, tmp_path: Path, high: float, word: str, status: int
) -> None:
    pilot, docs = tool("pilot"), tool("docs")
    outcome = outcome_of_pilot(tool, Relative(0.7, 0.6, high))
    monkeypatch.setattr(pilot, "tested", lambda *_: outcome)
    monkeypatch.setattr(docs, "tested", lambda *_: outcome)
    printed = CliRunner().invoke(pilot.main, ["--scene", "cloud"])
    page = tmp_path / "pilot.md"
    written = CliRunner().invoke(docs.main, ["pilot", "--scene", "cloud", "--output", str(page)])
    assert printed.exit_code == written.exit_code == status, written.output
    for text in (printed.output, page.read_text()):
        assert f"| 0.70 (0.60 to {high:.2f}) | {word} |" in text


def test_a_joint_optimum_that_the_search_missed_is_found(tool) -> None:
    """One combination of those drawn is planted ten times as efficient as what its choices promise."""
    pilot = tool("pilot")
    found, run = made_up(Choices())
    met = list(run.candidates)
    added = pilot.unmet(run, 5)
    labels = [candidate.label for candidate in run.candidates]
    assert len(added) == 5 and len(set(labels)) == len(labels) == len(met) + 5
    _, again = made_up(Choices())
    assert [c.label for c in pilot.unmet(again, 5)] == [c.label for c in added]
    chosen = next(c for c in met if pilot.is_of(c, found.names))
    missed = next(c for c in added if len(c.images) > 1)
    missed.seconds = [chosen.seconds[-1] / 10] * len(missed.seconds)
    all_measured = [c for c in (*met, *added) if len(c.images) > 1]
    for candidate in all_measured:
        for seed in range(8):
            candidate.seconds.append(candidate.seconds[-1])
            candidate.images.append(
                np.random.default_rng([seed, labels.index(candidate.label)]).normal(1.0, 0.1, (16, 16, 3))
            )
    best, to_best, _ = pilot.compared(all_measured, chosen)
    assert best is missed and to_best.high < pilot.ENOUGH


# --- make_scenes -----------------------------------------------------------------------------------


def test_the_plume_is_the_committed_one_and_empty_at_its_border(tool) -> None:
    plume = tool("make_scenes").make_plume()
    committed = np.frombuffer((SCENES / "plume.vol").read_bytes(), "<f4", offset=48)
    np.testing.assert_allclose(committed.reshape(plume.shape), plume, atol=1.01 / 255)  # sines may differ
    inner = plume.copy()
    inner[1:-1, 1:-1, 1:-1] = 0
    assert not inner.any() and plume.max() <= 1


def test_the_knot_is_the_committed_one_and_a_closed_outward_surface(tool) -> None:
    vertices, normals, faces = tool("make_scenes").make_knot()
    mesh = clvol.load_file(SCENES / "jade.xml").shapes[-1].mesh
    np.testing.assert_allclose(mesh.vertices, vertices, atol=1e-5)
    assert not mesh_flaws(Mesh(vertices, faces, normals))
