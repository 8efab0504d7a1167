"""The same scene, seed and choices give the same bits, however the work is scheduled, split or cut short.

Nothing here is statistical but the last test, whose false-alarm rate is 1e-4.
"""

import os
import signal
import subprocess
import sys

import numpy as np
import pytest
from every_bit import SPP, digest, rendered, scene
from OpenImageIO import ImageInput
from pictures import ball, box, homogeneous, picture
from places import SCENES
from signals import press_key
from stat_tests import assert_same_picture
from tiers import quick_first

import clvol
from clvol.planning.plan import Plan
from clvol.planning.settled import Tuning
from clvol.scene.records import ConstantEmitter


def absorbing_scene():
    """A ball before a cube under a light of 1, without scattering."""
    shapes = [box((-2, -2, 1.5), (2, 2, 2.5), homogeneous(0.5)), ball((0, 0, 0), 1.0, homogeneous(0.7))]
    return picture(shapes, [ConstantEmitter()], (0, 0, -4), (0, 0, 0), 20.0, (8, 8))


@pytest.fixture(scope="module")
def whole():
    return rendered(scene(), spp=SPP, seed=7)


def test_the_same_seed_gives_the_same_bits_twice(whole):
    again = rendered(scene(), spp=SPP, seed=7)
    assert digest(again) == digest(whole)


def test_another_seed_gives_another_picture(whole):
    for seed in (8, 7 + 2**32, 2**64 - 1):
        assert (rendered(scene(), spp=256, seed=seed).image != whole.image).any(axis=2).mean() > 0.9


def test_no_two_pixels_and_no_two_samples_share_their_random_numbers(whole):
    """A furnace-like scene would hide it: here equal numbers would give equal sums in symmetric pixels."""
    assert len(np.unique(whole.estimate.sum_[..., 0])) == whole.estimate.sum_[..., 0].size
    first, second = (rendered(scene(), samples=(n, 1), seed=7).image for n in (0, 1))
    assert (first != second).any()


@pytest.mark.contract
def test_the_launch_geometry_of_a_gpu_does_not_touch_a_bit(whole, monkeypatch):
    """Work-groups of 64 that share a queue, as on a GPU, where a CPU runs groups of one."""
    tune = Plan.tune
    monkeypatch.setattr(Plan, "tune", lambda plan, _: tune(plan, Tuning(local_size=64, group_slots=512)))
    assert digest(rendered(scene(), spp=SPP, seed=7)) == digest(whole)


@pytest.mark.parametrize("pool", [256, 40_000])
def test_the_pool_size_does_not_touch_a_bit(whole, pool):
    """40,000 slots lengthen the passes as well."""
    other = rendered(scene(), spp=SPP, seed=7, pool=pool)
    assert other.stats["slots"] != whole.stats["slots"]
    assert digest(other) == digest(whole)


THREAD_SCRIPT = """
import sys
sys.path[:0] = sys.argv[1:]
from every_bit import SPP, digest, rendered, scene
from clvol.planning.plan import Plan
from clvol.planning.settled import Tuning
result = rendered(scene(), spp=SPP, seed=7)
print(digest(result), result.metadata["device"], sep="|")
"""


@quick_first("threads", ["1", "2"])
def test_one_and_two_threads_give_the_same_bits(whole, threads):
    """PoCL reads it when it is loaded, so that each needs a process of its own."""
    environment = {**os.environ, "POCL_MAX_PTHREAD_COUNT": threads}
    command = [sys.executable, "-c", THREAD_SCRIPT, *sys.path]
    done = subprocess.run(command, env=environment, capture_output=True, text=True, timeout=300)
    assert done.returncode == 0, done.stderr
    assert done.stdout.strip().splitlines()[-1].split("|")[0] == digest(whole)


def test_joint_is_what_users_get(tmp_path):
    """In a process of its own: the tests' default is another (conftest.py)."""
    scene, saved = SCENES / "slab.xml", tmp_path / "a.exr"
    options = ["-o", str(saved), "--spp", "1", "-D", "res=8"]
    command = [sys.executable, "-m", "clvol.cli.main", "render", str(scene), *options]
    done = subprocess.run(command, capture_output=True, text=True, timeout=300)
    assert done.returncode == 0, done.stderr
    assert ImageInput.open(str(saved)).spec().get_string_attribute("sampler") == "joint"


@pytest.mark.parametrize("cut", [SPP // 2, 337, 1])
def test_two_parts_of_the_samples_merge_to_the_whole(whole, cut):
    parts = [rendered(scene(), samples=r, seed=7) for r in ((0, cut), (cut, SPP - cut))]
    merged = clvol.merge(parts[::-1])
    assert merged.samples == whole.samples
    assert (merged.estimate.counts == whole.estimate.counts).all()
    np.testing.assert_allclose(merged.estimate.sums, whole.estimate.sums, rtol=1e-10)
    np.testing.assert_allclose(merged.image, whole.image, rtol=2e-7)
    np.testing.assert_allclose(merged.variance, whole.variance, rtol=1e-6)
    lookups = [np.rint(r.aovs["lookups"] * float(r.samples[1])).sum() for r in (*parts, whole)]
    assert lookups[0] + lookups[1] == lookups[2]
    assert sum(p.stats["lookups"] for p in parts) == whole.stats["lookups"]


def test_parts_whose_samples_are_whole_numbers_merge_to_the_last_bit():
    """Absorbing media under a light of 1: each sample is 0 or 1, so that sums are exact, of squares too."""
    still = absorbing_scene()
    parts = [clvol.render(still, samples=r, seed=9) for r in ((0, 333), (333, 667))]
    merged, single = clvol.merge(parts), clvol.render(still, spp=1000, seed=9)
    sums = single.estimate.sum_
    assert len(np.unique(sums)) > 10 and (sums == np.rint(sums)).all()
    for name in ("sum_", "sum_of_squares"):
        assert np.array_equal(getattr(merged.estimate, name), getattr(single.estimate, name)), name
    for name in ("image", "variance"):
        assert np.array_equal(getattr(merged, name), getattr(single, name)), name


def test_a_range_of_all_samples_is_the_render_itself(whole):
    assert digest(rendered(scene(), samples=(0, SPP), seed=7)) == digest(whole)


def test_samples_are_numbered_up_to_the_end_of_32_bits():
    last = 2**32 - 2
    low, high = (rendered(scene(), samples=r, seed=7) for r in ((0, 1), (last, 1)))
    assert high.samples == (last, 1)
    assert (low.image != high.image).any()


def interrupted_render(signals=1):
    """Presses Ctrl-C (`signals` times) when the first pass is reported."""
    left = [signals]

    def press(progress):
        while left[0]:
            left[0] -= 1
            press_key(signal.SIGINT)

    return rendered(scene(), spp=50 * SPP, seed=7, progress=press)


@pytest.mark.usefixtures("ctrl_c")
def test_ctrl_c_keeps_whole_passes_of_every_pixel():
    """What is left has the bits of a shorter render: no pixel has more samples, no path was dropped."""
    cut = interrupted_render()
    assert cut.stats["interrupted"]
    assert 0 < cut.samples[1] < 50 * SPP
    assert cut.metadata["spp"] == cut.samples[1]
    assert digest(cut) == digest(rendered(scene(), spp=cut.samples[1], seed=7))


@pytest.mark.usefixtures("ctrl_c")
def test_a_second_ctrl_c_keeps_what_is_finished_and_a_third_is_a_keyboard_interrupt():
    cut = interrupted_render(signals=2)
    assert cut.stats["interrupted"] and 0 < cut.samples[1] < 50 * SPP
    assert digest(cut) == digest(rendered(scene(), spp=cut.samples[1], seed=7))
    with pytest.raises(KeyboardInterrupt):
        interrupted_render(signals=3)
    assert signal.getsignal(signal.SIGINT) is signal.default_int_handler


def test_a_process_that_ignores_ctrl_c_goes_on_ignoring_it(ctrl_c):
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    whole = rendered(scene(), spp=SPP, seed=7, progress=lambda _: signal.raise_signal(signal.SIGINT))
    assert whole.samples == (0, SPP) and not whole.stats["interrupted"]


def test_a_time_limit_keeps_whole_passes_too():
    cut = rendered(scene(), time_limit=0.3, seed=7)
    assert not cut.stats["interrupted"]
    assert digest(cut) == digest(rendered(scene(), spp=cut.samples[1], seed=7))


@pytest.mark.contract
@pytest.mark.usefixtures("ctrl_c")
def test_an_interrupted_picture_is_not_biased():
    assert_same_picture(interrupted_render(), rendered(scene(), spp=SPP, seed=8))
