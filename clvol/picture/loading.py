"""`clvol.load_result`: an .exr that clvol wrote, as the Result that it was."""

from __future__ import annotations

import json
import math
from itertools import pairwise
from typing import TYPE_CHECKING, Any

import numpy as np

from clvol.base.files import open_regular
from clvol.base.image_reading import UnreadableError, read_stored
from clvol.errors import OptionError, shown
from clvol.picture import kept_sums
from clvol.picture.encoding import RECORD
from clvol.picture.image_io import ALPHA, DENOISED
from clvol.picture.result import Result
from clvol.picture.scenery import Scenery

if TYPE_CHECKING:
    from os import PathLike

    from clvol.picture.estimate import Ranges

_HINT = "give an .exr that `clvol render` or Result.save wrote"


def load_result(path: str | PathLike[str]) -> Result:
    """Read a picture that clvol wrote as .exr: image, variance, AOVs, metadata, statistics, sample ranges.

    It merges as the result did that was saved (`merge`), and a render goes on where it ended
    (``clvol render --resume``).  Numbers are floats of the file: a merged picture is that of one render up to
    their rounding, 2e-7 of a pixel.

    Parameters
    ----------
    path
        The file.

    Returns
    -------
    Result

    Raises
    ------
    OptionError
        No such file, no .exr of clvol, or a damaged one.
    """
    try:
        name = str(path) if isinstance(path, str) else str(path.__fspath__())
    except AttributeError:
        raise OptionError(f"load_result takes a file's name, not {shown(path)}", hint=_HINT) from None
    with open_regular(name, OptionError, "picture"):
        try:
            stored = read_stored(name)
        except UnreadableError as error:
            raise OptionError(f"cannot be read: {error}", name, _HINT) from None
    if RECORD not in stored.metadata:
        raise OptionError("is no picture with the record of its render", name, _HINT)
    layers = _layers({c: stored.pixels[..., n] for n, c in enumerate(stored.channels)})
    try:
        return _result(json.loads(stored.metadata[RECORD]), layers)
    except (KeyError, TypeError, ValueError, AttributeError, OverflowError, RecursionError) as error:
        raise OptionError(f"the record of its render is damaged ({error})", name, _HINT) from None


def _layers(channels: dict[str, np.ndarray]) -> dict[str, np.ndarray]:
    """Channels "x" as (h, w), and "x.R", "x.G", … and "x.0", "x.1", … as (h, w, n), by layer."""
    grouped: dict[str, list[str]] = {}
    for name in channels:
        layer, _, label = name.rpartition(".")
        if name == "A":
            grouped[ALPHA] = [name]
        elif label in ("R", "G", "B", "A") or (layer and label.isdecimal()):
            grouped.setdefault(layer, []).append(name)
        else:
            grouped[name] = [name]
    layers = {}
    for layer, names in grouped.items():
        if names == [layer] or layer == ALPHA:
            layers[layer] = channels[names[0]].copy()
            continue
        labels = [name.rpartition(".")[2] for name in names]
        order = sorted(zip(map(_place, labels), names, strict=True))
        layers[layer] = np.stack([channels[name] for _, name in order], axis=-1)
    return layers


def _place(label: str) -> int:
    """Where a channel of that label stands among those of its layer."""
    return "RGBA".index(label) if label in ("R", "G", "B", "A") else int(label)


def _result(said: Any, layers: dict[str, np.ndarray]) -> Result:
    """The result of a file's record and layers; KeyError, TypeError or ValueError where it is none."""
    image, variance, denoised = layers.pop(""), layers.pop("variance"), layers.pop(DENOISED, None)
    deviations = {name: layers.pop(name) for name in list(layers) if name.startswith(kept_sums.LAYER)}
    if image.shape != variance.shape or image.shape[2:] != (3,):
        raise ValueError("the picture has no three channels")
    ranges = _ranges(said["ranges"])
    metadata, stats = said["metadata"], said["stats"]
    if not (isinstance(metadata, dict) and isinstance(stats, dict)):
        raise TypeError("its metadata are none")
    estimate = kept_sums.rebuilt(said["sums"], image, variance, deviations, layers.get("samples"))
    count = _whole(said["samples"])
    result = Result(image, variance, stats, layers, metadata, (ranges[0][0], count), estimate, ranges)
    result.component_format, result.denoised = said.get("component_format"), denoised
    result.scenery = Scenery.read(said.get("scenery"))
    result.files = tuple(map(str, said.get("files", ())))
    return result


def _ranges(said: Any) -> Ranges:
    ranges = tuple((_whole(first), _whole(count)) for first, count in said)
    apart = all(a[0] + a[1] < b[0] for a, b in pairwise(ranges))
    if not ranges or not apart or any(first < 0 or count < 1 for first, count in ranges):
        raise ValueError("its ranges of samples are none")
    return ranges


def _whole(value: Any) -> int:
    if isinstance(value, bool) or not isinstance(value, int) or not math.fabs(value) < 2**40:
        raise ValueError(f"{value!r} is no whole number")
    return value
