"""Pictures as files: EXR with named channels, and every other format of `clvol.picture.formats`.

Radiance is kept as it is where numbers are floats, and goes through a view (`clvol.picture.view_transform`)
where they are whole.  Files are made in memory and carry metadata where the format has a place for it.
"""

from __future__ import annotations

import json
import logging
import os
import tempfile
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from clvol.base.image_reading import jpeg_is_whole
from clvol.errors import OptionError
from clvol.picture.dither import codes
from clvol.picture.formats import COMPONENTS, FORMATS, Format
from clvol.picture.view_transform import View, through_view

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping

log = logging.getLogger("clvol")

RESERVED = frozenset({"version", "name", "type", "view", "channels", "compression", "tiles", "lineOrder"})
"""Names EXR keeps for itself: metadata of such a name is written as "clvol:name"."""
_BLOCK = 16
"""Rows that an EXR compresses together."""
_PNG_END = b"IEND\xaeB`\x82"
"""The last chunk, which readers do not miss."""
_LARGEST_HALF = 65504.0
MAGENTA = (255, 0, 255)
"""What a display shows for a pixel that is NaN or infinite."""
ALPHA = "alpha"
"""The picture of that name is channel A of a file."""
_COLOURS = frozenset("RGBA")
"""Channels, of any layer of colours, that may be half floats; errors and depths need more digits."""
DENOISED = "denoised"
"""The layer of that name is the denoised picture."""
_COLOUR_LAYERS = ("", DENOISED)
HALVED = "deviation."
"""Layers whose names begin so are half floats: numbers of the size of 1."""


def split_channels(name: str, image: np.ndarray) -> dict[str, np.ndarray]:
    """Name the planes of an image.

    (h, w) is `name`, or A for alpha; (h, w, 3) is name.R, name.G, name.B, and (h, w, 4) name.A too; else
    name.0, name.1, …
    """
    if image.ndim == 2:
        return {"A" if name == ALPHA else name: image}
    count = image.shape[2]
    labels = "RGBA"[:count] if count in (3, 4) else [str(index) for index in range(count)]
    prefix = f"{name}." if name else ""
    return {f"{prefix}{label}": image[:, :, index] for index, label in enumerate(labels)}


def encode_exr(
    channels: Mapping[str, np.ndarray], metadata: Mapping[str, Any], component: str = "float32"
) -> bytes:
    """An EXR file of one part: planes (h, w) as float channels, in the given order; NaN and inf stay.

    component : of the channels of colour and alpha, "float16" or "float32"; the others are float32.
    """
    pixels = np.stack([np.asarray(plane, np.float32) for plane in channels.values()], axis=-1)
    halves = [name.startswith(HALVED) or (component == "float16" and _is_colour(name)) for name in channels]
    if any(halves):
        pixels[..., halves] = _as_half(pixels[..., halves])
    exr_metadata = {
        f"clvol:{name}" if name in RESERVED else name: _exr_value(value) for name, value in metadata.items()
    }
    attributes = {
        "compression": "zip",
        "oiio:ColorSpace": "lin_rec709_scene",
        "Software": _software(metadata),
    }
    return _encode(".exr", pixels, list(channels), attributes | exr_metadata, halves)


def encode_linear(
    suffix: str, image: np.ndarray, alpha: np.ndarray | None, metadata: Mapping[str, Any]
) -> bytes:
    """Linear radiance (h, w, 3), and the alpha (h, w) in it, as a file of floats; NaN and inf stay."""
    planes = image if alpha is None else np.dstack([image, alpha])
    channels = list("RGBA")[: planes.shape[2]]
    return _encode(suffix, np.asarray(planes, np.float32), channels, _described(metadata))


def encode_display(
    suffix: str,
    image: np.ndarray,
    alpha: np.ndarray | None,
    metadata: Mapping[str, Any],
    view: View,
    component: str = "uint8",
) -> bytes:
    """Linear radiance (h, w, 3) as a display shows it; with alpha (h, w) colours are divided by it.

    Pixels that are NaN or infinite are painted magenta and counted in a warning, so that they are seen.
    Eight bits are dithered (`clvol.picture.dither`).
    `view` has full names and a number of stops.
    """
    display = shown_pixels(image, alpha, view)
    if component == "uint8":
        pixels = codes(display)
    else:
        pixels = np.rint(65535 * display.astype(np.float64)).astype(COMPONENTS[component])
    said: dict[str, Any] = {
        "display": view.display,
        "view_transform": view.transform,
        "exposure": f"{view.exposure:g}",
    }
    attributes: dict[str, Any] = {"oiio:UnassociatedAlpha": 1}
    if "srgb" in str(view.display).casefold():
        attributes["oiio:ColorSpace"] = "srgb_rec709_scene"
    if suffix == ".png":
        texts = {name: _text(value) for name, value in (dict(metadata) | said).items()}
        attributes |= {"Software": _software(metadata), **texts}
    else:
        attributes |= _described(dict(metadata) | said)
    return _encode(suffix, pixels, list("RGBA")[: pixels.shape[2]], attributes)


def shown_pixels(image: np.ndarray, alpha: np.ndarray | None, view: View) -> np.ndarray:
    """What a display shows of a picture: float32 (h, w, 3), or with straight alpha (h, w, 4), from 0 to 1.

    NaN and infinite pixels are magenta, opaque, and counted in a warning.
    """
    broken = ~np.isfinite(image).all(axis=-1)
    straight = image
    if alpha is not None:
        broken |= ~np.isfinite(alpha)
        covered = np.clip(np.where(broken, 1.0, alpha), 0.0, 1.0)[..., None]
        straight = np.divide(image, covered, out=np.zeros(image.shape, np.float32), where=covered > 0)
    display = through_view(np.where(broken[..., None], 0.0, straight), view)
    display[broken] = np.array(MAGENTA, np.float32) / 255
    if broken.any():
        log.warning("%d pixels are NaN or infinite and shown in magenta", int(broken.sum()))
    return display if alpha is None else np.dstack([display, covered.astype(np.float32)])


def _is_colour(name: str) -> bool:
    layer, _, channel = name.rpartition(".")
    return layer in _COLOUR_LAYERS and channel in _COLOURS


def _as_half(values: np.ndarray) -> np.ndarray:
    """As half floats hold them; what is finite stays so, cut to the largest with a warning."""
    cut = np.isfinite(values) & (np.abs(values) > _LARGEST_HALF)
    if cut.any():
        log.warning("%d values are beyond half floats and written as %g", int(cut.sum()), _LARGEST_HALF)
    limited = np.where(cut, np.copysign(np.float32(_LARGEST_HALF), values), values)
    return limited.astype(np.float16).astype(np.float32)


def _encode(
    suffix: str,
    pixels: np.ndarray,
    channels: list[str],
    attributes: Mapping[str, Any],
    halves: list[bool] | None = None,
) -> bytes:
    """Pixels (h, w, channels) of their own type as a file that OpenImageIO makes.

    The file is made in memory: OpenImageIO tells of a full disk at some writes and not at others.
    """
    import OpenImageIO as oiio  # noqa: N813

    form = FORMATS[suffix]
    height, width, count = pixels.shape
    base = {np.dtype(np.uint8): oiio.UINT8, np.dtype(np.uint16): oiio.UINT16}.get(pixels.dtype, oiio.FLOAT)
    spec = oiio.ImageSpec(width, height, count, base)
    spec.channelnames = channels
    if halves and any(halves):
        spec.channelformats = [oiio.TypeHalf if half else oiio.TypeFloat for half in halves]
    for name, value in attributes.items():
        spec.attribute(name, value)
    spec.attribute("tiff:write_exif", 0)  # which fails in files of other spaces than sRGB
    with open(os.memfd_create("picture"), "rb") as memory, _named(memory.fileno(), suffix) as path:
        output = oiio.ImageOutput.create(form.plugin)
        if output is None:
            raise OptionError(f"this OpenImageIO cannot make {suffix} files", hint=oiio.geterror())
        written = output.open(path, spec) and output.write_image(np.ascontiguousarray(pixels))
        closed = output.close()
        reason = output.geterror()
        data = memory.read()
        planes = dict(zip(channels, np.moveaxis(pixels, -1, 0), strict=True))
        if reason or not (written and closed and _is_whole(path, data, form, planes)):
            first = next(iter(reason.splitlines()), "it cannot be read back")
            raise OptionError(f"cannot make the {suffix} file: {first}", hint="is there enough memory?")
        return data


@contextmanager
def _named(descriptor: int, suffix: str) -> Iterator[str]:
    """A path of the open file, whose name ends as it should where OpenImageIO goes by that."""
    path = f"/proc/{os.getpid()}/fd/{descriptor}"
    if not FORMATS[suffix].needs_suffix:
        yield path
        return
    with tempfile.TemporaryDirectory() as folder:
        link = Path(folder) / f"picture{suffix}"
        link.symlink_to(path)
        yield str(link)


def _is_whole(path: str, data: bytes, form: Format, planes: Mapping[str, np.ndarray]) -> bool:
    """Whether the last rows of the picture file are those of the planes: its end is what goes missing.

    Of formats that change pixels, whether there are such rows.
    """
    import OpenImageIO as oiio  # noqa: N813

    ends = {"png": data.endswith(_PNG_END), "jpeg": jpeg_is_whole(data)}
    if not ends.get(form.plugin, True):
        return False
    config = oiio.ImageSpec()
    config.attribute("oiio:UnassociatedAlpha", 1)
    opened = oiio.ImageInput.open(path, config)
    if opened is None:
        oiio.geterror()  # or it is printed at the end
        return False
    spec = opened.spec()
    first = max(spec.height - _BLOCK, 0)
    kind = next(iter(planes.values())).dtype
    read_as = {np.dtype(np.uint8): oiio.UINT8, np.dtype(np.uint16): oiio.UINT16}.get(kind, oiio.FLOAT)
    pixels = opened.read_scanlines(0, 0, first, spec.height, 0, 0, spec.nchannels, read_as)
    opened.geterror()
    opened.close()
    if pixels is None or spec.nchannels != len(planes):
        return False
    if not form.exact:
        return True
    found = {name: pixels[..., n].tobytes() for n, name in enumerate(spec.channelnames)}
    return found == {name: plane[first:].tobytes() for name, plane in planes.items()}


def _software(metadata: Mapping[str, Any]) -> str:
    """Program and version, "clvol 1.2.3"; the version is the one in the metadata."""
    return f"clvol {metadata.get('version', '')}".rstrip()


def _described(metadata: Mapping[str, Any]) -> dict[str, str]:
    """All metadata as one text, for formats that have a place for one."""
    text = json.dumps(dict(metadata), default=str)
    return {"Software": _software(metadata), "ImageDescription": _text(text)}


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
