"""A prepared scene in device buffers: media, volumes, majorants, lights, filter.

World positions are relative to the scene's centre, taken in double before they become floats.
Volumes are written brick chunk by brick chunk, so that the host never holds a second copy.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import pyopencl as cl

from clvol import layout
from clvol.accel.skipping import marked_empty
from clvol.layout import BRICK_SAMPLES
from clvol.planning.lanes import lanes
from clvol.rendering.light_cache import light_cache_buffers
from clvol.scene import records
from clvol.tables.affine import rows_3x4
from clvol.tables.blackbody import blackbody_table
from clvol.tables.lights import LightTable, envmap_arrays, light_table
from clvol.tables.materials import material_table
from clvol.tables.media import medium_table, phase_table
from clvol.tables.pixel_filter import filter_cdf
from clvol.tables.sobol import block_table

if TYPE_CHECKING:
    from clvol.device.device import Device
    from clvol.tables.majorants import PreparedMajorant
    from clvol.tables.prepare import PreparedScene
    from clvol.tables.surfaces import Surfaces


def upload_scene(device: Device, prepared: PreparedScene, render: np.ndarray) -> dict[str, cl.Buffer]:
    """Buffers of every scene argument that the plan needs, by argument name, but the RENDER record."""
    buffers: dict[str, cl.Buffer] = {}
    needed = {argument.name for argument in layout.arguments(prepared.plan.macros)}
    if "sobol" in needed:
        buffers["sobol"] = _buffer(device, block_table(bool(prepared.plan.macros["CLVOL_JOINT"])))
    if "volumes" in needed:
        buffers |= _volume_buffers(device, prepared)
    if "media" in needed:
        buffers["media"] = _buffer(device, medium_table(prepared))
    if "boundary_masks" in needed:
        buffers["boundary_masks"] = _buffer(device, prepared.boundaries.masks())
    entries = prepared.boundaries.entries
    tables = (prepared.majorants[number] for number in prepared.matter.of_entry)
    majorants = [table for table in tables if table is not None]
    if "majorants" in needed:
        bounds = [_bounds(m) if lanes(prepared.plan) else m.majorant for m in majorants]
        buffers["majorants"] = _buffer(device, np.concatenate(bounds))
    if "majorant_links" in needed:
        buffers["majorant_links"] = _buffer(
            device, np.concatenate([m.links for m in majorants if m.links is not None])
        )
    if "kd_nodes" in needed:
        buffers["kd_nodes"] = _buffer(
            device, np.concatenate([m.nodes for m in majorants if m.nodes is not None])
        )
    if "controls" in needed:
        buffers["controls"] = _table(device, [m.control for m in majorants if m.control is not None])
    if "residuals" in needed:
        residuals = [m.residual for m in majorants if m.residual is not None]
        channels = max(rows.shape[1] - 1 for rows in residuals)
        parts = [
            np.hstack([np.broadcast_to(rows[:, :-1], (len(rows), channels)), rows[:, -1:]])
            for rows in residuals
        ]
        buffers["residuals"] = _table(device, parts)
    if "blackbody" in needed:
        buffers["blackbody"] = _buffer(device, blackbody_table())
    if "phases" in needed:
        buffers["phases"] = _buffer(device, phase_table(entries))
    lights = light_table(
        prepared.scene, prepared.centre, prepared.radius, prepared.surfaces, prepared.plan.uniform_share
    )
    arrays = {"emitters": lights.emitters, "light_faces": lights.faces, "light_cdf": lights.cdf}
    if prepared.surfaces is not None:
        arrays |= _surface_arrays(prepared.surfaces, lights)
    buffers |= {name: _buffer(device, array) for name, array in arrays.items() if name in needed}
    if "envmap" in needed:
        [environment] = (e for e in prepared.scene.emitters if isinstance(e, records.EnvmapEmitter))
        for name, array in envmap_arrays(environment).items():
            buffers[name] = _buffer(device, array)
    if "filter_cdf" in needed:
        buffers["filter_cdf"] = _buffer(device, filter_cdf(prepared.scene.film.rfilter))
    if "light_cache" in needed:
        known = {**buffers, "render": device.memory.upload(render, "the camera")}
        buffers |= light_cache_buffers(device, prepared, known)
    return buffers


def _bounds(majorant: PreparedMajorant) -> np.ndarray:
    """Bounds of a grid's cells as walks in lanes take them."""
    return marked_empty(majorant.majorant.reshape(majorant.cells[::-1])).reshape(-1)


def _surface_arrays(surfaces: Surfaces, lights: LightTable) -> dict[str, np.ndarray]:
    """What the device knows of surfaces, by argument name; without what no surface has."""
    materials = material_table([shape.bsdf for shape in surfaces.shapes])
    table = surfaces.table.copy()
    table["front"], table["back"] = materials.sides.T
    table["emitter"] = lights.of_shape
    arrays: dict[str, np.ndarray | None] = {
        "bvh_nodes": surfaces.hierarchy.nodes,
        "bvh_triangles": surfaces.hierarchy.packets,
        "quadrics": surfaces.quadrics,
        "shapes": table,
        "faces": surfaces.faces,
        "vertices": surfaces.vertices,
        "normals": surfaces.normals,
        "uvs": surfaces.uvs,
        "materials": materials.materials,
        "textures": materials.textures,
        "texels": materials.texels,
        "material_tables": materials.tables,
    }
    return {name: array for name, array in arrays.items() if array is not None}


def _buffer(device: Device, array: np.ndarray) -> cl.Buffer:
    return device.memory.upload(
        array, "the scene", "use a device with more memory, or simpler meshes and pictures"
    )


def _table(device: Device, parts: list[np.ndarray]) -> cl.Buffer:
    """Rows per majorant cell of every medium, one after the other; a grey medium repeats its channel."""
    width = max(part.shape[1] for part in parts)
    rows = [np.broadcast_to(part, (len(part), width)) for part in parts]
    return _buffer(device, np.concatenate(rows).astype(np.float32))


def _volume_buffers(device: Device, prepared: PreparedScene) -> dict[str, cl.Buffer]:
    """Records, top grids and the brick pool of every volume."""
    table = np.zeros(len(prepared.volumes), layout.VOLUME)
    tops, brick_offset, top_offset = [], 0, 0
    for record, volume in zip(table, prepared.volumes, strict=True):
        bricks = volume.bricks
        record["world_to_index"] = rows_3x4(volume.world_to_index)
        record["size"], record["channels"] = bricks.size, bricks.channels
        record["bricks"], record["levels"] = bricks.shape[::-1], bricks.levels
        record["top_offset"], record["brick_offset"] = top_offset, brick_offset
        record["nearest"] = int(volume.volume.filter_type == "nearest")
        # numbers count bricks of `channels` × 729 floats; in the pool all count in 729 floats
        top = bricks.top.reshape(-1)
        tops.append(np.where(top > 0, top * np.int32(bricks.channels), top))
        top_offset += bricks.top.size
        brick_offset += bricks.brick_count * bricks.channels
    pool = device.memory.allocate(
        brick_offset * BRICK_SAMPLES * 4,
        "the scene's volumes",
        "use a device with more memory, or a volume of lower resolution",
    )
    for record, volume in zip(table, prepared.volumes, strict=True):
        for first, samples in volume.bricks.stored():
            at = (int(record["brick_offset"]) + first * volume.bricks.channels) * BRICK_SAMPLES * 4
            cl.enqueue_copy(device.queue, pool, samples, dst_offset=at, is_blocking=True)
    return {"volumes": _buffer(device, table), "tops": _buffer(device, np.concatenate(tops)), "bricks": pool}
