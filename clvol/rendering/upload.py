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
from clvol.rendering.lamp_edges import lamp_edge_buffer
from clvol.rendering.light_cache import light_cache_buffers
from clvol.rendering.residence import Residence, Same, compiled
from clvol.scene import records
from clvol.tables.affine import rows_3x4
from clvol.tables.blackbody import blackbody_table
from clvol.tables.light_cache import light_cache_record, rows
from clvol.tables.lights import LightTable, envmap_arrays, light_table
from clvol.tables.materials import material_table
from clvol.tables.media import glow_table, medium_table
from clvol.tables.meters import meter_faces
from clvol.tables.phases import phase_table
from clvol.tables.pixel_filter import filter_cdf
from clvol.tables.sobol import block_table
from clvol.tables.transfers import transfer_tables

if TYPE_CHECKING:
    from clvol.device.device import Device
    from clvol.tables.majorants import PreparedMajorant
    from clvol.tables.prepare import PreparedScene
    from clvol.tables.surfaces import Surfaces


def upload_scene(
    device: Device, prepared: PreparedScene, render: np.ndarray, residence: Residence | None = None
) -> dict[str, cl.Buffer]:
    """Buffers of every scene argument that the plan needs, by argument name, but the RENDER record.

    `residence`: where some of them may be already.
    """
    there = residence or Residence(device)
    needed = {argument.name for argument in layout.arguments(prepared.plan.macros)}
    buffers = _volume_buffers(there, prepared) if "volumes" in needed else {}
    arrays = {**_medium_arrays(prepared, needed), **_light_arrays(prepared, there, needed)}
    if "sobol" in needed:
        arrays["sobol"] = block_table(bool(prepared.plan.macros["CLVOL_JOINT"]))
    if "filter_cdf" in needed:
        arrays["filter_cdf"] = filter_cdf(prepared.scene.film.rfilter)
    if (measured := records.measured_shape(prepared.scene.camera)) is not None:
        arrays["meter"] = meter_faces(measured, prepared.centre)
    buffers |= {name: there.put(name, array) for name, array in arrays.items()}
    if "light_cache" in needed:
        camera = device.memory.upload(render, "the camera")

        def fill() -> dict[str, cl.Buffer]:
            return light_cache_buffers(device, prepared, {**buffers, "render": camera})

        names = sorted(name for name in buffers if name not in _NOT_OF_THE_CACHE)
        grid = light_cache_record(prepared).tobytes(), rows(prepared)
        key = compiled(prepared.plan), grid, tuple(names), Same(*(buffers[name] for name in names))
        buffers |= there.made("light_cache", key, fill)
    if "lamp_edges" in needed:
        view = render.copy()
        view["seed"] = 0
        seen = {"render": device.memory.upload(view, "the camera"), **buffers}
        names = sorted(name for name in buffers if name not in _NOT_OF_THE_CACHE)
        of_view = compiled(prepared.plan), view.tobytes(), tuple(names), Same(*(buffers[n] for n in names))
        buffers["lamp_edges"] = there.made(
            "lamp_edges", of_view, lambda: lamp_edge_buffer(device, prepared, seen)
        )
    return buffers


_NOT_OF_THE_CACHE = ("sobol", "filter_cdf", "meter")
"""Buffers that the cache of lights has nothing to do with."""


def _medium_arrays(prepared: PreparedScene, needed: set[str]) -> dict[str, np.ndarray]:
    """Media, what bounds them, and their majorants, by argument name."""
    arrays: dict[str, np.ndarray] = {}
    entries = prepared.boundaries.entries
    tables = (prepared.majorants[number] for number in prepared.matter.of_entry)
    majorants = [table for table in tables if table is not None]
    if "media" in needed:
        arrays["media"] = medium_table(prepared)
    if "glows" in needed:
        arrays["glows"] = glow_table(prepared)
    if "boundary_masks" in needed:
        arrays["boundary_masks"] = prepared.boundaries.masks()
    if "majorants" in needed:
        bounds = [_bounds(m) if lanes(prepared.plan) else m.majorant for m in majorants]
        arrays["majorants"] = np.concatenate(bounds)
    if "majorant_links" in needed:
        arrays["majorant_links"] = np.concatenate([m.links for m in majorants if m.links is not None])
    if "kd_nodes" in needed:
        arrays["kd_nodes"] = np.concatenate([m.nodes for m in majorants if m.nodes is not None])
    if "controls" in needed:
        arrays["controls"] = _table([m.control for m in majorants if m.control is not None])
    if "residuals" in needed:
        residuals = [m.residual for m in majorants if m.residual is not None]
        channels = max(rows.shape[1] - 1 for rows in residuals)
        parts = [
            np.hstack([np.broadcast_to(rows[:, :-1], (len(rows), channels)), rows[:, -1:]])
            for rows in residuals
        ]
        arrays["residuals"] = _table(parts)
    if "transfers" in needed:
        arrays["transfers"], arrays["transfer_points"] = transfer_tables(prepared.matter.media)
    if "blackbody" in needed:
        arrays["blackbody"] = blackbody_table()
    if "phases" in needed:
        arrays["phases"] = phase_table(entries, prepared.matter)
    return arrays


def _light_arrays(prepared: PreparedScene, there: Residence, needed: set[str]) -> dict[str, np.ndarray]:
    """Lights and surfaces, by argument name."""
    lights = light_table(
        prepared.scene, prepared.centre, prepared.radius, prepared.surfaces, prepared.plan.uniform_share
    )
    arrays = {"emitters": lights.emitters, "light_faces": lights.faces, "light_cdf": lights.cdf}
    if prepared.surfaces is not None:
        arrays |= _surface_arrays(prepared, prepared.surfaces, lights)
    elif "textures" in needed:
        materials = material_table([], lights.textures)
        arrays |= {"textures": materials.textures, "texels": materials.texels}
    if "envmap" in needed:
        [environment] = (e for e in prepared.scene.emitters if isinstance(e, records.EnvmapEmitter))
        arrays |= there.made("envmap", Same(environment), lambda: envmap_arrays(environment))
    return {name: array for name, array in arrays.items() if name in needed}


def _bounds(majorant: PreparedMajorant) -> np.ndarray:
    """Bounds of a grid's cells as walks in lanes take them."""
    return marked_empty(majorant.majorant.reshape(majorant.cells[::-1])).reshape(-1)


def _surface_arrays(prepared: PreparedScene, surfaces: Surfaces, lights: LightTable) -> dict[str, np.ndarray]:
    """What the device knows of surfaces, by argument name; without what no surface has."""
    volumes = {id(volume): number for number, volume in enumerate(prepared.matter.volumes)}
    materials = material_table([shape.bsdf for shape in surfaces.shapes], lights.textures, volumes)
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


def _table(parts: list[np.ndarray]) -> np.ndarray:
    """Rows per majorant cell of every medium, one after the other; a grey medium repeats its channel."""
    width = max(part.shape[1] for part in parts)
    rows = [np.broadcast_to(part, (len(part), width)) for part in parts]
    return np.concatenate(rows).astype(np.float32)


def _volume_buffers(there: Residence, prepared: PreparedScene) -> dict[str, cl.Buffer]:
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
    tops_array = np.concatenate(tops)

    def fill() -> cl.Buffer:
        """The samples of every brick, a chunk at a time."""
        device, size = there.device, brick_offset * BRICK_SAMPLES * 4
        hint = "use a device with more memory, or a volume of lower resolution"
        pool = device.memory.allocate(size, "the scene's volumes", hint)
        for record, volume in zip(table, prepared.volumes, strict=True):
            for first, samples in volume.bricks.stored():
                at = (int(record["brick_offset"]) + first * volume.bricks.channels) * BRICK_SAMPLES * 4
                cl.enqueue_copy(device.queue, pool, samples, dst_offset=at, is_blocking=True)
        there.uploaded += size
        return pool

    pool = there.made("bricks", Same(*(volume.bricks for volume in prepared.volumes)), fill)
    return {"volumes": there.put("volumes", table), "tops": there.put("tops", tops_array), "bricks": pool}
