"""Pictures whose walks go in lanes: as those of walks one by one, and of the same bits at every width."""

import functools

import numpy as np
import pytest
from every_bit import SPP, digest, rendered
from pictures import box, gridded, hg, homogeneous, picture, volume
from stat_tests import assert_same_picture, seed_of
from tiers import quick_first

import clvol
from clvol.planning.choices import Choices
from clvol.planning.in_force import warnings
from clvol.planning.lanes import lanes as stages_in_lanes
from clvol.planning.lanes import widths
from clvol.planning.plan import Plan
from clvol.planning.registry import SAMPLERS
from clvol.planning.settled import Tuning
from clvol.scene.records import ConstantEmitter, DirectionalEmitter

CUBE = (0, 0, 0), (1, 1, 1)
LUMPS = np.random.default_rng(3).uniform(0, 1, (17, 16, 15)) ** 4
LIGHTS = (ConstantEmitter((0.8,)), DirectionalEmitter((2.0,), (0.0, -1.0, 0.0)))


def cloud(scale=(12.0,), more=(), size=(8, 8)):
    """A grid under a sky and a sun."""
    medium = gridded(volume(LUMPS, *CUBE), 0.9, hg(0.6), scale=scale)
    return picture([box(*CUBE, medium), *more], LIGHTS, (0.5, 0.6, -2.0), (0.5, 0.5, 0.5), 30.0, size)


def room():
    """The same before a wall and over a floor, as a dict; the lamp is a surface too."""
    grid = {"type": "gridvolume", "data": LUMPS.astype(np.float32)}
    floor = clvol.translate((0.5, -0.2, 0.5)) @ clvol.rotate((1, 0, 0), -90.0) @ clvol.scale(2.0)
    lamp = clvol.translate((0.5, 2.0, 0.5)) @ clvol.rotate((1, 0, 0), 90.0) @ clvol.scale(0.5)
    return clvol.load_dict(
        {
            "type": "scene",
            "integrator": {"type": "volpath", "max_depth": 8},
            "sensor": {
                "type": "perspective",
                "fov": 35.0,
                "to_world": clvol.look_at(origin=(0.5, 0.6, -2.0), target=(0.5, 0.4, 0.5), up=(0, 1, 0)),
                "film": {"type": "hdrfilm", "width": 8, "height": 8, "rfilter": {"type": "box"}},
            },
            "floor": {"type": "rectangle", "to_world": floor, "bsdf": {"type": "diffuse"}},
            "lamp": {
                "type": "rectangle",
                "to_world": lamp,
                "emitter": {"type": "area", "radiance": 6.0},
            },
            "cloud": {
                "type": "cube",
                "to_world": clvol.translate(0.5) @ clvol.scale(0.5),
                "bsdf": {"type": "null"},
                "interior": {"type": "heterogeneous", "sigma_t": grid, "scale": 12.0, "albedo": 0.9},
            },
        }
    )


SCENES = {"cloud": cloud, "channels": lambda: cloud((12.0, 6.0, 2.0)), "room": room}


@pytest.mark.contract
@pytest.mark.parametrize("transmittance", ["ratio", "delta"])
@pytest.mark.parametrize("kind", SCENES)
def test_walks_in_lanes_and_one_by_one_show_the_same_picture(kind, transmittance):
    seeds = [seed_of(kind, transmittance, lanes) for lanes in ("off", "8")]
    one, many = (
        clvol.render(SCENES[kind](), spp=1024, seed=seed, lanes=lanes, transmittance=transmittance)
        for lanes, seed in zip(("off", "8"), seeds, strict=True)
    )
    assert (one.metadata["lanes"], many.metadata["lanes"]) == ("off", "8")
    assert one.stats["lane_steps"] == 0 and many.stats["majorant_violations"] == 0
    assert 0.4 * many.stats["lane_steps"] < many.stats["busy_lane_steps"] <= many.stats["lane_steps"]
    assert_same_picture(one, many)


@functools.cache
def sixteen(spp):
    return digest(rendered(cloud(), spp=spp, seed=7, lanes="16"))


@quick_first(
    ("options", "spp"),
    [
        ({"lanes": "4"}, 250),
        ({"lanes": "4"}, SPP),
        ({"lanes": "8"}, SPP),
        ({"lanes": "16", "pool": 3000}, SPP),
    ],
    ids=str,
)
def test_neither_their_number_nor_the_pool_touches_a_bit(options, spp):
    assert digest(rendered(cloud(), spp=spp, seed=7, **options)) == sixteen(spp)


@pytest.mark.contract
def test_groups_of_a_gpu_do_not_touch_a_bit(monkeypatch):
    tune, expected = Plan.tune, sixteen(SPP)
    monkeypatch.setattr(Plan, "tune", lambda plan, _: tune(plan, Tuning(64, 512, lanes=4)))
    assert digest(rendered(cloud(), spp=SPP, seed=7)) == expected


@pytest.mark.contract
@pytest.mark.parametrize("kind", SCENES)
def test_walks_in_lanes_may_go_in_legs(kind, bounds):
    """Of three steps each, whatever their number."""
    whole = clvol.render(SCENES[kind](), spp=512, seed=3, lanes="8")
    bounds(WALK_STEPS=3)
    parts = clvol.render(SCENES[kind](), spp=512, seed=4, lanes="8")
    assert parts.stats["waves"] > whole.stats["waves"] and parts.stats["walks_exhausted"] == 0
    assert_same_picture(whole, parts)
    if kind == "cloud":
        one = rendered(cloud(), spp=64, seed=4, lanes="8", pool=256)
        assert digest(rendered(cloud(), spp=64, seed=4, lanes="16", pool=2000)) == digest(one)


@pytest.mark.contract
def test_a_work_item_leaves_paths_to_the_next_wave(bounds):
    """Which changes no bit: nothing of them has begun."""
    whole = rendered(cloud(), spp=256, seed=5, lanes="8")
    bounds(STAGE_STEPS=20)
    parts = rendered(cloud(), spp=256, seed=5, lanes="8")
    assert parts.stats["waves"] > whole.stats["waves"] and digest(parts) == digest(whole)


# -- the plan ------------------------------------------------------------------------------------------------

BESIDE = box((2, 0, 0), (3, 1, 1), homogeneous(1.0, 0.9))


@pytest.mark.parametrize(
    ("scene", "choices", "stages", "said"),
    [
        (cloud(), {"lanes": "8"}, {"medium_sample": 8, "shadow_transmittance": 8}, "asked for"),
        (cloud(), {"lanes": "off"}, {}, "asked for"),
        (cloud(), {"technique": "spectral", "lanes": "8"}, {"shadow_transmittance": 8}, "asked for"),
        (cloud(), {"transmittance": "regular", "lanes": "8"}, {"medium_sample": 8}, "asked for"),
        (cloud((3.0, 2.0, 1.0)), {"technique": "spectral", "lanes": "8"}, {}, "several channels"),
        (cloud(), {"majorant": "kdtree", "lanes": "8"}, {}, "kdtree is walked one path at a time"),
        (cloud(more=[BESIDE]), {"lanes": "8"}, {}, "there are several media"),
    ],
)
def test_a_plan_says_which_stages_walk_in_lanes_and_what_is_against_it(scene, choices, stages, said):
    plan = clvol.plan(scene, **choices)
    assert stages_in_lanes(plan) == stages
    assert said in next(line for line in plan.describe() if line.startswith("  lanes"))


def test_a_device_decides_where_nobody_else_does():
    plan = clvol.plan(cloud())
    assert plan.chosen["lanes"] == "auto" and not stages_in_lanes(plan)
    assert plan.tune(Tuning(lanes=16)).chosen["lanes"] == "16"
    assert plan.tune(Tuning(64, 512)).chosen["lanes"] == "off"
    mixed = " ".join(str(clvol.plan(cloud(), technique="spectral", lanes="4")).split())
    assert "medium_sample one path at a time: technique spectral" in mixed
    assert "shadow_transmittance 4 paths at a time" in mixed


def test_where_no_walk_goes_in_lanes_numbers_are_drawn_in_them():
    several = Plan.of(cloud(more=[BESIDE]), Choices(lanes="8"))
    assert several.in_force["lanes"] == "none", "pictures with lanes and without are the same"
    assert stages_in_lanes(several) == {} and widths(several) == {"generate": 8, "shade": 8}
    assert "generate and shade draw for 8 at a time" in " ".join(str(several).split())
    assert not list(warnings(several, {"lanes": "8"}))
    assert widths(Plan.of(cloud(), Choices(lanes="off"))) == {}


@quick_first("scene", [lambda: cloud(more=[BESIDE]), room], ids=["media", "room"])
@pytest.mark.parametrize(
    "sampler", [s if s == "joint" else pytest.param(s, marks=pytest.mark.contract) for s in SAMPLERS]
)
@quick_first("lanes", ["16", "4"])
def test_numbers_drawn_in_lanes_are_those_drawn_one_by_one(scene, sampler, lanes):
    """Of walks one by one, so that pictures have the same bits; roulette and absorption are drawn, too."""
    choices = {"technique": "weighted-delta", "transmittance": "regular", "sampler": sampler, "spp": 512}
    off, drawn = (rendered(scene(), lanes=width, seed=8, **choices) for width in ("off", lanes))
    assert np.array_equal(off.image, drawn.image)
    assert off.stats["lookups"] == drawn.stats["lookups"]
