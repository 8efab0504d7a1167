"""A render to a target error reaches it, stays unbiased, and spends its samples where the noise is.

Every statistical test raises a false alarm with probability 1e-4 at most; seeds are fixed.
"""

from __future__ import annotations

import itertools
import logging
import math
import signal
from types import SimpleNamespace

import numpy as np
import OpenImageIO as oiio  # noqa: N813
import pytest
from click.testing import CliRunner
from pictures import ball, box, gridded, homogeneous, picture, volume
from scipy import optimize, stats
from stat_tests import FALSE_ALARM
from tiers import quick_first

import clvol
from clvol.cli.main import main
from clvol.errors import OptionError
from clvol.picture.estimate import error_bias
from clvol.picture.result import relative_noise
from clvol.planning.choices import Choices
from clvol.rendering import adaptive
from clvol.rendering.adaptive import (
    CHUNK,
    LEAST,
    TargetRender,
    allocate,
    capped,
    chunks,
    optimum,
    powers_of_two,
)
from clvol.rendering.outcome import make_result
from clvol.rendering.session import Session, seed_words
from clvol.scene.records import ConstantEmitter

THICKNESS = 1.3
TRANSMITTED = math.exp(-0.99 * THICKNESS)
"""What each pixel of `inside` sees of the sky: the camera's near plane is at 0.01."""


def inside(size=16, thickness=THICKNESS):
    """In the middle of an absorbing ball under a sky of 1, looking straight ahead: samples are 0 or 1."""
    medium = homogeneous(thickness)
    return picture(
        [ball((0, 0, 0), 1.0, medium)], [ConstantEmitter()], (0, 0, 0), (0, 0, 1), 0.1, (size, size)
    )


def halves(size=16):
    """To the left the noiseless sky, to the right an absorbing ball before it."""
    shapes = [ball((-1.2, 0, 0), 1.2, homogeneous(1.5))]
    return picture(shapes, [ConstantEmitter()], (0, 0, -4), (0, 0, 0), 30.0, (size, size))


def opened(device, scene, sampler="independent", **choices):
    return Session.for_scene(device, scene, Choices(target_error=1.0, sampler=sampler, **choices), 0)


def started(session, seed, target, most=None):
    session.restart(seed)
    return TargetRender(session, target, most)


def finished(session, seed, target, most=None, time_limit=None, callback=None):
    """The render, run to its end."""
    render = started(session, seed, target, most)
    render.run(time_limit, callback, lambda: False)
    return render


@pytest.fixture(scope="module")
def small(device):
    return opened(device, inside())


@pytest.fixture(scope="module")
def half(device):
    return opened(device, halves())


@pytest.fixture(scope="module")
def sobol(device):
    return opened(device, inside(), "sobol")


# -- how samples are given out -----------------------------------------------------------------------


def noises(seed, pixels):
    """Of very different size, some of them 0."""
    random = np.random.default_rng(seed)
    noise = np.exp(2 * random.standard_normal(pixels))
    noise[random.random(pixels) < 0.2] = 0
    return noise


@pytest.mark.parametrize("seed", range(5))
def test_the_optimum_is_that_of_a_general_solver(seed):
    noise = noises(seed, 6)
    allowed = 0.1 * noise.sum() if seed else 10 * noise.sum()
    found = optimum(noise, allowed)
    solved = optimize.minimize(
        lambda x: np.exp(x).sum(),
        np.log(np.full(6, 1e4)),
        bounds=[(math.log(LEAST), 20)] * 6,
        constraints={"type": "ineq", "fun": lambda x: 1 - (noise * np.exp(-x / 2)).sum() / allowed},
    )
    assert solved.success
    assert found.min() >= LEAST
    assert (noise / np.sqrt(found)).sum() <= allowed * (1 + 1e-12)
    assert found.sum() == pytest.approx(np.exp(solved.x).sum(), rel=1e-4)


def test_whole_chunks_are_nearly_the_fewest():
    """Against every way to give out up to 40 chunks to 3 pixels."""
    numbers = CHUNK * np.arange(LEAST // CHUNK, 41)
    ways = np.stack(np.meshgrid(*[numbers] * 3), -1).reshape(-1, 3)
    for seed in range(20):
        noise = np.random.default_rng(seed).uniform(0.2, 2, 3)
        allowed = 0.12 * noise.sum()
        kept = (noise / np.sqrt(ways)).sum(axis=1) <= allowed
        fewest = ways[kept].sum(axis=1).min()
        assert fewest <= allocate(noise, allowed).sum() <= fewest + 2 * CHUNK


@pytest.mark.parametrize("rounding", [chunks, powers_of_two])
def test_the_bound_is_kept_by_every_rounding(rounding):
    for seed in range(20):
        noise = noises(seed, 300)
        allowed = 0.02 * noise.sum()
        samples = allocate(noise, allowed, LEAST, rounding)
        error = (noise / np.sqrt(samples)).sum()
        assert 0.97 * allowed < error <= allowed
        assert samples.dtype == np.int64
        assert samples.min() == LEAST
        assert (samples[noise == 0] == LEAST).all()
        assert (rounding(samples.astype(float)) == samples).all()


def test_rounding_never_lowers_a_number_and_ends_below_32_bits():
    numbers = np.array([0.0, 0.5, 1, 7.9, 8, 8.1, 1000, 1024, 1025, 1e30, np.inf])
    assert list(chunks(numbers)) == [0, 8, 8, 8, 8, 16, 1000, 1024, 1032, 2**31, 2**31]
    assert list(powers_of_two(numbers)) == [1, 1, 1, 8, 8, 16, 1024, 1024, 2048, 2**31, 2**31]


@pytest.mark.filterwarnings("error")
@pytest.mark.parametrize("rounding", [chunks, powers_of_two])
def test_what_cannot_be_reached_asks_for_the_most(rounding):
    for noise, allowed in ((1e300, 1.0), (1.0, 1e-300), (1e200, 1e-200), (1.0, 0.0)):
        samples = allocate(np.array([noise, 0.0]), allowed, LEAST, rounding)
        assert list(samples) == [2**31, LEAST]
    assert (allocate(np.zeros(3), 0.0, LEAST, rounding) == LEAST).all()
    assert (allocate(np.array([1e-300, 1.0]), 1e300, LEAST, rounding) == LEAST).all()


@pytest.mark.parametrize("rounding", [chunks, powers_of_two])
@pytest.mark.parametrize("mean", [1, 3, 7, 8, 10, 100])
def test_a_cap_is_kept_and_used(rounding, mean):
    wanted = optimum(noises(3, 5000), 1.0)
    plan = capped(wanted, np.zeros(5000, np.int64), mean, rounding)
    assert 0.5 * mean < plan.mean() <= mean
    assert plan.min() >= min(mean, CHUNK) // 2 + 1 if mean != 8 else plan.min() == 8
    if mean == 100:
        assert plan.mean() > 0.98 * mean
    more = capped(wanted[::-1], plan, mean + 1, rounding)
    assert (more >= plan).all() and more.mean() <= mean + 1


# -- runs over lists of pixels -----------------------------------------------------------------------


def chromatic(size=16):
    """A grid of another shape in each channel: delta tracking follows one channel a path."""
    values = np.random.default_rng(3).uniform(0, 1, (7, 6, 5, 3)) ** 3
    cube = (0, 0, 0), (1, 1, 1)
    medium = gridded(volume(values, *cube), 0.8, scale=6.0)
    sky = [ConstantEmitter((0.8, 0.5, 0.2))]
    return picture([box(*cube, medium)], sky, (0.5, 0.6, -2.0), (0.5, 0.5, 0.5), 30.0, (size, size))


def in_lists(session, seed, samples):
    """Render `samples` of every pixel in uneven runs over lists in a random order."""
    session.restart(seed)
    film, wavefront = session.wavefront.film, session.wavefront
    random = np.random.default_rng(seed)
    while (film.samples < samples).any():
        left = random.permutation(np.flatnonzero(film.samples < samples))
        pixels = left[: random.integers(1, len(left) + 1)]
        count = int(min(random.integers(1, samples), (samples - film.samples[pixels]).min()))
        wavefront.list_pixels(pixels)
        *_, done = wavefront.passes(0, count, lambda: 0)
        film.samples[pixels] += done
    session.seconds = 1.0
    return make_result(session, 0, samples)


CASES = {
    "independent": (inside, "independent", (), 200),
    "sobol, a channel a path": (chromatic, "sobol", ("tentative", "largest_weight", "depth", "position"), 60),
}


@quick_first("case", CASES)
def test_lists_of_pixels_give_the_bits_of_an_ordinary_render(device, case):
    scene, sampler, aovs, spp = CASES[case]
    ordinary = clvol.render(scene(), spp=spp, seed=5, sampler=sampler, aov=aovs)
    session = opened(device, scene(), sampler, aov=aovs)
    assert (session.plan.jobs_per_sample == 3) == ("channel" in case)
    listed = in_lists(session, 5, spp)
    assert (listed.aovs["samples"] == spp).all()
    for name in ("image", "variance"):
        assert np.array_equal(getattr(listed, name), getattr(ordinary, name)), name
    for name, values in ordinary.aovs.items():
        assert np.array_equal(listed.aovs[name], values), name
    for name in ("paths", "lookups", "non_finite", "largest_sample"):
        assert listed.stats[name] == ordinary.stats[name]


@pytest.mark.parametrize("listed", [1, 100, 399])
def test_passes_over_any_list_fit_into_the_ring(device, listed):
    """Fewer pixels have longer passes: of 399 pixels, with more jobs than those of all 400."""
    session = opened(device, inside(20))
    wavefront = session.wavefront
    wavefront.list_pixels(np.arange(listed))
    jobs = wavefront.pass_samples * wavefront.sample_jobs * wavefront.ring_passes
    assert 4 * jobs * session.plan.channels <= wavefront.buffers["results"].size


# -- what decides ------------------------------------------------------------------------------------


def test_only_the_survey_decides_how_many_samples_a_pixel_gets(half):
    def counts(seed, survey_seed):
        render = started(half, seed, 0.05)
        render.survey.clear(seed_words(survey_seed))
        render.run(None, None, lambda: False)
        return render.picture.samples, make_result(half, 0, 1).image

    samples, image = counts(1, 2)
    assert samples.min() == LEAST < samples.max()
    for survey_seed, same in ((2, True), (4, False)):
        others, other_image = counts(3, survey_seed)
        assert np.array_equal(others, samples) == same
        assert (other_image != image).any()


def test_the_same_seed_gives_the_same_bits_twice(half):
    first, again = (finished(half, 6, 0.05) and make_result(half, 0, 1) for _ in range(2))
    assert np.array_equal(first.image, again.image)
    assert np.array_equal(first.aovs["samples"], again.aovs["samples"])


def relative_means(session, target, seeds, shown=False):
    """Image means over the truth; `shown`: by a planted scheme that decides on the picture's own samples."""
    means = []
    for seed in range(seeds):
        render = started(session, 1000 + seed, target)
        if shown:
            render.survey = render.picture
        render.run(None, None, lambda: False)
        means.append(render.picture.uneven_estimate().mean.mean() / TRANSMITTED)
    return np.array(means)


def deviation(means):
    """Of the mean from 1, and the largest one that chance explains."""
    bound = stats.t.isf(FALSE_ALARM / 2, len(means) - 1)
    return abs(means.mean() - 1), bound * means.std(ddof=1) / math.sqrt(len(means))


@quick_first(("sampler", "size", "target", "seeds"), [("sobol", 16, 0.1, 30), ("independent", 48, 0.25, 50)])
def test_the_picture_is_unbiased_to_half_a_percent(device, sampler, size, target, seeds, caplog):
    caplog.set_level(logging.ERROR, "clvol")
    off, bound = deviation(relative_means(opened(device, inside(size), sampler), target, seeds))
    assert off <= bound
    assert off + bound < 0.005  # a bias of 0.5 % would have been seen


def test_decisions_on_the_pictures_own_samples_would_be_biased(device, monkeypatch):
    """The test above can fail: where chance made a pixel dark it looks quiet, and stays dark."""
    monkeypatch.setattr(adaptive, "_SMOOTHED", 1)
    session = opened(device, inside(32))
    off, bound = deviation(relative_means(session, 0.25, 20))
    assert off <= bound < 0.01
    off, bound = deviation(relative_means(session, 0.25, 20, shown=True))
    assert off > bound


# -- the target --------------------------------------------------------------------------------------


def true_noise(pictures):
    """Mean standard error over the mean radiance by the scatter of pictures, and its own relative error."""
    spread = np.std(pictures, axis=0, ddof=1)
    noise = spread.sum() / np.mean(pictures, axis=0).sum() / error_bias(len(pictures) - 1)
    error = math.sqrt((spread**2).sum() / (2 * (len(pictures) - 1))) / spread.sum()
    return noise, error


@pytest.mark.parametrize(
    ("which", "target", "least"), [("small", 0.1, 0.95), ("half", 0.01, 0.75), ("sobol", 0.1, 0)]
)
def test_the_noise_is_the_target(request, which, target, least):
    """By the scatter of 20 pictures.

    Independent samples are not many more than needed: beside the ball the sky looks noisy to the smoothed
    survey.  Of low-discrepancy ones less is asked, the survey's law being too pessimistic.
    """
    session = request.getfixturevalue(which)
    pictures, told = [], []
    for seed in range(20):
        finished(session, seed, target)
        result = make_result(session, 0, 1)
        pictures.append(result.image[..., 0].astype(float))
        told.append(result.noise)
    noise, error = true_noise(np.array(pictures))
    allowance = 1 + stats.norm.isf(FALSE_ALARM) * error
    assert allowance < 1.15
    assert least * target < noise <= target * allowance
    if least:  # few degrees of freedom, and errors that are not normal, say less
        assert np.mean(told) == pytest.approx(noise, rel=allowance - 1)


def test_a_quiet_half_saves_samples(device):
    """The survey's counted: against an even render of the same noise."""
    target, session = 0.01, opened(device, halves(48))
    render = finished(session, 3, target)
    samples = render.picture.samples.reshape(48, 48)
    assert (samples[:, :12] == LEAST).all()
    assert samples[24, 36] > 10 * LEAST
    spent = samples.mean() + render.survey.samples.mean()
    even = in_lists(session, 3, 64)
    assert spent < 0.8 * 64 * (even.noise / target) ** 2


def test_low_discrepancy_samples_come_in_powers_of_two(sobol):
    """Others are noisier than half as many: what the survey says of them would not hold."""
    render = finished(sobol, 3, 0.03)
    for counts in (render.picture.samples, render.survey.samples):
        assert (np.bitwise_count(counts) == 1).all()
    assert render.picture.samples.min() >= render.survey.samples.max()


# -- ends --------------------------------------------------------------------------------------------


@pytest.mark.parametrize("most", [1, 5, 20, 300])
def test_spp_is_the_most_on_the_mean(half, most):
    """A target out of reach: its surveys keep to the cap too."""
    render = finished(half, 1, 1e-9, most)
    assert 0.75 * most <= render.picture.samples.mean() <= most
    assert render.picture.samples.min() >= 1
    assert render.survey.samples[0] <= max(LEAST, most / 2)


def test_a_target_within_the_cap_does_not_feel_it(half):
    free, under = (finished(half, 1, 0.1, most).picture.samples for most in (None, 10_000))
    assert np.array_equal(free, under)


@pytest.mark.parametrize("ticks", [0, 1, 3, 40, 200])
def test_a_time_limit_leaves_a_whole_picture(half, monkeypatch, ticks):
    """On a clock that ticks when it is looked at; most samples are the picture's whenever that is."""
    clock = itertools.count()
    monkeypatch.setattr(adaptive, "time", SimpleNamespace(perf_counter=lambda: next(clock)))
    render = finished(half, 1, 1e-6, time_limit=ticks + 0.5)
    counts = render.picture.samples
    assert counts.min() >= 1
    assert render.survey.samples.max() <= max(LEAST, counts.mean() / 2)
    result = make_result(half, 0, round(counts.mean()))
    assert np.isfinite(result.image).all()
    assert result.image[:, :4] == pytest.approx(1.0)


@pytest.mark.usefixtures("ctrl_c")
@pytest.mark.parametrize("presses", [1, 4])
def test_ctrl_c_keeps_what_there_is_of_every_pixel(presses):
    """At the first report, which is the survey's, and at a later one."""
    left = [presses]

    def press(_progress):
        left[0] -= 1
        if left[0] == 0:
            signal.raise_signal(signal.SIGINT)

    result = clvol.render(halves(), target_error=1e-6, seed=2, progress=press)
    assert result.stats["interrupted"]
    assert result.aovs["samples"].min() >= 1
    assert result.image[:, :4] == pytest.approx(1.0)
    assert result.metadata["target_error"] == 1e-6
    assert signal.getsignal(signal.SIGINT) is signal.default_int_handler


def test_a_black_scene_ends_and_says_why(device, caplog):
    black = opened(device, inside(thickness=1e6))
    render = finished(black, 1, 0.01)
    assert (render.picture.samples == LEAST).all()
    assert "saw no light" in caplog.text
    assert finished(black, 1, 0.01, most=3).picture.samples.max() == 3


def test_one_sample_has_no_noise_to_be_judged_by(caplog):
    clvol.render(inside(), spp=1, target_error=0.1)
    assert "the noise is unknown, the target was 0.1" in caplog.text


@pytest.mark.parametrize("sampler", ["independent", "sobol"])
def test_a_scene_without_noise_ends_at_once(device, sampler, caplog):
    render = finished(opened(device, inside(thickness=0.0), sampler), 1, 1e-12)
    assert (render.picture.samples == LEAST).all()
    assert (render.survey.samples == LEAST).all()
    assert not [r for r in caplog.records if r.name == "clvol" and r.levelno >= logging.WARNING]


@pytest.mark.parametrize("target", [math.nan, math.inf, 0, 0.0, -0.1, True, "0.1"])
def test_a_target_that_is_no_positive_number_is_refused(target):
    with pytest.raises(OptionError, match="target_error"):
        clvol.render(inside(), target_error=target)


def test_the_pilot_of_techniques_renders_without_a_target(monkeypatch):
    """Its trials are even renders, judged by their own rules."""
    from clvol.lab import pilot

    class AskedError(Exception):
        pass

    def asked(_device, _scene, choices, **_more):
        raise AskedError(choices.target_error)

    monkeypatch.setattr(pilot, "pilot", asked)
    with pytest.raises(AskedError, match="None"):
        clvol.render(inside(), technique="auto:pilot", target_error=0.1)


def test_a_target_and_a_range_of_samples_exclude_each_other():
    with pytest.raises(OptionError, match="target_error and samples"):
        clvol.render(inside(), target_error=0.1, samples=(0, 4))


def test_pictures_of_a_target_do_not_merge():
    one, other = (clvol.render(inside(), target_error=0.3, seed=1) for _ in range(2))
    with pytest.raises(OptionError, match="target error do not merge"):
        clvol.merge([one, other])
    with pytest.raises(OptionError, match="different target_error"):
        clvol.merge([one, clvol.render(inside(), spp=4, seed=1)])


# -- what is told ------------------------------------------------------------------------------------


def test_progress_tells_survey_and_picture_and_never_goes_back(half):
    records = []
    render = finished(half, 4, 0.005, callback=records.append)
    assert [what for what, _ in itertools.groupby(r.what for r in records)][:3] == [
        "survey",
        "rendering",
        "survey",
    ]
    for name in ("samples_done", "seconds"):
        values = [getattr(r, name) for r in records]
        assert values == sorted(values), name
    assert all(0 <= r.fraction <= 1 and r.samples_done <= (r.samples_total or math.inf) for r in records)
    assert records[0].samples_total is None and math.isnan(records[0].noise)
    planned = [r for r in records if r.samples_total is not None]
    assert all(0 <= r.seconds_left < math.inf for r in planned)
    known = [r.noise for r in planned if r.samples_done >= LEAST]
    assert min(known) > 0 and known[0] > 2 * known[-1]
    last = records[-1]
    assert last.samples_done == last.samples_total == int(render.picture.samples.mean())
    assert last.fraction == 1 and last.seconds_left == 0
    estimate = render.picture.uneven_estimate()
    assert last.noise == pytest.approx(relative_noise(*estimate.mean_and_variance(), estimate.dof), rel=1e-5)
    assert last.noise <= 1.05 * 0.005


def test_the_time_left_counts_the_surveys():
    """After 100 of 900 samples, all of them the survey's, in 10 seconds: 80 are left."""
    record = adaptive.TargetProgress(0, 800, 10.0, survey=(100, 100))
    assert record.fraction == pytest.approx(1 / 9)
    assert record.seconds_left == pytest.approx(80)
    assert adaptive.TargetProgress(0, None, 10.0, 20.0, survey=(10, 16)).fraction == 0.5


XML = """<scene version="3.0.0">
  <integrator type="volpath"/>
  <sensor type="perspective">
    <float name="fov" value="30"/>
    <transform name="to_world"><lookat origin="0, 0, -4" target="0, 0, 0" up="0, 1, 0"/></transform>
    <film type="hdrfilm">
      <integer name="width" value="16"/> <integer name="height" value="16"/> <rfilter type="box"/>
    </film>
  </sensor>
  <emitter type="constant"/>
  <shape type="sphere">
    <point name="center" x="-1.2" y="0" z="0"/> <float name="radius" value="1.2"/>
    <bsdf type="null"/>
    <medium name="interior" type="homogeneous">
      <float name="albedo" value="0"/> <float name="sigma_t" value="1.5"/>
    </medium>
  </shape>
</scene>
"""


def test_the_command_renders_to_a_target(tmp_path):
    scene, output = tmp_path / "scene.xml", tmp_path / "a.exr"
    scene.write_text(XML)
    done = CliRunner().invoke(main, ["render", str(scene), "-o", str(output), "--target-error", "0.02", "-v"])
    assert done.exit_code == 0, done.output
    assert "16 x 16 pixels" in done.stdout
    assert "target error 0.02: noise 0.0" in done.stderr
    picture = oiio.ImageInput.open(str(output))
    spec = picture.spec()
    samples = picture.read_image("float")[..., list(spec.channelnames).index("samples")]
    picture.close()
    assert samples.min() == LEAST < samples.max()
    found = {a.name.removeprefix("clvol:"): a.value for a in spec.extra_attribs}
    assert float(found["target_error"]) == pytest.approx(0.02)
    assert float(found["spp"]) == pytest.approx(samples.mean(), abs=1e-3)
    for wrong in ("nan", "0", "-1", "inf"):
        refused = CliRunner().invoke(main, ["render", str(scene), "-o", str(output), "--target-error", wrong])
        assert refused.exit_code == 2
        assert "--target-error" in refused.stderr or "target_error" in refused.stderr
