"""A scene that is rendered again has its tables, for as long as it is there, and they are small."""

import copy
import gc
import weakref
from dataclasses import fields, is_dataclass

import numpy as np
import pytest
from probe import medium_of, scene_of

from clvol.errors import OptionError
from clvol.planning.choices import Choices
from clvol.planning.plan import Plan
from clvol.tables import prepare as preparation
from clvol.tables.prepare import prepare
from clvol.volumes.grid import DenseGrid

VALUES = np.random.default_rng(4).random((65, 65, 65), np.float32)
CHOICES = [Choices(technique="decomposition", majorant=kind) for kind in ("grid", "kdtree")]


@pytest.fixture
def scene():
    return scene_of(medium_of(VALUES, 4.0, 0.5))


def prepared(scene, choices):
    return prepare(scene, Plan.of(scene, choices))


def test_a_scene_is_worked_out_once(scene):
    first, again = (prepared(scene, CHOICES[0]) for _ in range(2))
    assert again.volumes is first.volumes
    assert again.majorants is first.majorants
    assert again.plan == first.plan


def test_another_plan_gets_majorants_of_its_own(scene):
    grid, tree = (prepared(scene, choices) for choices in CHOICES)
    assert tree.volumes is grid.volumes
    assert grid.majorants[0].nodes is None
    assert tree.majorants[0].nodes is not None
    fresh = prepared(copy.deepcopy(scene), CHOICES[1])
    assert fresh.volumes is not tree.volumes
    assert np.array_equal(fresh.majorants[0].majorant, tree.majorants[0].majorant)
    assert fresh.plan.settled == tree.plan.settled


def test_what_a_plan_may_not_do_is_refused_each_time(scene):
    prepared(scene, CHOICES[0])
    for _ in range(2):
        with pytest.raises(OptionError, match="step"):
            prepared(scene, Choices(technique="marching", step=1e-9))


def test_tables_go_with_their_scene():
    short_lived = scene_of(medium_of(VALUES, 4.0, 0.5))
    volume = weakref.ref(prepared(short_lived, CHOICES[0]).volumes[0])
    assert volume() is not None
    del short_lived
    gc.collect()
    assert volume() is None


def test_tables_are_small(scene):
    prepared(scene, CHOICES[0])
    assert 0 < bytes_of(scene.kept[preparation.__name__], set()) < 0.12 * VALUES.nbytes


def bytes_of(value, seen):
    """Bytes of all arrays in a record, without those of grids."""
    if id(value) in seen or isinstance(value, DenseGrid):
        return 0
    seen.add(id(value))
    if isinstance(value, np.ndarray):
        return value.nbytes if value.base is None else bytes_of(value.base, seen)
    if isinstance(value, dict):
        return sum(bytes_of(v, seen) for v in value.values())
    if isinstance(value, tuple | list):
        return sum(bytes_of(v, seen) for v in value)
    return sum(bytes_of(getattr(value, f.name), seen) for f in fields(value)) if is_dataclass(value) else 0
