"""`clvol selftest`: a sound scene passes, a planted bias does not and is named.

The judgement is tested on made-up pictures; the whole of it on a homogeneous cube, whose kernels are small.
"""

import itertools

import numpy as np
import pytest
from click.testing import CliRunner
from pictures import box, gridded, homogeneous, picture, volume
from scipy import stats
from tiers import quick_first

import clvol
from clvol.cli.main import main
from clvol.cli.selftest import notes, table_of
from clvol.device import programs
from clvol.errors import OptionError
from clvol.lab import judgement
from clvol.lab import selftest as selftests
from clvol.lab.combinations import KEYS, covering, in_force, unbiased, usable
from clvol.lab.judgement import judge
from clvol.lab.reduced import reduced
from clvol.lab.seeds import independent_seeds
from clvol.lab.trials import rounds
from clvol.lab.verdict import SelfTest
from clvol.planning.plan import Plan
from clvol.planning.registry import FAMILIES
from clvol.scene.records import ConstantEmitter, DirectionalEmitter, Film

CUBE = (0.0, 0.0, 0.0), (1.0, 1.0, 1.0)
SKY, SUN = ConstantEmitter(), DirectionalEmitter((2.0,), (0.0, -1.0, 0.0))


def scene(medium, lights=(SKY, SUN)):
    return picture([box(*CUBE, medium)], lights, (0.4, 0.5, -3.0), (0.5, 0.5, 0.5), 30.0, (8, 8))


def lumps(scale=(3.0,)):
    return gridded(volume(np.random.default_rng(1).random((5, 6, 7)), *CUBE), 0.7, scale=scale)


# -- which combinations -------------------------------------------------------------------------------


@quick_first("medium", [lumps((3.0, 2.0, 1.0)), lumps(), homogeneous(1.0, 0.5)])
def test_every_choice_that_is_in_use_occurs(medium):
    plan = Plan.of(scene(medium))
    all_of_them = set(usable(plan))
    first = dict(zip(KEYS, next(iter(all_of_them)), strict=True))
    found = covering(plan, first)
    had = [first, *(in_force(plan, names) for names in found.combinations)]
    for n, key in enumerate(KEYS):
        assert {one[key] for one in had} == {row[n] for row in all_of_them}
    for names in found.combinations:
        assert all(name in unbiased(family) for family, name in names.items())
    more = covering(plan, first, most=len(found.combinations) + 5)
    assert len(more.combinations) <= len(found.combinations) + 5 and more.pairs >= found.pairs
    assert len(all_of_them) > len(had) or medium.homogeneous


def test_a_smaller_film_keeps_its_shape_and_crop():
    whole = scene(homogeneous(1.0))
    film = Film(400, 300, crop=(100, 60, 200, 120))
    small = reduced(type(whole)(whole.sensor, film, whole.integrator, whole.shapes, whole.emitters), 600).film
    assert small.window[2] * small.window[3] == pytest.approx(600, rel=0.1)
    assert small.width / small.height == pytest.approx(4 / 3, rel=0.05)
    assert small.crop[0] / small.width == pytest.approx(0.25, rel=0.1)
    assert reduced(whole, 64) is whole


def test_seeds_of_one_purpose_are_not_those_of_another():
    first, second = (
        [seed for seed, _ in zip(independent_seeds(3, p), range(50), strict=False)] for p in ("a", "b")
    )
    assert len({*first, *second, 3}) == 101
    assert first == [seed for seed, _ in zip(independent_seeds(3, "a"), range(50), strict=False)]


# -- judging made-up pictures -------------------------------------------------------------------------


def made_up(rng, choices, bias=None, weight=1.0):
    """Pictures of combinations named by (technique, transmittance), of which some are brighter."""
    found = []
    for technique, transmittance in choices:
        factor = 1.0 if bias is None else bias(technique, transmittance)
        names = {family: "none" for family in FAMILIES} | {
            "technique": technique,
            "transmittance": transmittance,
        }
        images = factor * rng.normal(1.0, 0.2, (4, 16, 16, 3))
        found.append(
            judgement.Tested(f"{technique} {transmittance}", names, False, images, largest_weight=weight)
        )
    return found


GRID = [(t, e) for t in ("delta", "regular", "spectral") for e in ("ratio", "regular", "power-series")]


def test_a_sound_set_is_accused_no_more_often_than_stated():
    rng, alpha, tries = np.random.default_rng(5), 0.05, 60
    accused = 0
    for _ in range(tries):
        tested = made_up(rng, GRID[:5])
        judge(tested, alpha)
        accused += not all(one.agrees for one in tested)
    assert accused <= stats.binom.isf(1e-4, tries, alpha)


def test_the_one_that_is_wrong_is_the_one_that_is_named():
    """By so much that each of the others would disagree with a pool that holds it."""
    tested = made_up(np.random.default_rng(1), GRID, lambda *pair: 1.3 if pair == GRID[4] else 1.0)
    judge(tested, 1e-4)
    assert [one.options for one in tested if not one.agrees] == ["regular regular"]


def test_what_the_wrong_ones_share_is_named():
    tested = made_up(np.random.default_rng(1), GRID, lambda technique, e: 0.9 if e == "ratio" else 1.0)
    found = judge(tested, 1e-4)
    assert [one.names["transmittance"] for one in tested if not one.agrees] == ["ratio"] * 3
    (contrast,) = found.guilty
    assert contrast.why.startswith("The 3 combinations of transmittance ratio DISAGREE with the 6 others")


def test_a_bias_that_many_share_is_not_hidden_in_what_they_are_compared_with():
    """Of the least size that the self-test says it sees: two thirds of the combinations, then half of them.

    The test of each combination alone, against a pool of mostly guilty ones, sees far less.
    """
    clean = made_up(np.random.default_rng(1), GRID)
    limit = max(judge(clean, 1e-4).limits)
    seen, tries = 0, 15
    for n in range(tries):
        tested = made_up(np.random.default_rng(n), GRID, lambda t, e: 1.0 if e == "ratio" else 1 + limit)
        (contrast, *_) = judge(tested, 1e-4).guilty or [None]
        seen += contrast is not None and len(contrast.accused) == 3
    assert seen >= stats.binom.ppf(1e-4, tries, 0.95)
    assert limit < 0.7 * min(one.agreement.smallest_bias for one in clean)


def test_of_an_even_split_both_sides_are_named():
    pairs = [(t, e) for t in ("delta", "regular", "spectral") for e in ("ratio", "regular")]
    tested = made_up(np.random.default_rng(1), pairs, lambda t, e: 1.1 if e == "ratio" else 1.0)
    (contrast,) = judge(tested, 1e-4).guilty
    assert "of transmittance ratio DISAGREE with the 3 of transmittance regular" in contrast.why
    assert "cannot be told" in contrast.why and not any(one.agrees for one in tested)


def by_chance(rng, choices, chance):
    """The light is sampled by the first half, and found by the others: with a small chance in a pixel."""
    tested = made_up(rng, choices)
    for n, one in enumerate(tested):
        one.names["lights"] = "sampled" if n < len(tested) / 2 else "found"
        if one.names["lights"] == "found":
            one.images = (rng.random((4, 16, 16, 1)) < chance) / chance * np.ones(3)
            one.found = 1 / chance
    return tested


@pytest.mark.parametrize("chance", [1e-5, 1e-3])
def test_lights_found_by_chance_alone_leave_it_open(chance):
    """No hit of the light in 1024 chances, or a few in some tiles and none in others: no accusation."""
    for seed in range(10):
        tested = by_chance(np.random.default_rng(seed), GRID, chance)
        judged = judge(tested, 1e-2)
        assert all(one.agrees for one in tested) and not judged.guilty
        assert all(one.doubtful is (one.found > 0) for one in tested)
    for one in tested:
        one.found = 0.0
    judge(tested, 1e-2)
    assert chance == 1e-3 or not all(one.agrees for one in tested)  # black pictures, if it were not known


def test_of_two_both_are_named_and_large_weights_leave_it_open():
    for weight, agrees in ((1.0, False), (1e4, True)):
        rng = np.random.default_rng(1)
        tested = made_up(rng, GRID[:2], lambda t, e: 1.2 if e == "ratio" else 1.0, weight)
        judge(tested, 1e-4)
        assert all(one.agrees is agrees and one.doubtful is agrees for one in tested)


def test_a_noisy_combination_does_not_make_the_others_blind():
    rng = np.random.default_rng(2)
    tested = made_up(rng, GRID)
    tested[0].images = 1.0 + 20.0 * (tested[0].images - 1.0)
    judge(tested, 1e-4)
    seen = [one.agreement.smallest_bias for one in tested]
    assert seen[0] > 0.1 and max(seen[1:]) < 0.04


def test_nothing_of_the_table_is_cut_on_a_narrow_terminal():
    tested = made_up(np.random.default_rng(3), GRID)
    judge(tested, 1e-4)
    for one in tested:
        one.names["majorant"] = "x" * 40 + one.names["technique"]
    found = SelfTest(tested, 1e-4, (16, 16), 4, 4, 1, 1, [], 1.06, 74.2)
    narrow, uncut = table_of(found, 80), table_of(found)
    assert max(map(len, narrow)) <= 80 and len(uncut) == 1 + 2 * len(tested)
    assert " ".join(narrow).split() == " ".join(uncut).split()
    for n, (one, row, options) in enumerate(zip(tested, uncut[1::2], uncut[2::2], strict=True), start=1):
        assert row.split()[0] == str(n) and row.endswith("agrees")
        assert all(f"{f} {one.names[f]}" in options for f in ("technique", "transmittance"))
        assert "sampler" not in options  # the same for all
    assert "1.1 s of rendering, 74 s of building kernels" in notes(found)[0]


@pytest.mark.parametrize(
    ("totals", "needs_bound", "passed"),
    [
        ({}, True, True),
        ({"non_finite": 1}, False, False),
        ({"walks_exhausted": 2}, False, False),
        ({"majorant_violations": 3}, True, False),
        ({"majorant_violations": 3}, False, True),
    ],
)
def test_counts_that_no_sound_render_has_are_faults(totals, needs_bound, passed):
    tested = made_up(np.random.default_rng(3), GRID[:2])
    judge(tested, 1e-4)
    tested[0].totals, tested[0].needs_bound = totals, needs_bound
    found = SelfTest(tested, 1e-4, (16, 16), 4, 4, 1, 1, [], 1.0)
    assert found.passed is passed and ("FAULTY" in found.verdict) is not passed


# -- the whole of it ----------------------------------------------------------------------------------

SCENE = """<scene version="3.0.0">
  <integrator type="volpath"/>
  <sensor type="perspective"><float name="fov" value="30"/>
    <transform name="to_world"><lookat origin="0.4, 0.5, -4" target="0, 0, 0" up="0, 1, 0"/></transform>
    <film type="hdrfilm">
      <integer name="width" value="16"/> <integer name="height" value="16"/> <rfilter type="box"/>
    </film>
  </sensor>
  <emitter type="constant"/>
  <shape type="cube"> <bsdf type="null"/>
    <medium name="interior" type="homogeneous"> <float name="albedo" value="0.8"/> </medium>
  </shape>
</scene>
"""


def run(tmp_path, *options):
    path = tmp_path / "scene.xml"
    path.write_text(SCENE)
    return CliRunner().invoke(main, ["selftest", str(path), "--quick", *options])


def test_a_sound_scene_passes_and_a_planted_bias_does_not(tmp_path, monkeypatch):
    sound = run(tmp_path, "--time", "0.5")
    assert sound.exit_code == 0, sound.output
    assert "combinations agree. A bias of" in sound.stdout and "technique marching" in sound.stdout
    original, name = programs.kernel_source, "tracking/homogeneous_transmittance.h"

    def source(wanted):
        text = original(wanted)
        if wanted != name:
            return text
        assert "in->scale * in->t_max" in text
        return text.replace("in->scale * in->t_max", "0.8f * in->scale * in->t_max")

    monkeypatch.setattr(programs, "kernel_source", source)
    wrong = run(tmp_path, "--time", "0.5")
    assert wrong.exit_code == 1, wrong.output
    assert "DISAGREE" in wrong.stdout.splitlines()[-1]
    found = clvol.selftest(clvol.load_file(tmp_path / "scene.xml"), quick=True, spp=128)
    assert not found.passed
    accused = {one.names["lights"] for one in found.disagreeing}  # those who sample lights, or who find them
    assert len(accused) == 1 and not accused & {one.names["lights"] for one in found.tested if one.agrees}


@pytest.mark.parametrize("complete", [1, 2])
def test_an_interrupt_leaves_complete_rounds_to_be_judged(tmp_path, monkeypatch, complete):
    def interrupted(*arguments):
        yield from itertools.islice(rounds(*arguments), complete)
        raise KeyboardInterrupt

    monkeypatch.setattr(selftests, "rounds", interrupted)
    monkeypatch.setattr(selftests, "affordable", lambda *_: (4, 12))
    found = run(tmp_path)
    assert found.exit_code == 130
    if complete == 1:
        assert found.stderr.strip() == "clvol: interrupted before the second round: no verdict"
        assert not found.stdout
    else:
        assert "2 rounds of 4 spp each, interrupted before all 12;" in found.stdout
        assert "combinations agree" in found.stdout.splitlines()[-1]


def test_mistakes_are_told_in_one_line(tmp_path):
    missing = CliRunner().invoke(main, ["selftest", str(tmp_path / "none.xml")])
    assert missing.exit_code == 2 and len(missing.stderr.splitlines()) == 1
    for options in ({"alpha": 2.0}, {"seconds": -1.0}):
        with pytest.raises(OptionError):
            clvol.selftest(scene(homogeneous(1.0)), **options)
    with pytest.raises(OptionError, match="Scene"):
        clvol.selftest("scene.xml")
