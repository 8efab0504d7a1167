"""Fills the cache of lights on the device, once per scene (cl/kernels/light_cache.cl)."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import pyopencl as cl

from clvol.device.launch import GROUP, run_kernel, scene_arguments, whole
from clvol.device.programs import BUILD_OPTIONS, arguments_of, build, light_cache_source
from clvol.device.side_builds import Launch, Unit
from clvol.errors import option
from clvol.tables.light_cache import SKY_DIRECTIONS, light_cache_record, rows, typical_radiance

if TYPE_CHECKING:
    from collections.abc import Mapping

    from clvol.device.device import Device
    from clvol.tables.prepare import PreparedScene

_PURPOSE = "the cache of lights", f"choose {option('shadow_cache', 'off')}"


def light_cache_unit(prepared: PreparedScene) -> Unit:
    """What is built for it."""
    cells = int(np.prod(light_cache_record(prepared)["size"]))
    sizes = {"light_cache_extinction": cells, "light_cache_transmittance": cells * rows(prepared)}
    launches = tuple(Launch(name, whole(size), GROUP) for name, size in sizes.items())
    return Unit(light_cache_source(prepared.plan), BUILD_OPTIONS, launches)


def light_cache_buffers(
    device: Device, prepared: PreparedScene, buffers: Mapping[str, cl.Buffer]
) -> dict[str, cl.Buffer]:
    """The cache's record and cells, by argument name; `buffers`: what the scene has beside them."""
    plan, record = prepared.plan, light_cache_record(prepared)
    cells = int(np.prod(record["size"]))
    count = cells * rows(prepared)
    source = light_cache_source(plan)
    program = build(device, source, "light_cache")
    unused = device.memory.allocate(4, *_PURPOSE)
    known = {**buffers, "light_cache": device.memory.upload(record, *_PURPOSE)}
    arguments = scene_arguments(arguments_of(source), known, slot_stride=1, unused=unused)

    def run(name: str, inputs: list[np.ndarray], outputs: list[np.ndarray]) -> None:
        number = np.uint32(len(outputs[0]))
        kernel = cl.Kernel(program, name)
        run_kernel(device, kernel, len(outputs[0]), arguments, inputs, outputs, [number], purpose=_PURPOSE)

    extinction = np.empty(cells, np.float32)
    transmittance, irradiance = np.empty(count, np.float32), np.empty(count, np.float32)
    run("light_cache_extinction", [], [extinction])
    run("light_cache_transmittance", [extinction], [transmittance, irradiance])
    of_rows = transmittance.reshape(-1, cells)
    if plan.features.samples_sky:
        of_rows[0] = of_rows[-SKY_DIRECTIONS:].mean(axis=0)
    record["typical"] = typical_radiance(extinction, (of_rows * irradiance.reshape(-1, cells)).sum(axis=0))
    return {
        "light_cache": device.memory.upload(record, *_PURPOSE),
        "light_transmittance": device.memory.upload(transmittance, *_PURPOSE),
    }
