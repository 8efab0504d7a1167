"""The few kinds of scene that hard cases are made of, and what they show, in float64.

A thin bundle of rays meets the media: it sees the sky behind them, or the light of a sun that they scatter
once, or it is in a furnace, where nothing shows.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from clvol.scene.transforms import look_at, translate

if TYPE_CHECKING:
    from collections.abc import Sequence

    from clvol.lab.hard.block import Block

SUN = np.array([0.3, 0.1, 1.0]) / np.linalg.norm([0.3, 0.1, 1.0])
"""Direction of travel of the light."""
FOV = 1e-2
PIXELS = 4


def view(
    o: np.ndarray,
    d: np.ndarray,
    emitters: dict[str, Any],
    *,
    fov: float = FOV,
    size: float = 1.0,
    depth: int = -1,
) -> dict[str, Any]:
    """A scene without shapes: a bundle of rays from `o` along `d`, in units of `size`."""
    up = np.eye(3)[np.argmin(np.abs(d))]
    return {
        "type": "scene",
        "integrator": {"type": "volpath", "max_depth": depth},
        "sensor": {
            "type": "perspective",
            "fov": fov,
            "near_clip": 1e-6 * size,
            "far_clip": 1e6 * size,
            "to_world": translate(o) @ look_at([0, 0, 0], d, up),
            "film": {"type": "hdrfilm", "width": PIXELS, "height": PIXELS, "rfilter": {"type": "box"}},
        },
        **emitters,
    }


def through(blocks: Sequence[Block], o: Any, d: Any, **more: Any) -> dict[str, Any]:
    """A sky of radiance 1 through media that absorb."""
    scene = view(np.asarray(o, float), np.asarray(d, float), {"sky": {"type": "constant"}}, **more)
    return scene | {f"block{n}": block.shape(albedo=0.0) for n, block in enumerate(blocks)}


def transmitted(blocks: Sequence[Block], o: Any, d: Any) -> np.ndarray:
    """What `through` shows."""
    o, d = _ray(o, d)
    answer: np.ndarray = np.exp(-sum(block.depth(o, d) for block in blocks))[0]
    return answer


def sunlit(
    blocks: Sequence[Block],
    o: Any,
    d: Any,
    *,
    albedo: Any = 1.0,
    g: float = 0.0,
    sun: np.ndarray = SUN,
    depth: int = 2,
    **more: Any,
) -> dict[str, Any]:
    """The light of a sun that media scatter, once as a rule; its irradiance times the phase function is 1."""
    irradiance = 1 / _phase(g, -float(_ray(o, d)[1][0] @ sun))
    light = {"type": "directional", "direction": list(sun), "irradiance": irradiance}
    scene = view(np.asarray(o, float), np.asarray(d, float), {"sun": light}, depth=depth, **more)
    phase = {"type": "hg", "g": g}
    return scene | {
        f"block{n}": block.shape(albedo=albedo, phase=dict(phase)) for n, block in enumerate(blocks)
    }


def scattered(blocks: Sequence[Block], o: Any, d: Any, sun: np.ndarray = SUN) -> np.ndarray:
    """What `sunlit` shows of albedo 1: the integral of sigma_t T(t) T(to the sun)."""
    o, d = _ray(o, d)
    starts, ends = zip(*(block.span(o, d) for block in blocks), strict=True)
    start, end = np.maximum(np.min(starts, axis=0), 0.0), np.max(ends, axis=0)
    cuts = np.unique(np.concatenate([block.cuts(o, d, start, end)[0] for block in blocks]))
    x, w = np.polynomial.legendre.leggauss(6)
    for _ in range(40):  # to halves, until no piece matters that is thick
        depth = _depths(blocks, o, d, cuts)
        thick = (np.diff(depth, axis=0).max(axis=1) > 0.1) & (depth[:-1].min(axis=1) < 40)
        if not thick.any():
            break
        cuts = np.sort(np.concatenate([cuts, (cuts[:-1] + cuts[1:])[thick] / 2]))
    half, middle = np.diff(cuts) / 2, (cuts[1:] + cuts[:-1]) / 2
    t, weight = (middle[:, None] + half[:, None] * x).reshape(-1), (half[:, None] * w).reshape(-1)
    at = o + t[:, None] * d
    to_sun = np.broadcast_to(-sun, at.shape)
    sigma, optical = np.zeros((len(t), 1)), _depths(blocks, o, d, t)
    for block in blocks:
        optical = optical + block.depth(at, to_sun)
        near, far = block.span(o, d)
        inside = (t > near) & (t < far)
        sigma = sigma + np.where(inside[:, None], block.sigma_t(at), 0.0)
    answer: np.ndarray = (weight[:, None] * sigma * np.exp(-optical)).sum(axis=0)
    return answer


def slab_light(depth: Any, albedo: Any = 1.0, sun: np.ndarray = SUN) -> np.ndarray:
    """In closed form, what a homogeneous slab across z scatters back along -z once, where p E is 1.

    Chandrasekhar 1960: omega p E / (1 + 1/mu) (1 - exp(-tau (1 + 1/mu))), mu the cosine of the sun.
    """
    factor = 1 + 1 / sun[2]
    depth = np.atleast_1d(np.asarray(depth, float))
    answer: np.ndarray = np.asarray(albedo) / factor * -np.expm1(-depth * factor)
    return answer


def furnace(blocks: Sequence[Block], o: Any, d: Any, **medium: Any) -> dict[str, Any]:
    """Media in uniform radiance 1, of albedo 1, or that emit as they absorb: nothing shows (Kirchhoff)."""
    more = {key: medium.pop(key) for key in ("fov", "size") if key in medium}
    scene = view(np.asarray(o, float), np.asarray(d, float), {"sky": {"type": "constant"}}, **more)
    return scene | {f"block{n}": block.shape(**medium) for n, block in enumerate(blocks)}


def _depths(blocks: Sequence[Block], o: np.ndarray, d: np.ndarray, t: np.ndarray) -> np.ndarray:
    """Optical depths to places on one ray, (t, channels)."""
    os, ds = np.broadcast_to(o, (len(t), 3)), np.broadcast_to(d, (len(t), 3))
    total: np.ndarray = sum(block.depth(os, ds, t) for block in blocks)  # type: ignore[assignment]
    return total


def _ray(o: Any, d: Any) -> tuple[np.ndarray, np.ndarray]:
    d = np.asarray(d, float)
    return np.asarray(o, float)[None], (d / np.linalg.norm(d))[None]


def _phase(g: float, cosine: float) -> float:
    """Henyey-Greenstein, directions of travel."""
    return float((1 - g * g) / (4 * np.pi * (1 + g * g - 2 * g * cosine) ** 1.5))
