"""Picture files as arrays: any that OpenImageIO reads, whole or not at all."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import OpenImageIO as oiio  # noqa: N813

from clvol.base.memory import available_memory, format_bytes

MAX_PIXELS = 2**27
"""16,384 x 8,192: as an environment 1.6 GB of texels and 0.5 GB of tables, here and again on the device."""
_END, _STUFFED, _FILL = 0xD9, 0x00, 0xFF
_WITHOUT_LENGTH = (_STUFFED, 0x01, *range(0xD0, _END))
"""What may stand after 0xFF in a JPEG without the length of a segment behind it."""


class UnreadableError(Exception):
    """A file that is no picture, or a damaged one, or too large: the text says why."""


@dataclass(frozen=True, eq=False)
class Stored:
    """A picture as it is in its file.

    Parameters
    ----------
    pixels : float32 (height, width, channels), top row first; integers from 0 to 1.
    channels : their names.
    type_name : of the samples in the file, as "uint8", "half", "float".
    format_name : of the file, as "png", "openexr".
    metadata : attributes by name.
    """

    pixels: np.ndarray
    channels: tuple[str, ...]
    type_name: str
    format_name: str
    metadata: dict[str, Any]


def read_stored(path: str, channels: int | None = None) -> Stored:
    """The picture in file `path`, or so many channels of it at most; colours are not multiplied by alpha.

    Raises UnreadableError.
    """
    config = oiio.ImageSpec()
    config.attribute("oiio:UnassociatedAlpha", 1)
    try:
        opened = oiio.ImageInput.open(path, config)
        if opened is None:
            raise UnreadableError(_reason(oiio))
        try:
            return _read(opened, path, channels)
        finally:
            opened.close()
    except UnicodeError:  # names and texts in the file, or the file's own name
        raise UnreadableError("it has names or texts that are no UTF-8") from None


def _read(opened: Any, path: str, channels: int | None) -> Stored:
    spec = opened.spec()
    if spec.width * spec.height > MAX_PIXELS:
        size = f"{spec.width} x {spec.height}"
        raise UnreadableError(f"it is {size}, which is more than the limit of {MAX_PIXELS} pixels")
    if spec.depth > 1:
        raise UnreadableError("it has several layers")
    count = min(spec.nchannels, channels or spec.nchannels)
    made = 0 if channels == count else channels or 0  # of other channels than were asked for, these are made
    size, free = 4 * spec.width * spec.height * (count + made), available_memory()
    if free is not None and size > free:
        raise UnreadableError(
            f"it takes {format_bytes(size)} of memory, of which {format_bytes(free)} are free"
        )
    pixels = opened.read_image(0, 0, 0, count, oiio.FLOAT)
    if pixels is None:
        raise UnreadableError(_reason(opened))
    if opened.format_name() == "jpeg" and not jpeg_is_whole(Path(path).read_bytes()):
        raise UnreadableError("the file is cut short")
    return Stored(
        np.asarray(pixels).reshape(spec.height, spec.width, count),
        tuple(spec.channelnames[:count]),
        str(spec.format),
        opened.format_name(),
        {attribute.name: attribute.value for attribute in spec.extra_attribs},
    )


def jpeg_is_whole(data: bytes) -> bool:
    """Whether a JPEG file goes to its end marker: decoders fill up with grey what is missing before it."""
    at = 0
    while (at := data.find(b"\xff", at)) >= 0 and at + 1 < len(data):
        marker = data[at + 1]
        if marker == _END:
            return True
        if marker == _FILL:
            at += 1
        elif marker in _WITHOUT_LENGTH:
            at += 2
        else:
            at += 2 + int.from_bytes(data[at + 2 : at + 4])
    return False


def _reason(source: Any) -> str:
    """What OpenImageIO says went wrong, in one line; damaged files get into it with bytes of any kind."""
    try:
        message = source.geterror()
    except UnicodeDecodeError as error:
        message = error.object.decode("utf-8", "replace")
    return " ".join(message.split()) or "unknown or damaged format"
