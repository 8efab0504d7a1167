"""A result as a picture file of any format: what of it goes in, and how it is shown there."""

from __future__ import annotations

import json
from collections.abc import Mapping
from typing import TYPE_CHECKING, Any, Protocol

import numpy as np

from clvol.picture import image_io, kept_sums
from clvol.picture.formats import component_of, is_linear

if TYPE_CHECKING:
    from clvol.picture.estimate import Estimate, Ranges
    from clvol.picture.scenery import Scenery
    from clvol.picture.view_transform import View

RECORD = "clvol:result"
"""The attribute of an .exr with all that its planes do not say."""


class Pictured(Protocol):
    """What a file is made of: `clvol.picture.result.Result`."""

    image: np.ndarray
    variance: np.ndarray
    aovs: dict[str, np.ndarray]
    metadata: dict[str, Any]
    stats: dict[str, Any]
    samples: tuple[int, int]
    ranges: Ranges
    estimate: Estimate
    component_format: str | None
    denoised: np.ndarray | None
    files: tuple[str, ...]
    scenery: Scenery | None

    @property
    def alpha(self) -> np.ndarray | None:
        """How opaque it is."""

    @property
    def dof(self) -> int:
        """Degrees of freedom of the variance."""


def encode_result(result: Pictured, suffix: str, view: View, component: str | None = None) -> bytes:
    """The whole file: everything there is in an .exr, the picture alone in other formats.

    view : how it is shown, in formats of whole numbers.  component : what numbers are, in formats that hold
        such; else what the scene says, or what is usual.

    Raises OptionError for a view that there is not.
    """
    numbers = component_of(suffix, component, result.component_format)
    if suffix == ".exr":
        metadata = result.metadata | {"dof": result.dof, RECORD: _record(result, numbers)}
        return image_io.encode_exr(_channels(result, numbers), metadata, numbers)
    if is_linear(numbers):
        return image_io.encode_linear(suffix, *shown_layers(result), result.metadata)
    image, alpha = shown_layers(result)
    view = view.resolved().with_stops(image)
    return image_io.encode_display(suffix, image, alpha, result.metadata, view, numbers)


def shown_layers(result: Pictured) -> tuple[np.ndarray, np.ndarray | None]:
    """Radiance and alpha that are shown: denoised where there is such."""
    if result.denoised is None:
        return result.image, result.alpha
    alpha = result.denoised[..., 3] if result.denoised.shape[2] == 4 else None
    return result.denoised[..., :3], alpha


def _record(result: Pictured, component: str) -> str:
    """What a file's planes do not say of a result, for `clvol.picture.loading`."""
    said = {
        "metadata": result.metadata,
        "stats": result.stats,
        "samples": result.samples[1],
        "ranges": result.ranges,
        "sums": kept_sums.described(result.estimate, component == "float16"),
        "component_format": result.component_format,
        "files": result.files,
        "scenery": result.scenery and result.scenery.described(),
    }
    return json.dumps(said, default=_plain)


def _plain(value: Any) -> Any:
    """A value that JSON does not know as one that it does."""
    if isinstance(value, np.generic | np.ndarray):
        return value.tolist()
    return dict(value) if isinstance(value, Mapping) else str(value)


def _channels(result: Pictured, component: str) -> dict[str, np.ndarray]:
    """Every picture of a result, plane by plane; alpha beside the colours that are multiplied by it."""
    layers = {"": result.image}
    if result.alpha is not None:
        layers[image_io.ALPHA] = result.alpha
    if result.denoised is not None:
        layers[image_io.DENOISED] = result.denoised
    layers |= {"variance": result.variance} | result.aovs
    if component != "float16":
        layers |= kept_sums.layers_of(result.estimate)
    channels: dict[str, np.ndarray] = {}
    for name, image in layers.items():
        channels |= image_io.split_channels(name, image)
    return channels
