"""Pictures on disk: EXR with named channels, tone-mapped PNG; both with metadata, written atomically."""

from __future__ import annotations

import json
import logging
import os
import secrets
import tempfile
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from os import PathLike
from pathlib import Path
from typing import Any

import numpy as np

from clvol.errors import OptionError

log = logging.getLogger("clvol")

SUFFIXES = (".exr", ".png")
SHOULDER = 0.6
"""Linear radiance at which `tone_map` begins to roll off."""
RESERVED = frozenset({"version", "name", "type", "view", "channels", "compression", "tiles", "lineOrder"})
"""Names EXR keeps for itself: metadata of such a name is written as "clvol:name"."""
MAGENTA = (255, 0, 255)
"""What a PNG shows for a pixel that is NaN or infinite."""


def output_suffix(path: str | PathLike[str]) -> str:
    """Lower-case suffix of a picture's path; OptionError where it is neither .exr nor .png."""
    suffix = Path(path).suffix.lower()
    if suffix not in SUFFIXES:
        raise OptionError(
            f"unknown picture format '{suffix}'" if suffix else "no picture format",
            where=str(path),
            hint=f"name the file {' or '.join(SUFFIXES)}",
        )
    return suffix


def check_output(path: str | PathLike[str]) -> None:
    """Raise OptionError now for a path that `Result.save` could not write after a long render."""
    output_suffix(path)
    target = Path(os.path.realpath(path))
    if target.is_dir():
        raise OptionError("is a folder, not a picture", where=str(path), hint="give a file name")
    folder = target.parent
    if not folder.is_dir():
        raise OptionError(f"no such folder '{folder}'", where=str(path), hint="make it first")
    try:  # the only sure way to know
        with tempfile.TemporaryFile(dir=folder):
            pass
    except OSError as error:
        reason = f"cannot write to '{folder}': {error.strerror}"
        raise OptionError(reason, where=str(path), hint="choose another folder") from None


def split_channels(name: str, image: np.ndarray) -> dict[str, np.ndarray]:
    """Name the planes of an image: (h, w) is `name`; (h, w, 3) is name.R, name.G, name.B; else name.0, …"""
    if image.ndim == 2:
        return {name: image}
    count = image.shape[2]
    labels = "RGB" if count == 3 else [str(index) for index in range(count)]
    prefix = f"{name}." if name else ""
    return {f"{prefix}{label}": image[:, :, index] for index, label in enumerate(labels)}


def tone_map(image: np.ndarray, exposure: float = 0.0) -> np.ndarray:
    """Map linear radiance to sRGB in 0..1, float32, the same shape; NaN and inf are not looked after.

    Radiance times 2^exposure is kept as it is up to a = 0.6; above, it rolls off along
    a + (1 - a) t / (1 + t), t = (x - a) / (1 - a), which has slope 1 at a and reaches 1 only at infinity:
    mid-tones stay exact, and highlights keep their shape and fade towards white.
    """
    linear = np.maximum(np.asarray(image, np.float32) * np.float32(2.0**exposure), 0.0)
    above = np.maximum(linear - SHOULDER, 0.0) / (1.0 - SHOULDER)
    linear = np.minimum(linear, SHOULDER) + (1.0 - SHOULDER) * (above / (1.0 + above))
    low = 12.92 * linear
    high = 1.055 * np.power(np.maximum(linear, 0.0031308), 1 / 2.4) - 0.055
    return np.where(linear <= 0.0031308, low, high).astype(np.float32)


def write_exr(
    path: str | PathLike[str], channels: Mapping[str, np.ndarray], metadata: Mapping[str, Any]
) -> None:
    """Write planes (h, w) as float32 channels of one EXR part, in the given order; NaN and inf stay.

    Raises OptionError where the file cannot be written.
    """
    pixels = np.stack([np.asarray(plane, np.float32) for plane in channels.values()], axis=-1)
    exr_metadata = {
        f"clvol:{name}" if name in RESERVED else name: _exr_value(value) for name, value in metadata.items()
    }
    attributes = {
        "compression": "zip",
        "oiio:ColorSpace": "lin_rec709_scene",
        "Software": _software(metadata),
    }
    _write(path, pixels, list(channels), attributes | exr_metadata)


def write_png(
    path: str | PathLike[str], image: np.ndarray, metadata: Mapping[str, Any], exposure: float = 0.0
) -> None:
    """Write linear radiance (h, w, 3) as an 8-bit sRGB PNG (`tone_map`), metadata as text.

    Pixels that are NaN or infinite are painted magenta and counted in a warning, so that they are seen.
    Raises OptionError where the file cannot be written.
    """
    broken = ~np.isfinite(image).all(axis=-1)
    display = tone_map(np.where(broken[..., None], 0.0, image), exposure)
    pixels = np.rint(255.0 * display).astype(np.uint8)
    pixels[broken] = MAGENTA
    if broken.any():
        log.warning("%s: %d pixels are NaN or infinite and shown in magenta", path, int(broken.sum()))
    attributes = {
        "oiio:ColorSpace": "srgb_rec709_scene",
        "Software": _software(metadata),
        "exposure": f"{exposure:g}",
    }
    texts = {name: _text(value) for name, value in metadata.items()}
    _write(path, pixels, ["R", "G", "B"], attributes | texts)


def _write(
    path: str | PathLike[str], pixels: np.ndarray, channels: list[str], attributes: Mapping[str, Any]
) -> None:
    """Write (h, w, channels) pixels of their own type with OpenImageIO."""
    import OpenImageIO as oiio  # noqa: N813

    height, width, count = pixels.shape
    kind = oiio.UINT8 if pixels.dtype == np.uint8 else oiio.FLOAT
    spec = oiio.ImageSpec(width, height, count, kind)
    spec.channelnames = channels
    for name, value in attributes.items():
        spec.attribute(name, value)
    with _replacing(path) as temporary:
        output = oiio.ImageOutput.create(str(temporary))
        if output is None:
            raise OptionError(f"OpenImageIO cannot write it: {oiio.geterror()}", where=str(path))
        written = output.open(str(temporary), spec) and output.write_image(np.ascontiguousarray(pixels))
        reason = output.geterror()
        if not (output.close() and written):
            raise OptionError(
                f"cannot write the picture: {reason or output.geterror()}",
                where=str(path),
                hint="is the disk full?",
            )


@contextmanager
def _replacing(path: str | PathLike[str]) -> Iterator[Path]:
    """A temporary path beside `path` that takes its place if the block succeeds, and goes away if not."""
    check_output(path)
    target = Path(os.path.realpath(path))
    temporary = target.with_name(f".{target.stem}.{secrets.token_hex(4)}{target.suffix}")
    try:
        yield temporary
        os.replace(temporary, target)
    except OSError as error:
        raise OptionError(f"cannot write the picture: {error.strerror}", where=str(path)) from error
    finally:
        temporary.unlink(missing_ok=True)


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
    """Metadata value as text: strings as they are, the rest as JSON where it can be said in JSON."""
    return value if isinstance(value, str) else json.dumps(value, default=str)
