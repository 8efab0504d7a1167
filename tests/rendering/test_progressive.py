"""`clvol.progressive`: each frame is the picture of all samples so far, and the loop may end at any."""

from __future__ import annotations

import os
import signal
import threading
import time
from itertools import pairwise

import numpy as np
import pytest
from every_bit import digest, rendered, scene

import clvol

OPTIONS = {"seed": 7, "sampler": "joint", "pool": 256, "interval": 0}
"""With 8 x 8 pixels a pass of this pool holds 16 samples of each."""
SPP = 80


@pytest.fixture(scope="module")
def frames():
    return list(clvol.progressive(scene(), spp=SPP, **OPTIONS))


def endless():
    return clvol.progressive(scene(), time_limit=3600, **OPTIONS)


def test_every_frame_has_the_bits_of_a_render_of_so_many_samples(frames):
    counts = [frame.samples[1] for frame in frames]
    assert counts == sorted(set(counts)) and len(counts) > 2 and counts[-1] == SPP
    for frame in (frames[0], frames[-1]):
        assert digest(frame) == digest(rendered(scene(), spp=frame.samples[1], seed=7))


def test_frames_are_results_with_their_noise(frames):
    assert [frame.is_last for frame in frames] == [False] * (len(frames) - 1) + [True]
    assert all(isinstance(frame, clvol.Result) and 0 < frame.noise < np.inf for frame in frames)
    assert frames[0].noise > 1.5 * frames[-1].noise
    assert repr(frames[0]).startswith("<Frame 8 x 8, 16 spp")
    rest = rendered(scene(), samples=(frames[0].samples[1], 8), seed=7)
    assert clvol.merge([frames[0], rest]).samples == (0, frames[0].samples[1] + 8)


def test_break_ends_the_render_and_gives_the_memory_back(device):
    before = device.memory.taken
    for frame in endless():
        assert not frame.is_last and device.memory.taken > before
        break
    assert device.memory.taken == before
    assert digest(frame) == digest(rendered(scene(), spp=frame.samples[1], seed=7))


def test_no_frame_comes_after_one_that_is_cancelled():
    seen = []
    for frame in endless():
        seen.append(frame)
        if len(seen) == 2:
            frame.cancel()
    assert len(seen) == 2 and seen[1].samples[1] > seen[0].samples[1]


def test_another_thread_ends_it():
    frames = endless()
    first = next(frames)
    timer = threading.Timer(0.2, first.cancel)
    timer.start()
    last = list(frames)[-1]
    timer.join()
    assert not last.stats["interrupted"]
    assert digest(last) == digest(rendered(scene(), spp=last.samples[1], seed=7))
    assert list(frames) == []


def test_what_is_cancelled_before_it_begins_has_no_frame():
    frames = endless()
    frames.cancel()
    assert len(list(frames)) <= 1  # of a pass that was finished at once


def test_a_closed_render_has_no_further_frame():
    with endless() as frames:
        next(frames)
    assert list(frames) == []


def test_frames_are_apart_by_the_interval():
    options = OPTIONS | {"interval": 0.15}
    times = [time.perf_counter() for _ in clvol.progressive(scene(), time_limit=0.6, **options)]
    assert all(later - earlier > 0.1 for earlier, later in pairwise(times[:-1]))


@pytest.mark.usefixtures("ctrl_c")
def test_ctrl_c_while_it_renders_ends_it_with_whole_passes():
    timer = threading.Timer(0.3, os.kill, [os.getpid(), signal.SIGINT])
    timer.start()
    frames = list(endless())
    timer.join()
    assert frames[-1].is_last and frames[-1].stats["interrupted"]
    assert digest(frames[-1]) == digest(rendered(scene(), spp=frames[-1].samples[1], seed=7))


@pytest.mark.usefixtures("ctrl_c")
def test_ctrl_c_in_the_body_of_the_loop_is_a_keyboard_interrupt():
    frames = endless()
    next(frames)
    with pytest.raises(KeyboardInterrupt):
        signal.raise_signal(signal.SIGINT)
    frames.close()


def test_frames_to_a_target_error_end_with_it():
    frames = list(clvol.progressive(scene(), target_error=0.05, **OPTIONS))
    assert frames[-1].is_last and frames[-1].noise < 1.3 * 0.05
    whole = rendered(scene(), target_error=0.05, seed=7, pool=256)
    assert (frames[-1].image == whole.image).all()
    assert frames[-1].metadata["target_error"] == 0.05


def test_mistakes_are_said_at_once():
    with pytest.raises(clvol.OptionError, match="progressive takes a Scene"):
        clvol.progressive("scene.xml")
    with pytest.raises(clvol.OptionError, match="unknown technique"):
        clvol.progressive(scene(), technique="detla")
    with pytest.raises(clvol.OptionError, match="interval=-1 is not a positive number"):
        clvol.progressive(scene(), interval=-1)
    with pytest.raises(TypeError, match=r"takes interval and spp, .*, not 'progress'"):
        clvol.progressive(scene(), progress=True)


def test_a_callback_sees_the_picture_and_its_noise_at_each_record():
    records, seen = [], []

    def look(record):
        records.append(record)
        seen.append((record.samples_done, record.image, record.noise))

    result = rendered(scene(), spp=SPP, seed=7, pool=256, progress=look)
    counts, images, noises = zip(*seen, strict=True)
    assert len(counts) > 2 and counts[-1] == SPP
    for count, image, noise in (seen[0], seen[-1]):
        whole = rendered(scene(), spp=count, seed=7)
        assert (image == whole.image).all() and noise == whole.noise
    assert len(set(noises)) == len(noises)
    assert noises[-1] == result.noise and (images[-1] == result.image).all()
    assert records[0].noise == noises[0]


def test_the_picture_of_a_record_is_there_while_the_callback_runs():
    records = []
    rendered(scene(), spp=SPP, seed=7, pool=256, progress=records.append)
    assert records[0].noise > records[-1].noise > 0
    with pytest.raises(clvol.OptionError, match="only while the callback runs"):
        _ = records[0].image
