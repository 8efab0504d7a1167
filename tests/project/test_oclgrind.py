"""tools/oclgrind.py reads what Oclgrind says, and lets nothing pass but races that do no harm."""

from __future__ import annotations

import importlib
import re
from typing import TYPE_CHECKING

import pytest
from places import ROOT, SCENES, TOOLS

import clvol
from clvol.planning import registry
from clvol.tables.prepare import prepare

if TYPE_CHECKING:
    from types import ModuleType

LOG = """
Read-write data race at global memory address 0x1d000000000000
    Kernel: generate_kernel

    First entity:  Global(1,0,0) Local(1,0,0) Group(0,0,0)
      %5 = load i32, i32 addrspace(1)* %arrayidx, align 4, !dbg !298
    At line {read} (column 45) of stages/generate.h:
      (source not available)

    Second entity: Global(0,0,0) Local(0,0,0) Group(0,0,0)
      %call = call spir_func i32 @_Z10atomic_incPU3AS1Vj(i32 addrspace(1)* noundef %add.ptr) #8
    At line {changed} (column 22) of stages/generate.h:
      (source not available)

Invalid read of size 4 at global memory address 0x1000000000050
    Kernel: shade_kernel
    Entity: Global(2,0,0) Local(2,0,0) Group(0,0,0)
    At line 48 (column 5) of core/sobol.h:
      INLINE int min_int(int a, int b)

Invalid read of size 4 at global memory address 0x1000000000054
    Kernel: shade_kernel
    Entity: Global(3,0,0) Local(3,0,0) Group(0,0,0)
    At line 48 (column 5) of core/sobol.h:
      INLINE int min_int(int a, int b)

"""


@pytest.fixture
def oclgrind(monkeypatch: pytest.MonkeyPatch) -> ModuleType:
    monkeypatch.syspath_prepend(TOOLS)
    return importlib.import_module("oclgrind")


def number_of(text: str) -> int:
    """The first line of stages/generate.h with this text."""
    lines = (ROOT / "cl" / "stages" / "generate.h").read_text(encoding="utf-8").splitlines()
    return next(number for number, line in enumerate(lines, 1) if text in line)


def log(read: str, changed: str) -> str:
    return LOG.format(read=number_of(read), changed=number_of(changed))


def test_what_is_found_is_told_with_its_places_and_counted(oclgrind: ModuleType, capsys) -> None:
    found = oclgrind.findings(log("idle_slots(scene, group) == 0", "atomic_add(idle_slots"))
    assert sorted(found.values()) == [1, 2]
    assert oclgrind.report("a case", found)
    [_, line] = capsys.readouterr().out.splitlines()
    assert line == "  Invalid read of size 4 at global memory, shade_kernel, 2 times, at core/sobol.h:48"


def test_no_race_passes_but_those_of_counters_that_are_looked_at_first(oclgrind: ModuleType) -> None:
    known = ("scene->counters[COUNTER_NEXT_JOB] >= limit", "atomic_inc(scene->counters + COUNTER_NEXT_JOB)")
    others = (("set_path_job(scene, slot, job)", "atomic_add(idle_slots"), (known[0], known[0]))
    for places, harmless in ((known, True), *((places, False) for places in others)):
        [race] = [f for f in oclgrind.findings(log(*places)) if "race" in f.what]
        assert race.is_harmless == harmless


def test_every_choice_and_every_scene_is_rendered(oclgrind: ModuleType) -> None:
    cases = oclgrind.CASES.values()
    for family in ("technique", "transmittance", "majorant", "sampler"):
        named = {case.options.get(family) for case in cases}
        assert set(registry.FAMILIES[family]) - named <= {"none", "joint"}, family
    scenes = {case.scene for case in cases}
    assert scenes == {path.stem for path in SCENES.glob("*.xml")} | set(oclgrind.MADE)


FIXED = {"CLVOL_LOCAL_SIZE", "CLVOL_LANES"}
"""Macros that the device decides, and units."""


@pytest.mark.contract
def test_every_part_of_the_kernels_is_compiled_for_some_case(oclgrind: ModuleType) -> None:
    """And left out for another: a macro that hides something has several values."""
    values: dict[str, set[int]] = {}
    for name, case in oclgrind.CASES.items():
        scene = oclgrind.scene_of(case)
        plan = clvol.plan(scene, **case.options)
        if name.startswith("far apart"):  # whose tree of bricks is known once it is prepared
            plan = prepare(scene, plan).plan
        for macro, value in plan.macros.items():
            values.setdefault(macro, set()).add(value)
    text = "".join(path.read_text() for path in (ROOT / "cl").rglob("*") if path.is_file())
    conditions = " ".join(re.findall(r"^\s*#\s*(?:el)?if (.*)$", text, re.M))
    hiding = set(re.findall(r"CLVOL_\w+", conditions))
    seen = {macro for macro, found in values.items() if len(found) > 1}
    assert hiding & set(values) - seen - FIXED == set()
