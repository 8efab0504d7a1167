"""Noise taken out of a picture by Open Image Denoise, a neural network; the picture itself stays as it is.

What comes out is biased, by an amount that nothing tells: it is a layer of its own, to be looked at.  Errors,
comparisons and targets are the picture's.

The network is guided by pictures of what camera paths first meet, where there are such: the albedo of a
surface or of a medium, and the normal of a surface (0 in media).  They are noisy themselves, where media are
thin, and are filtered first.  In pictures of a single medium of one albedo the colours tell as much: with
them errors of a cloud, smoke and fire were 0 to 5 % larger than without, those of a room with smoke 2 %
smaller.  The gradient of the density as a normal of media changed no more.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from clvol.base.extras import need

FEATURES = ("albedo", "normal")
"""Pictures that guide it."""


def need_denoiser() -> Any:
    """The module; OptionError, with the command that installs it, where it is missing."""
    return need("pyoidn", "denoising", "denoise")


def denoiser_name() -> str:
    """Program and version, as "Open Image Denoise 2.5.1"."""
    oidn = need_denoiser()
    with oidn.Device() as device:
        parts = [device.get_int(f"version{part}") for part in ("Major", "Minor", "Patch")]
    return f"Open Image Denoise {'.'.join(map(str, parts))}"


def denoise(
    image: np.ndarray,
    alpha: np.ndarray | None = None,
    albedo: np.ndarray | None = None,
    normal: np.ndarray | None = None,
) -> np.ndarray:
    """A picture without its noise.

    Parameters
    ----------
    image : linear radiance (h, w, 3).  What is NaN or infinite stays so.
    alpha : (h, w), which is denoised too.
    albedo, normal : (h, w, 3), what paths first meet.

    Returns
    -------
    float32 (h, w, 3), or with alpha (h, w, 4).
    """
    broken = ~np.isfinite(image)
    guides = {
        name: _filtered({name: _finite(guide)})
        for name, guide in (("albedo", albedo), ("normal", normal))
        if guide is not None
    }
    colours = _filtered({"color": np.maximum(_finite(image), 0.0)} | guides, hdr=True)
    np.copyto(colours, image, where=broken)
    if alpha is None:
        return colours
    grey = np.repeat(np.clip(_finite(alpha), 0.0, 1.0)[..., None], 3, axis=-1)
    covered = _filtered({"color": grey} | guides, hdr=False).mean(axis=-1)
    return np.dstack([colours, np.clip(covered, 0.0, 1.0)])


def _finite(image: np.ndarray) -> np.ndarray:
    return np.nan_to_num(np.asarray(image, np.float32), nan=0.0, posinf=0.0, neginf=0.0)


def _filtered(images: dict[str, np.ndarray], hdr: bool = False) -> np.ndarray:
    """One run of the network: a picture, guided by others that have no noise; or such a guide alone."""
    oidn = need_denoiser()
    kept = {name: np.ascontiguousarray(image) for name, image in images.items()}  # which it reads in place
    output = np.zeros_like(next(iter(kept.values())))
    with oidn.Device() as device:
        device.commit()
        with oidn.Filter(device, oidn.OIDN_FILTER_TYPE_RT) as network:
            for name, image in (kept | {"output": output}).items():
                network.set_image(name, image, oidn.OIDN_FORMAT_FLOAT3)
            network.set_bool("hdr", hdr)
            network.set_bool("cleanAux", len(kept) > 1)
            network.commit()
            network.execute()
        if error := device.get_error():
            raise RuntimeError(f"Open Image Denoise: {error}")
    return output
