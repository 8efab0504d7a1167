"""Pictures as files: EXR with named channels, tone-mapped PNG; both with metadata, made in memory."""

from __future__ import annotations

import json
import logging
import os
from typing import TYPE_CHECKING, Any

import numpy as np

from clvol.errors import OptionError

if TYPE_CHECKING:
    from collections.abc import Mapping

log = logging.getLogger("clvol")

SHOULDER = 0.6
"""Linear radiance at which `tone_map` begins to roll off."""
RESERVED = frozenset({"version", "name", "type", "view", "channels", "compression", "tiles", "lineOrder"})
"""Names EXR keeps for itself: metadata of such a name is written as "clvol:name"."""
_BLOCK = 16
"""Rows that an EXR compresses together."""
_PNG_END = b"IEND\xaeB`\x82"
"""The last chunk, which readers do not miss."""
MOST_STOPS = 100.0
"""Exposures beyond it are no pictures, and overflow."""
BRIGHTEST = np.float32(1e30)
"""Radiance above it is shown as bright as this, which is white; its square root would still be a float32."""
MAGENTA = (255, 0, 255)
"""What a PNG shows for a pixel that is NaN or infinite."""


def split_channels(name: str, image: np.ndarray) -> dict[str, np.ndarray]:
    """Name the planes of an image.

    (h, w) is `name`; (h, w, 3) is name.R, name.G, name.B; else name.0, name.1, …
    """
    if image.ndim == 2:
        return {name: image}
    count = image.shape[2]
    labels = "RGB" if count == 3 else [str(index) for index in range(count)]
    prefix = f"{name}." if name else ""
    return {f"{prefix}{label}": image[:, :, index] for index, label in enumerate(labels)}


def tone_map(image: np.ndarray, exposure: float = 0.0) -> np.ndarray:
    """Map linear radiance to sRGB in 0..1, float32, the same shape; NaN stays.

    Radiance times 2^exposure is kept as it is up to a = 0.6; above, it rolls off along
    a + (1 - a) t / (1 + t), t = (x - a) / (1 - a), which has slope 1 at a and reaches 1 only at infinity:
    mid-tones stay exact, and highlights keep their shape and fade towards white.
    """
    with np.errstate(over="ignore"):
        linear = np.asarray(image, np.float32) * np.float32(2.0**exposure)
    linear = np.clip(linear, 0.0, BRIGHTEST)
    above = np.maximum(linear - SHOULDER, 0.0) / (1.0 - SHOULDER)
    linear = np.minimum(linear, SHOULDER) + (1.0 - SHOULDER) * (above / (1.0 + above))
    low = 12.92 * linear
    high = 1.055 * np.power(np.maximum(linear, 0.0031308), 1 / 2.4) - 0.055
    encoded: np.ndarray = np.where(linear <= 0.0031308, low, high)
    return encoded.astype(np.float32)


def check_exposure(exposure: float) -> None:
    """OptionError for an exposure that is no number of stops up to `MOST_STOPS`, either way."""
    if not (isinstance(exposure, int | float | np.number) and abs(exposure) <= MOST_STOPS):
        raise OptionError(f"exposure {exposure} is not a number from {-MOST_STOPS:g} to {MOST_STOPS:g} stops")


def encode_exr(channels: Mapping[str, np.ndarray], metadata: Mapping[str, Any]) -> bytes:
    """An EXR file of one part: planes (h, w) as float32 channels, in the given order; NaN and inf stay."""
    pixels = np.stack([np.asarray(plane, np.float32) for plane in channels.values()], axis=-1)
    exr_metadata = {
        f"clvol:{name}" if name in RESERVED else name: _exr_value(value) for name, value in metadata.items()
    }
    attributes = {
        "compression": "zip",
        "oiio:ColorSpace": "lin_rec709_scene",
        "Software": _software(metadata),
    }
    return _encode("exr", pixels, list(channels), attributes | exr_metadata)


def encode_png(image: np.ndarray, metadata: Mapping[str, Any], exposure: float = 0.0) -> bytes:
    """Linear radiance (h, w, 3) as an 8-bit sRGB PNG file (`tone_map`), metadata as text.

    Pixels that are NaN or infinite are painted magenta and counted in a warning, so that they are seen.
    Raises OptionError for an impossible exposure.
    """
    check_exposure(exposure)
    broken = ~np.isfinite(image).all(axis=-1)
    display = tone_map(np.where(broken[..., None], 0.0, image), exposure)
    pixels = np.rint(255.0 * display).astype(np.uint8)
    pixels[broken] = MAGENTA
    if broken.any():
        log.warning("%d pixels are NaN or infinite and shown in magenta", int(broken.sum()))
    attributes = {
        "oiio:ColorSpace": "srgb_rec709_scene",
        "Software": _software(metadata),
        "exposure": f"{exposure:g}",
    }
    texts = {name: _text(value) for name, value in metadata.items()}
    return _encode("png", pixels, ["R", "G", "B"], attributes | texts)


def _encode(kind: str, pixels: np.ndarray, channels: list[str], attributes: Mapping[str, Any]) -> bytes:
    """Pixels (h, w, channels) of their own type as a file that OpenImageIO makes.

    The file is made in memory: OpenImageIO tells of a full disk at some writes and not at others.
    """
    import OpenImageIO as oiio  # noqa: N813

    height, width, count = pixels.shape
    base = oiio.UINT8 if pixels.dtype == np.uint8 else oiio.FLOAT
    spec = oiio.ImageSpec(width, height, count, base)
    spec.channelnames = channels
    for name, value in attributes.items():
        spec.attribute(name, value)
    with open(os.memfd_create("picture"), "rb") as memory:
        path = f"/proc/self/fd/{memory.fileno()}"
        output = oiio.ImageOutput.create(kind)
        if output is None:
            raise OptionError(f"this OpenImageIO cannot make {kind} files", hint=oiio.geterror())
        written = output.open(path, spec) and output.write_image(np.ascontiguousarray(pixels))
        closed = output.close()
        reason = output.geterror()
        data = memory.read()
        planes = dict(zip(channels, np.moveaxis(pixels, -1, 0), strict=True))
        ended = data.endswith(_PNG_END) if kind == "png" else True
        if reason or not (written and closed and ended and _ends_with(path, planes)):
            first = next(iter(reason.splitlines()), "it cannot be read back")
            raise OptionError(f"cannot make the {kind} file: {first}", hint="is there enough memory?")
        return data


def _ends_with(path: str, planes: Mapping[str, np.ndarray]) -> bool:
    """Whether the last rows of the picture file are those of the planes: its end is what goes missing."""
    import OpenImageIO as oiio  # noqa: N813

    opened = oiio.ImageInput.open(path)
    if opened is None:
        oiio.geterror()  # or it is printed at the end
        return False
    spec = opened.spec()
    first = max(spec.height - _BLOCK, 0)
    pixels = opened.read_scanlines(0, 0, first, spec.height, 0, 0, spec.nchannels, spec.format)
    opened.geterror()
    opened.close()
    if pixels is None:
        return False
    found = {name: pixels[..., n].tobytes() for n, name in enumerate(spec.channelnames)}
    return found == {name: plane[first:].tobytes() for name, plane in planes.items()}


def _software(metadata: Mapping[str, Any]) -> str:
    """Program and version, "clvol 1.2.3"; the version is the one in the metadata."""
    return f"clvol {metadata.get('version', '')}".rstrip()


def _exr_value(value: Any) -> int | float | str:
    """Metadata value as an EXR attribute: numbers that fit stay numbers, everything else becomes text."""
    if isinstance(value, float | np.floating):
        return float(value)
    if isinstance(value, int | np.integer) and not isinstance(value, bool) and -(2**31) <= value < 2**31:
        return int(value)
    return _text(value)


def _text(value: Any) -> str:
    r"""Metadata value as text: strings as they are, the rest as JSON where it can be said in JSON.

    Bytes of a file's name that are no UTF-8 become \udcNN.
    """
    text = value if isinstance(value, str) else json.dumps(value, default=str)
    return text.encode("utf-8", "backslashreplace").decode()
