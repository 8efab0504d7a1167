"""Media as device records: where each is, what it is made of, and what bounds it.  Pure NumPy."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from clvol import layout
from clvol.scene import records
from clvol.scene.boundaries import entry_bounds, is_clipped
from clvol.scene.medium_facts import bounding_kind, is_homogeneous
from clvol.scene.phase import phase_lobes
from clvol.scene.thinness import thin_media
from clvol.tables.affine import centred, from_centred, rows_3x4
from clvol.tables.apart import peak_extinction
from clvol.tables.blackbody import blackbody_rgb
from clvol.tables.colours import luminance, rgb
from clvol.tables.phases import has_varied_lobes

if TYPE_CHECKING:
    from collections.abc import Mapping

    from clvol.tables.prepare import PreparedScene

BOUND_SLACK = 1e-5
"""Share of its size by which a medium's world box exceeds the boundaries that hold it."""


def medium_table(prepared: PreparedScene) -> np.ndarray:
    """MEDIUM records of a scene's media, in the order of its entries."""
    entries, matter = prepared.boundaries.entries, prepared.matter
    table = np.zeros(len(entries), layout.MEDIUM)
    cell_offset = kd_root = links_first = phase_first = 0
    sky, suns = mean_incident_radiance(prepared.scene, prepared.plan.sun_control)
    alone = prepared.surfaces is None
    varied = has_varied_lobes(entries)
    boxes = entry_bounds(prepared.scene, prepared.boundaries)
    thin = thin_media(prepared.scene, prepared.boundaries)
    numbered = zip(table, entries, matter.of_entry, boxes, thin, strict=True)
    for record, entry, number, box, is_thin in numbered:
        medium, roles = entry.medium, matter.roles[number]
        sigma_t = medium.sigma_t
        majorant, volume = prepared.majorants[number], prepared.density(number)
        record["thin"] = int(is_thin)
        record["presence"] = int(entry.shape is not None or entry.everywhere)
        if entry.shape is not None:
            record["shape_from_world"] = rows_3x4(from_centred(entry.shape.to_world, prepared.centre))
            record["shape_kind"] = layout.enum("SHAPE", bounding_kind(entry.shape))
        record["homogeneous"] = int(is_homogeneous(medium))
        record["clipped"] = int(is_clipped(medium))
        record["phase_first"], record["phase_count"] = phase_first, len(phase_lobes(medium.phase))
        phase_first += record["phase_count"] * (2 if varied else 1)
        record["sample_emitters"] = int(medium.sample_emitters)
        _emission(record, medium, roles)
        depth = most_depth(peak_extinction(medium, volume), box)
        caught = -np.expm1(-depth)  # a sun is seen in what scatters it alone
        returned = expected_albedo(medium)
        if prepared.plan.expects_background:
            across = np.minimum(depth, prepared.plan.depth_across)
            returned = np.maximum(returned, escaping_share(_mean_albedo(prepared, medium, roles), across))
            caught *= beside_peaks(medium.phase)
        record["background"] = (sky + suns * caught) * returned * alone
        record["camera_rate"] = prepared.plan.camera_rate
        record["transfer"] = -1 if medium.transfers is None else len(layout.ENUMS["TRANSFER"]) * number
        record["sigma_t_volume"] = roles.get("sigma_t", -1)
        record["albedo_volume"] = roles.get("albedo", -1)
        if isinstance(medium.albedo, records.ConstVolume):
            record["albedo"] = rgb(medium.albedo.value)
        if isinstance(sigma_t, records.ConstVolume):
            record["sigma_t"] = rgb(sigma_t.value) * rgb(medium.scale)
            record["box_from_world"] = rows_3x4(from_centred(sigma_t.to_world, prepared.centre))
            record["box_upper"] = 1.0
            if medium.homogeneous and entry.shape is None and not entry.everywhere:
                _clip_to(record, box, prepared.centre)
            continue
        assert majorant is not None
        assert volume is not None
        to_brick = volume.world_to_index @ centred(sigma_t.index_to_world, prepared.centre)
        record["sigma_t"] = rgb(medium.scale)
        record["box_from_world"] = rows_3x4(volume.world_to_index)
        record["box_lower"] = (to_brick @ [*sigma_t.lower, 1.0])[:3]
        record["box_upper"] = (to_brick @ [*sigma_t.upper, 1.0])[:3]
        record["march_step"] = prepared.plan.choices.step or volume.voxel.min()
        record["majorant"] = majorant.majorant.max()
        record["bound"] = max(record["majorant"], volume.peak(medium.transfer("sigma_t")).max())
        record["cells"], record["cell_size"] = majorant.cells, majorant.cell_size
        record["cell_offset"], record["kd_root"] = cell_offset, kd_root
        record["links_first"], record["links_levels"] = links_first, majorant.levels
        cell_offset += len(majorant.majorant)
        links_first += 0 if majorant.links is None else majorant.links.size
        kd_root += 0 if majorant.nodes is None else len(majorant.nodes)
    return table


def glow_table(prepared: PreparedScene) -> np.ndarray:
    """GLOW records, one for each MEDIUM."""
    entries, matter = prepared.boundaries.entries, prepared.matter
    table = np.zeros(len(entries), layout.GLOW)
    for record, entry, number in zip(table, entries, matter.of_entry, strict=True):
        medium = entry.medium
        record["volume"] = matter.roles[number].get("emission_density", -1)
        if medium.glows:
            density = medium.emission_density
            constant = rgb(density.value) if isinstance(density, records.ConstVolume) else 1.0
            record["emission_density"] = rgb(medium.emission_density_scale) * constant
    return table


def _clip_to(record: np.void, box: tuple[np.ndarray, np.ndarray], centre: np.ndarray) -> None:
    """Bounds a medium by a world box as well: a boundary that is open lets no path stray for ever."""
    slack = BOUND_SLACK * (np.linalg.norm(box[1] - box[0]) + np.abs(box[0] - centre).max())
    record["clipped"] = 1
    record["box_from_world"] = np.eye(4)[:3].reshape(12)
    record["box_lower"], record["box_upper"] = box[0] - centre - slack, box[1] - centre + slack


def mean_incident_radiance(
    scene: records.Scene, but_strongest: bool = False
) -> tuple[np.ndarray, np.ndarray]:
    """Mean over all directions of the radiance that arrives from infinity, float64 (3,).

    That of the sky and of suns, which no ray meets; 0 where a limit of depth keeps most of it from the
    picture.  but_strongest : without the strongest directional light, which is expected by where it reaches.
    """
    sky, suns, strongest = np.zeros(3), np.zeros(3), np.zeros(3)
    if 0 <= scene.integrator.max_depth < 3:
        return sky, suns
    for emitter in scene.emitters:
        match emitter:
            case records.ConstantEmitter():
                sky += rgb(emitter.radiance)
            case records.DirectionalEmitter():
                sun = rgb(emitter.irradiance) / (4 * np.pi)
                suns += sun
                strongest = max(strongest, sun, key=luminance)
            case records.SunEmitter():
                suns += rgb(emitter.irradiance) / (4 * np.pi)
            case records.EnvmapEmitter():
                rows = emitter.radiance.mean(axis=1, dtype=np.float64)
                weights = np.sin(np.pi * np.arange(len(rows)) / max(len(rows) - 1, 1)) + 1e-9
                sky += np.average(rows, axis=0, weights=weights)
    return sky, suns - strongest * but_strongest


def most_depth(extinction: np.ndarray, box: tuple[np.ndarray, np.ndarray]) -> np.ndarray:
    """Bound of the optical depth across a medium's world box, float64 (3,); inf where it has no end.

    `extinction`: its largest sigma_t.
    """
    length = np.linalg.norm(box[1] - box[0])
    depth: np.ndarray = np.multiply(extinction, length, where=extinction > 0, out=np.zeros(3))
    return depth


def expected_albedo(medium: records.Medium) -> np.ndarray:
    """Root of the share of diffuse light that a half-space of the medium returns, float64 (3,).

    After van de Hulst 1980; the root is a guess between that and the 1 of its rim.  It is 0 where the albedo
    varies.
    """
    if not isinstance(medium.albedo, records.ConstVolume):
        return np.zeros(3)
    s = np.sqrt(1.0 - rgb(medium.albedo.value))
    return np.sqrt((1 - s) * (1 - 0.139 * s) / (1 + 1.17 * s))


def escaping_share(albedo: np.ndarray, depth: np.ndarray) -> np.ndarray:
    """Share of the light in a medium that leaves it after any number of scatterings, float64 (3,).

    By Wigner's rational approximation (Case, de Hoffmann, Placzek 1953), a flight from somewhere in a body
    of mean optical depth d gets out of it with the probability 1 / (1 + d).  In the light of a uniform sky
    it is what a collision brings, by reciprocity.  albedo, depth : (3,), `depth` may be infinite.
    """
    share: np.ndarray = albedo / (albedo + (1.0 - albedo) * (1.0 + np.minimum(depth, 1e9)))
    return share


def beside_peaks(phase: records.PhaseFunction) -> float:
    """What a phase function scatters far from its peak, about, as a share of what an isotropic one does.

    Most rays are far from the peak towards a sun.  At right angles to it, that of Henyey and Greenstein has
    (1 - g²) / (1 + g²)^1.5; other kinds count as isotropic.
    """
    shares = [(weight, lobe.g**2 if lobe.kind == "hg" else 0.0) for lobe, weight in phase_lobes(phase)]
    total = sum(weight for weight, _ in shares)
    return float(sum(weight * (1.0 - g2) / (1.0 + g2) ** 1.5 for weight, g2 in shares) / total)


def _mean_albedo(prepared: PreparedScene, medium: records.Medium, roles: Mapping[str, int]) -> np.ndarray:
    """Mean albedo of a heterogeneous medium, float64 (3,): about, and of volumes where there is some.

    Where a volume has the samples where the density has them, it is weighted by that.
    """
    if isinstance(medium.albedo, records.ConstVolume):
        return rgb(medium.albedo.value)
    albedo = prepared.volumes[roles["albedo"]].middles(medium.transfer("albedo"))
    density = prepared.volumes[roles["sigma_t"]].middles(medium.transfer("sigma_t")).mean(axis=-1)
    weights = (albedo > 0).any(axis=-1).astype(np.float64)
    if density.shape == weights.shape:
        weights *= density
    total = float(weights.sum())
    mean = np.tensordot(weights, albedo, weights.ndim) / total if total > 0 else np.zeros(1)
    return np.broadcast_to(mean, 3).clip(0.0, 1.0)


def _emission(record: np.void, medium: records.Medium, roles: dict[str, int]) -> None:
    """What a medium emits; constants are multiplied together here."""
    record["emission_volume"] = roles.get("emission", -1)
    record["temperature_volume"] = roles.get("temperature", -1)
    if not medium.emits:
        return
    radiance = rgb(medium.emission_scale)
    if isinstance(medium.emission, records.ConstVolume):
        radiance = radiance * rgb(medium.emission.value)
    if isinstance(medium.temperature, records.ConstVolume):
        kelvin = (medium.temperature.value[0] - medium.temperature_offset) * medium.temperature_scale
        radiance = radiance * blackbody_rgb(np.array([kelvin]))[0]
    record["emits"], record["emission"] = 1, radiance
    record["temperature_scale"] = medium.temperature_scale
    record["temperature_offset"] = medium.temperature_offset
