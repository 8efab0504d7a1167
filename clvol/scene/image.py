"""Pictures used as input: any file OpenImageIO reads, or an array, as linear float32 RGB."""

from __future__ import annotations

import numpy as np

from clvol.base.image_reading import UnreadableError, read_stored
from clvol.base.masks import masked_count
from clvol.base.rows import bands
from clvol.errors import SceneError
from clvol.scene.spectra import srgb_to_linear


def read_image(path: str, where: str, raw: bool = False) -> np.ndarray:
    """The image in file `path` as linear RGB, float32 (height, width, 3), top row first.

    8-bit files, and PNG of any depth, are sRGB-decoded unless `raw`; grey images are replicated, alpha is
    dropped, and colours are as stored, not multiplied by it.

    Raises
    ------
    SceneError
        At `where`: not an image, damaged, or larger than `image_reading.MAX_PIXELS`.
    """
    try:
        stored = read_stored(path, channels=3)
        integers = stored.type_name in ("uint8", "uint16")
        encoded = stored.type_name == "uint8" or (integers and stored.format_name == "png")
        return _linear_rgb(stored.pixels, encoded and not raw, in_place=True)
    except UnreadableError as error:
        raise SceneError(f"cannot read image '{path}'", where, str(error)) from None
    except MemoryError:
        raise SceneError(f"cannot read image '{path}'", where, "it takes more memory than there is") from None


def image_from_array(array: np.ndarray, where: str, raw: bool = False) -> np.ndarray:
    """`array` (height, width) or (height, width, 1..4 channels) as linear RGB, float32 (height, width, 3).

    uint8 values are sRGB-encoded unless `raw`, uint16 values linear, both from 0 to their type's maximum.

    Raises
    ------
    SceneError
        At `where`: another shape, another integer type, or masked pixels.
    """
    if masked_count(array):
        what = f"{masked_count(array)} of {array.size} values are masked, a picture needs them all"
        raise SceneError(what, where, "give them values: array.filled(0)")
    array = np.ma.getdata(array)
    pixels = array[..., None] if array.ndim == 2 else array
    if pixels.ndim != 3 or not 1 <= pixels.shape[2] <= 4 or pixels.size == 0:
        raise SceneError(f"expected an image (height, width, 3), got shape {array.shape}", where)
    if pixels.dtype.kind != "f" and pixels.dtype not in (np.uint8, np.uint16):
        raise SceneError(f"expected floats, uint8 or uint16, got {array.dtype}", where)
    return _linear_rgb(pixels, array.dtype == np.uint8 and not raw)


def _linear_rgb(pixels: np.ndarray, encoded: bool, in_place: bool = False) -> np.ndarray:
    """Linear RGB of a picture, float32 (height, width, 3), never the array itself unless `in_place`."""
    height, width, channels = pixels.shape
    same = in_place and channels == 3 and pixels.dtype == np.float32 and pixels.flags.writeable
    linear = pixels if same else np.empty((height, width, 3), np.float32)
    for rows in bands(height, width):
        rgb = pixels[rows, :, :3] if channels >= 3 else pixels[rows, :, :1]
        if rgb.dtype.kind != "f":
            rgb = rgb / np.float32(np.iinfo(rgb.dtype).max)
        linear[rows] = srgb_to_linear(rgb) if encoded else rgb
    return linear
