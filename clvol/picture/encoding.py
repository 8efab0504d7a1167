"""A result as a picture file of any format: what of it goes in, and how it is shown there."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, Protocol

from clvol.picture import image_io
from clvol.picture.formats import component_of, is_linear

if TYPE_CHECKING:
    import numpy as np

    from clvol.picture.view_transform import View


class Pictured(Protocol):
    """What a file is made of: `clvol.picture.result.Result`."""

    image: np.ndarray
    variance: np.ndarray
    aovs: dict[str, np.ndarray]
    metadata: dict[str, Any]
    component_format: str | None

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
        return image_io.encode_exr(_channels(result), result.metadata | {"dof": result.dof}, numbers)
    if is_linear(numbers):
        return image_io.encode_linear(suffix, result.image, result.alpha, result.metadata)
    view = view.resolved().with_stops(result.image)
    return image_io.encode_display(suffix, result.image, result.alpha, result.metadata, view, numbers)


def _channels(result: Pictured) -> dict[str, np.ndarray]:
    """Every picture of a result, plane by plane; alpha beside the colours that are multiplied by it."""
    layers = {"": result.image}
    if result.alpha is not None:
        layers[image_io.ALPHA] = result.alpha
    layers |= {"variance": result.variance} | result.aovs
    channels: dict[str, np.ndarray] = {}
    for name, image in layers.items():
        channels |= image_io.split_channels(name, image)
    return channels
