"""The contracts of the stages.

That they make sense together, and that the code does what they say, no less and no more.

More does not compile.  For less, sources are searched, of scenes that together need all of a path's state.
"""

import re

import numpy as np
import pyopencl as cl
import pytest
from tiers import quick_first

import clvol
from clvol import layout
from clvol.device import programs
from clvol.errors import DeviceError
from clvol.layout.path_text import path_values
from clvol.layout.stages import EVENTS, IDLE, QUEUES, STAGES
from clvol.planning.choices import Choices
from clvol.planning.plan import Plan
from clvol.rendering import wavefront
from clvol.rendering.session import Session, on_device
from clvol.scene.views import TRANSPARENT, before
from clvol.tables.prepare import prepare

NAMES = [stage.name for stage in STAGES]
EMPTIED_BY = {stage.empties: stage for stage in STAGES}
TRANSITIONS = {f"to_{queue.lower()}" for queue in (*QUEUES, IDLE)}
HANDLER = EMPTIED_BY["SHADE"]

# -- contracts among themselves --------------------------------------------------------------------------


def test_every_queue_is_emptied_by_one_stage_which_hands_no_path_on_to_it():
    assert [stage.empties for stage in STAGES] == list(QUEUES)
    for stage in STAGES:
        assert stage.empties not in {t.to for t in stage.transitions}
        assert not (stage.begins and stage.stands_by)
        assert {t.to for t in stage.transitions} <= {*QUEUES, IDLE}


def test_the_counters_of_a_group_have_room_for_idle_slots_and_twice_for_every_queue():
    assert 2 * len(QUEUES) + 1 <= layout.QUEUE_LENGTHS_STRIDE


def test_contracts_name_values_and_events_that_there_are():
    values = {declared.name for declared in layout.PATH_STATE}
    for stage in STAGES:
        assert stage.reads | stage.writes | stage.sets <= values
        assert set(stage.events) <= set(EVENTS)
        assert not stage.writes & stage.sets
        for transition in stage.transitions:
            assert bool(transition.events) == (transition.sets == "event")


def test_a_path_that_nothing_holds_up_goes_from_ray_to_ray_in_one_wave():
    """Only these go back in the order of launches; whoever waits for them waits for the next wave."""
    back = {
        (stage.name, t.to)
        for place, stage in enumerate(STAGES)
        for t in stage.transitions
        if t.to != IDLE and NAMES.index(EMPTIED_BY[t.to].name) < place
    }
    assert back == {
        ("shade", "MEDIUM"),
        ("shade", "INTERSECT"),
        ("shade", "GENERATE"),
        ("shadow_transmittance", "SHADE"),
        ("shadow_transmittance", "INTERSECT"),
        ("shadow_transmittance", "GENERATE"),
    }


def test_shade_handles_every_event_and_no_other():
    left = {e for stage in STAGES for t in stage.transitions for e in t.events}
    assert left == {e for t in HANDLER.transitions for e in t.on} == set(EVENTS)
    for stage in STAGES:
        assert not stage.stands_by or stage.stands_by in {e for t in stage.transitions for e in t.events}


def test_shadow_rays_arrive_before_their_path_goes_on_or_ends():
    """A path whose shadow ray is under way is in SHADOW, or in SHADE and goes back from there."""
    for stage in STAGES:
        for transition in stage.transitions:
            under_way = transition.to == "SHADOW" or transition.events == ("SHADOW",)
            assert transition.shadow_ray == under_way, (stage.name, transition)
            assert "SHADOW" not in transition.events or under_way, "a path with and one without look alike"
            assert transition.to == IDLE or not (transition.shadow_ray and QUEUES[transition.to].settled)
    assert [t.to for t in HANDLER.transitions if "SHADOW" in t.on] == ["SHADOW"]
    assert QUEUES["GENERATE"].settled and QUEUES["INTERSECT"].settled


# -- contracts against sources ---------------------------------------------------------------------------


def volume(values):
    corner = clvol.translate([-1, -1, -1]) @ clvol.scale([2, 2, 2])
    return {"type": "gridvolume", "data": values, "to_world": corner}


RNG = np.random.default_rng(4)
GREY, COLOURED = RNG.random((4, 4, 4), np.float32), RNG.random((4, 4, 4, 3), np.float32)
SKY = {"type": "constant"}
SENSOR = {
    "type": "perspective",
    "to_world": clvol.look_at([0, 1, 5], [0, 0, 0], [0, 1, 0]),
    "film": {"type": "hdrfilm", "width": 6, "height": 4, "rfilter": {"type": "mitchell"}},
}


def scene(**what):
    integrator = {"type": "volpath", "max_depth": 6}
    described = {"type": "scene", "integrator": integrator, "sensor": SENSOR, **what}
    return before(clvol.load_dict(described), TRANSPARENT)


def cube(medium, **what):
    return {"type": "cube", "bsdf": {"type": "null"}, "interior": medium, **what}


def cloud(values=GREY, **what):
    return {"type": "heterogeneous", "sigma_t": volume(values), "scale": 3.0, "albedo": 0.8, **what}


AOV = (
    "depth",
    "normal",
    "albedo",
    "position",
    "lookups",
    "tentative",
    "real",
    "cells",
    "violations",
    "shadow_rays",
)


def everything():
    """Surfaces of every sort, media over each other, the camera inside of a boundary, lamps."""
    return scene(
        ball={
            "type": "sphere",
            "bsdf": {"type": "dielectric"},
            "interior": {"type": "homogeneous", "sigma_t": 0.1, "albedo": 0.5},
            "to_world": clvol.scale([9, 9, 9]),
        },
        cloud=cube(cloud()),
        floor={"type": "rectangle", "to_world": clvol.translate([0, 0, -2])},
        veil={
            "type": "sphere",
            "bsdf": {"type": "mask", "opacity": 0.5, "nested": {"type": "diffuse"}},
            "to_world": clvol.translate([1, 0, 1]),
        },
        lamp={
            "type": "rectangle",
            "to_world": clvol.translate([0, 3, 0]) @ clvol.rotate([1, 0, 0], 90),
            "emitter": {"type": "area"},
        },
        sky=SKY,
    )


def seen_lamp():
    """A lamp in a cloud, a channel a path, before a camera whose pixels weigh all that they see alike."""
    film = {"type": "hdrfilm", "width": 6, "height": 4, "rfilter": {"type": "box"}}
    lamp = {"type": "rectangle", "emitter": {"type": "area"}}
    return scene(sensor={**SENSOR, "film": film}, lamp=lamp, cloud=cube(cloud(COLOURED)))


CASES = {
    "everything": (
        everything,
        {"aov": (*AOV, "largest_weight"), "technique": "weighted-delta", "transmittance": "ratio"},
    ),
    "a medium, a channel a path": (
        lambda: scene(cloud=cube(cloud(COLOURED)), sky=SKY),
        {"technique": "delta", "transmittance": "ratio", "background": "expected"},
    ),
    "a lamp that is seen": (seen_lamp, {}),
}


def plan_of(device, name):
    described, choices = CASES[name]
    made = described()
    prepared = prepare(made, Plan.of(made, Choices(majorant="grid", **choices)))
    return on_device(prepared, device).plan


def functions(source):
    """Bodies of the functions of a unit by name, without comments, with the macros of its stage resolved."""
    text = re.sub(r"/\*.*?\*/", "", source, flags=re.DOTALL)
    macros = dict(re.findall(r"^#define (STAGE\w*) (\w+)$", text, re.MULTILINE))
    choice = re.compile(r"^#ifdef (STAGE\w*)\n(.*?)(?:^#else\n(.*?))?^#endif\n", re.DOTALL | re.MULTILINE)
    text = choice.sub(lambda m: m[2] if m[1] in macros else m[3] or "", text)
    text = re.sub(r"\bSTAGE\w*\b", lambda m: macros.get(m[0], m[0]), text)
    found = {}
    for match in re.finditer(r"^(?:INLINE|__kernel)\b[^;{]*?(\w+)\((?:[^()]|\([^()]*\))*\)\s*\{", text, re.M):
        depth, end = 1, match.end()
        while depth:
            depth += {"{": 1, "}": -1}.get(text[end], 0)
            end += 1
        found[match[1]] = text[match.end() : end]
    return found


def named(source, stage):
    """Everything that the code a stage runs names, and the functions of its unit."""
    bodies = functions(source)
    waiting, seen = [f"{stage.name}_kernel"], set()
    while waiting:
        name = waiting.pop()
        if name not in seen:
            seen.add(name)
            waiting += re.findall(r"\b[A-Za-z_]\w*\b", bodies.get(name, ""))
    return seen, bodies


@pytest.mark.parametrize("stage", STAGES, ids=NAMES)
def test_a_stage_does_all_that_its_contract_says(device, stage):
    values = {declared.name for declared in layout.PATH_STATE}
    reads, writes, pushes, events = set(), set(), set(), set()
    for name in CASES:
        plan = plan_of(device, name)
        if stage.name not in plan.stages:
            continue
        words, bodies = named(programs.stage_source(plan, stage.name), stage)
        kept = {n for n, value in path_values(plan.macros).items() if value.rows}
        reads |= {v for v in values & kept if f"path_{v}" in words}
        writes |= {v for v in values & kept if f"set_path_{v}" in words}
        pushes |= words & TRANSITIONS
        events |= {e for e in EVENTS if f"EVENT_{e}" in words}
        assert (
            words & (TRANSITIONS | {f"{verb}path_{v}" for v in values for verb in ("", "set_")})
            <= bodies.keys()
        )
    assert reads == stage.reads
    assert writes == stage.writes
    assert pushes == {t.function for t in stage.transitions}
    assert events == set(stage.events)


def test_paths_are_moved_by_transitions_alone(device):
    for name in CASES:
        plan = plan_of(device, name)
        for stage in (s for s in STAGES if s.name in plan.stages):
            bodies = functions(programs.stage_source(plan, stage.name))
            pushing = {name for name, body in bodies.items() if "queue_push(" in body}
            waking = {"from_idle"} if stage.wakes else set()
            assert pushing == waking | {t.function for t in stage.transitions if t.to != IDLE}
            assert not [n for n in bodies if n in {f"set_path_{value}" for value in stage.sets}]


@pytest.mark.parametrize(
    ("stage", "file", "old", "new"),
    [
        ("intersect", "intersect", "to_medium(", "to_generate("),
        ("medium_sample", "sample_lanes", "to_shade(", "to_intersect("),
        ("intersect", "intersect", "uint event = EVENT_ESCAPE", "uint event = EVENT_COLLISION"),
        ("shade", "shade", "to_intersect(scene, group, slot);", "set_path_event(scene, slot, EVENT_WALK);"),
        ("shadow_transmittance", "shadow_ray", "path_goes_on(", "path_hit_t("),
    ],
)
def test_what_a_contract_does_not_name_does_not_compile(device, monkeypatch, stage, file, old, new):
    plan = plan_of(device, "a medium, a channel a path")
    original = programs.kernel_source

    def source(name):
        text = original(name)
        if name != f"stages/{file}.h":
            return text
        assert old in text
        return text.replace(old, new)

    programs.build(device, programs.stage_source(plan, stage), stage)
    monkeypatch.setattr(programs, "kernel_source", source)
    with pytest.raises(DeviceError, match="does not build"):
        programs.build(device, programs.stage_source(plan, stage), stage)


# -- contracts against what happens ----------------------------------------------------------------------


@quick_first("name", CASES)
def test_a_launch_moves_paths_and_writes_values_as_its_contract_says(device, monkeypatch, name):
    described, choices = CASES[name]
    made = described()
    plan = Plan.of(made, Choices(majorant="grid", **choices))
    session = Session.for_plan(device, made, plan, 0, pool=256, spp=4)
    waves, launch = session.wavefront, cl.enqueue_nd_range_kernel
    value_of = [declared.name for declared in layout.PATH_STATE for _ in declared.fields(session.plan.macros)]
    moved, written = {stage: set() for stage in NAMES}, {stage: set() for stage in NAMES}

    def read(buffer, shape):
        words = np.empty(shape, np.uint32)
        cl.enqueue_copy(device.queue, words, waves.buffers[buffer], is_blocking=True)
        return words

    def found():
        counters = read("queue_lengths", (waves.groups, layout.QUEUE_LENGTHS_STRIDE)).sum(axis=0)
        queued = dict(zip((*QUEUES, IDLE), counters, strict=False))
        return queued, read("state", (len(value_of), waves.stride))

    def watched(queue, kernel, size, local):
        stage = next((s for s in STAGES if kernel.function_name == f"{s.name}_kernel"), None)
        (queued, state), event = found(), launch(queue, kernel, size, local)
        event.wait()
        if stage is not None:
            (queued_after, state_after), name = found(), stage.name
            assert queued_after[stage.empties] == 0
            moved[name] |= {to for to in queued if queued_after[to] > queued[to]}
            written[name] |= {value_of[row] for row in np.nonzero((state != state_after).any(axis=1))[0]}
        return event

    monkeypatch.setattr(wavefront.cl, "enqueue_nd_range_kernel", watched)
    session.run(0, 4)
    for stage in STAGES:
        assert moved[stage.name] <= {t.to for t in stage.transitions}
        assert written[stage.name] <= stage.writes | stage.sets
        assert stage.name not in session.plan.stages or moved[stage.name]
