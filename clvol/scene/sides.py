"""Front and back of a surface: what wrappers hold, as single BSDFs behind masks, and mixtures of such."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

from clvol.layout import BSDF_FACTS
from clvol.scene.materials import (
    Blend,
    Bsdf,
    BumpMap,
    Conductor,
    Dielectric,
    Diffuse,
    FrontOnly,
    Mask,
    NormalMap,
    Null,
    Plastic,
    Principled,
    PrincipledThin,
    RoughConductor,
    RoughDielectric,
    RoughPlastic,
    Texture,
    TwoSided,
    Varied,
)

if TYPE_CHECKING:
    from collections.abc import Iterator

_KINDS = {
    Null: "NULL",
    Diffuse: "DIFFUSE",
    Dielectric: "DIELECTRIC",
    RoughDielectric: "ROUGH_DIELECTRIC",
    Conductor: "CONDUCTOR",
    RoughConductor: "ROUGH_CONDUCTOR",
    Plastic: "PLASTIC",
    RoughPlastic: "ROUGH_PLASTIC",
    PrincipledThin: "PRINCIPLED_THIN",
}
MAX_PARTS = 64
"""Most BSDFs that a mixture may hold, counted with repetition: mixtures of mixtures double without end."""


@dataclass(frozen=True)
class Side:
    """A surface as seen from one side: a BSDF that is no wrapper, behind masks of these opacities.

    `black`: it absorbs whatever the masks do not let pass.  `bend`: the wrapper that bends its surface,
    `mirrored` where that lies outside of what makes it two-sided, and is seen from the back.
    Equal where the BSDF is the same object.
    """

    bsdf: Bsdf
    opacities: tuple[Texture, ...] = ()
    black: bool = False
    bend: NormalMap | BumpMap | None = None
    mirrored: bool = False


@dataclass(frozen=True)
class Mixture:
    """One side of a surface that looks like either of two by chance; None: black."""

    first: Look | None
    second: Look | None
    weight: Texture  # share of the second


Look = Side | Mixture
Factor = tuple[Texture, bool]
"""A number over a surface, or (True) what is missing of it to 1."""


def side_kind(bsdf: Bsdf) -> str:
    """Name in `layout.BSDFS` of a BSDF that is no wrapper."""
    match bsdf:
        case Dielectric(thin=True):
            return "THIN_DIELECTRIC"
        case Principled():
            return "PRINCIPLED" if bsdf.spec_trans == (0.0,) else "PRINCIPLED_GLASS"
    return _KINDS[type(bsdf)]


def bsdf_sides(bsdf: Bsdf) -> tuple[Look | None, Look | None]:
    """Front and back of a surface; None: black.  What light passes has the same on both.

    Raises
    ------
    ValueError
        A two-sided BSDF round one that light passes, or a surface that is bent twice.
    """
    if isinstance(bsdf, TwoSided):
        front, back = bsdf_sides(bsdf.front)[0], bsdf_sides(bsdf.back)[0]
        for side, _ in (*mixed_parts(front), *mixed_parts(back)):
            if side and (side.opacities or BSDF_FACTS[side_kind(side.bsdf)].transmits):
                raise ValueError("a two-sided BSDF takes no BSDF that light passes")
        return front, back
    if isinstance(bsdf, FrontOnly):
        return bsdf_sides(bsdf.front)[0], Side(Null())
    if isinstance(bsdf, Blend):
        first, second = bsdf_sides(bsdf.first), bsdf_sides(bsdf.second)
        return _mixed(first[0], second[0], bsdf.weight), _mixed(first[1], second[1], bsdf.weight)
    if isinstance(bsdf, NormalMap | BumpMap):
        front, back = bsdf_sides(bsdf.nested)
        return _bent(front, bsdf, False), _bent(back, bsdf, True)
    if isinstance(bsdf, Mask):
        return _masked(bsdf)
    side = Side(bsdf)
    return side, side if BSDF_FACTS[side_kind(bsdf)].transmits else None


def _bent(look: Look | None, bend: NormalMap | BumpMap, from_back: bool) -> Look | None:
    if isinstance(look, Mixture):
        return Mixture(_bent(look.first, bend, from_back), _bent(look.second, bend, from_back), look.weight)
    if look is None or look.black or isinstance(look.bsdf, Null):
        return look
    if look.bend is not None:
        raise ValueError("a surface is bent once at most")
    return replace(look, bend=bend, mirrored=from_back and not BSDF_FACTS[side_kind(look.bsdf)].transmits)


def _mixed(first: Look | None, second: Look | None, weight: Texture) -> Look | None:
    if first == second or set(weight if isinstance(weight, tuple) else ()) == {0.0}:
        return first
    return second if isinstance(weight, tuple) and set(weight) == {1.0} else Mixture(first, second, weight)


def _masked(mask: Mask) -> tuple[Look | None, Look | None]:
    """Masks are opacities of a side while one of them at most has a texture; else mixtures with nothing."""
    front, back = bsdf_sides(mask.nested)
    if isinstance(front, Side) and not isinstance(back, Mixture):
        if isinstance(front.bsdf, Null) or mask.opacity in ((1.0,), (1.0, 1.0, 1.0)):
            return front, back
        if sum(isinstance(o, Varied) for o in (mask.opacity, *front.opacities)) <= 1:
            back = Side(front.bsdf, front.opacities, black=True) if back is None else back
            sides = [replace(side, opacities=(*side.opacities, mask.opacity)) for side in (front, back)]
            return sides[0], sides[1]
    nothing = Side(Null())
    return _mixed(nothing, front, mask.opacity), _mixed(nothing, back, mask.opacity)


def mixed_parts(look: Look | None) -> Iterator[tuple[Side | None, tuple[Factor, ...]]]:
    """Every BSDF of a side, and the factors whose product is its share of it."""
    if not isinstance(look, Mixture):
        yield look, ()
        return
    for inner, rest in ((look.first, True), (look.second, False)):
        for side, factors in mixed_parts(inner):
            yield side, ((look.weight, rest), *factors)


def bsdf_looks(bsdf: Bsdf) -> list[Look]:
    """What is on either side, each once, but for what is black."""
    return [look for look in dict.fromkeys(bsdf_sides(bsdf)) if look is not None]


def bsdf_parts(bsdf: Bsdf) -> list[Side]:
    """The single BSDFs on either side and in mixtures, each once."""
    found = dict.fromkeys(side for look in bsdf_looks(bsdf) for side, _ in mixed_parts(look))
    return [side for side in found if side is not None]


def bsdf_weights(bsdf: Bsdf) -> list[Texture]:
    """What its mixtures are mixed by."""
    return [
        weight
        for look in bsdf_looks(bsdf)
        for _, factors in mixed_parts(look)
        for weight, rest in factors
        if rest
    ]


def count_parts(bsdf: Bsdf) -> int:
    """How many BSDFs a mixture holds, counted with repetition."""
    return max((sum(1 for _ in mixed_parts(look)) for look in bsdf_looks(bsdf)), default=0)
