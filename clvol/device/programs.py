"""From a KernelConfig to bound kernels: composes one translation unit per stage and builds it.

Units are written out in full (includes expanded, `#line` kept), so that a dump is self-contained, no
include path reaches the compiler, and drivers' caches see exactly what is compiled.
"""

from __future__ import annotations

import re
from functools import cache
from importlib import resources
from typing import TYPE_CHECKING

import pyopencl as cl

from clvol import layout
from clvol.errors import DeviceError
from clvol.planning import registry
from clvol.tables.materials import BSDF_HEADERS

if TYPE_CHECKING:
    from collections.abc import Iterator

    from clvol.device.device import Device
    from clvol.planning.config import KernelConfig

_INCLUDE = re.compile(r'^\s*#include\s+"([^"]+)"')
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


def _expand(name: str, seen: set[str]) -> Iterator[str]:
    """Lines of a file with its includes in place, each file once."""
    if name in seen:
        return
    seen.add(name)
    yield f'#line 1 "{name}"'
    for number, line in enumerate(kernel_source(name).splitlines(), 1):
        match = _INCLUDE.match(line)
        if match:
            yield from _expand(match[1], seen)
            yield f'#line {number + 1} "{name}"'
        else:
            yield line


def stage_headers(config: KernelConfig, stage: str) -> list[str]:
    """Headers that a stage of this configuration needs, in order."""
    features = config.features
    walks = stage in ("medium_sample", "shadow_transmittance")
    emits = (stage == "medium_sample" and features.emission and not features.media_overlap) or (
        stage == "shade" and features.emission and features.media_overlap
    )
    scatters = stage == "shade" and (features.scattering or (bool(config.first_hit) and features.media > 0))
    fields = (emits and (features.albedo_volumes or features.emission_volumes or features.temperature)) or (
        scatters and features.albedo_volumes
    )
    headers = []
    if walks and features.heterogeneous:
        headers.append(registry.LOOKUPS[config.lookup].header)
    elif fields:
        headers.append("density/volume.h")
    if emits:
        headers.append("medium/emission.h")
    elif scatters:
        headers.append("medium/albedo.h")
    if walks and features.heterogeneous:
        chosen = config.tracker if stage == "medium_sample" else registry.TRANSMITTANCES[config.transmittance]
        if chosen.walks_majorant:
            headers.append(majorant_header(config))
        headers.append(chosen.header)
        if emits:
            headers.append("tracking/thin_emission.h")
    if walks and features.homogeneous:
        analytic = "homogeneous" if stage == "medium_sample" else "homogeneous_transmittance"
        headers.append(f"tracking/{analytic}.h")
    materials = features.surfaces and (
        stage == "shade" or (stage == "shadow_transmittance" and features.passable)
    )
    if materials:
        headers += [*(["texture/texture.h"] if features.textures else []), *bsdf_headers(features.bsdfs)]
    if stage == "shade":
        if features.scattering:
            headers.append("phase/phase.h")
        if features.area:
            headers += ["geometry/surface.h", "emitter/area.h"]
        if features.envmap:
            headers.append("emitter/envmap.h")
        headers.append("emitter/emitter.h")
    return headers + geometry_headers(config, stage)


def majorant_header(config: KernelConfig) -> str:
    """The header of the majorant's walk."""
    return "majorant/tree_grid.h" if config.tree_grid else registry.MAJORANTS[config.majorant].header


def geometry_headers(config: KernelConfig, stage: str) -> list[str]:
    """Headers of what a stage knows of surfaces and of where media are."""
    features = config.features
    headers = []
    crosses = {
        "intersect": features.camera_inside,
        "shade": features.surfaces > 0,
        "shadow_transmittance": features.passable,
    }
    if features.surfaces and stage in crosses:
        headers.append("geometry/bvh.h")
        if stage != "shadow_transmittance":
            headers.append("stages/hit.h")
        elif features.area:
            headers.append("geometry/surface.h")
        if crosses[stage]:
            headers += ["geometry/surface.h", "stages/boundary.h"]
        if crosses[stage] and stage != "intersect":
            headers.append("stages/side.h")
    if features.media and stage in ("intersect", "medium_sample", "shadow_transmittance"):
        headers.append("geometry/interval.h")
        if features.stretches or stage == "shadow_transmittance":
            headers.append("stages/media.h")
        if stage != "intersect":
            headers.append("stages/legs.h")
    return headers


def shade_headers(config: KernelConfig) -> list[str]:
    """Headers of the events that shade handles."""
    features = config.features
    found = {
        "stages/escape.h": features.constant or features.envmap,
        "stages/bounce.h": features.surfaces or features.scattering,
        "stages/first_hit.h": bool(config.first_hit),
        "stages/surface_scatter.h": features.surfaces > 0,
        "stages/collision_scatter.h": features.media > 0,
    }
    return [name for name, needed in found.items() if needed]


def bsdf_headers(kinds: tuple[str, ...]) -> list[str]:
    """Headers of the BSDFs that a scene uses, and the one that chooses among them."""
    return [BSDF_HEADERS[kind] for kind in kinds if kind in BSDF_HEADERS] + ["bsdf/bsdf.h"]


def compose(config: KernelConfig, headers: list[str], body: str) -> str:
    """A translation unit: defines, layout, `headers`, then `body` (OpenCL text).

    Only the macros that occur in it are defined: caches are keyed on the text, and stages that a choice
    does not touch are not built again.
    """
    seen: set[str] = set()
    lines = []
    for name in ("core/types.h", "core/random.h"):
        lines += _expand(name, seen)
    lines += ['#line 1 "layout"', *layout.layout_text(config.macros).splitlines()]
    reads = config.top_trees and any(name.startswith("density/") for name in headers)
    trees = ["geometry/lattice_tree.h"] if reads else []
    for name in (registry.SAMPLERS[config.sampler].header, *trees, *headers):
        lines += _expand(name, seen)
    for line in body.splitlines():
        match = _INCLUDE.match(line)
        lines += _expand(match[1], seen) if match else [line]
    text = "\n".join(lines) + "\n"
    used = set(re.findall(r"\bCLVOL_\w+", text))
    defines = [f"#define {name} {value}\n" for name, value in config.macros.items() if name in used]
    return "/* Composed by clvol. */\n" + "".join(defines) + text


def stage_source(config: KernelConfig, stage: str) -> str:
    """The composed source of one stage kernel, or of `accumulate`."""
    headers = [] if stage == "accumulate" else [*stage_headers(config, stage), "stages/path.h"]
    if stage == "shade":
        headers += shade_headers(config)
    return compose(config, headers, f'#include "kernels/{stage}.cl"\n')


def build(device: Device, source: str, name: str) -> cl.Program:
    """Build a unit, once per device and process.

    A build that fails raises DeviceError with the log, which names file and line.
    """
    if source in device.programs:
        return device.programs[source]
    program = cl.Program(device.context, source)
    try:
        device.programs[source] = program.build(options=list(BUILD_OPTIONS))
        return device.programs[source]
    except cl.RuntimeError as error:
        log = program.get_build_info(device.queue.device, cl.program_build_info.LOG).strip() or str(error)
        raise DeviceError(f"kernel {name!r} does not build on {device.description}:\n{log}") from error


def build_stages(device: Device, config: KernelConfig) -> dict[str, cl.Kernel]:
    """One kernel object per stage of `config`, and `accumulate`."""
    names = (*config.stages, "accumulate")
    return {
        name: cl.Kernel(build(device, stage_source(config, name), name), f"{name}_kernel") for name in names
    }
