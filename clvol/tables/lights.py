"""A scene's lights as the device has them: Emitter records, and the triangles of those that are meshes.

Pure functions from records to arrays.  An environment is emitter 0; next-event estimation looks for it there.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from clvol import layout
from clvol.scene import records
from clvol.scene.extents import quadric_area
from clvol.scene.primitives import QUADRICS
from clvol.tables.affine import rotation_3x4
from clvol.tables.colours import luminance, mean_luminance, rgb
from clvol.tables.environment import envmap_distribution
from clvol.tables.lamp_edges import bright_sky, outshining
from clvol.tables.textures import lamp_textures, mean_radiance, projector_frame, slide

if TYPE_CHECKING:
    from clvol.scene.materials import Texture, Varied
    from clvol.tables.surfaces import Surfaces

RANDOM_STEPS = 2.0**32
"""Values that a random number of the device takes."""


class LightTable(NamedTuple):
    """Lights on the device.

    emitters : EMITTER records.  faces : uint32 (k,), numbers of triangles.  cdf : float32 (k,).
    of_shape : int32, per shape the number of its emitter, or -1.
    textures : those of lights, by the numbers that emitters have, from 0 on.

    A mesh's emitter has `count` triangles.  Its `count + 1` entries of both arrays begin at its `first`:
    those of `cdf` go from 0 to 1, and the last of `faces` is not used.
    """

    emitters: np.ndarray
    faces: np.ndarray
    cdf: np.ndarray
    of_shape: np.ndarray
    textures: list[Varied]


def emitter_order(scene: records.Scene) -> list[records.Emitter]:
    """Emitters that are no shapes, with the environment, if any, first."""
    return sorted(scene.emitters, key=lambda e: not _is_environment(e))


def light_table(
    scene: records.Scene,
    centre: np.ndarray,
    radius: float,
    surfaces: Surfaces | None = None,
    uniform: float = 0.0,
) -> LightTable:
    """Every light of a scene, by the power it sends through the scene's sphere.

    centre : float64 (3,), what device positions are relative to.
    radius : of a sphere round it that holds the scene.
    uniform : share of the choices that go to all lights alike.
    surfaces : None where a scene has none.

    The environment comes first, or else the strongest light; the others follow, weakest first, in the order
    of their intervals of the random number that chooses (`selection`), but for a sun, which comes last. A
    uniform sky among other lights is never chosen (`Features.sky_apart`): it comes after all of them.
    """
    emitters = emitter_order(scene)
    shapes = () if surfaces is None else surfaces.shapes
    shining = [(n, shape.emission) for n, shape in enumerate(shapes) if shape.emission is not None]
    pictures = lamp_textures(emission for _, emission in shining)
    table = np.zeros(len(emitters) + len(shining), layout.EMITTER)
    power = np.zeros(len(table))
    for i, emitter in enumerate(emitters):
        power[i] = _describe_emitter(table[i], emitter, centre, radius)
        if isinstance(emitter, records.SpotEmitter | records.ProjectorEmitter):
            picture = slide(emitter) if isinstance(emitter, records.SpotEmitter) else emitter.texture
            if picture is not None:
                pictures = list(dict.fromkeys([*pictures, picture]))
                table[i]["first"] = 1 + pictures.index(picture)
                mean = mean_radiance(picture)
                power[i] *= float(luminance(mean))
                table[i]["primitive"] = _share(table[i]["value"], mean).view(np.uint32)
    faces, cdf = [np.zeros(0, np.uint32)], [np.zeros(0, np.float32)]
    if surfaces is not None:
        for i, (number, emission) in enumerate(shining, len(emitters)):
            if shapes[number].kind in QUADRICS:
                table[i]["primitive"], table[i]["count"] = quadric_primitive(surfaces, number), 1
            else:
                table[i]["first"] = sum(map(len, faces))
                members, shares = mesh_run(surfaces, number, table[i])
                faces.append(members)
                cdf.append(shares)
            power[i] = _describe_area(table[i], shapes[number], emission, number, centre)
            if emission in pictures:
                table[i]["beam_width"] = 1 + pictures.index(emission)
    order, chosen = _order(table["kind"], power)
    table, power = table[order], power[order]
    maps = [bright_sky(e.radiance) for e in emitters if isinstance(e, records.EnvmapEmitter)]
    table["cutoff_angle"][outshining(table, sum(maps))] = 1.0
    among = table[:chosen]
    among["select_pdf"], among["cdf"] = selection(power[:chosen], uniform)
    of_shape = np.full(len(shapes), -1, np.int32)
    lit = np.flatnonzero(table["kind"] == layout.enum("EMITTER", "area"))
    of_shape[table["shape"][lit]] = lit
    return LightTable(table, np.concatenate(faces), np.concatenate(cdf), of_shape, pictures)


def _order(kind: np.ndarray, power: np.ndarray) -> tuple[np.ndarray, int]:
    """Numbers of the lights in the order of the table, and how many of them are chosen among."""
    constant, envmap, sun = (layout.enum("EMITTER", name) for name in ("constant", "envmap", "sun"))
    order = np.argsort(np.where(kind == sun, np.inf, power), kind="stable")
    skies = np.isin(kind[order], (constant, envmap))
    sky, others = order[skies], order[~skies]
    if len(sky) and len(others) and kind[sky[0]] == constant:
        return np.concatenate([others[-1:], others[:-1], sky]), len(others)
    first = sky if len(sky) else others[-1:]
    return np.concatenate([first, others if len(sky) else others[:-1]]), len(order)


def selection(power: np.ndarray, uniform: float = 0.0) -> tuple[np.ndarray, np.ndarray]:
    """Probability of each light and its cumulative table, float32 (n,) each.

    Intervals begin with light 1 and end with light 0, and their borders are multiples of 2⁻³², so that the
    device, which compares a random number of 32 bits, picks each with just the probability it says: in
    proportion to `power` but for that rounding, never 0 for any light but an environment, and 0 for a power
    of 0.  Where all have none, they are equally likely.
    """
    if not len(power):
        return np.zeros(0, np.float32), np.zeros(0, np.float32)
    share = power / power.sum() if power.sum() > 0 else np.full(len(power), 1 / len(power))
    share = (1 - uniform) * share + uniform * (share > 0) / np.count_nonzero(share)
    steps = np.ceil(np.roll(share, -1) * RANDOM_STEPS)
    cdf = np.minimum(np.cumsum(steps) / RANDOM_STEPS, 1.0).astype(np.float32)
    cdf[np.flatnonzero(steps)[-1] :] = 1.0
    return np.roll(np.diff(cdf, prepend=np.float32(0)), 1), np.roll(cdf, 1)


def mesh_run(surfaces: Surfaces, number: int, record: np.void) -> tuple[np.ndarray, np.ndarray]:
    """A shape's entries of `LightTable.faces` and `.cdf`; writes its triangles and area into the record."""
    members = np.flatnonzero(surfaces.faces[:, 3] == number)
    a, b, c = (surfaces.vertices[surfaces.faces[members, k]].astype(np.float64) for k in range(3))
    area = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.cross(b - a, c - a), axis=1) / 2)])
    record["count"], record["area"] = len(members), area[-1]
    if area[-1] > 0:
        record["position"] = np.diff(area) / area[-1] @ ((a + b + c) / 3)
        normal = np.cross(b - a, c - a).sum(axis=0) / (2 * area[-1])
        record["vector"] = -normal if surfaces.shapes[number].flip_normals else normal
    record["primitive"] = members[0] if len(members) else 0
    cdf = area / area[-1] if area[-1] > 0 else np.append(0.0, np.ones(len(members)))
    return np.append(members, 0).astype(np.uint32), cdf.astype(np.float32)


def quadric_primitive(surfaces: Surfaces, number: int) -> int:
    """Number of a shape's primitive: quadrics follow all triangles, in the order of their shapes."""
    return len(surfaces.faces) + sum(shape.kind in QUADRICS for shape in surfaces.shapes[:number])


def spot_solid_angle(cutoff: float, beam: float) -> float:
    """Integral over all directions of a spot's fall-off, steradians; both angles in radians.

    It is 2π (1 − (sin c − sin b) / (c − b)), written without the difference of near sines.
    """
    beam = min(beam, cutoff)
    return 2 * np.pi * float(1 - np.cos((cutoff + beam) / 2) * np.sinc((cutoff - beam) / (2 * np.pi)))


def envmap_arrays(emitter: records.EnvmapEmitter) -> dict[str, np.ndarray]:
    """What the device knows of an environment map, by argument name: its record, texels and distribution."""
    record = np.zeros(1, layout.ENVMAP)
    rotation = emitter.to_world[:3, :3]
    record["world_from_env"] = rotation_3x4(rotation)
    record["env_from_world"] = rotation_3x4(np.linalg.inv(rotation))
    height, width, _ = emitter.radiance.shape
    record["size"] = width, height
    marginal, conditional = envmap_distribution(emitter.radiance)
    return {
        "envmap": record,
        "env_texels": emitter.radiance.astype(np.float32, copy=False),
        "env_marginal": marginal,
        "env_conditional": conditional,
    }


def _share(value: np.ndarray, mean: np.ndarray) -> np.float32:
    """What a picture of that mean leaves of a light, on the mean over channels."""
    total = value.sum(dtype=np.float64)
    return np.float32(value @ mean / total if total > 0 else 1.0)


def _is_environment(emitter: records.Emitter) -> bool:
    return isinstance(emitter, (records.ConstantEmitter, records.EnvmapEmitter))


def _describe_area(
    record: np.void, shape: records.Shape, emission: Texture, number: int, centre: np.ndarray
) -> float:
    """Fill in an area light and return its power; a mesh's area and place are there already."""
    if shape.kind in QUADRICS:
        record["area"] = quadric_area(shape)
        middle = [0.0, 0.0, 0.5 if shape.kind == "cylinder" else 0.0, 1.0]
        record["position"] = (shape.to_world @ middle)[:3] - centre
        if shape.kind == "disk":
            normal = np.cross(shape.to_world[:3, 0], shape.to_world[:3, 1])
            record["vector"] = normal / max(float(np.linalg.norm(normal)), 1e-300)
            record["vector"] *= -1 if shape.flip_normals else 1
    record["kind"] = layout.enum("EMITTER", "area")
    record["shape"] = number
    record["value"] = mean_radiance(emission)
    return np.pi * float(record["area"]) * float(luminance(mean_radiance(emission)))


def _describe_emitter(record: np.void, emitter: records.Emitter, centre: np.ndarray, radius: float) -> float:
    """Fill in a light that is no shape and return its power."""
    disc = np.pi * radius**2
    match emitter:
        case records.ConstantEmitter():
            value, extent = emitter.radiance, 4 * np.pi * disc
        case records.EnvmapEmitter():
            value, extent = (mean_luminance(emitter.radiance),), 4 * np.pi * disc
        case records.DirectionalEmitter():
            value, extent = emitter.irradiance, disc
            record["vector"] = emitter.direction
        case records.PointEmitter():
            value, extent = emitter.intensity, 4 * np.pi
            record["position"] = np.asarray(emitter.position) - centre
        case records.SpotEmitter():
            cutoff, beam = np.radians(emitter.cutoff_angle), np.radians(emitter.beam_width)
            value, extent = emitter.intensity, spot_solid_angle(cutoff, beam)
            axis = emitter.to_world[:3, 2]
            record["vector"] = axis / np.linalg.norm(axis)
            record["position"] = emitter.to_world[:3, 3] - centre
            record["cutoff_angle"], record["beam_width"] = cutoff, beam
        case records.ProjectorEmitter():
            width, height = emitter.half_sides
            size = float(np.linalg.norm(emitter.to_world[:3, 2]))
            strength = np.pi * emitter.scale * size
            picture = emitter.irradiance if emitter.texture is None else (1.0,)
            value, extent = tuple(strength * np.asarray(picture)), 4 * width * height
            record["vector"] = emitter.to_world[:3, 2] / size
            record["position"] = emitter.to_world[:3, 3] - centre
            record["cutoff_angle"], record["beam_width"], record["area"] = projector_frame(emitter)
        case records.SunEmitter():
            solid_angle = emitter.solid_angle
            value = tuple(np.asarray(emitter.irradiance) / solid_angle)
            extent = solid_angle * disc
            record["vector"], record["area"] = np.negative(emitter.sun_direction), solid_angle
            record["position"] = emitter.up or np.zeros(3)
    record["kind"] = layout.enum("EMITTER", type(emitter).__name__.removesuffix("Emitter"))
    record["value"] = rgb(value)
    return extent * float(luminance(rgb(value)))
