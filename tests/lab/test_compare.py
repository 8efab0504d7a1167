"""Comparisons: what is compared, how it is measured, what is claimed of it, and the report that is left."""

from __future__ import annotations

import json
import re
from dataclasses import replace
from types import SimpleNamespace
from typing import TYPE_CHECKING

import numpy as np
import pytest
from click.testing import CliRunner
from made_up_comparison import SIZE, MadeUp, measured
from scipy import stats

import clvol
from clvol.base.output_files import write_file
from clvol.cli.main import main
from clvol.errors import OptionError
from clvol.lab.comparison.bar import progress_words
from clvol.lab.comparison.combine import open_lineup
from clvol.lab.comparison.entrants import Render
from clvol.lab.comparison.figures import compute_figures
from clvol.lab.comparison.flip import has_flip
from clvol.lab.comparison.measure import REFERENCE_SAMPLES, Effort, Measured
from clvol.lab.comparison.plots import plain_number
from clvol.lab.comparison.reference import Reference, read_reference
from clvol.lab.comparison.report import as_json, check_folder, write_report
from clvol.lab.comparison.shorter import render_slope, shorter_spp, slope_spp
from clvol.lab.comparison.table import text_table
from clvol.lab.comparison.words import _slope
from clvol.lab.names import names_asked, plural
from clvol.lab.seeds import seeds_from
from clvol.lab.statistics import Interval
from clvol.layout import RANDOMIZATIONS
from clvol.picture.image_io import encode_exr, split_channels
from clvol.planning.registry import FAMILIES

if TYPE_CHECKING:
    from pathlib import Path

FALSE_ALARM = 1e-4
CUBE = """<scene version="3.0.0">
  <sensor type="perspective"><float name="fov" value="35"/>
    <transform name="to_world"><lookat origin="0.5,0.5,-1.4" target="0.5,0.5,0.5" up="0,1,0"/></transform>
    <film type="hdrfilm"><integer name="width" value="16"/><integer name="height" value="16"/>
      <rfilter type="box"/></film></sensor>
  <emitter type="constant"><rgb name="radiance" value="1"/></emitter>
  <shape type="cube">
    <transform name="to_world"><translate x="1" y="1" z="1"/><scale value="0.5"/></transform>
    <bsdf type="null"/>
    <medium name="interior" type="heterogeneous"><float name="albedo" value="0.8"/>
      <float name="scale" value="8"/>
      <volume name="sigma_t" type="gridvolume"><string name="filename" value="density.npy"/></volume>
    </medium></shape>
</scene>"""


@pytest.fixture(scope="module")
def scene_file(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A cube of noise under a white sky; its name is not harmless in HTML."""
    folder = tmp_path_factory.mktemp("scene")
    np.save(folder / "density.npy", np.random.default_rng(1).random((6, 6, 6)).astype(np.float32))
    path = folder / "a<b>&c.xml"
    path.write_text(CUBE)
    return path


def film_only() -> SimpleNamespace:
    """What a reference without a digest is compared with."""
    return SimpleNamespace(film=SimpleNamespace(window=(0, 0, SIZE, SIZE)))


# ---- what is compared


def test_every_family_can_be_named_in_the_singular_and_the_plural() -> None:
    for family, names in FAMILIES.items():
        several = list(names)[:2]
        assert names_asked({plural(family): several})[family] == tuple(several)
        assert names_asked({family: ",".join(several)})[family] == tuple(several)
    assert set(names_asked({})) == set(FAMILIES)


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"techniques": "dleta"}, "delta"),
        ({"tehcniques": "delta"}, "techniques"),
        ({"technique": "delta", "techniques": "regular"}, "twice"),
        ({"majorants": []}, "no majorant"),
        ({"technique": "delta,auto:pilot"}, "for clvol render only"),
    ],
)
def test_names_that_won_t_do_are_refused(options: dict, message: str) -> None:
    with pytest.raises(OptionError, match=message):
        names_asked(options)


def test_doubles_are_measured_once_and_impossible_ones_left_out(device, scene_file: Path) -> None:
    scene = clvol.load_file(str(scene_file))
    asked = names_asked({"techniques": "auto,delta,regular", "lookup": "stochastic", "transmittance": "none"})
    lineup = open_lineup(device, scene, asked)
    assert list(lineup.trials) == ["delta"] and lineup.doubles == (("delta", "delta"),)
    [(asked_for, reason)] = lineup.left_out
    assert asked_for == "regular" and "bias" in reason
    with pytest.raises(OptionError, match="none of these"):
        open_lineup(device, scene, names_asked({"techniques": "regular", "lookup": "stochastic"}))
    with pytest.raises(OptionError, match="nothing marches"):
        open_lineup(device, scene, names_asked({}), step=0.1)


# ---- how it is measured


def test_rounds_take_equal_time_seeds_differ_and_the_reference_has_ten_times_the_samples() -> None:
    trials = {"fast": MadeUp(rate=4000), "slow": MadeUp(rate=1000)}
    comparison = measured(trials, Effort(rounds=5, seconds=5.0, seed=7))
    fast, slow = (f.measured for f in comparison.figures)
    assert fast.spp == pytest.approx(4000, rel=0.01) and slow.spp == pytest.approx(1000, rel=0.01)
    assert [*fast.shorter] == [fast.spp // 4**step for step in range(1, 6)]
    assert fast.picture.spp == pytest.approx(4 * slow.picture.spp, rel=0.01)  # in the same time
    assert fast.picture.seconds == pytest.approx(1.0, rel=0.01)
    assert all(f.render_slope.low < -1 < f.render_slope.high for f in comparison.figures)
    assert "compatible with the -1 of independent" in " ".join(comparison.words)
    seeds = [seed for trial in trials.values() for seed, _ in trial.renders]
    assert len(set(seeds)) == len(seeds) and min(seeds) == 7
    assert comparison.reference.spp == REFERENCE_SAMPLES * 5 * fast.spp  # fast is the more efficient
    assert not set(fast.seeds) & set(slow.seeds)


def test_a_biased_combination_never_makes_the_reference() -> None:
    trials = {"biased": MadeUp(bias=0.5, sigma=0.1), "honest": MadeUp()}
    comparison = measured(trials, Effort(rounds=4, spp=8))
    assert comparison.reference.image.mean() == pytest.approx(1, abs=0.05)
    alone = measured({"biased": MadeUp(bias=0.5)}, Effort(rounds=4, spp=8))
    assert alone.reference.image.mean() == pytest.approx(1, abs=0.05)


def test_ctrl_c_keeps_complete_rounds_but_not_too_few() -> None:
    before, each = 4 + 1, 2  # trying it out and a picture; rounds of 4 samples and of 1
    trials = {"first": MadeUp(), "second": MadeUp(sigma=9.0, ctrl_c=before + 6 * each)}
    comparison = measured(trials, Effort(rounds=10, spp=4))
    assert comparison.interrupted and len(comparison.figures[0].seconds) == 6
    assert any("Interrupted" in sentence for sentence in comparison.words)
    with pytest.raises(KeyboardInterrupt):
        measured({"first": MadeUp(ctrl_c=before + 1)}, Effort(rounds=10, spp=4))


def test_seeds_leave_out_those_of_a_given_reference() -> None:
    for start in (0, 3, 5, 9):
        seeds = seeds_from(start, (3, 6))
        taken = [next(seeds) for _ in range(8)]
        assert not set(taken) & {3, 4, 5, 6} and len(set(taken)) == 8 and min(taken) >= start
    assert next(seeds_from(2**64)) == 0


# ---- what is claimed


def test_twice_the_samples_a_second_are_twice_the_efficiency_in_words_too() -> None:
    """Its 95 % interval has the truth in so many of 40 comparisons, with a false alarm once in 10,000."""
    repeats, covered, planted = 40, 0, 0
    for repeat in range(repeats):
        effort = Effort(rounds=8, seconds=64.0, seed=1000 * repeat)
        comparison = measured({"a": MadeUp(rate=1000), "b": MadeUp(rate=4000)}, effort)
        by_time = comparison["b"].efficiency["seconds"]
        assert by_time.significant
        covered += by_time.ratio.low < 4 < by_time.ratio.high
        planted += by_time.ratio.low < 5 < by_time.ratio.high
    assert covered >= stats.binom.ppf(FALSE_ALARM, repeats, 0.95) > planted
    assert not comparison["b"].efficiency["lookups"].significant
    assert any(re.match(r"By time, b is .* significantly more", text) for text in comparison.words)
    assert any(re.match(r"By look-ups, b is .* no significant difference", t) for t in comparison.words)


def test_a_planted_bias_is_seen_flattens_the_curve_and_is_told() -> None:
    trials = {"good": MadeUp(sigma=0.5), "bad": MadeUp(bias=0.2)}
    trials["liar"] = MadeUp(bias=0.2)
    trials["liar"].biased = False
    comparison = measured(trials, Effort(rounds=10, spp=16))
    assert [f.verdict.agrees for f in comparison.figures] == [True, False, False]
    assert comparison["good"].slope.low <= -1 <= comparison["good"].slope.high
    assert comparison["bad"].slope.low > -1
    assert comparison["bad"].squared_bias == pytest.approx(0.04, rel=0.2)
    words = " ".join(comparison.words)
    assert "bad flattens" in words and "bad differs from the reference, as its label says" in words
    assert "liar differs from the reference, though neither should be biased" in words


def test_the_slope_of_one_render_over_its_samples_and_its_interval() -> None:
    """Covers what it says, whatever the slope; one combination has -1.4 and is told from -1."""
    random, comparisons, covered, steeper = np.random.default_rng(5), 1000, 0, 0
    for _ in range(comparisons):
        found = render_slope({n: n**-1.4 * random.chisquare(50, 10) / 50 for n in (64, 16, 4)})
        covered += found.low <= -1.4 <= found.high
        steeper += found.high < -1
    assert covered >= stats.binom.ppf(FALSE_ALARM, comparisons, 0.95) and covered < comparisons
    assert steeper > 0.9 * comparisons
    assert shorter_spp(64) == (16, 4, 1) and shorter_spp(15) == (3,) and shorter_spp(1) == ()
    assert slope_spp(1024) == (256, 64) and slope_spp(31) == (7,) and slope_spp(15) == ()
    assert np.isnan(render_slope({4: np.ones(10)}).value)


def test_a_slope_that_chance_made_flat_is_not_called_bias() -> None:
    figures = measured({"good": MadeUp()}, Effort(rounds=4, spp=4))["good"]
    flat, steep = (replace(figures, slope=Interval(*ends)) for ends in ((-0.9, -0.95, -0.85), (-2, -3, -1.5)))
    assert "chance does that" in _slope(flat) and "flattens" not in _slope(flat)
    assert "chance does that" in _slope(steep) and "separate renders of 4 spp" in _slope(steep)


def rare(random: np.random.Generator, spp: int) -> np.ndarray:
    """Grey light: 1, and one sample in 1024 of 256 more; float32 (SIZE, SIZE, 3)."""
    bright = 256.0 * random.binomial(spp, 1 / 1024, (SIZE, SIZE, 1)) / spp
    return np.repeat(1 + bright, 3, axis=-1).astype(np.float32)


def test_rare_bright_samples_are_no_bias_against_a_given_reference(tmp_path: Path) -> None:
    """Four samples of each pixel against thousands.

    A third of such pictures have seen no bright one, and are certain of what they lack unless told by how
    many samples the reference is ahead.
    """
    random, scene, spp = np.random.default_rng(3), film_only(), 1024
    rounds = np.stack([rare(random, spp) for _ in range(16)])
    truth = Reference.of_rounds(rounds, spp, "made up")
    path = tmp_path / "reference.exr"
    channels = split_channels("", truth.image) | split_channels("variance", truth.variance)
    write_file(path, encode_exr(channels, {"spp": truth.spp, "dof": 15}))
    given = read_reference(path, scene)
    assert given.round_spp == spp
    alarms = {name: 0 for name in ("as it is", "samples unknown")}
    for _ in range(20):
        images = np.stack([rare(random, 1) for _ in range(4)])
        trial, ones = MadeUp(), np.ones(4)
        picture = Render(images[0], 1.0, 1.0, 1, 1)
        found = [Measured("delta", trial, 1, images, ones, ones, (1, 2, 3, 4), picture)]
        for name, reference in (("as it is", given), ("samples unknown", replace(given, spp=None))):
            alarms[name] += not compute_figures(found, reference, "delta")[0].verdict.agrees
    assert alarms["as it is"] == 0 < 3 < alarms["samples unknown"]


def test_a_given_variance_counts_with_the_freedom_it_has(tmp_path: Path, device, scene_file: Path) -> None:
    scene, path = clvol.load_file(str(scene_file)), tmp_path / "few.exr"
    result = clvol.render(scene, spp=8, technique="delta", sampler="sobol", seed=1)
    result.save(path)
    found = read_reference(path, scene)
    assert len(found.rounds) == result.dof + 1 == RANDOMIZATIONS
    np.testing.assert_allclose(found.rounds.var(axis=0, ddof=1) / 4, result.variance, rtol=1e-3, atol=1e-9)
    away = (found.rounds - found.image)[:, (result.variance > 0).all(axis=-1)]
    away /= np.sqrt(4 * result.variance[(result.variance > 0).all(axis=-1)])
    np.testing.assert_allclose(away[..., 0], away[..., 2], atol=1e-2)  # channels share their noise


def test_renders_that_draw_from_sobol_have_a_power_of_two_of_samples() -> None:
    trials = {"a": MadeUp(rate=1100), "b": MadeUp(rate=3)}
    plain = measured(trials, Effort(rounds=4, seconds=4.0))
    assert plain["a"].measured.spp == pytest.approx(1100, abs=1)
    trials["a"].names = {"technique": "delta", "sampler": "sobol"}
    drawn = measured(trials, Effort(rounds=4, seconds=4.0))
    assert [f.measured.spp for f in drawn.figures] == [1024, 4] and drawn.reference.spp == 4 * 8192
    assert any("at 4 against 1024 spp a render" in text for text in drawn.words)
    assert not any("Sobol'" in text for text in drawn.words)
    assert any("it has 6" in text for text in measured(trials, Effort(rounds=4, spp=6)).words)


def test_what_only_the_first_open_pays_for_is_not_the_first_combination_s(monkeypatch) -> None:
    seconds = iter([0.319, 0.21, 0.21, 0.21])

    def opened(_device, _scene, choices) -> MadeUp:
        trial = MadeUp()
        trial.precompute_seconds, trial.names = (
            next(seconds),
            dict.fromkeys(FAMILIES, choices.names["technique"]),
        )
        return trial

    monkeypatch.setattr("clvol.lab.comparison.combine.Trial.open", opened)
    scene = SimpleNamespace(integrator=SimpleNamespace(choices={}, aovs=()))
    lineup = open_lineup(None, scene, names_asked({"techniques": "delta,spectral"}))
    assert [trial.precompute_seconds for trial in lineup.trials.values()] == [0.21, 0.21]


def test_the_table_cuts_no_name_however_long() -> None:
    labels = [f"weighted-decomposition/residual-ratio/kdtree/stochastic/{'x' * 90}/{n}" for n in range(2)]
    lines = repr(measured({label: MadeUp() for label in labels}, Effort(rounds=4, spp=4))).splitlines()
    assert all(sum(label in line for line in lines) == 1 for label in labels)


def test_a_narrow_terminal_has_a_paragraph_a_combination_and_a_star_its_footnote() -> None:
    made = measured({"a": MadeUp(rate=1000), "b": MadeUp(rate=4000)}, Effort(rounds=8, seconds=64.0))
    wide, narrow = text_table(made, 1000), text_table(made, 80)
    assert max(map(len, narrow.splitlines())) <= 80 and {"a", "b"} < {*narrow.splitlines()}
    assert "no bias seen" in wide and "no bias seen" in narrow
    for samples in ("at 8 × 8000 spp", "at 32000 against 8000 spp"):
        assert samples in wide and samples in narrow.replace("\n  ", " ")
    assert wide.endswith("* significantly different from a") and narrow.endswith("different from a")
    assert "*" not in text_table(measured({"a": MadeUp(), "b": MadeUp()}, Effort(rounds=4, spp=4)))


def test_one_combination_is_compared_with_a_reference_only(scene_file: Path, caplog) -> None:
    scene = clvol.load_file(str(scene_file))
    for techniques in ("auto", "delta,delta"):
        with pytest.raises(OptionError, match="only one combination: nothing to compare"):
            clvol.compare(scene, techniques=techniques)
    assert "technique delta is asked for more than once" in caplog.text
    with pytest.raises(OptionError, match="auto comes to the same as delta"):
        clvol.compare(scene, techniques="delta,auto")


def test_axes_read_plainly_and_the_progress_knows_what_is_left() -> None:
    numbers = (0.06, 1, 2000, 1e8, 5e-7)
    assert [plain_number(n) for n in numbers] == ["0.06", "1", "2000", "$10^{8}$", "5·$10^{-7}$"]
    assert progress_words(3, 12, 4) == "passed, 25 % done, 12 s left" and "7 s" in progress_words(0, 7, 1)


def test_a_reference_without_variance_is_used_with_a_warning(
    tmp_path: Path, scene_file: Path, caplog
) -> None:
    scene = clvol.load_file(str(scene_file))
    image, variance = np.ones((SIZE, SIZE, 3)), np.full((SIZE, SIZE, 3), 0.25)
    plain, full = tmp_path / "plain.exr", tmp_path / "full.exr"
    write_file(
        plain, encode_exr(split_channels("", image), {"digest": "another", "biased": "technique marching"})
    )
    channels = split_channels("", image) | split_channels("variance", variance)
    write_file(full, encode_exr(channels, {"seeds": "4 9", "spp": 64}))
    found = read_reference(full, scene)
    assert found.variance_known and found.seeds == (4, 9) and not caplog.records
    np.testing.assert_allclose(found.rounds.mean(axis=0), image, rtol=1e-5)
    np.testing.assert_allclose(found.rounds.var(axis=0, ddof=1) / len(found.rounds), variance, rtol=1e-4)
    assert not read_reference(plain, scene).variance_known
    assert len(caplog.records) == 3  # no variance, another scene, biased itself
    write_file(plain, encode_exr(split_channels("", image[:8]), {}))
    for path, message in (
        (plain, "16 x 8"),
        (tmp_path / "none.exr", "no such file"),
        (scene_file, "an .exr"),
    ):
        with pytest.raises(OptionError, match=message):
            read_reference(path, scene)
    full.write_bytes(full.read_bytes()[:300])
    with pytest.raises(OptionError, match="cannot be read"):
        read_reference(full, scene)


# ---- the report


def test_the_report_is_whole_escaped_and_without_nan(tmp_path: Path) -> None:
    comparison = measured({"a": MadeUp(), "<b>": MadeUp(bias=0.1)}, Effort(rounds=4, spp=4))
    write_report(comparison, tmp_path / "report")
    text = (tmp_path / "report" / "report.json").read_text()
    written = json.loads(text, parse_constant=lambda name: pytest.fail(f"{name} in the JSON"))
    assert written["combinations"][1]["curve"]["rmse"]["value"][0] > 0
    assert written["made"]["odd"] is None
    assert {*written["files"], "report.json"} == {p.name for p in (tmp_path / "report").iterdir()}
    page = (tmp_path / "report" / "report.html").read_text()
    assert "<b>" not in page and "<i>" not in page and "&lt;b&gt;" in page
    assert not re.search(r'(src|href)="(?!data:)', page) and "url(" not in page and "http" not in page
    rows = 3 if has_flip() else 2
    plots = len([name for name in written["files"] if name.endswith(".png")])
    assert page.count("<img") == plots + 1 + 2 * (rows + 2)
    assert read_reference(
        tmp_path / "report" / "reference.exr",
        film_only(),
    ).seeds  # a comparison's reference serves the next one


def test_only_an_earlier_report_is_replaced_and_a_failure_leaves_it(tmp_path: Path, monkeypatch) -> None:
    comparison = measured({"a": MadeUp()}, Effort(rounds=4, spp=4))
    folder = tmp_path / "report"
    monkeypatch.setattr("clvol.lab.comparison.report.plots", lambda _: {})
    comparison.save(folder)
    comparison.save(folder)
    before = sorted(p.name for p in tmp_path.rglob("*"))
    monkeypatch.setattr("clvol.lab.comparison.report.html_report", lambda *_: 1 / 0)
    with pytest.raises(ZeroDivisionError):
        comparison.save(folder)
    assert sorted(p.name for p in tmp_path.rglob("*")) == before
    (folder / "notes.txt").write_text("mine")
    for place, message in (
        (folder, "notes.txt"),
        (folder / "notes.txt", "is a file"),
        (tmp_path / "no" / "where", "no such folder"),
    ):
        with pytest.raises(OptionError, match=message):
            check_folder(place)


def test_the_command_measures_and_writes(tmp_path: Path, scene_file: Path, monkeypatch) -> None:
    monkeypatch.setattr("clvol.lab.comparison.report.plots", lambda _: {})
    arguments = ["compare", str(scene_file), "--technique", "delta,regular", "--spp", "2", "--rounds", "4"]
    found = CliRunner().invoke(main, [*arguments, "--baseline", "regular", "-o", str(tmp_path / "r")])
    assert found.exit_code == 0, found.output
    written = json.loads((tmp_path / "r" / "report.json").read_text())
    assert [c["label"] for c in written["combinations"]] == ["delta", "regular"]
    assert written["baseline"] == "regular" and "--technique delta,regular" in written["made"]["command"]
    assert "as efficient as regular" in found.output
    again = [*arguments, "--reference", str(tmp_path / "r" / "reference.exr"), "-o", str(tmp_path / "r")]
    found = CliRunner().invoke(main, again)
    assert found.exit_code == 0, found.output
    written = json.loads((tmp_path / "r" / "report.json").read_text())
    assert written["reference"]["source"] == "given: reference.exr"


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["--spp", "2", "--time", "3"], "not both"),
        (["--techniques", "delta,regular", "--baseline", "nobody", "--spp", "1"], "nobody"),
        (["--techniques", "dleta"], "delta"),
        (["--techniques", "delta,regular", "--spp", "100000000000"], "--spp 100000000000 is too many"),
        (["--techniques", "delta,regular", "--reference-spp", "100000000000"], "is too many"),
        (["--techniques", "delta,regular", "--rounds", "100000000000"], "is too many"),
        (["--reference", "missing.exr"], "no such file"),
    ],
)
def test_mistakes_on_the_command_line(
    tmp_path: Path, scene_file: Path, arguments: list[str], message: str
) -> None:
    found = CliRunner().invoke(main, ["compare", str(scene_file), *arguments, "-o", str(tmp_path / "r")])
    assert found.exit_code == 2 and message in found.output and "Traceback" not in found.output
    assert not (tmp_path / "r").exists()


def test_as_json_holds_plain_values_only() -> None:
    comparison = measured({"a": MadeUp(sigma=0.0)}, Effort(rounds=4, spp=4))  # no error at all
    json.dumps(as_json(comparison), allow_nan=False)
    assert "a" in repr(comparison)
