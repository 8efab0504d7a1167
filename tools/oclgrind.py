"""Render tiny pictures under Oclgrind: it finds data races, uninitialised values, accesses out of bounds.

    python tools/oclgrind.py                 # every case, some minutes
    python tools/oclgrind.py "cloud, marching"

Oclgrind (github.com/jrprice/Oclgrind; Debian: `apt-get install oclgrind`) interprets kernels and watches
each access to memory.  Pictures of 4 x 4 pixels and a sample each run every stage in the work-groups of a
GPU; the cache of lights, of up to 32,768 cells elsewhere, has 27.  What it finds is printed with the place in
cl/; the exit status is 1 where anything is wrong.

Flaws of version 21.10 are worked round, each seen in a kernel of a few lines.  It does not know functions
that its compiler makes of inlined and of optimised code, nor all of Clang's own: nothing is inlined or
optimised, and kernels are not told that it is Clang.  Buffers that the host fills, and those that it writes a
part of, pass for uninitialised: whole ones are written.
"""

from __future__ import annotations

import os
import re
import shutil
import subprocess
import sys
import tempfile
import time
from collections import Counter
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import click
import numpy as np
from folders import ROOT, SCENES
from oclgrind_scenes import MADE

import clvol
from clvol.cli.messages import fail
from clvol.tables import light_cache

OPTIONS = (
    "--data-races",
    *("--max-errors", "100000"),
    *("--global-mem-size", "4000000000"),
    *("--build-options", "-cl-opt-disable -Dalways_inline=noinline -U__clang__"),
)
POOL = 64
SECONDS = 600
"""That a case may take, of which the longest take half a minute."""
CACHE_EDGE = 3
"""Cells of the cache of lights along its longest edge: filling it takes more steps than all else."""


@dataclass(frozen=True)
class Case:
    """A scene of scenes/ or oclgrind_scenes.py, its definitions, and what `clvol.render` is told beside."""

    scene: str
    definitions: dict[str, int]
    options: dict[str, Any] = field(default_factory=dict)
    uninitialised: bool = True
    """Whether uninitialised values are looked for, in which Oclgrind itself may crash."""


SQUARE, SIDES = {"res": 4}, {"width": 4, "height": 4}
AOVS = ["depth", "normal", "albedo", "position", "tentative", "cells", "largest_weight", "variance"]
CASES = {
    "slab": Case("slab", SQUARE),
    "slab, to a noise": Case("slab", SQUARE, {"target_error": 0.3}),
    "room": Case("room", SQUARE),
    "jade": Case("jade", SIDES, {"aov": AOVS}),
    "clouds": Case(
        "clouds",
        SIDES,
        {"technique": "weighted-decomposition", "transmittance": "residual-ratio", "majorant": "kdtree"},
    ),
    "cloud, global": Case(
        "cloud", SQUARE, {"technique": "decomposition", "transmittance": "power-series", "majorant": "global"}
    ),
    "cloud, stochastic": Case(
        "cloud",
        SQUARE,
        {"technique": "delta", "transmittance": "ratio", "majorant": "grid", "lookup": "stochastic"},
    ),
    "cloud, lanes": Case(
        "cloud", SQUARE, {"technique": "delta", "transmittance": "ratio", "majorant": "grid", "lanes": "8"}
    ),
    "cloud, marching": Case(
        "cloud", SQUARE, {"technique": "marching", "transmittance": "marching", "sampler": "sobol"}
    ),
    "smoke": Case("smoke", SIDES, {"technique": "spectral", "transmittance": "ratio", "majorant": "grid"}),
    "smoke, regular": Case(
        "smoke", SIDES, {"technique": "regular", "transmittance": "regular", "majorant": "kdtree"}
    ),
    "smoke, decomposition": Case(
        "smoke",
        SIDES,
        {"technique": "spectral-decomposition", "transmittance": "delta", "majorant": "global"},
    ),
    "shaft": Case("shaft", SIDES, uninitialised=False),
    "lights and masks": Case("lights and masks", {}, {"majorant": "grid"}),
    "materials": Case("materials", {}),
    "bends": Case("bends", {}, uninitialised=False),
    "depths": Case("depths", {}, {"aov": ["normal", "albedo"]}, uninitialised=False),
    "colours, delta": Case("colours", {}, {"technique": "delta", "majorant": "grid"}),
    "colours, spectral": Case(
        "colours", {}, {"technique": "spectral", "majorant": "grid", "probability": "max"}
    ),
    "flakes": Case("flakes", {}, {"technique": "delta", "majorant": "grid", "shadow_cache": "off"}),
    "woven": Case("woven", {}, {"technique": "decomposition", "majorant": "grid"}),
    "flames": Case("flames", {}, {"majorant": "grid", "probability": "average"}, uninitialised=False),
    "within": Case("within", {}),
    "a meter": Case("a meter", {}),
    "a target": Case("a target", {}),
    "far apart": Case("far apart", {}, {"technique": "delta", "majorant": "grid"}),
    "far apart, tree": Case("far apart", {}, {"technique": "spectral", "majorant": "kdtree"}),
    "a backdrop": Case("a backdrop", {}, {"technique": "delta", "background": "sampled", "majorant": "grid"}),
    "a background": Case(
        "transparent", {}, {"technique": "delta", "background": "expected", "majorant": "grid"}
    ),
    "a sun": Case("sunlit", {}, {"technique": "delta", "background": "expected", "majorant": "grid"}),
    "a sun, lanes": Case(
        "sunlit",
        {},
        {"technique": "delta", "background": "expected", "majorant": "grid", "lanes": "8"},
    ),
    "transparent": Case("transparent", {}, {"background": "transparent", "majorant": "grid"}),
    "strata": Case(
        "an emitting medium",
        {},
        {"technique": "regular", "transmittance": "regular", "gathering": "strata", "majorant": "grid"},
    ),
    "fire": Case("fire", SIDES, {"technique": "weighted-delta", "sampler": "independent", "aov": AOVS}),
}

HARMLESS = ("COUNTER_NEXT_JOB", "idle_slots")
"""Numbers that are read while an atomic may change them.  A slot looks at the number of jobs before it takes
one by the atomic, which decides; and at the number of idle slots, which is not 0 while it is idle itself.
Any value that these ever had will do."""


@dataclass(frozen=True)
class Finding:
    """What Oclgrind says of a kernel, and the lines of cl/ where it says so."""

    what: str
    kernel: str
    places: frozenset[str]

    @property
    def is_harmless(self) -> bool:
        """Whether it is a race of an atomic with a look at one of the numbers above."""
        lines = [line_of(place) for place in self.places]
        atomics = sum("atomic_" in line for line in lines)
        of_one_number = any(all(name in line for line in lines) for name in HARMLESS)
        return "race" in self.what and len(lines) == 2 and atomics == 1 and of_one_number


def line_of(place: str) -> str:
    """The text of FILE:NUMBER, where that is a file of cl/."""
    file, _, number = place.rpartition(":")
    path = ROOT / "cl" / file
    return path.read_text(encoding="utf-8").splitlines()[int(number) - 1] if path.is_file() else ""


def findings(log: str) -> Counter[Finding]:
    """What stands in a log of Oclgrind's, with how often."""
    found: Counter[Finding] = Counter()
    for block in re.split(r"\n(?=\S)", log):
        kernel = re.search(r"Kernel: (\w+)", block)
        if kernel:
            what = re.sub(r" (address )?0x[0-9a-f]+", "", block.strip().splitlines()[0])
            places = re.findall(r"At line (\d+) \(column \d+\) of (\S+):", block)
            found[Finding(what, kernel[1], frozenset(f"{file}:{line}" for line, file in places))] += 1
    return found


def write_whole_buffers() -> None:
    """Host writes as Oclgrind understands them: see above."""
    import pyopencl as cl

    write = cl.enqueue_copy

    def copy(queue, target, source, **options):
        if not (isinstance(target, cl.Buffer) and isinstance(source, np.ndarray)):
            return write(queue, target, source, **options)
        whole, at = np.empty(target.size, np.uint8), options.pop("dst_offset", 0)
        if source.nbytes < target.size:
            write(queue, whole, target, is_blocking=True)
        whole[at : at + source.nbytes] = np.frombuffer(source.tobytes(), np.uint8)
        return write(queue, target, whole, is_blocking=True)

    def fill(queue, buffer, pattern, offset, size):
        pattern = np.asarray(pattern)
        return copy(queue, buffer, np.full(size // pattern.nbytes, pattern), dst_offset=offset)

    cl.enqueue_copy, cl.enqueue_fill_buffer = copy, fill


def scene_of(case: Case) -> clvol.Scene:
    """The scene that a case names."""
    if case.scene in MADE:
        return MADE[case.scene]()
    return clvol.load_file(SCENES / f"{case.scene}.xml", **case.definitions)


def render(case: Case) -> None:
    """Render a case, in a process that Oclgrind began."""
    write_whole_buffers()
    light_cache.EDGE = CACHE_EDGE
    result = clvol.render(scene_of(case), spp=1, seed=1, pool=POOL, **case.options)
    if not (result.image > 0).any():
        raise clvol.Error("the picture is black")


def checked(name: str) -> Counter[Finding]:
    """What Oclgrind finds in a case."""
    with tempfile.TemporaryDirectory() as folder:
        log = Path(folder) / "log"
        options = (*OPTIONS, "--uninitialized") if CASES[name].uninitialised else OPTIONS
        command = ["oclgrind", *options, "--log", str(log), sys.executable, __file__, "--inside", name]
        variables = {"PYOPENCL_NO_CACHE": "1", "PYTHONWARNINGS": "ignore", "CLVOL_DEVICE": "Oclgrind"}
        environment = os.environ | variables
        try:
            done = subprocess.run(command, env=environment, capture_output=True, text=True, timeout=SECONDS)
        except subprocess.TimeoutExpired:
            fail(f"{name} did not end in {SECONDS} s: make its scene smaller, or split it")
        if done.returncode:
            fail(f"{name} did not render ({done.returncode}): {done.stderr.strip().splitlines()[-1]}")
        return findings(log.read_text(encoding="utf-8", errors="replace") if log.exists() else "")


def report(name: str, found: Counter[Finding], seconds: float = 0.0) -> bool:
    """Print what was found in a case, and how long that took; whether there is a fault."""
    faults = {finding: times for finding, times in found.items() if not finding.is_harmless}
    click.echo(f"{name}, {seconds:.0f} s: {'nothing' if not faults else ''}")
    for finding, times in faults.items():
        click.echo(
            f"  {finding.what}, {finding.kernel}, {times} times, at {', '.join(sorted(finding.places))}"
        )
    return bool(faults)


@click.command(help=__doc__)
@click.argument("cases", nargs=-1, metavar="[CASE]...")
@click.option("--inside", hidden=True, help="Render this case: what Oclgrind is called with.")
def main(cases: tuple[str, ...], inside: str | None) -> None:
    """Run the cases one by one."""
    if inside:
        return render(CASES[inside])
    if unknown := set(cases) - set(CASES):
        fail(f"no case {', '.join(sorted(unknown))}; there are {'; '.join(CASES)}")
    if not shutil.which("oclgrind"):
        fail("oclgrind is not installed (Debian: apt-get install oclgrind)")
    outcomes = []
    for name in cases or CASES:
        started = time.perf_counter()
        found = checked(name)
        outcomes.append(report(name, found, time.perf_counter() - started))
    sys.exit(any(outcomes))


if __name__ == "__main__":
    main()
