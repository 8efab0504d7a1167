"""Films that have no room on their device are rendered in bands, with the bits of one that has room."""

import gc
import logging
import re
import signal
from dataclasses import replace

import numpy as np
import pytest
from every_bit import scene as scene_of_8
from pictures import box, gridded, hg, picture, volume
from signals import press_key
from tiers import quick_first

import clvol
from clvol.planning.choices import Choices
from clvol.planning.lanes import lanes
from clvol.rendering import bands, checkpoint, session, sizes
from clvol.rendering.session import Session
from clvol.scene.records import Batch, ConstantEmitter, DirectionalEmitter, ReconstructionFilter

AOVS = ("depth", "cells", "largest_weight", "position", "efficiency")
TIMED = ("efficiency",)
"""Pictures of times, which differ from one render to the next."""
COUNTS = (
    *("paths", "lookups", "tentative_collisions", "null_collisions", "real_collisions", "cells_crossed"),
    *("shadow_rays", "non_finite", "majorant_violations", "walks_exhausted", "largest_weight"),
    *("largest_sample", "paths_cut_by_max_depth"),
)


def on_film(seen, size=(10, 8), **film):
    return replace(seen, film=replace(seen.film, width=size[0], height=size[1], **film))


def scene(size=(10, 8), **film):
    """Smoke under a coloured sky and a sun."""
    values = np.random.default_rng(3).uniform(0, 1, (7, 6, 5)) ** 3
    cube = (0, 0, 0), (1, 1, 1)
    lights = [ConstantEmitter((0.8, 0.5, 0.2)), DirectionalEmitter((2.0,), (0.0, -1.0, 0.0))]
    medium = gridded(volume(values, *cube), 0.8, hg(0.5), scale=8.0)
    return on_film(
        picture([box(*cube, medium)], lights, (0.5, 0.6, -2.0), (0.5, 0.5, 0.5), 30.0), size, **film
    )


def several(size=(10, 8)):
    """Media that overlap."""
    return on_film(scene_of_8(), size)


def chromatic(size=(10, 8)):
    """A grid of another shape in each channel: delta tracking follows one channel a path."""
    values = np.random.default_rng(3).uniform(0, 1, (7, 6, 5, 3)) ** 3
    cube = (0, 0, 0), (1, 1, 1)
    medium = gridded(volume(values, *cube), 0.8, scale=6.0)
    sky = [ConstantEmitter((0.8, 0.5, 0.2))]
    return picture([box(*cube, medium)], sky, (0.5, 0.6, -2.0), (0.5, 0.5, 0.5), 30.0, size)


@pytest.fixture
def held(monkeypatch):
    """Have the device hold so many rows at a time."""

    def hold(rows):
        monkeypatch.setattr(session, "rows_at_a_time", lambda memory, plan, size, *_: min(rows, size[1]))

    return hold


def assert_same(one, other):
    assert one.samples == other.samples and one.ranges == other.ranges
    for name in ("image", "variance"):
        assert getattr(one, name).tobytes() == getattr(other, name).tobytes(), name
    assert one.noise == other.noise or np.isnan(other.noise)
    assert one.aovs.keys() == other.aovs.keys()
    for name in one.aovs.keys() - set(TIMED):
        assert one.aovs[name].dtype == other.aovs[name].dtype
        assert one.aovs[name].tobytes() == other.aovs[name].tobytes(), name
    for name in COUNTS:
        assert one.stats[name] == other.stats[name], name
    lost = "energy_lost_to_caps"  # added in no order
    assert one.stats[lost] == pytest.approx(other.stats[lost], rel=1e-6)


def in_bands(held, rows, make, **options):
    """A render as it is, and in bands of so many rows; both were looked at."""
    whole = clvol.render(make(), **options)
    held(rows)
    parts = clvol.render(make(), **options)
    assert_same(parts, whole)
    assert "bands" not in whole.metadata
    assert parts.metadata.get("bands", 1) == -(-len(parts.image) // rows)
    assert parts.stats["uploaded_bytes"] == whole.stats["uploaded_bytes"], "once for all bands"
    assert parts.stats["kernels_built"] <= 1, "accumulate, whose size is another"
    return whole, parts


CASES = {
    "joint": (scene, {"sampler": "joint", "aov": AOVS}),
    "sobol": (scene, {"sampler": "sobol", "aov": AOVS}),
    "independent": (scene, {"sampler": "independent", "aov": AOVS}),
    "joint, one by one": (scene, {"sampler": "joint", "lanes": "off"}),
    "independent, one by one": (scene, {"sampler": "independent", "lanes": "off"}),
    "a channel a path": (chromatic, {"technique": "delta", "aov": ("tentative", "depth")}),
    "a channel a path, independent": (chromatic, {"technique": "delta", "sampler": "independent"}),
    "media that overlap": (several, {"sampler": "joint", "aov": ("tentative",)}),
    "alpha": (lambda: scene(pixel_format="rgba"), {"background": "transparent"}),
    "a crop": (lambda: scene((16, 16), crop=(3, 5, 7, 8)), {}),
    "a wide filter, cut at the border": (
        lambda: scene(rfilter=ReconstructionFilter("mitchell", 2.0)),
        {"sampler": "sobol"},
    ),
    "a cache of lights": (scene, {"shadow_cache": "on"}),
    "a range": (scene, {"spp": None, "samples": (6, 7)}),
    "one column": (lambda: scene((1, 11)), {}),
    "a small pool": (scene, {"pool": 64}),
}


@quick_first("case", CASES)
@pytest.mark.parametrize("rows", [3])
def test_bands_have_the_bits_of_the_whole(held, case, rows):
    make, options = CASES[case]
    in_bands(held, rows, make, **{"spp": 13, "seed": 5} | options)


def test_cases_are_what_they_say(device):
    plan = clvol.plan(chromatic(), technique="delta")
    assert plan.jobs_per_sample == 3
    if device.is_cpu:
        assert any(lanes(opened(device).plan).values())
    assert clvol.plan(scene(), shadow_cache="on").light_cache


@pytest.mark.parametrize("rows", [1, 2, 7])
def test_bands_of_any_number_of_rows(held, rows):
    in_bands(held, rows, scene, spp=6, seed=1)


@quick_first("sampler", ["joint", "independent"])
def test_a_target_error_surveys_and_fills_all_bands(held, sampler):
    options = {"spp": 512, "target_error": 0.03, "seed": 2, "sampler": sampler}
    whole, parts = in_bands(held, 3, scene, **options)
    assert len(np.unique(parts.aovs["samples"])) > 1 and parts.metadata["target_error"] == 0.03
    assert parts.estimate.counts.tobytes() == whole.estimate.counts.tobytes()


def test_lists_of_pixels_in_any_order_leave_the_same_film(device, held):
    """Twice, of which the second leaves bands out."""
    random = np.random.default_rng(1)
    lists = random.permutation(80)[:50], random.permutation(30)[:9] + 50
    films = []
    for rows in (8, 2):
        held(rows)
        choices = Choices.for_scene(scene(), {}, target_error=0.1)
        wavefront = Session.for_scene(device, scene(), choices, seed=4).wavefront
        for pixels in lists:
            wavefront.list_pixels(pixels)
            *_, done = wavefront.passes(0, 5, lambda: 0)
            wavefront.film.samples[pixels] += done
        films.append(wavefront.film.contents())
        assert wavefront.film.samples.max() == 10
    for name, whole in films[0].items():
        assert whole.tobytes() == films[1][name].tobytes(), name
    assert films[0]["film"].any()


def test_pictures_and_checkpoints_go_on_from_one_to_the_other(held, tmp_path):
    """And they merge: bands are how a picture was made, not what it is."""
    options = {"seed": 5, "aov": ("depth",)}
    whole = clvol.render(scene(), spp=24, **options)
    first = clvol.render(scene(), spp=9, checkpoint=tmp_path / "whole.npz", **options)
    first.save(tmp_path / "first.exr")
    alone = clvol.merge([clvol.render(scene(), samples=(n, 12), **options) for n in (0, 12)])
    held(3)
    for checkpoint_ in ("whole.npz", "bands.npz"):
        for spp in (9, 17, 24):
            result = clvol.render(scene(), spp=spp, checkpoint=tmp_path / checkpoint_, **options)
        assert_same(result, whole)
        assert result.metadata["bands"] == 3
    resumed = clvol.render(scene(), spp=24, resume=tmp_path / "first.exr", **options)
    assert resumed.ranges == ((0, 24),)
    np.testing.assert_allclose(resumed.image, whole.image, rtol=1e-6)
    parts = [clvol.render(scene(), samples=(n, 12), **options) for n in (0, 12)]
    assert_same(clvol.merge(parts), alone)
    assert clvol.merge(parts).metadata["bands"] == 3
    held(8)
    assert_same(clvol.render(scene(), spp=24, resume=tmp_path / "bands.npz", **options), whole)
    mixed = clvol.merge([parts[0], clvol.render(scene(), samples=(12, 12), **options)])
    assert_same(mixed, alone)


def test_views_and_sensors_side_by_side_are_rendered_in_bands_too(held, monkeypatch):
    monkeypatch.setattr("clvol.cluster.ranges.LEAST_PATHS", 1)
    seen = scene()
    beside = replace(seen, sensor=Batch((seen.sensor, seen.sensor), ("a", "b")))
    options = {"spp": 6, "seed": 3}
    views = clvol.render(seen, sensor=[0, {"x_fov": 30.0}], **options)
    both = clvol.render(beside, **options)
    held(3)
    for one, other in zip(clvol.render(seen, sensor=[0, {"x_fov": 30.0}], **options), views, strict=True):
        assert_same(one, other)
        assert one.metadata["bands"] > 1
    assert_same(clvol.render(beside, **options), both)


def test_devices_that_share_a_render_have_bands_each(held, monkeypatch):
    monkeypatch.setattr("clvol.cluster.ranges.LEAST_PATHS", 1)
    monkeypatch.setattr("clvol.cluster.ranges.LEAST_RANGES", 4)
    options = {"spp": 12, "seed": 3, "aov": ("depth",), "device": [0]}
    whole = clvol.render(scene(), **options)
    held(3)
    result = clvol.render(scene(), **options)
    assert_same(result, whole)
    assert result.metadata["bands"] == 3


def test_progress_goes_over_all_bands(held):
    held(2)
    seen, noise = [], []

    def tell(progress):
        seen.append((progress.samples_done, progress.samples_total))
        noise.append(progress.noise)

    result = clvol.render(scene(), spp=24, seed=1, progress=tell)
    assert [done for done, _ in seen] == sorted(done for done, _ in seen)
    assert len(seen) > 1 and seen[-1] == (24, 24) and {total for _, total in seen} == {24}
    assert noise[-1] == result.noise
    *_, last = clvol.progressive(scene(), spp=24, seed=1)
    assert_same(last, result)


def test_a_profile_books_the_bands(held):
    held(3)
    profile = clvol.render(scene(), spp=6, seed=1, profile=True).profile
    assert any(span.name == "bands" for span in profile.host)


# -- early ends ----------------------------------------------------------------------------------------


def opened(device, **options):
    return Session.for_scene(device, scene(), Choices.for_scene(scene(), {}), seed=4, **options)


def shown(session_, done):
    return clvol.rendering.outcome.make_result(session_, 0, done)


def test_an_early_end_finishes_the_round(device, held):
    """Asked for in the middle of a round, which is the third: 1 + 2 + 4 samples."""
    held(2)
    bands_ = opened(device)
    rounds = []
    for done in bands_.passes(0, 100, None, lambda: int(len(rounds) == 2)):
        rounds.append(done)
    assert rounds == [1, 3]
    calls = iter(range(10**6))
    asked = []

    def urgency():
        asked.append(next(calls))
        return int(len(asked) > 3)

    bands_.restart(4)
    assert bands_.run(0, 100, None, urgency) == 1, "of the first round, all bands"
    assert_same(shown(bands_, 1), clvol.render(scene(), spp=1, seed=4))


@pytest.mark.parametrize("level", [2, 3])
def test_an_urgent_end_leaves_out_the_round_under_way(device, held, level, caplog):
    held(2)
    bands_ = opened(device)
    finished, since = [], []

    def urgency():
        since.append(len(finished))
        return level if since.count(2) > 5 else 0  # in the middle of the third round

    for done in bands_.passes(0, 100, None, urgency):
        finished.append(done)
    assert finished == [1, 3]
    assert ("dropped an unfinished round of 4 samples" in caplog.text) == (level == 2)
    assert_same(shown(bands_, 3), clvol.render(scene(), spp=3, seed=4))
    more = bands_.run(3, 5)
    assert more == 5
    assert_same(shown(bands_, 8), clvol.render(scene(), spp=8, seed=4))


def test_what_is_counted_in_a_round_that_is_left_out_does_not_count(device, held):
    held(2)
    bands_ = opened(device)
    assert bands_.run(0, 3) == 3
    wavefront = bands_.wavefront
    wavefront._set_counter(bands._NON_FINITE, 5)  # as if there had been some
    before = wavefront.slot_statistics(), wavefront.non_finite()
    asked = []

    def urgency():
        asked.append(0)
        if len(asked) == 3:
            wavefront._set_counter(bands._NON_FINITE, 9)
        return 3 * (len(asked) > 3)

    with pytest.raises(KeyboardInterrupt):
        bands_.run(3, 9, None, urgency)
    assert not wavefront.film._fresh, "bands of the round are not kept with those of another"
    assert (wavefront.slot_statistics(), wavefront.non_finite()) == before
    assert before[0]["shadow_rays"] > 0 and before[1] == 5
    assert bands_.run(3, 9) == 9
    assert wavefront.slot_statistics()["shadow_rays"] > before[0]["shadow_rays"]
    assert wavefront.non_finite() == 5


def test_a_first_round_that_does_not_end_is_no_picture(device, held, monkeypatch):
    held(2)
    monkeypatch.setattr("clvol.rendering.patience.FIRST_PATIENCE_SECONDS", -1.0)
    with pytest.raises(clvol.RenderError, match="its first samples did not"):
        opened(device).run(0, 100, None, lambda: 1)
    with pytest.raises(KeyboardInterrupt):
        opened(device).run(0, 100, None, lambda: 2)


@pytest.mark.usefixtures("ctrl_c")
def test_ctrl_c_keeps_whole_rounds(held):
    held(3)
    result = clvol.render(
        scene(), spp=1000, seed=4, progress=lambda p: press_key(signal.SIGINT) if p.samples_done == 3 else 0
    )
    assert result.stats["interrupted"] and result.samples == (0, 3)
    assert_same(result, clvol.render(scene(), spp=3, seed=4))


def test_a_time_limit_is_for_all_bands(held):
    held(2)
    result = clvol.render(scene(), time_limit=0.5, seed=4)
    assert result.samples[1] >= 1 and result.metadata["bands"] == 4
    assert_same(result, clvol.render(scene(), spp=result.samples[1], seed=4))


def test_rounds_are_no_longer_than_the_time_that_is_left(device, held, monkeypatch):
    held(2)
    monkeypatch.setattr(bands, "_ROUND_SECONDS", 1e9)
    wavefront = opened(device).wavefront
    sizes_ = np.diff(list(wavefront.passes(0, 64, lambda: 0)), prepend=0)
    assert list(sizes_) == [1, 2, 4, 8, 16, 32, 1]
    assert set(np.diff(list(wavefront.passes(0, 8, lambda: 0, lambda: 1e-9)))) == {1}


def test_a_device_that_fails_in_a_round_leaves_the_rounds_before(device, held, tmp_path, monkeypatch):
    """What was finished is in the checkpoint, and goes on to the same bits."""
    held(2)
    options = {"seed": 4, "checkpoint": tmp_path / "a.npz"}
    fetch, fetched = bands.BandedFilm.fetch, []

    def failing(film, count):
        fetched.append(count)
        if len(fetched) == 10:  # in the third round of four bands
            raise clvol.DeviceError("the device is gone", hint="buy another")
        yield from fetch(film, count)

    monkeypatch.setattr(bands.BandedFilm, "fetch", failing)
    with pytest.raises(clvol.DeviceError, match="has 3 samples of each pixel"):
        clvol.render(scene(), spp=40, **options)
    monkeypatch.setattr(bands.BandedFilm, "fetch", fetch)
    assert checkpoint.read_checkpoint(tmp_path / "a.npz").done == 3
    assert_same(clvol.render(scene(), spp=20, **options), clvol.render(scene(), spp=20, seed=4))


# -- room ----------------------------------------------------------------------------------------------


def test_a_film_beyond_the_largest_buffer_is_rendered_in_bands(device, monkeypatch, caplog):
    """As on a device that has the memory, and hands it out in parts only."""
    seen = scene((64, 61))
    whole = clvol.render(seen, spp=3, seed=1, pool=256, sampler="joint")
    monkeypatch.setattr(device.memory, "largest", 200_000)  # the film takes 96 bytes a pixel, 374,784 in all
    with caplog.at_level(logging.INFO, "clvol"):
        parts = clvol.render(seen, spp=3, seed=1, pool=256, sampler="joint")
    assert_same(parts, whole)
    count, rows = parts.metadata["bands"], re.search(r"in (\d+) bands of up to (\d+) rows", caplog.text)
    assert int(rows[1]) == count >= 2 and int(rows[2]) == -(-61 // count), "bands are alike"
    assert caplog.text.count("bands of up to") == 1


def limit(monkeypatch, memory, room, shared, host=1 << 40):
    """Let a device have so many bytes beside what tests hold, and the host so many."""
    gc.collect()
    taken = memory.taken
    monkeypatch.setattr(memory, "shared", shared)
    monkeypatch.setattr(memory, "room", lambda: room - (memory.taken - taken))
    monkeypatch.setattr(memory, "limit", taken + room)
    monkeypatch.setattr(sizes, "available_memory", lambda: host)


def test_a_device_of_a_quarter_of_the_films_bytes_renders_it(device, monkeypatch):
    seen = scene((64, 60))
    whole = clvol.render(seen, spp=3, seed=1, pool=256, sampler="joint")
    beside = opened(device, pool=256).wavefront.bytes
    limit(monkeypatch, device.memory, beside + 64 * 60 * 96 // 4, shared=False)
    parts = clvol.render(seen, spp=3, seed=1, pool=256, sampler="joint")
    assert_same(parts, whole)
    assert parts.metadata["bands"] > 4, "results of four samples a pixel are there, too"
    error = clvol.render(seen, spp=32, seed=1, pool=256, sampler="joint", target_error=0.5)
    assert error.metadata["bands"] > parts.metadata["bands"], "the survey has a film of its own"


def test_sensors_side_by_side_share_the_room(device, monkeypatch):
    seen = scene((40, 30))
    beside = replace(seen, sensor=Batch((seen.sensor, seen.sensor), ("a", "b")))
    options = {"spp": 2, "seed": 1, "pool": 256, "sampler": "joint"}
    whole = clvol.render(beside, **options)
    wavefront = opened(device, pool=256).wavefront
    waves = sum(wavefront.buffers[name].size for name in sizes.wave_sizes(wavefront.plan, 80, 256, 1))
    limit(monkeypatch, device.memory, wavefront.bytes + waves + 40 * 30 * 96 // 4, shared=False)
    parts = clvol.render(beside, **options)
    assert_same(parts, whole)
    assert "bands" in parts.metadata


def test_a_render_that_only_a_cycle_holds_takes_no_room(device, monkeypatch):
    seen = scene((64, 60))
    whole = clvol.render(seen, spp=1, seed=1, pool=256)
    gc.collect()
    before = opened(device, pool=256)
    limit(monkeypatch, device.memory, before.wavefront.bytes + 64 * 60 * 96, shared=False)
    gc.disable()
    try:
        cycle = [Session.for_scene(device, seen, Choices.for_scene(seen, {}), seed=4, pool=256)]
        cycle.append(cycle)
        del cycle
        assert_same(again := clvol.render(seen, spp=1, seed=1, pool=256), whole)
    finally:
        gc.enable()
    assert "bands" not in again.metadata


def test_a_film_of_which_no_row_has_room_is_refused_with_what_has(device, monkeypatch):
    seen = on_film(picture([], [ConstantEmitter((0.8, 0.5, 0.2))], (0, 0, -2), (0, 0, 0)), (4096, 2))
    small = on_film(seen, (4, 4))
    beside = Session.for_scene(device, small, Choices.for_scene(small, {}), seed=4, pool=256).wavefront.bytes
    limit(monkeypatch, device.memory, beside + 4096 * 96 // 2, shared=False)
    taken, built = device.memory.taken, len(device.programs)
    with pytest.raises(clvol.DeviceError, match="a film of 8192 pixels needs") as caught:
        clvol.render(seen, spp=1, pool=256, sampler="joint")
    assert device.memory.taken == taken and len(device.programs) == built
    width, height = map(int, re.search(r"(\d+) x (\d+) would fit", str(caught.value)).groups())
    assert 256 < width < 4096
    clvol.render(seen, spp=1, pool=256, sampler="joint", size=(width, height))


def test_a_picture_without_room_on_the_host_is_refused_at_once(device, monkeypatch):
    """A device of its own memory: the host has the film, and makes the picture."""
    huge = replace(scene(), film=replace(scene().film, width=100_000, height=10_000))
    limit(monkeypatch, device.memory, 1 << 30, shared=False, host=64 << 30)
    taken, built = device.memory.taken, len(device.programs)
    with pytest.raises(clvol.DeviceError, match="of this machine's memory, which has") as caught:
        clvol.render(huge, spp=1, sampler="joint")
    assert device.memory.taken == taken and len(device.programs) == built
    width, height = map(int, re.search(r"(\d+) x (\d+) would fit", str(caught.value)).groups())
    assert 346 * width * height < (64 << 30) < 420 * width * height
