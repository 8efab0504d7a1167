"""Where the time went: a profile adds up to the render's statistics, and changes no bit of the picture."""

import json
from itertools import pairwise

import numpy as np
import pytest
from benched import benched
from click.testing import CliRunner

import clvol
from clvol.cli.main import main
from clvol.layout import HANDLED, QUEUE_LENGTHS_STRIDE
from clvol.picture.profile import ACCUMULATE, CopyProfile, KernelProfile, Profile, Span
from clvol.rendering.handled import Handled

SPP = 8


@pytest.fixture(scope="module")
def scene(tmp_path_factory):
    """A room with smoke and a lamp: every stage, surfaces in the way of shadow rays."""
    return benched("box_smoke", tmp_path_factory.mktemp("box_smoke"))


@pytest.fixture(scope="module")
def profiled(scene):
    return clvol.render(scene, spp=SPP, seed=1, sampler="sobol", aov=["shadow_rays"], profile=True)


def test_a_render_has_a_profile_only_where_it_was_asked_for_one(scene, profiled):
    plain = clvol.render(scene, spp=SPP, seed=1, sampler="sobol", aov=["shadow_rays"])
    assert plain.profile is None
    assert (plain.image == profiled.image).all() and (plain.variance == profiled.variance).all()
    for name in ("items", "shadow_rays", "lookups", "paths"):
        assert plain.stats[name] == profiled.stats[name]


def test_the_kernels_of_a_profile_are_those_of_the_statistics(profiled):
    profile, stats = profiled.profile, profiled.stats
    stages = {name: kernel for name, kernel in profile.kernels.items() if name != ACCUMULATE}
    assert {name: kernel.items for name, kernel in stages.items()} == stats["items"]
    assert {kernel.launches for kernel in stages.values()} == {stats["waves"]}
    assert sum(kernel.launches for kernel in profile.kernels.values()) == stats["launches"]
    for name, kernel in profile.kernels.items():
        assert kernel.seconds == pytest.approx(stats["seconds"][name])
        assert kernel.item_bytes > 0
    assert profile.kernels["generate"].items == profile.kernels[ACCUMULATE].items == stats["paths"]


def test_parts_of_the_time_add_up_to_the_render(profiled):
    profile = profiled.profile
    parts = [*(kernel.seconds for kernel in profile.kernels.values()), profile.copied.seconds]
    assert sum(parts) + profile.host_seconds == pytest.approx(profile.seconds)
    assert profile.outside == pytest.approx(1 - profile.stage_seconds / profile.seconds)
    assert {"plan", "volumes and tables", "kernels", "upload"} <= profile.steps.keys()
    assert "render" not in profile.steps and "waves" not in profile.steps


def test_shadow_rays_are_counted_where_they_are_traced(profiled):
    assert profiled.stats["shadow_rays"] == profiled.stats["items"]["shadow_transmittance"] > 0
    picture = profiled.aovs["shadow_rays"].astype(float)
    assert picture.sum() * SPP == pytest.approx(profiled.stats["shadow_rays"], rel=1e-5)


def test_a_trace_has_every_launch_and_copy_one_after_the_other(profiled, tmp_path):
    profiled.profile.save_trace(tmp_path / "trace.json")
    trace = json.loads((tmp_path / "trace.json").read_text())
    events = [event for event in trace["traceEvents"] if event["ph"] == "X"]
    device = sorted((e for e in events if e["pid"] == 2), key=lambda event: event["ts"])
    for event, following in pairwise(device):
        assert event["ts"] + event["dur"] <= following["ts"] + 1e-3  # microseconds: rounding
    handled = sum(event["args"]["items"] for event in device if event["name"] == "shade")
    assert handled == profiled.stats["items"]["shade"]
    [render] = (event for event in events if event["name"] == "render")
    waves = [event for event in events if event["name"] == "waves"]
    assert waves and {event["pid"] for event in waves} == {render["pid"]} == {1}
    flight = [event["args"]["paths"] for event in trace["traceEvents"] if event["ph"] == "C"]
    assert min(flight) == 0 and 0 < max(flight) <= profiled.stats["slots"]
    assert trace["otherData"]["technique"] == "delta"


def made_up():
    """4 s of stages, half a second of accumulate and as much of copies in 8 s, after 2 s of set-up."""
    kernels = {
        "generate": KernelProfile(1.0, 10, 1000, 40),
        "shade": KernelProfile(3.0, 10, 2000, 80),
        ACCUMULATE: KernelProfile(0.5, 1, 100, 4),
    }
    host = [
        Span("kernels", 0, 2 * 10**9),
        Span("waves", 3 * 10**9, 4 * 10**9),
        Span("render", 2 * 10**9, 10**10),
    ]
    return Profile(kernels, CopyProfile(0.5, 20, 1 << 20), 8.0, 12.0, host, [], [], lanes_busy=0.75)


def test_shares_are_of_the_whole_render():
    profile = made_up()
    assert profile.outside == 0.5
    assert profile.host_seconds == 3.0
    assert profile.steps == {"kernels": 2.0}
    assert profile.kernels["shade"].nanoseconds == 1.5e6
    assert KernelProfile().nanoseconds is None


def test_the_table_says_what_each_kernel_took():
    from clvol.cli.profile import profile_lines

    text = "\n".join(profile_lines(made_up()))
    lines = [" ".join(line.split()) for line in text.splitlines()]
    assert "shade 3.000 37.5 % 10 300,000 2,000 1,500,000 80" in lines
    assert "launching and waiting 3.000 37.5 % - -" in lines
    assert "outside of the stages' kernels: 50.0 % of 8 s; 1 MiB copied; 1.50 threads busy" in text
    assert "lanes busy: 75 %" in lines and "seconds before and after: kernels 2" in lines


def test_counters_of_a_group_may_run_over():
    handled, counters = Handled(2), np.zeros((2, QUEUE_LENGTHS_STRIDE), np.uint32)
    for count in (2**32 - 5, 7, 9):
        counters[:, HANDLED] = count
        handled.add(counters)
    assert set(handled.by_stage(("shade", "generate")).values()) == {2 * (2**32 + 9)}
    handled.clear()
    handled.add(counters)
    assert handled.by_stage(("shade",)) == {"shade": 0}
    assert (handled.all_idle(64)[:, HANDLED] == 9).all()


def test_the_command_line_prints_a_profile_and_writes_a_trace(tmp_path):
    (tmp_path / "scene").mkdir()
    benched("box_smoke", tmp_path / "scene")
    words = [
        "render",
        str(tmp_path / "scene" / "scene.xml"),
        "-D",
        "res=4",
        "--spp",
        "2",
        "--sampler",
        "sobol",
    ]
    words += [
        "--aov",
        "shadow_rays",
        "-o",
        str(tmp_path / "out.exr"),
        "--trace",
        str(tmp_path / "trace.json"),
    ]
    outcome = CliRunner().invoke(main, [*words, "--quiet", "--profile"])
    assert outcome.exit_code == 0, outcome.output
    assert "shadow_transmittance" in outcome.stdout and "outside of the stages' kernels" in outcome.stdout
    assert json.loads((tmp_path / "trace.json").read_text())["traceEvents"]
    outcome = CliRunner().invoke(main, words)
    assert "outside of the stages' kernels" not in outcome.stdout


@pytest.mark.parametrize(
    ("name", "told"), [("trace.txt", "name the file .json"), ("missing/trace.json", "no such folder")]
)
def test_a_trace_that_cannot_be_written_is_refused_before_the_render(tmp_path, name, told):
    trace, output = str(tmp_path / name), str(tmp_path / "a.exr")
    outcome = CliRunner().invoke(main, ["render", "no scene.xml", "-o", output, "--trace", trace])
    assert outcome.exit_code == 2 and told in outcome.stderr
    assert not (tmp_path / "a.exr").exists()
