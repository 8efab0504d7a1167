"""Comparisons: what is compared, how it is measured, what is claimed of it, and the report that is left."""

from __future__ import annotations

import json
import re
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from click.testing import CliRunner
from scipy import stats

import clvol
from clvol.choices import Choices
from clvol.cli import main
from clvol.comparison.combine import Lineup, open_lineup
from clvol.comparison.figures import Comparison, compute_figures
from clvol.comparison.measure import REFERENCE_SAMPLES, Plan, measure, seeds_from
from clvol.comparison.names import names_asked, plural
from clvol.comparison.reference import Reference, read_reference
from clvol.comparison.report import as_json, check_folder, write_report
from clvol.comparison.words import _slope
from clvol.errors import OptionError
from clvol.image_io import split_channels, write_exr
from clvol.measure.efficiency import Interval, Work, compare_efficiency, error_products
from clvol.measure.trials import Trial
from clvol.registry import FAMILIES

FALSE_ALARM = 1e-4
SIZE = 16
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


class MadeUp:
    """A trial that renders 1 + bias + noise of variance 1 / spp; a look-up a sample, a second for `rate`."""

    def __init__(self, rate: float = 1e3, bias: float = 0.0, sigma: float = 1.0, ctrl_c: int = 10**9):
        self.rate, self.bias, self.sigma, self.ctrl_c = rate, bias, sigma, ctrl_c
        self.biased, self.names, self.options = bias != 0, {"technique": "delta"}, "--technique delta"
        self.precompute_seconds, self.session = 0.5, SimpleNamespace(kernel_seconds=3.0)
        self.renders: list[tuple[int, int]] = []

    def render(self, seed: int, spp: int) -> SimpleNamespace:
        if len(self.renders) == self.ctrl_c:
            raise KeyboardInterrupt
        self.renders.append((seed, spp))
        noise = np.random.default_rng(seed).standard_normal((SIZE, SIZE, 3)) * self.sigma / np.sqrt(spp)
        seconds = {"render": spp / self.rate}
        return SimpleNamespace(
            image=(1 + self.bias + noise).astype(np.float32),
            stats={"seconds": seconds, "lookups": spp * SIZE**2},
            metadata={"seed": seed},
        )


def measured(trials: dict[str, MadeUp], plan: Plan) -> Comparison:
    """A comparison of made-up trials."""
    told: list[tuple[float, float, str]] = []
    found, reference, interrupted = measure(
        Lineup(trials), plan, None, MadeUp, lambda *record: told.append(record)
    )
    assert all(done <= total + 1e-6 for done, total, _ in told if total)
    labels = list(trials)
    figures = compute_figures(found, reference, labels[0], reference.spp // len(reference.rounds))
    about = {"scene": "<i>x</i>", "rounds": len(found[0].seconds), "odd": float("nan")}
    return Comparison(figures, labels[0], reference, (), (), interrupted, about)


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
    comparison = measured(trials, Plan(rounds=5, seconds=5.0, seed=7))
    fast, slow = (f.measured for f in comparison.figures)
    assert fast.spp == pytest.approx(4000, rel=0.01) and slow.spp == pytest.approx(1000, rel=0.01)
    seeds = [seed for trial in trials.values() for seed, _ in trial.renders]
    assert len(set(seeds)) == len(seeds) and min(seeds) == 7
    assert comparison.reference.spp == REFERENCE_SAMPLES * 5 * fast.spp  # fast is the more efficient
    assert not set(fast.seeds) & set(slow.seeds)


def test_a_biased_combination_never_makes_the_reference() -> None:
    trials = {"biased": MadeUp(bias=0.5, sigma=0.1), "honest": MadeUp()}
    comparison = measured(trials, Plan(rounds=4, spp=8))
    assert comparison.reference.image.mean() == pytest.approx(1, abs=0.05)
    alone = measured({"biased": MadeUp(bias=0.5)}, Plan(rounds=4, spp=8))
    assert alone.reference.image.mean() == pytest.approx(1, abs=0.05)


def test_ctrl_c_keeps_complete_rounds_but_not_too_few() -> None:
    trials = {
        "first": MadeUp(),
        "second": MadeUp(sigma=9.0, ctrl_c=3 + 6),
    }  # three to try it out, then six rounds
    comparison = measured(trials, Plan(rounds=10, spp=4))
    assert comparison.interrupted and len(comparison.figures[0].seconds) == 6
    assert any("Interrupted" in sentence for sentence in comparison.words)
    with pytest.raises(KeyboardInterrupt):
        measured({"first": MadeUp(ctrl_c=4)}, Plan(rounds=10, spp=4))


def test_seeds_leave_out_those_of_a_given_reference() -> None:
    for start in (0, 3, 5, 9):
        seeds = seeds_from(start, (3, 6))
        taken = [next(seeds) for _ in range(8)]
        assert not set(taken) & {3, 4, 5, 6} and len(set(taken)) == 8 and min(taken) >= start
    assert next(seeds_from(2**64)) == 0


# ---- what is claimed


def test_a_technique_does_not_differ_significantly_from_itself(device, scene_file: Path) -> None:
    """Forty comparisons of real renders, cost by look-ups: at most so many are called different as a rate
    of 5 % allows, with a false alarm once in 10,000."""
    trial = Trial.open(device, clvol.load_file(str(scene_file)), Choices(technique="delta"))
    repeats, rounds, spp = 40, 4, 2
    reference = Reference.of_rounds(np.stack([trial.render(n, 400).image for n in range(4)]), 400, "test")
    results = [trial.render(10 + n, spp) for n in range(2 * repeats * rounds)]
    works = []
    for start in range(0, len(results), rounds):
        images = np.stack([r.image for r in results[start : start + rounds]])
        cost = np.array([float(r.stats["lookups"]) for r in results[start : start + rounds]])
        products = error_products(images, reference.image, reference.variance)
        works.append(Work(products, cost, reference_error=reference.product_error))
    found = [compare_efficiency(*pair) for pair in zip(works[::2], works[1::2], strict=True)]
    different = sum(f.p < 0.05 for f in found)
    assert different <= stats.binom.isf(FALSE_ALARM, repeats, 0.05)
    assert all((f.p < 0.05) == (not f.ratio.low <= 1 <= f.ratio.high) for f in found)
    halved = [Work(w.products / 2, w.cost) for w in works]  # and a difference that is there is found
    planted = [compare_efficiency(*pair) for pair in zip(halved[::2], works[1::2], strict=True)]
    assert sum(f.p < 0.05 for f in planted) > repeats / 2


def test_twice_the_samples_a_second_are_twice_the_efficiency_in_words_too() -> None:
    comparison = measured({"a": MadeUp(rate=1000), "b": MadeUp(rate=4000)}, Plan(rounds=8, seconds=64.0))
    by_time = comparison["b"].efficiency["seconds"]
    assert by_time.ratio.low < 4 < by_time.ratio.high and by_time.significant
    assert not comparison["b"].efficiency["lookups"].significant
    assert any(re.match(r"By time, b is .* significantly more", text) for text in comparison.words)
    assert any(re.match(r"By look-ups, b is .* no significant difference", t) for t in comparison.words)


def test_a_planted_bias_is_seen_flattens_the_curve_and_is_told() -> None:
    trials = {"good": MadeUp(sigma=0.5), "bad": MadeUp(bias=0.2)}
    trials["liar"] = MadeUp(bias=0.2)
    trials["liar"].biased = False
    comparison = measured(trials, Plan(rounds=10, spp=16))
    assert [f.verdict.agrees for f in comparison.figures] == [True, False, False]
    assert comparison["good"].slope.low <= -1 <= comparison["good"].slope.high
    assert comparison["bad"].slope.low > -1
    assert comparison["bad"].squared_bias == pytest.approx(0.04, rel=0.2)
    words = " ".join(comparison.words)
    assert "bad flattens" in words and "bad differs from the reference, as its label says" in words
    assert "liar differs from the reference, though neither should be biased" in words


def test_a_slope_that_chance_made_flat_is_not_called_bias() -> None:
    figures = measured({"good": MadeUp()}, Plan(rounds=4, spp=4))["good"]
    flat = replace(figures, slope=Interval(-0.9, -0.95, -0.85))
    assert "find no bias" in _slope(flat) and "flattens" not in _slope(flat)


def test_a_reference_without_variance_is_used_with_a_warning(
    tmp_path: Path, scene_file: Path, caplog
) -> None:
    scene = clvol.load_file(str(scene_file))
    image, variance = np.ones((SIZE, SIZE, 3)), np.full((SIZE, SIZE, 3), 0.25)
    plain, full = tmp_path / "plain.exr", tmp_path / "full.exr"
    write_exr(plain, split_channels("", image), {"digest": "another", "biased": "technique marching"})
    channels = split_channels("", image) | split_channels("variance", variance)
    write_exr(full, channels, {"seeds": "4 9", "spp": 64})
    found = read_reference(full, scene)
    assert found.variance_known and found.seeds == (4, 9) and not caplog.records
    np.testing.assert_allclose(found.rounds.mean(axis=0), image, rtol=1e-5)
    np.testing.assert_allclose(found.rounds.var(axis=0, ddof=1) / len(found.rounds), variance, rtol=1e-4)
    assert not read_reference(plain, scene).variance_known
    assert len(caplog.records) == 3  # no variance, another scene, biased itself
    write_exr(plain, split_channels("", image[:8]), {})
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
    comparison = measured({"a": MadeUp(), "<b>": MadeUp(bias=0.1)}, Plan(rounds=4, spp=4))
    write_report(comparison, tmp_path / "report")
    text = (tmp_path / "report" / "report.json").read_text()
    written = json.loads(text, parse_constant=lambda name: pytest.fail(f"{name} in the JSON"))
    assert written["combinations"][1]["curve"]["rmse"]["value"][0] > 0
    assert written["made"]["odd"] is None
    assert {*written["files"], "report.json"} == {p.name for p in (tmp_path / "report").iterdir()}
    page = (tmp_path / "report" / "report.html").read_text()
    assert "<b>" not in page and "<i>" not in page and "&lt;b&gt;" in page
    assert not re.search(r'(src|href)="(?!data:)', page) and "url(" not in page and "http" not in page
    assert page.count("<img") == len([n for n in written["files"] if n.endswith(".png")]) + 1 + 3 * 2
    assert read_reference(
        tmp_path / "report" / "reference.exr",
        SimpleNamespace(film=SimpleNamespace(window=(0, 0, SIZE, SIZE))),
    ).seeds  # a comparison's reference serves the next one


def test_only_an_earlier_report_is_replaced_and_a_failure_leaves_it(tmp_path: Path, monkeypatch) -> None:
    comparison = measured({"a": MadeUp()}, Plan(rounds=4, spp=4))
    folder = tmp_path / "report"
    monkeypatch.setattr("clvol.comparison.report.plots", lambda _: {})
    comparison.save(folder)
    comparison.save(folder)
    before = sorted(p.name for p in tmp_path.rglob("*"))
    monkeypatch.setattr("clvol.comparison.report.html_report", lambda *_: 1 / 0)
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
    monkeypatch.setattr("clvol.comparison.report.plots", lambda _: {})
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
        (["--baseline", "nobody", "--spp", "1"], "nobody"),
        (["--techniques", "dleta"], "delta"),
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
    comparison = measured({"a": MadeUp(sigma=0.0)}, Plan(rounds=4, spp=4))  # no error at all
    json.dumps(as_json(comparison), allow_nan=False)
    assert "a" in repr(comparison)
