"""Dielectric coats of plastics: what they reflect in all, by the formulas that the device uses per facet.

A smooth coat over a diffuse base needs its mean reflectance from inside; a rough one also what it lets
through from each direction, as a table.  Both follow Mitsuba, so that pictures agree: tables are integrated
to 1e-4, and those of Mitsuba are within 5e-4 of them.
"""

from __future__ import annotations

import math
from functools import cache

import numpy as np

from clvol.layout import COAT_ENTRIES

MIN_ALPHA = 1e-4
"""Roughness below which a microfacet model is as good as smooth, and single precision ends."""
_RADII, _ANGLES = 64, 32


def diffuse_reflectance(ior: float) -> float:
    """Reflectance of a smooth boundary for diffuse light; the far side is `ior` times denser.

    Fits: Egan and Hilgeman (1973) for ior < 1; d'Eon and Irving (2011) otherwise.
    """
    if ior < 1:
        return -1.4399 * ior**2 + 0.7099 * ior + 0.6681 + 0.0636 / ior
    coefficients = (0.919317, -3.4793, 6.75335, -7.80989, 4.98554, -1.36881)
    return sum(c / ior**n for n, c in enumerate(coefficients))


def fresnel(cos_i: np.ndarray, ior: float) -> np.ndarray:
    """Reflectance of a smooth boundary for unpolarised light at `cos_i` >= 0, any shape; ior not 1."""
    cos_t = np.sqrt(np.maximum(1 - (1 - cos_i**2) / ior**2, 0))
    with np.errstate(invalid="ignore"):
        s = (cos_i - ior * cos_t) / (cos_i + ior * cos_t)
        p = (cos_t - ior * cos_i) / (cos_t + ior * cos_i)
    return np.where(cos_i == 0, 1.0, 0.5 * (s**2 + p**2))


def _shadowing(distribution: str, alpha: float, cosine: np.ndarray) -> np.ndarray:
    """G1 of values (see cl/bsdf/microfacet.h); 0 below the horizon."""
    sine = np.sqrt(np.maximum(1 - cosine**2, 1e-30))
    a = np.maximum(cosine, 0) / (alpha * sine)
    if distribution == "ggx":
        ggx: np.ndarray = 2 * a / (a + np.sqrt(a**2 + 1))
        return ggx
    cut = np.minimum(a, 1.6)
    fit = (3.535 * cut + 2.181 * cut**2) / (1 + 2.276 * cut + 2.577 * cut**2)
    return np.where(a < 1.6, fit, 1.0)


def _visibility_over_cos(distribution: str, alpha: float, cosine: float) -> float:
    """Exact G1 / cos theta, for cosine > 0."""
    s = alpha * math.sqrt(max(1 - cosine**2, 0))
    if distribution == "ggx":
        return 2 / (cosine + math.hypot(cosine, s))
    a = cosine / max(s, 1e-30)
    return 2 / (cosine * (1 + math.erf(a)) + s * math.exp(-min(a * a, 700)) / math.sqrt(math.pi))


def coat_shares(distribution: str, alpha: float, ior: float) -> tuple[np.ndarray, np.ndarray]:
    """Shares of light that a rough boundary reflects and refracts once, from each of the table's cosines.

    Both are the integral of D G1(wi) (wi·m)+ / cos theta_i · G1(wo) over the normals m, with F or 1 - F, and
    with tan² theta_m distributed as D cos theta_m is; float64 (entries,).  They add up to less than 1: light
    that other facets block is lost.
    """
    alpha = max(alpha, MIN_ALPHA)
    nodes, weights = np.polynomial.legendre.leggauss(_RADII)
    u = 1 - (0.5 - 0.5 * nodes) ** 2  # denser towards the tail of D
    weights = weights * (0.5 - 0.5 * nodes) / _ANGLES
    tan2 = alpha**2 * (u / (1 - u) if distribution == "ggx" else -np.log1p(-u))
    azimuth = np.pi * (np.arange(_ANGLES) + 0.5) / _ANGLES
    cos_m = 1 / np.sqrt(1 + tan2)[:, None]
    tilt = np.sqrt(tan2)[:, None] * np.cos(azimuth)
    shares = np.empty((2, COAT_ENTRIES))
    for n, mu in enumerate(np.linspace(0, 1, COAT_ENTRIES)):
        cosine = max(mu, 1e-6)
        facing = np.maximum(cosine + math.sqrt(1 - cosine**2) * tilt, 0)  # wi·m / m.z
        wi_m = np.minimum(facing * cos_m, 1)
        arriving = facing * _visibility_over_cos(distribution, alpha, cosine) * weights[:, None]
        wo_m = np.sqrt(np.maximum(1 - (1 - wi_m**2) / ior**2, 0))
        reflected = fresnel(wi_m, ior)
        up = _shadowing(distribution, alpha, 2 * wi_m * cos_m - cosine)
        down = _shadowing(distribution, alpha, (wo_m - wi_m / ior) * cos_m + cosine / ior)
        shares[:, n] = (arriving * reflected * up).sum(), (arriving * (1 - reflected) * down).sum()
    return shares[0], shares[1]


@cache
def coat_table(distribution: str, alpha: float, ior: float) -> tuple[np.ndarray, float]:
    """What a rough coat lets in, float32 (entries,), and its mean reflectance from inside."""
    _, transmittance = coat_shares(distribution, alpha, ior)
    inside, _ = coat_shares(distribution, alpha, 1 / ior)
    return transmittance.astype(np.float32), float(2 * np.mean(inside * np.linspace(0, 1, COAT_ENTRIES)))
