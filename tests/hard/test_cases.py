"""Every hard case shows its number: in one way by `pytest -m contract` and `pytest`, but for LONG ones.

Every case in every way, an hour or two, is `pytest tests/hard -m hard_full`; docs/hard-cases.md has what that
found.  All cases of a run together raise a false alarm with probability 1e-4, at fixed seeds.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from stat_tests import sidak

import clvol
from clvol.lab.combinations import unbiased
from clvol.lab.hard import scenes, thickness
from clvol.lab.hard.case import CROSSED, NOISY, SAMPLER, loaded, ways
from clvol.lab.hard.suite import ALPHA, CASES, TURNS, every_way, run, turn

QUICK = [
    case
    for case in CASES
    if case.name.startswith(("sunlit", "in the sun", "majorants"))
    and case.group not in ("chromatic media", "boundaries")
]
"""Of many groups, and rendered by the same kernels."""
LONG = (
    "homogeneous white slab in the sun, thickness 1000, all orders, reflected",
    "before a sky: 200 media, each the exterior of the next",
)
"""Half a minute each, in one way: for `hard_full` alone."""


def name_of(case):
    return case.name


def assert_right(seen, count):
    assert seen.word(sidak(ALPHA, count)) != "WRONG", (
        f"{seen.mean} ± {seen.error} for {seen.expected}, p {seen.p:.2g}, {seen.faults}, {seen.names}"
    )


@pytest.mark.parametrize("case", QUICK, ids=name_of)
def test_a_hard_case_shows_its_number(device, case):
    for seen in run(device, [case], lambda case, _: [turn(case, 1)]):
        assert_right(seen, len(QUICK))
        assert not seen.noisy


@pytest.mark.contract
@pytest.mark.parametrize("case", [c for c in CASES if c not in QUICK and c.name not in LONG], ids=name_of)
def test_every_hard_case_shows_its_number(device, case):
    for seen in run(device, [case], seed=1):
        assert_right(seen, len(CASES))


@pytest.mark.hard_full
@pytest.mark.parametrize("case", CASES, ids=name_of)
def test_every_hard_case_shows_its_number_in_every_way(device, case):
    for seen in run(device, [case], every_way, seed=2):
        assert_right(seen, 105 * len(CASES))
        assert not seen.noisy


def test_a_number_that_is_off_is_noticed(device):
    """Power: by 2 %, of which samples enough tell at any seed; and a picture that is no number at all."""
    case = next(case for case in QUICK if case.name == "sunlit cube, thickness 1")
    off = replace(case, expected=lambda: 1.02 * case.expected(), spp=16 * case.spp)
    (seen,) = run(device, [off], lambda case, _: [turn(case, 1)])
    assert seen.word(ALPHA) == "WRONG"
    assert replace(seen, mean=seen.mean * np.nan, p=0.0).word(ALPHA) == "WRONG"
    assert replace(seen, faults=("1 walks exhausted",), p=1.0).word(ALPHA) == "WRONG"
    assert seen.noise < NOISY < replace(seen, mean=np.zeros(3)).noise


def test_turns_and_the_product_have_every_choice():
    assert len({case.name for case in CASES}) == len(CASES)
    product = list(ways(loaded(QUICK[0])))
    for family in CROSSED:
        assert {way[family] for way in product} >= set(unbiased(family)) - {"none"}
    assert {way["sampler"] for way in product} == set(unbiased("sampler")) == set(SAMPLER.values())
    assert [tuple(turn(QUICK[0], n)[family] for family in CROSSED) for n in range(len(TURNS))] == list(TURNS)


@pytest.mark.parametrize("g", [1.0, -1.0, 0.99999999999, -0.999998, float("nan")])
def test_a_peak_that_single_precision_does_not_tell_is_refused(g):
    """One that it takes for 1 had no light from any sun, and no word."""
    block, phase = thickness.block(1.0), {"type": "hg", "g": g}
    scene = scenes.furnace([block], thickness.EYE, thickness.AHEAD, phase=phase)
    with pytest.raises(clvol.Error, match="'g' of phase 'hg' must be"):
        clvol.load_dict(scene)


def test_analog_techniques_refuse_bounds_that_do_not_hold():
    case = next(case for case in CASES if case.majorant_scale < 1)
    techniques = {way["technique"] for way in ways(loaded(case), case.majorant_scale)}
    assert techniques == set(unbiased("technique")) - {"delta", "decomposition"}


def test_weights_that_grow_are_told(device):
    case = next(case for case in CASES if case.majorant_scale < 1)
    (seen,) = run(device, [case], lambda case, _: [turn(case, 1)])
    assert seen.largest_weight > 2
