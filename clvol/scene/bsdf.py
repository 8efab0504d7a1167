"""BSDFs: the materials of surfaces."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any

from clvol.scene.material_facts import is_transmissive, passes_light
from clvol.scene.materials import (
    Blend,
    Bsdf,
    Conductor,
    Dielectric,
    Diffuse,
    Mask,
    Null,
    Plastic,
    Principled,
    PrincipledThin,
    RoughConductor,
    RoughDielectric,
    Roughness,
    RoughPlastic,
    Texture,
    TwoSided,
)
from clvol.scene.refraction import COMMON_NAMES, INDICES, METALS
from clvol.scene.sampling_rates import sheet_leaves_out, solid_leaves_out
from clvol.scene.sides import MAX_PARTS, count_parts
from clvol.scene.texture import constant, roughness, share, texture
from clvol.scene.vocabulary import close_ones, join_hints, listed

if TYPE_CHECKING:
    from clvol.scene.reader import Reader

DISTRIBUTIONS = ("beckmann", "ggx")
_SHEET_RATES = tuple(
    f"{lobe}_{way}_sampling_rate"
    for way in ("reflectance", "transmittance")
    for lobe in ("specular", "diffuse")
)
_LEFT_OUT = "0, as given: light that no other lobe's samples find is left out, as in Mitsuba"
MOST_SPECULAR = 12.0
"""Below 1 / 0.08, where a dielectric would reflect all."""


def null(reader: Reader) -> Null:
    """The `null` BSDF: light passes the surface unchanged."""
    return Null()


def diffuse(reader: Reader) -> Diffuse:
    """The `diffuse` plugin: Lambertian on the front, black on the back."""
    return Diffuse(texture(reader, "reflectance", 0.5))


def dielectric(reader: Reader) -> Dielectric:
    """The `dielectric` plugin: a smooth boundary."""
    return Dielectric(*_indices(reader, "bk7"), *_specular(reader))


def thindielectric(reader: Reader) -> Dielectric:
    """The `thindielectric` plugin: a pane, both of its boundaries in one."""
    return Dielectric(*_indices(reader, "bk7"), *_specular(reader), thin=True)


def roughdielectric(reader: Reader) -> RoughDielectric:
    """The `roughdielectric` plugin."""
    indices = _indices(reader, "bk7", differ=True)
    distribution, alpha_u, alpha_v = _microfacets(reader)
    return RoughDielectric(*indices, distribution, alpha_u, alpha_v, *_specular(reader))


def conductor(reader: Reader) -> Conductor:
    """The `conductor` plugin: a smooth metal of a `material` or of eta and k; else a perfect mirror."""
    return Conductor(*_metal(reader), texture(reader, "specular_reflectance", 1.0))


def roughconductor(reader: Reader) -> RoughConductor:
    """The `roughconductor` plugin."""
    metal = _metal(reader)
    distribution, alpha_u, alpha_v = _microfacets(reader)
    specular = texture(reader, "specular_reflectance", 1.0)
    return RoughConductor(*metal, distribution, alpha_u, alpha_v, specular)


def plastic(reader: Reader) -> Plastic:
    """The `plastic` plugin: a diffuse base under a smooth coat."""
    base = texture(reader, "diffuse_reflectance", 0.5)
    indices = _indices(reader, "polypropylene")
    nonlinear = reader.boolean("nonlinear", False)
    return Plastic(base, *indices, nonlinear, texture(reader, "specular_reflectance", 1.0))


def roughplastic(reader: Reader) -> RoughPlastic:
    """The `roughplastic` plugin: a diffuse base under a rough coat."""
    reader.ignore(sample_visible=bool)
    base = texture(reader, "diffuse_reflectance", 0.5)
    indices = _indices(reader, "polypropylene", differ=True)
    nonlinear = reader.boolean("nonlinear", False)
    distribution = reader.string("distribution", "beckmann", DISTRIBUTIONS)
    alpha = constant(reader, "alpha", 0.1, minimum=0.0)
    specular = texture(reader, "specular_reflectance", 1.0)
    return RoughPlastic(base, *indices, nonlinear, distribution, alpha, specular)


def principled(reader: Reader) -> Principled:
    """The `principled` plugin: its index is `eta`, or follows from `specular`, which is in units of 8 %."""
    if reader.has("eta") and reader.has("specular"):
        reader.fail("give either eta or specular, not both", "specular")
    eta = reader.number("eta", 1.5, minimum=0.0, open_interval=True)
    specular = reader.number("specular", 0.5, minimum=0.0, maximum=MOST_SPECULAR)
    transmits = _share(reader, "spec_trans")
    if not reader.has("eta"):
        if transmits != (0.0,) and specular == 0:
            specular = 1e-3  # a boundary of nothing has no density, as in Mitsuba
        eta = 2 / (1 - math.sqrt(0.08 * specular)) - 1
    elif transmits != (0.0,) and eta == 1:
        eta = 1.001
    made = Principled(
        **_principled(reader),
        metallic=_share(reader, "metallic"),
        clearcoat=_share(reader, "clearcoat"),
        clearcoat_gloss=_share(reader, "clearcoat_gloss"),
        spec_trans=transmits,
        eta=eta,
        specular_rate=_rate(reader, "main_specular"),
        clearcoat_rate=_rate(reader, "clearcoat"),
    )
    if solid_leaves_out(made):
        reader.approximated(_LEFT_OUT, "main_specular_sampling_rate")
    return made


def principledthin(reader: Reader) -> PrincipledThin:
    """The `principledthin` plugin."""
    made = PrincipledThin(
        **_principled(reader),
        spec_trans=_share(reader, "spec_trans"),
        eta=texture(reader, "eta", 1.5, maximum=math.inf),
        diff_trans=texture(reader, "diff_trans", 0.0, maximum=2.0),
        specular_rate=_rate(reader, "specular_reflectance"),
        specular_transmittance_rate=_rate(reader, "specular_transmittance"),
        diffuse_transmittance_rate=_rate(reader, "diffuse_transmittance"),
    )
    if sheet_leaves_out(made):
        zero = [name for name in _SHEET_RATES if reader.number(name, 1.0) == 0]
        reader.approximated(_LEFT_OUT, zero[0])
    return made


def _principled(reader: Reader) -> dict[str, Any]:
    """What both principled BSDFs have."""
    names = ("anisotropic", "spec_tint", "sheen", "sheen_tint", "flatness")
    return {
        "base_color": texture(reader, "base_color", 0.5),
        "roughness": texture(reader, "roughness", 0.5),
        "diffuse_rate": _rate(reader, "diffuse_reflectance"),
        **{name: _share(reader, name) for name in names},
    }


def _share(reader: Reader, name: str) -> Texture:
    return texture(reader, name, 0.0)


def _rate(reader: Reader, lobe: str) -> float:
    return reader.number(f"{lobe}_sampling_rate", 1.0, minimum=0.0)


def twosided(reader: Reader) -> TwoSided:
    """The `twosided` plugin: one BSDF for both sides, or the front's and the back's in the order given."""
    found = _nested(reader, most=2)
    for name, bsdf in found:
        if isinstance(bsdf, Mask) or passes_light(bsdf) or is_transmissive(bsdf):
            reader.fail(
                "a twosided BSDF takes no BSDF that light passes",
                name,
                "put the twosided one into the mask" if isinstance(bsdf, Mask) else "it has two sides itself",
            )
    return TwoSided(found[0][1], found[-1][1])


def mask(reader: Reader) -> Mask:
    """The `mask` plugin: `opacity` 1 shows the nested BSDF, 0 lets light pass."""
    opacity = texture(reader, "opacity", 0.5)
    return Mask(_nested(reader, most=1)[0][1], opacity)


def blendbsdf(reader: Reader) -> Blend:
    """The `blendbsdf` plugin: two BSDFs, in the order given, the second of share `weight`."""
    if not reader.has("weight"):
        reader.fail("a blendbsdf needs a weight", hint="the share of the second BSDF, 0 to 1")
    weight = share(reader, "weight")
    found = _nested(reader, most=2)
    if len(found) != 2:
        reader.fail("a blendbsdf takes two BSDFs, got 1")
    blend = Blend(found[0][1], found[1][1], weight)
    if (count := count_parts(blend)) > MAX_PARTS:
        reader.fail(f"a mixture takes at most {MAX_PARTS} BSDFs, got {count}")
    return blend


def _nested(reader: Reader, most: int) -> list[tuple[str, Bsdf]]:
    found = reader.children("bsdf")
    if not found:
        reader.fail(f"'{reader.type}' has no BSDF in it", hint="nest the one that it is about")
    if len(found) > most:
        reader.fail(f"'{reader.type}' takes at most {most} BSDFs, got {len(found)}", found[most][0])
    return [(name, reader.build(node)) for name, node in found]


def _specular(reader: Reader) -> tuple[Texture, Texture]:
    reflectance = texture(reader, "specular_reflectance", 1.0)
    return reflectance, texture(reader, "specular_transmittance", 1.0)


def _index(reader: Reader, name: str, default: str) -> float:
    """A refractive index: a number > 0, or one of `INDICES` in any case."""
    if not isinstance(reader.node.get(name, default), str):
        return reader.number(name, 1.0, minimum=0.0, open_interval=True)
    given = reader.string(name, default)
    if given.lower() not in INDICES:
        hint = join_hints(close_ones(given, INDICES), f"give a number, or one of: {listed(INDICES)}")
        reader.fail(f"'{name}' of bsdf '{reader.type}' is an unknown material '{given}'", name, hint)
    return INDICES[given.lower()]


def _indices(reader: Reader, interior: str, differ: bool = False) -> tuple[float, float]:
    """int_ior and ext_ior; `differ`: rough boundaries of nothing have no density."""
    inside, outside = _index(reader, "int_ior", interior), _index(reader, "ext_ior", "air")
    if differ and inside == outside:
        reader.fail(
            f"int_ior and ext_ior of a {reader.type} must differ",
            "int_ior" if reader.has("int_ior") else "ext_ior",
            "a boundary between equal indices is no surface: use null",
        )
    return inside, outside


def _metal(reader: Reader) -> tuple[Texture, Texture]:
    """The indices eta and k; of a perfect mirror where nothing is given."""
    name = reader.string("material", "none")
    given = [key for key in ("eta", "k") if reader.has(key)]
    if given and reader.has("material"):
        reader.fail("give either a material or eta and k, not both", given[0])
    if name != "none":
        if name not in METALS:
            common = COMMON_NAMES.get(name.lower())
            close = f"did you mean '{common}'?" if common else close_ones(name, METALS)
            hint = join_hints(close, f"supported: none, {listed(METALS, len(METALS))}")
            reader.fail(f"unknown metal '{name}'", "material", hint)
        return METALS[name]
    return texture(reader, "eta", 0.0, maximum=math.inf), texture(reader, "k", 1.0, maximum=math.inf)


def _microfacets(reader: Reader) -> tuple[str, Roughness, Roughness]:
    """Distribution, alpha_u and alpha_v."""
    reader.ignore(sample_visible=bool)
    distribution = reader.string("distribution", "beckmann", DISTRIBUTIONS)
    sides = [name for name in ("alpha_u", "alpha_v") if reader.has(name)]
    if sides and (len(sides) == 1 or reader.has("alpha")):
        reader.fail("give either alpha, or both alpha_u and alpha_v", sides[0])
    alpha = roughness(reader, "alpha", 0.1)
    u, v = (roughness(reader, name, alpha) for name in ("alpha_u", "alpha_v"))
    return distribution, u, v
