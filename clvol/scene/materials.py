"""What surfaces are made of: textures and BSDFs as plain frozen records.

As in `records`, nothing here knows Mitsuba's syntax or OpenCL.  A shape's BSDF is a `Bsdf`; wrappers (`Mask`,
`TwoSided`, `Blend`, `NormalMap`, `BumpMap`) hold others.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from clvol.scene.fields import GridVolume

Spectrum = tuple[float, ...]


@dataclass(frozen=True, eq=False)
class Bitmap:
    """A picture over (u, v).  `pixels`: float32 (height, width, 3), linear, the row at v = 0 first.

    `to_uv` (3x3, float64) maps the surface's (u, v, 1) to the picture's.  Values beyond the unit square
    repeat, mirror or take the border's ("repeat" | "mirror" | "clamp").
    """

    pixels: np.ndarray
    to_uv: np.ndarray = field(default_factory=lambda: np.eye(3))
    filter_type: str = "bilinear"  # "bilinear" | "nearest"
    wrap_mode: str = "repeat"
    source: str = ""

    def __repr__(self) -> str:
        return f"<Bitmap {self.source}: {self.pixels.shape[1]} x {self.pixels.shape[0]}>"


@dataclass(frozen=True, eq=False)
class Checkerboard:
    """Two colours by turns, four squares to the unit square of (u, v) under `to_uv` (3x3)."""

    color0: Spectrum = (0.4,)
    color1: Spectrum = (0.2,)
    to_uv: np.ndarray = field(default_factory=lambda: np.eye(3))


@dataclass(frozen=True, eq=False, repr=False)
class MeshAttribute(Bitmap):
    """The attribute `name` of a mesh, times `scale`: in shapes the picture made of it has its place."""

    pixels: np.ndarray = field(default_factory=lambda: np.zeros((1, 1, 3), np.float32))
    name: str = ""
    scale: float = 1.0


@dataclass(frozen=True, eq=False)
class VolumeTexture:
    """What a volume holds at the points of a surface, wherever these lie in the world."""

    volume: GridVolume


Varied = Bitmap | Checkerboard | VolumeTexture
"""A colour that varies over a surface."""

Texture = Spectrum | Varied
"""A colour everywhere the same, or one that varies."""

Roughness = float | Varied
"""A number everywhere the same, or one that varies."""


@dataclass(frozen=True)
class Null:
    """No surface at all: light passes straight on."""


@dataclass(frozen=True, eq=False)
class Diffuse:
    """Lambertian reflection, on the front only."""

    reflectance: Texture = (0.5,)


@dataclass(frozen=True, eq=False)
class Dielectric:
    """Smooth boundary between refractive indices `int_ior` (behind the normal) and `ext_ior`.

    `thin`: a pane with both its faces, which reflects back and forth between them and does not bend light.
    """

    int_ior: float = 1.5046
    ext_ior: float = 1.000277
    specular_reflectance: Texture = (1.0,)
    specular_transmittance: Texture = (1.0,)
    thin: bool = False


@dataclass(frozen=True, eq=False)
class RoughDielectric:
    """Boundary of microfacets; `distribution` "beckmann" or "ggx", roughness along the two tangents."""

    int_ior: float = 1.5046
    ext_ior: float = 1.000277
    distribution: str = "beckmann"
    alpha_u: Roughness = 0.1
    alpha_v: Roughness = 0.1
    specular_reflectance: Texture = (1.0,)
    specular_transmittance: Texture = (1.0,)


@dataclass(frozen=True, eq=False)
class Conductor:
    """Smooth metal of complex index eta - i k; eta 0 with k 1 reflects everything."""

    eta: Texture = (0.0,)
    k: Texture = (1.0,)
    specular_reflectance: Texture = (1.0,)


@dataclass(frozen=True, eq=False)
class RoughConductor:
    """Metal of microfacets."""

    eta: Texture = (0.0,)
    k: Texture = (1.0,)
    distribution: str = "beckmann"
    alpha_u: Roughness = 0.1
    alpha_v: Roughness = 0.1
    specular_reflectance: Texture = (1.0,)


@dataclass(frozen=True, eq=False)
class Plastic:
    """A diffuse base under a smooth dielectric coat; `nonlinear`: colour shifts by inner reflections."""

    diffuse_reflectance: Texture = (0.5,)
    int_ior: float = 1.49
    ext_ior: float = 1.000277
    nonlinear: bool = False
    specular_reflectance: Texture = (1.0,)


@dataclass(frozen=True, eq=False)
class RoughPlastic:
    """A diffuse base under a coat of microfacets (one `alpha`)."""

    diffuse_reflectance: Texture = (0.5,)
    int_ior: float = 1.49
    ext_ior: float = 1.000277
    nonlinear: bool = False
    distribution: str = "beckmann"
    alpha: float = 0.1
    specular_reflectance: Texture = (1.0,)


@dataclass(frozen=True, eq=False)
class Principled:
    """Burley's principled BSDF: a mixture of diffuse, metallic, coated and refracting lobes.

    `eta`: refractive index of the inside over that of the outside.  Rates say how often lobes are sampled.
    """

    base_color: Texture = (0.5,)
    roughness: Texture = (0.5,)
    anisotropic: Texture = (0.0,)
    metallic: Texture = (0.0,)
    spec_trans: Texture = (0.0,)
    eta: float = 1.5
    spec_tint: Texture = (0.0,)
    sheen: Texture = (0.0,)
    sheen_tint: Texture = (0.0,)
    flatness: Texture = (0.0,)
    clearcoat: Texture = (0.0,)
    clearcoat_gloss: Texture = (0.0,)
    diffuse_rate: float = 1.0
    specular_rate: float = 1.0
    clearcoat_rate: float = 1.0


@dataclass(frozen=True, eq=False)
class PrincipledThin:
    """The principled BSDF of a sheet; `diff_trans` from 0 to 2, where all diffuse light passes."""

    base_color: Texture = (0.5,)
    roughness: Texture = (0.5,)
    anisotropic: Texture = (0.0,)
    spec_trans: Texture = (0.0,)
    eta: Texture = (1.5,)
    spec_tint: Texture = (0.0,)
    sheen: Texture = (0.0,)
    sheen_tint: Texture = (0.0,)
    flatness: Texture = (0.0,)
    diff_trans: Texture = (0.0,)
    diffuse_rate: float = 1.0
    specular_rate: float = 1.0
    specular_transmittance_rate: float = 1.0
    diffuse_transmittance_rate: float = 1.0


@dataclass(frozen=True, eq=False)
class TwoSided:
    """`front` seen along the normal's side, `back` from the other."""

    front: Bsdf
    back: Bsdf


@dataclass(frozen=True, eq=False)
class FrontOnly:
    """`front` seen along the normal's side, and no surface at all from the other."""

    front: Bsdf


@dataclass(frozen=True, eq=False)
class Mask:
    """`nested` where `opacity` is 1, nothing where it is 0, by chance in between."""

    nested: Bsdf
    opacity: Texture = (0.5,)


@dataclass(frozen=True, eq=False)
class Blend:
    """`first` or `second` by chance, the second in this share of cases."""

    first: Bsdf
    second: Bsdf
    weight: Texture = (0.5,)


@dataclass(frozen=True, eq=False)
class NormalMap:
    """`nested` under the normals of a texture, n as the colour (n + 1) / 2 in the surface's frame.

    `flip_invalid_normals`: those seen from behind are turned about the surface's own normal.
    `use_shadowing_function`: light near the horizon is shadowed, as between facets.
    """

    nested: Bsdf
    normalmap: Texture
    flip_invalid_normals: bool = True
    use_shadowing_function: bool = True


@dataclass(frozen=True, eq=False)
class BumpMap:
    """`nested` under the normals of a surface of so many heights, times `scale`, above the real one."""

    nested: Bsdf
    texture: Bitmap
    scale: float = 1.0
    flip_invalid_normals: bool = True
    use_shadowing_function: bool = True


Bsdf = (
    Null
    | Diffuse
    | Dielectric
    | RoughDielectric
    | Conductor
    | RoughConductor
    | Plastic
    | RoughPlastic
    | Principled
    | PrincipledThin
    | TwoSided
    | FrontOnly
    | Mask
    | Blend
    | NormalMap
    | BumpMap
)
