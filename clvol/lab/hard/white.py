"""Albedo exactly 1: slabs thick enough to be half-spaces, and paths that scatter ten thousand times.

No path is absorbed here, so that all that a loop, a cap or a roulette takes away shows.
"""

from __future__ import annotations

from functools import cache

import numpy as np
from scipy.integrate import quad

from clvol.lab.hard import scenes
from clvol.lab.hard.block import Block
from clvol.lab.hard.case import Case
from clvol.lab.hard.thickness import AHEAD, EVEN

GROUP = "albedo exactly 1"
WIDTH = 100.0
"""Of a slab, in its thicknesses: what leaves at the sides falls as exp(-pi / 2 WIDTH)."""
LUMPS = 0.2 + 0.8 * np.random.default_rng(4).random((9, 9, 9))


@cache
def h_function(mu: float) -> float:
    """Chandrasekhar's H for isotropic scattering of albedo 1, to 1e-9.

    ln H = -mu / pi times the integral over 0..pi/2 of ln(1 - x cot x) / (cos² x + mu² sin² x): Chandrasekhar
    1960, chapter V, with tan x for his variable.
    """

    def integrand(x: float) -> float:
        logarithm = 2 * np.log(x) - np.log(3) if x < 1e-4 else np.log1p(-x / np.tan(x))
        return float(logarithm / (np.cos(x) ** 2 + (mu * np.sin(x)) ** 2))

    (low, _), (high, _) = (
        quad(integrand, *ends, epsabs=1e-12, limit=200) for ends in ((0, 1), (1, np.pi / 2))
    )
    return float(np.exp(-mu / np.pi * (low + high)))


@cache
def extrapolation_length() -> float:
    """Of the Milne problem, 0.7104 mean free paths: the ratio of H's moments of mu² and mu."""
    x, w = np.polynomial.legendre.leggauss(24)
    mu, w = (x + 1) / 2, w / 2
    h = np.array([h_function(m) for m in mu])
    return float((w * h * mu**2).sum() / (w * h * mu).sum())


def slab_radiance(
    depth: float, through: bool, mu: float = 1.0, mu_sun: float = float(scenes.SUN[2])
) -> float:
    """What a white slab of ten mean free paths and more reflects or lets through, where p E is 1.

    That of a half-space, H(mu) H(mu_0) mu_0 / (mu + mu_0), less what the slab lets through, of which the
    escape function is 3^(1/2)/4 H: van de Hulst 1980, on thick layers.  What lacks falls as exp(-depth).
    """
    h, h_sun = h_function(mu), h_function(mu_sun)
    transmitted = mu_sun * h * h_sun / (depth + 2 * extrapolation_length())
    return transmitted if through else mu_sun * h * h_sun / (mu + mu_sun) - transmitted


def _slab(depth: float, through: bool, spp: int, solid: bool = False) -> Case:
    block = Block(np.array(1.0) if solid else EVEN, (depth,), np.diag([WIDTH, WIDTH, 1.0, 1.0]))
    eye = (0.5 * WIDTH, 0.5 * WIDTH, 3.0 if through else -2.0)
    ahead = (0.0, 0.0, -1.0 if through else 1.0)
    seen = "let through" if through else "reflected"
    return Case(
        f"{'homogeneous ' * solid}white slab in the sun, thickness {depth:g}, all orders, {seen}",
        GROUP,
        lambda: scenes.sunlit([block], eye, ahead, depth=-1),
        lambda: np.array([slab_radiance(depth, through)]),
        "closed form: Chandrasekhar's H and the asymptotic slab of van de Hulst 1980",
        spp=spp,
        long=through or solid,
    )


CASES = (
    _slab(100.0, False, 256),
    _slab(100.0, True, 512),
    _slab(1000.0, False, 32, solid=True),
    Case(
        "white cube of lumps in a furnace: 1e4 scatterings a path",
        GROUP,
        lambda: scenes.furnace([Block(LUMPS, (400.0,), np.eye(4))], (0.5, 0.5, 0.5), AHEAD, albedo=1.0),
        lambda: np.ones(1),
        "energy: every path leaves with all of its weight",
        spp=4,
        long=True,
    ),
)
