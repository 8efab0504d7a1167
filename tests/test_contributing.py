"""CONTRIBUTING.md's worked example of a technique compiles, and is right and wrong where it says."""

import re
from pathlib import Path

import pytest
from fields import RAYS, exit_distance
from probe import Probe
from stat_tests import FALSE_ALARM
from walks import collision_p_value, exact_depth, sample_walks, scene_with

from clvol import programs, registry

TEXT = (Path(__file__).resolve().parent.parent / "CONTRIBUTING.md").read_text(encoding="utf-8")
STEPS = TEXT.split("## Adding a technique")[1].split("\n## ")[0]


@pytest.fixture
def registered(monkeypatch):
    """The example as a reader would add it."""
    [header] = re.findall(r"```c\n(.*?)```", STEPS, re.DOTALL)
    [entry] = re.findall(r"```python\n(.*?)```", STEPS, re.DOTALL)
    table = eval("{" + entry + "}", {"Choice": registry.Choice})
    original = programs.kernel_source
    name = next(iter(table.values())).header
    monkeypatch.setattr(programs, "kernel_source", lambda n: header if n == name else original(n))
    monkeypatch.setattr(registry, "TECHNIQUES", registry.TECHNIQUES | table)
    monkeypatch.setitem(registry.FAMILIES, "technique", registry.TECHNIQUES)
    return next(iter(table))


def p_value(device, technique, field):
    length = exit_distance(*RAYS["oblique"])
    probe = Probe(device, scene_with(field), technique=technique, majorant="grid")
    t, *_ = sample_walks(probe, RAYS["oblique"], length, 1 << 16)
    return collision_p_value(t, exact_depth(field, "oblique")[0], length)


def test_the_example_is_right_for_a_constant_medium(device, registered):
    assert p_value(device, registered, "constant") > FALSE_ALARM


def test_the_example_is_wrong_elsewhere(device, registered):
    assert p_value(device, registered, "ramp") < FALSE_ALARM
