"""Renders that go on from a checkpoint have the bits of those that nothing ended."""

import json
import signal
import subprocess
import sys
import time

import numpy as np
import pytest
from click.testing import CliRunner
from every_bit import rendered, scene
from signals import press_key

import clvol
from clvol.base.progress import RichProgress
from clvol.cli.main import main
from clvol.rendering import checkpoint as checkpoints

SPP, SEED, CUT = 48, 5, 19
AOVS = ["depth", "cells", "largest_weight"]


def same(one, other):
    assert one.image.tobytes() == other.image.tobytes() and one.variance.tobytes() == other.variance.tobytes()
    assert one.samples == other.samples and one.noise == other.noise
    for name in one.aovs:
        assert one.aovs[name].tobytes() == other.aovs[name].tobytes(), name
    for name in (
        "lookups",
        "real_collisions",
        "cells_crossed",
        "shadow_rays",
        "paths",
        "largest_sample",
        "non_finite",
        "items",
    ):
        assert one.stats[name] == other.stats[name], name


@pytest.fixture(scope="module", params=["sobol", pytest.param("independent", marks=pytest.mark.contract)])
def whole(request):
    return request.param, rendered(scene(), spp=SPP, seed=SEED, sampler=request.param, aov=AOVS)


def test_a_render_goes_on_to_the_same_bits(whole, tmp_path):
    sampler, expected = whole
    options = {"seed": SEED, "sampler": sampler, "aov": AOVS, "checkpoint": tmp_path / "a.npz"}
    for spp in (CUT, SPP, SPP):  # the last finds all there
        result = clvol.render(scene(), spp=spp, **options)
        assert result.samples == (0, spp)
    same(result, expected)
    assert result.metadata["seconds"] > 0


def test_resume_takes_a_checkpoints_name(whole, tmp_path):
    sampler, expected = whole
    options = {"seed": SEED, "sampler": sampler, "aov": AOVS}
    first, second = tmp_path / "a.npz", tmp_path / "b.npz"
    clvol.render(scene(), spp=CUT, checkpoint=first, **options)
    kept = first.read_bytes()
    same(clvol.render(scene(), spp=SPP, resume=first, **options), expected)
    assert first.read_bytes() == kept, "only what checkpoint= names is written"
    same(clvol.render(scene(), spp=SPP, resume=str(first), checkpoint=second, **options), expected)
    same(clvol.render(scene(), spp=SPP, resume=second, checkpoint=second, **options), expected)
    *_, last = clvol.progressive(scene(), spp=SPP, resume=first, **options)
    same(last, expected)
    with pytest.raises(clvol.OptionError, match="the render can go on from one of them"):
        clvol.render(scene(), spp=SPP, resume=first, checkpoint=second, **options)
    with pytest.raises(clvol.OptionError, match="no such file"):
        clvol.render(scene(), spp=SPP, resume=tmp_path / "c.npz", **options)
    with pytest.raises(clvol.OptionError, match="another seed"):
        clvol.render(scene(), spp=SPP, resume=first, **options | {"seed": SEED + 1})
    with pytest.raises(clvol.OptionError, match="resume is for renders"):
        clvol.render(scene(), resume=first, **options | {"target_error": 0.1})


def test_ranges_of_samples_have_checkpoints_too(tmp_path):
    options = {"seed": SEED, "checkpoint": tmp_path / "a.npz"}
    clvol.render(scene(), samples=(8, 5), **options)
    same(clvol.render(scene(), samples=(8, 16), **options), clvol.render(scene(), samples=(8, 16), seed=SEED))


def test_checkpoints_are_written_on_the_way(tmp_path, monkeypatch):
    written = []
    keep = checkpoints.write_checkpoint
    monkeypatch.setattr(checkpoints, "_LARGEST_SHARE", 1e9)

    def write(*given):
        written.append(given[-1])
        keep(*given)

    monkeypatch.setattr(checkpoints, "write_checkpoint", write)
    large = clvol.load_dict(
        {
            "type": "scene",
            "sensor": {"type": "perspective", "film": {"type": "hdrfilm", "width": 512, "height": 300}},
            "emitter": {"type": "constant"},
        }
    )
    clvol.render(large, spp=6, checkpoint=tmp_path / "a.npz", checkpoint_every=1e-9)
    assert written == [1, 2, 3, 4, 5, 6]


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"seed": SEED + 1}, "another seed"),
        ({"technique": "weighted-delta"}, "another technique"),
        ({"size": (5, 4)}, "the sensor or its size changed"),
        ({"aov": ["depth"]}, "with one with"),
        ({"spp": 3}, "has samples 0 to 3 of each pixel"),
        ({"samples": (1, 8)}, "has samples 0 to 3 of each pixel"),
        ({"resume": "a.exr"}, "a picture to resume exclude each other"),
        ({"target_error": 0.1}, "as many samples"),
        ({"technique": "auto:pilot"}, "may choose another"),
        ({"checkpoint_every": 0}, "seconds"),
        ({"sensor": [0, 0]}, "of one picture"),
    ],
)
def test_another_render_is_refused(change, message, tmp_path):
    options = {"seed": SEED, "spp": 4, "checkpoint": tmp_path / "a.npz"}
    clvol.render(scene(), **options)
    kept = options["checkpoint"].read_bytes()
    given = options | change
    if "samples" in change:
        del given["spp"]
    with pytest.raises(clvol.OptionError, match=message):
        clvol.render(scene(), **given)
    assert options["checkpoint"].read_bytes() == kept


def test_another_version_is_refused(tmp_path, monkeypatch):
    path = tmp_path / "a.npz"
    clvol.render(scene(), spp=2, checkpoint=path)
    parts = dict(np.load(path))
    about = json.loads(parts["about"].tobytes())
    about["metadata"]["version"] = "0.0.1"
    np.savez(path, **{**parts, "about": np.frombuffer(json.dumps(about).encode(), np.uint8)})
    with pytest.raises(clvol.OptionError, match=r"another version: '0\.0\.1'"):
        clvol.render(scene(), spp=4, checkpoint=path)


def test_files_that_are_none_are_refused_and_stay(tmp_path):
    path = tmp_path / "a.npz"
    clvol.render(scene(), spp=2, checkpoint=path)
    good = path.read_bytes()
    for data in (b"", b"PK", good[: len(good) // 2], b"no checkpoint at all"):
        path.write_bytes(data)
        with pytest.raises(clvol.OptionError, match=r"a\.npz: is no checkpoint of clvol, or is damaged"):
            clvol.render(scene(), spp=3, checkpoint=path)
        assert path.read_bytes() == data
    np.savez_compressed(path, about=np.zeros(4, np.uint8))
    with pytest.raises(clvol.OptionError, match="compressed"):
        clvol.render(scene(), spp=3, checkpoint=path)


def test_a_full_disk_costs_no_picture(tmp_path, monkeypatch, caplog):
    def full(*_):
        raise clvol.OptionError("cannot be written: No space left on device", "a.npz")

    monkeypatch.setattr(checkpoints, "write_checkpoint", full)
    assert clvol.render(scene(), spp=2, checkpoint=tmp_path / "a.npz").samples == (0, 2)
    assert "no checkpoint" in caplog.text


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_a_signal_leaves_a_checkpoint_and_the_picture(tmp_path, monkeypatch, number, ctrl_c):
    """As Ctrl-C does, and with the status of the signal: cluster schedulers send SIGTERM before they kill."""
    path, pressed = scene_file(tmp_path, 8), []

    def press_once(_bar, record):
        if not pressed and record.samples_done:
            pressed.append(press_key(number))

    def run(*options):
        command = ["render", str(path), "-o", str(tmp_path / "a.exr"), "--seed", "3", *options]
        return CliRunner().invoke(main, command).exit_code

    with monkeypatch.context() as patch:
        patch.setattr(RichProgress, "__call__", press_once)
        assert run("--checkpoint", str(tmp_path / "a.npz"), "--time", "120") == 128 + number
    done = clvol.load_result(tmp_path / "a.exr").samples[1]
    assert checkpoints.read_checkpoint(tmp_path / "a.npz").done == done > 0
    assert run("--resume", str(tmp_path / "a.npz"), "--spp", str(done + 3), "--quiet") == 0
    more = clvol.load_result(tmp_path / "a.exr")
    assert more.image.tobytes() == clvol.render(clvol.load_file(path), spp=done + 3, seed=3).image.tobytes()


def scene_file(folder, size):
    """A ball under a white sky, in a folder."""
    path = folder / "s.xml"
    film = "".join(f'<integer name="{side}" value="{size}"/>' for side in ("width", "height"))
    film += '<string name="component_format" value="float32"/>'
    path.write_text(
        f'<scene version="3.0.0"><sensor type="perspective"><film type="hdrfilm">{film}</film></sensor>'
        '<emitter type="constant"/>'
        '<shape type="sphere"><point name="center" x="0" y="0" z="5"/><bsdf type="diffuse"/></shape></scene>'
    )
    return path


@pytest.mark.contract
def test_a_killed_process_loses_nothing_that_was_kept(tmp_path):
    """Kill -9 at any moment, then the same command: the bits of a render that nothing ended."""
    command = [
        sys.executable,
        "-m",
        "clvol",
        "render",
        str(scene_file(tmp_path, 64)),
        "--spp",
        "4000",
        "--quiet",
        "-o",
    ]
    subprocess.run([*command, str(tmp_path / "whole.exr")], check=True, timeout=300)
    again = [*command, str(tmp_path / "a.exr"), "--checkpoint", str(tmp_path / "a.npz"), "--every", "0.001"]
    kills = 0
    for _ in range(3):
        process = subprocess.Popen(again)
        deadline = time.monotonic() + 120
        before = (tmp_path / "a.npz").stat().st_mtime_ns if (tmp_path / "a.npz").exists() else 0
        while process.poll() is None and time.monotonic() < deadline:
            if (tmp_path / "a.npz").exists() and (tmp_path / "a.npz").stat().st_mtime_ns > before:
                process.send_signal(signal.SIGKILL)
            time.sleep(0.01)
        kills += process.wait() == -signal.SIGKILL
    assert kills
    subprocess.run(again, check=True, timeout=300)
    one, other = (clvol.load_result(tmp_path / f"{name}.exr") for name in ("whole", "a"))
    assert one.image.tobytes() == other.image.tobytes()
    assert not list(tmp_path.glob(".clvol-*")) or kills
