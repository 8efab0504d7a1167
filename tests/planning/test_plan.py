"""The plan of a render: worked out once, from records and choices alone, and said with its reasons."""

import inspect
import pickle
import re
import subprocess
import sys
from collections import Counter
from dataclasses import FrozenInstanceError, replace
from typing import get_args

import numpy as np
import pytest
from pictures import box, gridded, homogeneous, picture, volume

import clvol
from clvol import layout
from clvol.errors import OptionError
from clvol.planning import auto, inspection, registry
from clvol.planning.choices import Choices
from clvol.planning.features import SAMPLED_LIGHTS, Features
from clvol.planning.plan import Plan
from clvol.planning.settled import FAR_APART, Settled, Tuning
from clvol.scene import boundaries
from clvol.scene.records import ConstantEmitter, ConstVolume, DirectionalEmitter, Emitter, Integrator
from clvol.tables.prepare import prepare

CUBE = (0.0, 0.0, 0.0), (1.0, 1.0, 1.0)
LUMPS = np.random.default_rng(1).random((5, 6, 7))
SKY, SUN = ConstantEmitter(), DirectionalEmitter((2.0,), (0.0, -1.0, 0.0))


def scene(lights=(SKY, SUN), more=(), scale=(3.0,), **choices):
    medium = gridded(volume(LUMPS, *CUBE), 0.7, scale=scale)
    found = picture([box(*CUBE, medium), *more], lights, (0.4, 0.5, -3.0), (0.5, 0.5, 0.5), 30.0, (4, 4))
    return replace(found, integrator=Integrator(choices=choices))


FOG = picture([box(*CUBE, homogeneous(1.0, 0.5))], (SKY,), (0.4, 0.5, -3.0), (0.5, 0.5, 0.5), 30.0, (4, 4))


# -- a value -----------------------------------------------------------------------------------------


def test_plans_of_the_same_scene_and_choices_are_one_value():
    described = scene()
    plans = {Plan.of(described), Plan.of(described, Choices()), Plan.of(described).having(Choices())}
    assert len(plans) == 1
    (plan,) = plans
    assert plan != Plan.of(described, Choices(technique="spectral"))
    assert plan != plan.settle(Settled("grid"))
    with pytest.raises(FrozenInstanceError):
        plan.features = None


def test_planning_loads_no_device_and_no_tables():
    """As modules, so that nothing of them can be asked."""
    code = (
        "import sys, clvol.planning.plan, clvol.layout\n"
        "rooms = ('clvol.tables', 'clvol.device', 'clvol.rendering', 'clvol.lab', 'pyopencl')\n"
        "print(*[name for name in sys.modules if name.startswith(rooms)])"
    )
    loaded = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert loaded.stdout.split() == []


def test_a_render_is_planned_once():
    counted = {
        f.__code__: f.__name__ for f in (boundaries.find_boundaries, inspection.find_features, auto.resolve)
    }
    calls = Counter()

    def count(frame, event, _):
        if event == "call" and frame.f_code in counted:
            calls[counted[frame.f_code]] += 1

    described = scene()
    sys.setprofile(count)
    try:
        clvol.render(described, spp=1)
    finally:
        sys.setprofile(None)
    assert calls == dict.fromkeys(counted.values(), 1)


# -- families, once ----------------------------------------------------------------------------------


def test_render_takes_every_family_of_the_registry_and_no_other():
    parameters = inspect.signature(clvol.render).parameters.values()
    assert [p.name for p in parameters if p.default == "auto"] == list(registry.FAMILIES)
    assert list(Choices().names) == list(registry.FAMILIES) == list(Plan.of(scene()).in_force)
    with pytest.raises(TypeError, match="tecnique"):
        Choices(tecnique="delta")


def test_what_the_layout_numbers_are_the_registry_s_names():
    for family, table in {"ABSORPTION": registry.ABSORPTIONS, "PROBABILITY": registry.PROBABILITIES}.items():
        assert [name.lower() for name in layout.ENUMS[family]] == list(table)
    assert set(registry.FIRST_HIT) == set(layout.FIRST_HIT)


# -- reasons -----------------------------------------------------------------------------------------


def glowing(albedo=0.5, **keywords):
    described = scene(**keywords)
    shape = described.shapes[0]
    medium = replace(shape.interior, albedo=ConstVolume((albedo,)), emission=ConstVolume((1.0,)))
    return replace(described, shapes=(replace(shape, interior=medium), *described.shapes[1:]))


BESIDE = box((0.5, 0, 0), (1.5, 1, 1), homogeneous(1.0, 0.5))


@pytest.mark.parametrize(
    ("described", "asked", "family", "name", "reason"),
    [
        (scene(), {}, "technique", "delta", "regular would not pay: nothing emits"),
        (glowing(albedo=0.7), {}, "technique", "delta", "emits with an albedo of at most 0.5"),
        (glowing(), {"sampler": "sobol"}, "technique", "regular", "collisions are the light"),
        (glowing(), {"sampler": "independent"}, "technique", "delta", "samples are independent"),
        (glowing(), {"lookup": "stochastic", "sampler": "sobol"}, "technique", "delta", "stochastic"),
        (glowing(more=[BESIDE]), {"sampler": "sobol"}, "technique", "delta", "media may overlap"),
        (glowing(scale=(3.0, 2.0, 1.0)), {}, "technique", "delta", "channels are attenuated differently"),
        (scene(), {}, "transmittance", "ratio", "lights to sample: directional"),
        (scene((SKY,)), {}, "transmittance", "none", "find a uniform sky by themselves"),
        (scene(()), {}, "transmittance", "none", "no light"),
        (scene(), {}, "majorant", "auto", "by expected cost once the volumes are prepared"),
    ],
)
def test_every_auto_has_its_reason(described, asked, family, name, reason):
    plan = Plan.of(described, Choices(**asked))
    assert plan.chosen[family] == name
    assert plan.reasons[family].startswith("auto: ") and reason in plan.reasons[family]


def test_what_is_asked_for_and_what_the_scene_says_are_told_apart():
    described = scene(technique="spectral", absorption="weight")
    reasons = clvol.plan(described, absorption="sample").reasons
    assert (reasons["technique"], reasons["absorption"]) == ("the scene's own", "asked for")
    others = set(registry.FAMILIES) - {"technique", "absorption"}
    assert all(reasons[family].startswith("auto: ") for family in others)


def test_other_choices_keep_the_scene_s_own_and_say_who_made_them():
    own = replace(FOG, integrator=Integrator(choices={"sampler": "independent"}))
    plan = Plan.of(own, Choices.for_scene(own, {}))
    other = plan.having(plan.choices.but(technique="spectral"), {"technique": "chosen by the pilot"})
    assert other.reasons["sampler"] == plan.reasons["sampler"] == "the scene's own"
    assert other.reasons["technique"] == "chosen by the pilot"
    assert plan.having(plan.choices.but(sampler="sobol")).reasons["sampler"] == "asked for"


def test_the_volumes_settle_the_majorant_with_the_costs_of_all():
    plan = prepare(scene(), Plan.of(scene())).plan
    assert plan.chosen["majorant"] in registry.MAJORANTS and plan.settled.majorant == plan.chosen["majorant"]
    assert f"{plan.chosen['majorant']} 1.00" in plan.reasons["majorant"]
    assert all(name in plan.reasons["majorant"] for name in registry.MAJORANTS)


def test_channels_far_apart_are_followed_one_by_one_once_the_volumes_show_it():
    coloured = picture(
        [box(*CUBE, homogeneous((9.0, 9.0, 1e-4), 0.5))], (SUN,), (0, 0, -3), (0, 0, 0), 30.0, (4, 4)
    )
    plan = Plan.of(coloured)
    assert (plan.spectrum, plan.far_apart) == (3, False)
    settled = prepare(coloured, plan).plan
    assert settled.settled.channels_apart > FAR_APART and settled.far_apart and settled.spectrum == 1


# -- in words ----------------------------------------------------------------------------------------


def test_a_plan_says_choices_with_reasons_stages_with_queues_and_what_is_compiled():
    text = str(clvol.plan(scene(), technique="spectral", transmittance="residual-ratio", majorant="grid"))
    for line in (
        r"technique +spectral +asked for",
        r"sampler +\w+ +auto: ",
        r"control +mean +auto: ",
        r"features: media: 1; volumes: 1; heterogeneous",
        r"majorant cells: a bound of the density; residual-ratio's control \(mean\)",
        r"medium_sample +MEDIUM +SHADE",
        r"path state: \d+ bytes per slot: origin \(3\), direction \(3\), beta",
        r"technique tracking/weighted\.h",
        r"majorant majorant/grid\.h",
        r"\bNEE=1\b",
    ):
        assert len(re.findall(line, text)) == 1, line


def test_a_plan_names_no_queue_that_nothing_empties_and_no_size_before_it_is_known():
    plan = Plan.of(FOG)
    assert re.search(r"  shade +SHADE +MEDIUM, INTERSECT, GENERATE\n", str(plan))
    assert "GROUP_SLOTS" not in str(plan) and "BVH_STACK" not in str(plan)
    assert "GROUP_SLOTS=512" in str(plan.tune(Tuning(64, 512)))
    assert "ABSORPTION=MIXED" in str(plan) and "PROBABILITY" not in str(plan)
    assert "ABSORPTION=SAMPLE" in str(Plan.of(FOG, Choices(absorption="sample")))


def test_every_kind_of_light_counts_and_an_unknown_one_is_never_none():
    """A kind that is added to the records has to be given a feature, and that a word."""
    kinds = {"constant", *SAMPLED_LIGHTS}
    for kind in get_args(Emitter):
        assert inspection._emitter_kind(object.__new__(kind)) in kinds
    with pytest.raises(AssertionError):
        inspection._emitter_kind("a new lamp")
    for features in (Features(emitters=1), Features(emitters=2, constant=True)):
        with pytest.raises(ValueError, match="SAMPLED_LIGHTS"):
            Plan.for_features(features, Choices())


def test_a_choice_that_has_no_use_says_why():
    text = str(Plan.of(FOG))
    assert "technique      analytic               closed forms: all media are homogeneous" in text
    assert "majorant       none                   nothing walks majorant cells" in text
    assert "shadow_transmittance" not in text and "tracking/" not in text


def test_plan_refuses_what_render_refuses():
    with pytest.raises(OptionError, match="point, spot and directional"):
        clvol.plan(scene(), transmittance="none")
    with pytest.raises(OptionError, match="takes a Scene"):
        clvol.plan("scene.xml")
    with pytest.raises(OptionError, match="not known before it has rendered"):
        clvol.plan(scene(), technique="auto:pilot")
    with pytest.raises(TypeError, match=r"choices of a render .*, not 'spp'"):
        clvol.plan(scene(), spp=4)


def test_a_plan_can_be_pickled():
    plan = clvol.plan(scene())
    for protocol in range(pickle.HIGHEST_PROTOCOL + 1):
        assert pickle.loads(pickle.dumps(plan, protocol)) == plan


# -- prepared for a plan -----------------------------------------------------------------------------


def test_tables_serve_other_plans_of_the_scene_that_need_the_same_majorants():
    described = scene()
    prepared = prepare(described, Plan.of(described))
    other = Plan.of(described, Choices(technique="spectral"))
    assert prepared.under(other).plan.chosen["technique"] == "spectral"
    assert prepared.under(other).plan.settled == prepared.plan.settled
    with pytest.raises(ValueError, match="other majorants"):
        prepared.under(Plan.of(described, Choices(technique="decomposition")))


def test_media_and_volumes_are_numbered_once():
    """One medium in two shapes, and another that shares its density."""
    shared = gridded(volume(LUMPS, *CUBE), 0.7)
    other = replace(shared, albedo=ConstVolume((0.5,)))
    places = [(0, 0, 0), (2, 0, 0), (4, 0, 0)]
    boxes = [box(p, (p[0] + 1, 1, 1), m) for p, m in zip(places, (shared, shared, other), strict=True)]
    described = picture(boxes, (SKY,), (0.4, 0.5, -3.0), (0.5, 0.5, 0.5), 30.0, (4, 4))
    prepared = prepare(described)
    assert prepared.matter.of_entry == (0, 0, 1)
    assert len(prepared.volumes) == 1 and len(prepared.majorants) == 2
    assert [roles["sigma_t"] for roles in prepared.matter.roles] == [0, 0]
