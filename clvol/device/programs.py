"""From a plan to bound kernels: composes one translation unit per stage and builds it.

Files under cl/ include what they use and guard what they hold; choices fill slots.  Units are written out in
full (clvol.device.preprocess), so that a dump is self-contained, no include path reaches the compiler, and
drivers' caches see exactly what is compiled.
"""

from __future__ import annotations

import re
from contextlib import suppress
from functools import cache, partial
from importlib import resources
from types import MappingProxyType
from typing import TYPE_CHECKING

import pyopencl as cl

from clvol import layout
from clvol.device.launch import GROUP, whole
from clvol.device.preprocess import Preprocessor
from clvol.device.side_builds import Launch, Unit
from clvol.errors import DeviceError
from clvol.planning.lanes import widths

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping

    from clvol.device.device import Device
    from clvol.layout.stages import Stage
    from clvol.planning.plan import Plan

LAYOUT, CONTRACT = "layout", "contract"
_LAYOUT_PLACE = "CLVOL_LAYOUT"
"""Stands for the layout until the rest of a unit is known."""
_ARGUMENTS = re.compile(r"^#define CLVOL_ARGUMENTS (.*)$", re.MULTILINE)
SHARED = {
    "CLVOL_SHARED_HEADER": "layout, shared",
    "CLVOL_BSDFS_HEADER": "layout, kinds of BSDF",
    "CLVOL_PHASES_HEADER": "layout, kinds of phase function",
}
"""Slots of generated text, and what messages call it."""
_LAMPS = "".join(
    f"#define {name} {getattr(layout, name)}u\n" for name in ("LAMP_GRID", "LAMP_NONE", "LAMP_UNSURE")
)
"""Numbers that the kernel alone has which looks for lamps."""
_MACRO = re.compile(r"CLVOL_\w+")
BUILD_OPTIONS = ("-cl-std=CL1.2", "-w")
"""No relaxed-math flag: they may delete the checks for NaN and infinity (METHODS §7).  -w: compilers
warn wherever a feature's macro makes a condition constant, which is how the kernels are composed."""


@cache
def kernel_source(name: str) -> str:
    """Text of the file `name` under cl/, which is installed as clvol/_cl; a checkout has it beside clvol/."""
    package = resources.files("clvol")
    installed = package.joinpath("_cl")
    folder = installed if installed.is_dir() else package.joinpath("..", "cl")
    return folder.joinpath(name).read_text(encoding="utf-8")


def _nothing(_unit: str) -> str:
    return ""


def expand(
    text: str,
    macros: Mapping[str, int],
    slots: Mapping[str, str],
    layout_of: Callable[[str], str] = _nothing,
    contract: str = "",
) -> str:
    """A translation unit of `text` and all that it includes.

    What `layout_of` says of the unit stands in core/scene.h, and `contract` in path/transitions.h.

    Only the macros that occur in it are defined: caches are keyed on the text, and stages that a choice
    does not touch are not built again.
    """
    shared = layout.shared_text(), layout.kinds_text("BSDF"), layout.kinds_text("PHASE")
    generated = dict(zip(SHARED.values(), shared, strict=True))
    generated |= {LAYOUT: f"{_LAYOUT_PLACE}\n", CONTRACT: contract}

    def read(name: str) -> str:
        return generated[name] if name in generated else kernel_source(name)

    slots = {**slots, **SHARED, "CLVOL_LAYOUT_HEADER": LAYOUT, "CLVOL_CONTRACT_HEADER": CONTRACT}
    expanded = Preprocessor(read, macros, slots).expand(text, "unit")
    body = "\n".join(expanded) + "\n"
    if f"\n{_LAYOUT_PLACE}\n" in body:
        body = body.replace(f"{_LAYOUT_PLACE}\n", layout_of(body))
    used = set(_MACRO.findall(body))
    defines = [f"#define {name} {value}\n" for name, value in macros.items() if name in used]
    return "/* Composed by clvol. */\n" + "".join(defines) + body


def compose(
    plan: Plan,
    text: str,
    macros: Mapping[str, int] = MappingProxyType({}),
    stage: Stage | None = None,
) -> str:
    """The translation unit of `text` for a plan, and more macros; `stage`: whose contract holds."""
    contract = layout.stage_text(plan.macros, stage) if stage else ""
    slots = {f"CLVOL_{family.upper()}_HEADER": header for family, header in plan.slots.items()}
    layout_of = partial(layout.layout_text, plan.macros, stage)
    return expand(text, {**plan.macros, **macros}, slots, layout_of, contract)


def stage_source(plan: Plan, stage: str) -> str:
    """The composed source of one stage kernel, or of `accumulate`."""
    if stage == "accumulate":
        return compose(plan, '#include "kernels/accumulate.cl"\n')
    contract, width = layout.stage(stage), widths(plan).get(stage, 0)
    handling = "packets" if contract.begins else "in_lanes" if width else "one_by_one"
    files = f"stages/{stage}.h", f"kernels/{handling}.cl", "kernels/stage.cl"
    text = "".join(f'#include "{file}"\n' for file in files)
    return compose(plan, text, {"CLVOL_LANES": width}, stage=contract)


def light_cache_source(plan: Plan) -> str:
    """The composed source of the kernels that fill the cache of lights."""
    return compose(plan, '#include "kernels/light_cache.cl"\n')


def lamp_edges_source(plan: Plan) -> str:
    """The composed source of the kernel that finds the pixels that edges of lamps pass."""
    return compose(plan, f'{_LAMPS}#include "kernels/lamp_edges.cl"\n')


def arguments_of(source: str) -> list[str]:
    """Names of what a unit's kernels take of the scene (CLVOL_ARGUMENTS), in order."""
    found = _ARGUMENTS.search(source)
    return [argument.split()[-1].removesuffix("_") for argument in found[1].split(", ")] if found else []


def build(device: Device, source: str, name: str, options: tuple[str, ...] = BUILD_OPTIONS) -> cl.Program:
    """Build a unit, once per device and process.

    A build that fails raises DeviceError with the log, which names file and line.
    """
    key = source, options
    if key in device.programs:
        return device.programs[key]
    if key in device.building:
        device.building[key]()
    program = cl.Program(device.context, source)
    try:
        device.programs[key] = program.build(options=list(options))
        return device.programs[key]
    except cl.Error as error:
        log, info = "", cl.program_build_info.LOG
        with suppress(cl.Error):  # a device that is lost has no log
            log = program.get_build_info(device.queue.device, info).strip()
        log = log or str(error)
        raise DeviceError(f"kernel {name!r} does not build on {device.description}:\n{log}") from error


def stage_units(plan: Plan, groups: int, pixels: int) -> dict[str, Unit]:
    """What is built for a plan: each stage, and `accumulate`, for so many groups and pixels."""
    local = plan.tuning.local_size
    sizes = dict.fromkeys(plan.stages, (groups * local, local)) | {"accumulate": (whole(pixels), GROUP)}
    return {
        name: Unit(stage_source(plan, name), BUILD_OPTIONS, (Launch(f"{name}_kernel", *size),))
        for name, size in sizes.items()
    }


def build_stages(device: Device, units: Mapping[str, Unit]) -> dict[str, cl.Kernel]:
    """One kernel object per unit."""
    return {
        name: cl.Kernel(build(device, unit.source, name, unit.options), unit.launches[0].name)
        for name, unit in units.items()
    }
