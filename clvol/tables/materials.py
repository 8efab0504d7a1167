"""BSDFs of a scene as what the device reads: one material per distinct side of a surface, and their textures.

Wrappers end here: a `TwoSided` becomes the two materials of a shape, a `Mask` the opacity of a material, a
`Blend` a material that is a list of others, a `NormalMap` or `BumpMap` one that names another.
Nothing here needs a device.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from clvol import layout
from clvol.scene import materials
from clvol.scene.materials import Bsdf, Texture, Varied
from clvol.scene.sides import Look, Mixture, Side, bsdf_sides, side_kind
from clvol.tables.bends import bend_entries
from clvol.tables.blends import blend_entries
from clvol.tables.coat import MIN_ALPHA, coat_table, diffuse_reflectance
from clvol.tables.colours import rgb
from clvol.tables.textures import TextureTable, mean_color

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

BLACK = -1
"""Number of the material that absorbs everything: the back of what has only a front."""


@dataclass(frozen=True, eq=False)
class MaterialTable:
    """Device records of every material.

    materials : MATERIAL records (n,).  textures : TEXTURE records (m,).  texels : float32 (t, 3), linear.
    tables : float32 (k,).  sides : int32 (bsdfs, 2), the materials of each one's front and back, or `BLACK`.
    """

    materials: np.ndarray
    textures: np.ndarray
    texels: np.ndarray
    tables: np.ndarray
    sides: np.ndarray


def material_table(
    bsdfs: Sequence[Bsdf], lamps: Sequence[Varied] = (), volumes: Mapping[int, int] | None = None
) -> MaterialTable:
    """Materials of `bsdfs`, those of a scene's shapes in their order; each object gives its records once.

    `lamps`: the textures of lights, which are the first ones.  `volumes`: numbers of grid volumes, by id().

    Raises
    ------
    ValueError
        Records nested as the loader never nests them (see `bsdf_sides`).
    """
    textures = TextureTable(volumes)
    for picture in lamps:
        textures.add(picture)
    tables: list[np.ndarray] = []
    numbers: dict[Look, int] = {}
    records: list[np.ndarray] = []

    def number(look: Look | None) -> int:
        if look is None:
            return BLACK
        if look not in numbers:
            if isinstance(look, Mixture):
                record = _wrapper("BLEND", blend_entries(look, number, textures), tables)
            elif look.bend is not None:
                inner = number(replace(look, bend=None, mirrored=False))
                record = _wrapper("BENT", bend_entries(look.bend, inner, look.mirrored, textures), tables)
            else:
                record = _record(look, textures, tables)
            numbers[look] = len(records)
            records.append(record)
        return numbers[look]

    sides = np.full((len(bsdfs), 2), BLACK, np.int32)
    for n, bsdf in enumerate(bsdfs):
        sides[n] = [number(look) for look in bsdf_sides(bsdf)]
    return MaterialTable(
        np.array(records, layout.MATERIAL),
        np.array(textures.records, layout.TEXTURE),
        np.concatenate([*textures.texels, np.empty((0, 3), np.float32)]),
        np.concatenate([*tables, np.empty(0, np.float32)]),
        sides,
    )


def _record(side: Side, textures: TextureTable, tables: list[np.ndarray]) -> np.ndarray:
    """One MATERIAL record, scalar; may add to `textures` and `tables`."""
    bsdf = side.bsdf
    record = np.zeros((), layout.MATERIAL)
    kind = side_kind(bsdf)
    record["kind"] = layout.enum("MATERIAL", kind)
    record["opacity"], record["opacity_texture"] = 1.0, -1
    for opacity in side.opacities:
        if isinstance(opacity, Varied):
            record["opacity_texture"] = textures.add(opacity, as_number=True)
        else:
            record["opacity"] *= np.mean(opacity)
    black = (0.0,)
    for field, name in (
        ("reflectance", "diffuse_reflectance" if "PLASTIC" in kind else "reflectance"),
        ("specular", "specular_reflectance"),
        ("transmittance", "specular_transmittance"),
    ):
        if "PRINCIPLED" in kind:
            name = "base_color"
        color = black if side.black else getattr(bsdf, name, black)
        _set_color(record, field, color, textures)
    record["ior"] = getattr(bsdf, "int_ior", 1.0) / getattr(bsdf, "ext_ior", 1.0)
    if isinstance(bsdf, materials.Principled | materials.PrincipledThin):
        _set_principled(record, side, textures, tables)
    if isinstance(bsdf, materials.Conductor | materials.RoughConductor):
        for name, index in (("eta", bsdf.eta), ("k", bsdf.k)):
            record[name] = -1 - textures.add(index) if isinstance(index, Varied) else rgb(index)
    if isinstance(bsdf, materials.RoughDielectric | materials.RoughConductor | materials.RoughPlastic):
        record["distribution"] = layout.enum("DISTRIBUTION", bsdf.distribution)
        for field in ("alpha_u", "alpha_v"):
            alpha = bsdf.alpha if isinstance(bsdf, materials.RoughPlastic) else getattr(bsdf, field)
            record[field] = (
                -1 - textures.add(alpha, as_number=True)
                if isinstance(alpha, Varied)
                else max(alpha, MIN_ALPHA)
            )
    if isinstance(bsdf, materials.Plastic | materials.RoughPlastic):
        _set_coat(record, bsdf, tables)
    return record


def _wrapper(kind: str, entries: np.ndarray, tables: list[np.ndarray]) -> np.ndarray:
    record = np.zeros((), layout.MATERIAL)
    record["kind"], record["opacity"], record["opacity_texture"] = layout.enum("MATERIAL", kind), 1.0, -1
    _add_table(record, entries, tables)
    return record


def _set_coat(
    record: np.ndarray, bsdf: materials.Plastic | materials.RoughPlastic, tables: list[np.ndarray]
) -> None:
    """What plastics alone have; the coat's share of samples goes by its mean colour and the base's."""
    ior = bsdf.int_ior / bsdf.ext_ior
    record["nonlinear"] = bsdf.nonlinear
    base, coat = mean_color(bsdf.diffuse_reflectance), mean_color(bsdf.specular_reflectance)
    record["specular_weight"] = coat / (base + coat) if base + coat > 0 else 0.5
    if isinstance(bsdf, materials.Plastic):
        record["inner_reflectance"] = diffuse_reflectance(1 / ior)
        return
    transmittance, record["inner_reflectance"] = coat_table(bsdf.distribution, bsdf.alpha, ior)
    _add_table(record, transmittance, tables)


def _add_table(record: np.ndarray, table: np.ndarray, tables: list[np.ndarray]) -> None:
    record["table"] = sum(len(other) for other in tables)
    tables.append(np.asarray(table, np.float32))


def _set_principled(record: np.ndarray, side: Side, textures: TextureTable, tables: list[np.ndarray]) -> None:
    """Each number and its texture, as in `layout.PRINCIPLED`; a black side is a boundary of nothing."""
    bsdf = materials.Principled(roughness=(1.0,), eta=1.0) if side.black else side.bsdf
    record["ior"] = bsdf.eta if isinstance(bsdf, materials.Principled) else 1.0
    rates = {
        "third_rate": getattr(bsdf, "clearcoat_rate", getattr(bsdf, "specular_transmittance_rate", 0.0)),
        "fourth_rate": getattr(bsdf, "diffuse_transmittance_rate", 0.0),
    }
    numbers = [rates[name] if name in rates else getattr(bsdf, name, 0.0) for name in layout.PRINCIPLED]
    rows = [
        (0.0, textures.add(number, as_number=True)) if isinstance(number, Varied) else (np.mean(number), -1)
        for number in numbers
    ]
    _add_table(record, np.array(rows).reshape(-1), tables)


def _set_color(record: np.ndarray, field: str, color: Texture, textures: TextureTable) -> None:
    if isinstance(color, Varied):
        record[f"{field}_texture"] = textures.add(color)
    else:
        record[field], record[f"{field}_texture"] = rgb(color), -1
