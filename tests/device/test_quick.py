"""Kernels built without optimisation: which renders take them, and that nothing but time depends on it."""

import signal

import every_bit
import numpy as np
import pytest
from places import ROOT
from tiers import quick_first

import clvol
from clvol.base.interrupts import interruptible, renew
from clvol.device import quick
from clvol.device.side_builds import Launch, Unit

ROOM = ROOT / "scenes/room.xml"
UNITS = {"a": Unit("a", ("-w",), (Launch("a", 1, 1),)), "b": Unit("b", ("-w",), (Launch("b", 1, 1),))}


@pytest.fixture
def pocl(device, monkeypatch):
    """PoCL, whose cache has nothing, and which has rendered nothing."""
    if not device.is_pocl:
        pytest.skip("the device is not PoCL")
    monkeypatch.setattr(quick, "in_cache", lambda device, units: set())
    before = dict(device.samples)
    device.samples.clear()
    yield device
    device.samples.clear()
    device.samples.update(before)


def unoptimised(units):
    return {name for name, unit in units.now.items() if quick.OPTION in unit.options}


def test_few_samples_are_rendered_by_what_is_built_quickly(pocl):
    units = quick.StageUnits.of(pocl, UNITS, quick.SAMPLES)
    assert unoptimised(units) == {"a", "b"}
    assert units.optimised == UNITS


@pytest.mark.parametrize("samples", [None, quick.SAMPLES + 1])
def test_many_samples_and_any_number_are_worth_optimised_kernels(pocl, samples):
    units = quick.StageUnits.of(pocl, UNITS, samples)
    assert (units.now, units.optimised) == (UNITS, {})
    assert units.when_slow(1e9) == {}


def test_many_small_renders_are_a_large_one(pocl):
    few = quick.SAMPLES // 2
    assert [len(unoptimised(quick.StageUnits.of(pocl, UNITS, few))) for _ in range(3)] == [2, 2, 0]


def test_what_is_optimised_already_is_taken(pocl, monkeypatch):
    monkeypatch.setattr(quick, "in_cache", lambda device, units: {UNITS["a"]})
    assert unoptimised(quick.StageUnits.of(pocl, UNITS, 1)) == {"b"}


def test_another_driver_may_build_other_arithmetic(pocl, monkeypatch):
    monkeypatch.setattr(type(pocl), "is_pocl", False)
    assert unoptimised(quick.StageUnits.of(pocl, UNITS, 1)) == set()


@quick_first("described", [every_bit.scene, lambda: clvol.load_file(ROOM, res=12)], ids=["media", "room"])
def test_bits_are_the_same_and_kernels_change_amid_a_render(pocl, monkeypatch, caplog, described):
    """Media that overlap, or surfaces; several lights; the whole of a small render, and half of one."""

    def picture(**options):
        result = clvol.render(described(), spp=4, seed=3, sampler="joint", **options)
        return np.concatenate([result.image.ravel(), result.variance.ravel()])

    monkeypatch.setattr(quick, "SAMPLES", 0)
    expected = picture()
    monkeypatch.setattr(quick, "SAMPLES", 1 << 15)
    np.testing.assert_array_equal(picture(), expected)
    assert pocl.samples
    monkeypatch.setattr(quick, "SECONDS", 0.0)
    with caplog.at_level("INFO", "clvol"):
        np.testing.assert_array_equal(picture(pool=256), expected)
    assert sum("built anew" in record.message for record in caplog.records) == 1


def test_signals_are_taken_back(ctrl_c):
    with interruptible() as interrupt:
        interrupt.heed(3)
        signal.signal(signal.SIGINT, signal.default_int_handler)
        renew()
        signal.raise_signal(signal.SIGINT)
        assert interrupt.level == 1
