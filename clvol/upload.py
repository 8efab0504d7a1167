"""A prepared scene in device buffers: media, volumes, majorants, lights, filter.

World positions are relative to the scene's centre, taken in double before they become floats.
Volumes are written brick chunk by brick chunk, so that the host never holds a second copy.
"""

from __future__ import annotations

import numpy as np
import pyopencl as cl

from clvol import layout
from clvol.blackbody import blackbody_rgb, blackbody_table
from clvol.config import KernelConfig
from clvol.device import Device
from clvol.environment import envmap_distribution, luminance
from clvol.features import bounding_kind, is_clipped, is_homogeneous, scene_media
from clvol.film import filter_cdf
from clvol.prepare import PreparedScene, PreparedVolume
from clvol.scene import records
from clvol.scene.phase import phase_lobes
from clvol.volumes.bricks import BRICK_SAMPLES


def upload_scene(
    device: Device, prepared: PreparedScene, config: KernelConfig, step: float | None = None
) -> dict[str, cl.Buffer]:
    """Buffers of every scene argument that `config` needs, by argument name.

    `step` is the world length of a step of ray marching; None takes the least edge of a voxel.
    """
    volumes = {key: number for number, key in enumerate(prepared.volumes)}
    emitters = emitter_order(prepared.scene)
    buffers: dict[str, cl.Buffer] = {}
    needed = {argument.name for argument in layout.arguments(config)}
    if "volumes" in needed:
        buffers |= _volume_buffers(device, prepared)
    if "media" in needed:
        buffers["media"] = _buffer(device, _media(prepared, volumes, step))
    majorants = [
        prepared.majorants[id(m)] for m in scene_media(prepared.scene) if id(m) in prepared.majorants
    ]
    if "majorants" in needed:
        buffers["majorants"] = _buffer(device, np.concatenate([m.majorant for m in majorants]))
    if "kd_nodes" in needed:
        buffers["kd_nodes"] = _buffer(device, np.concatenate([m.nodes for m in majorants]))
    if "controls" in needed:
        buffers["controls"] = _table(device, [m.control for m in majorants])
    if "residuals" in needed:
        channels = max(m.residual.shape[1] - 1 for m in majorants)
        rows = [
            np.hstack([np.broadcast_to(m.residual[:, :-1], (len(m.residual), channels)), m.residual[:, -1:]])
            for m in majorants
        ]
        buffers["residuals"] = _table(device, rows)
    if "blackbody" in needed:
        buffers["blackbody"] = _buffer(device, blackbody_table())
    if "phases" in needed:
        buffers["phases"] = _buffer(device, _phases(scene_media(prepared.scene)))
    if "emitters" in needed:
        buffers["emitters"] = _buffer(device, _emitters(prepared, emitters))
    if "envmap" in needed:
        buffers |= _envmap_buffers(device, emitters[0])
    if "filter_cdf" in needed:
        buffers["filter_cdf"] = _buffer(device, filter_cdf(prepared.scene.film.rfilter))
    return buffers


def _buffer(device: Device, array: np.ndarray) -> cl.Buffer:
    flags = cl.mem_flags.READ_ONLY | cl.mem_flags.COPY_HOST_PTR
    return cl.Buffer(device.context, flags, hostbuf=np.ascontiguousarray(array))


def rows_3x4(matrix: np.ndarray) -> np.ndarray:
    """The affine part of a 4x4 matrix as 12 floats."""
    return matrix[:3].astype(np.float32).reshape(12)


def _rgb(value: tuple[float, ...]) -> np.ndarray:
    return np.broadcast_to(np.asarray(value, np.float64), 3)


def _table(device: Device, parts: list[np.ndarray]) -> cl.Buffer:
    """Rows per majorant cell of every medium, one after the other; a grey medium repeats its channel."""
    width = max(part.shape[1] for part in parts)
    rows = [np.broadcast_to(part, (len(part), width)) for part in parts]
    return _buffer(device, np.concatenate(rows).astype(np.float32))


def _volume_buffers(device: Device, prepared: PreparedScene) -> dict[str, cl.Buffer]:
    """Records, top grids and the brick pool of every volume."""
    table = np.zeros(len(prepared.volumes), layout.VOLUME)
    tops, brick_offset, top_offset = [], 0, 0
    for record, volume in zip(table, prepared.volumes.values(), strict=True):
        bricks = volume.bricks
        record["world_to_index"] = rows_3x4(volume.world_to_index)
        record["size"], record["channels"] = bricks.size, bricks.channels
        record["bricks"] = bricks.top.shape[::-1]
        record["top_offset"], record["brick_offset"] = top_offset, brick_offset
        record["nearest"] = int(volume.volume.filter_type == "nearest")
        # numbers count bricks of `channels` × 729 floats; in the pool all count in 729 floats
        tops.append(bricks.top.reshape(-1) * np.int32(bricks.channels))
        top_offset += bricks.top.size
        brick_offset += bricks.brick_count * bricks.channels
    pool = device.allocate(
        brick_offset * BRICK_SAMPLES * 4,
        "the scene's volumes",
        "use a device with more memory, or a volume of lower resolution",
    )
    for record, volume in zip(table, prepared.volumes.values(), strict=True):
        for first, samples in volume.bricks.stored():
            at = (int(record["brick_offset"]) + first * volume.bricks.channels) * BRICK_SAMPLES * 4
            cl.enqueue_copy(device.queue, pool, samples, dst_offset=at, is_blocking=True)
    return {"volumes": _buffer(device, table), "tops": _buffer(device, np.concatenate(tops)), "bricks": pool}


def _media(prepared: PreparedScene, volumes: dict[int, int], step: float | None) -> np.ndarray:
    """One Medium record per bounding shape."""
    shapes = [s for s in prepared.scene.shapes if s.interior is not None]
    table = np.zeros(len(shapes), layout.MEDIUM)
    cell_offset = kd_root = phase_first = 0
    incident = mean_incident_radiance(prepared.scene)
    for record, shape in zip(table, shapes, strict=True):
        medium = shape.interior
        record["shape_from_world"] = rows_3x4(_from_centred(shape.to_world, prepared.centre))
        record["shape_kind"] = layout.enum("SHAPE", bounding_kind(shape))
        record["homogeneous"] = int(is_homogeneous(medium))
        record["clipped"] = int(is_clipped(medium))
        record["phase_first"], record["phase_count"] = phase_first, len(phase_lobes(medium.phase))
        phase_first += record["phase_count"]
        record["sample_emitters"] = int(medium.sample_emitters)
        _emission(record, medium, volumes)
        record["background"] = incident * expected_albedo(medium)
        record["sigma_t_volume"] = volumes.get(id(medium.sigma_t), -1)
        record["albedo_volume"] = volumes.get(id(medium.albedo), -1)
        if isinstance(medium.albedo, records.ConstVolume):
            record["albedo"] = _rgb(medium.albedo.value)
        if is_homogeneous(medium):
            record["sigma_t"] = _rgb(medium.sigma_t.value) * _rgb(medium.scale)
            record["box_from_world"] = rows_3x4(_from_centred(medium.sigma_t.to_world, prepared.centre))
            record["box_upper"] = 1.0
            continue
        majorant, volume = prepared.majorants[id(medium)], prepared.volumes[id(medium.sigma_t)]
        to_brick = volume.world_to_index @ _centred(medium.sigma_t.index_to_world, prepared.centre)
        record["sigma_t"] = _rgb(medium.scale)
        record["box_from_world"] = rows_3x4(volume.world_to_index)
        record["box_lower"] = (to_brick @ [*medium.sigma_t.lower, 1.0])[:3]
        record["box_upper"] = (to_brick @ [*medium.sigma_t.upper, 1.0])[:3]
        record["march_step"] = step or voxel_edges(volume).min()
        record["majorant"] = majorant.majorant.max()
        record["cells"], record["cell_size"] = majorant.cells, majorant.cell_size
        record["cell_offset"], record["kd_root"] = cell_offset, kd_root
        cell_offset += len(majorant.majorant)
        kd_root += 0 if majorant.nodes is None else len(majorant.nodes)
    return table


def _phases(media: list[records.Medium]) -> np.ndarray:
    """One Phase record per lobe of each medium, in the order that `phase_first` counts in."""
    lobes = [(layout.enum("PHASE", p.kind), p.g, share) for m in media for p, share in phase_lobes(m.phase)]
    return np.array(lobes, layout.PHASE)


def voxel_edges(volume: PreparedVolume) -> np.ndarray:
    """World lengths of a voxel's edges, float64 (3,)."""
    return np.linalg.norm(np.linalg.inv(volume.world_to_index)[:3, :3], axis=0)


def mean_incident_radiance(scene: records.Scene) -> np.ndarray:
    """Mean over all directions of the radiance that arrives from infinity, float64 (3,); 0 where a limit of
    depth keeps most of it from the picture."""
    total = np.zeros(3)
    if 0 <= scene.integrator.max_depth < 3:
        return total
    for emitter in scene.emitters:
        match emitter:
            case records.ConstantEmitter():
                total += _rgb(emitter.radiance)
            case records.DirectionalEmitter():
                total += _rgb(emitter.irradiance) / (4 * np.pi)
            case records.EnvmapEmitter():
                rows = emitter.radiance.mean(axis=1, dtype=np.float64)
                weights = np.sin(np.pi * np.arange(len(rows)) / max(len(rows) - 1, 1)) + 1e-9
                total += np.average(rows, axis=0, weights=weights)
    return total


def expected_albedo(medium: records.Medium) -> np.ndarray:
    """Root of the share of diffuse light that a half-space of the medium returns (van de Hulst 1980), a guess
    between that and the 1 of its rim, float64 (3,); 0 where the albedo varies."""
    if not isinstance(medium.albedo, records.ConstVolume):
        return np.zeros(3)
    s = np.sqrt(1.0 - _rgb(medium.albedo.value))
    return np.sqrt((1 - s) * (1 - 0.139 * s) / (1 + 1.17 * s))


def _emission(record: np.void, medium: records.Medium, volumes: dict[int, int]) -> None:
    """What a medium emits; constants are multiplied together here."""
    record["emission_volume"] = volumes.get(id(medium.emission), -1)
    record["temperature_volume"] = volumes.get(id(medium.temperature), -1)
    if not medium.emits:
        return
    radiance = np.full(3, medium.emission_scale)
    if isinstance(medium.emission, records.ConstVolume):
        radiance = radiance * _rgb(medium.emission.value)
    if isinstance(medium.temperature, records.ConstVolume):
        kelvin = (medium.temperature.value[0] - medium.temperature_offset) * medium.temperature_scale
        radiance = radiance * blackbody_rgb(np.array([kelvin]))[0]
    record["emits"], record["emission"] = 1, radiance
    record["temperature_scale"] = medium.temperature_scale
    record["temperature_offset"] = medium.temperature_offset


def _centred(to_world: np.ndarray, centre: np.ndarray) -> np.ndarray:
    matrix = to_world.copy()
    matrix[:3, 3] -= centre
    return matrix


def _from_centred(to_world: np.ndarray, centre: np.ndarray) -> np.ndarray:
    return np.linalg.inv(_centred(to_world, centre))


def emitter_order(scene: records.Scene) -> list[records.Emitter]:
    """Emitters with the environment, if any, first: the device looks for it there."""
    environments = (records.ConstantEmitter, records.EnvmapEmitter)
    return sorted(scene.emitters, key=lambda e: not isinstance(e, environments))


def _emitters(prepared: PreparedScene, emitters: list[records.Emitter]) -> np.ndarray:
    """Emitter records; next-event estimation picks them by the power they send through the scene's sphere."""
    table = np.zeros(len(emitters), layout.EMITTER)
    power = np.zeros(len(emitters))
    disc = np.pi * prepared.radius**2
    for i, (record, emitter) in enumerate(zip(table, emitters, strict=True)):
        match emitter:
            case records.ConstantEmitter():
                value, power[i] = emitter.radiance, 4 * np.pi * disc
            case records.EnvmapEmitter():
                value, power[i] = (float(luminance(emitter.radiance).mean()),), 4 * np.pi * disc
            case records.DirectionalEmitter():
                value, power[i] = emitter.irradiance, disc
                record["vector"] = emitter.direction
            case records.PointEmitter():
                value, power[i] = emitter.intensity, 4 * np.pi
                record["vector"] = np.asarray(emitter.position) - prepared.centre
        record["kind"] = layout.enum("EMITTER", type(emitter).__name__.removesuffix("Emitter"))
        record["value"] = _rgb(value)
        power[i] *= float(luminance(_rgb(value)))
    total = power.sum()
    table["select_pdf"] = power / total if total > 0 else 1.0 / len(power)
    return table


def _envmap_buffers(device: Device, emitter: records.EnvmapEmitter) -> dict[str, cl.Buffer]:
    record = np.zeros(1, layout.ENVMAP)
    rotation = np.eye(4)
    rotation[:3, :3] = emitter.to_world[:3, :3]
    record["world_from_env"] = rows_3x4(rotation)
    record["env_from_world"] = rows_3x4(np.linalg.inv(rotation))
    height, width, _ = emitter.radiance.shape
    record["size"] = width, height
    marginal, conditional = envmap_distribution(emitter.radiance)
    return {
        "envmap": _buffer(device, record),
        "env_texels": _buffer(device, emitter.radiance.astype(np.float32)),
        "env_marginal": _buffer(device, marginal),
        "env_conditional": _buffer(device, conditional),
    }
