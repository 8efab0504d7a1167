"""What a picture is taken on: films, their filters, and how many samples."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from clvol.scene.materials import Spectrum


@dataclass(frozen=True)
class ReconstructionFilter:
    """Pixel filter; `radius` and `stddev` in pixels (stddev only for the Gaussian)."""

    kind: str = "gaussian"  # "box" | "tent" | "gaussian" | "mitchell" | "lanczos"
    radius: float = 2.0
    stddev: float = 0.5
    b: float = 1 / 3  # of mitchell
    c: float = 1 / 3

    @property
    def signed(self) -> bool:
        """Whether it may be negative somewhere."""
        return self.kind in ("mitchell", "lanczos")


@dataclass(frozen=True)
class Film:
    """Image size in pixels and the filter each pixel is integrated with.

    `crop` (x, y, width, height): the part of it that is rendered; None: all.
    `pixel_format`: "rgb", or "rgba" for a picture with alpha.
    `backdrop`: radiance that is seen instead of the environment behind all there is; None: the environment.
    `component_format`: what colours are in files that hold such, "float16" or "float32"; None: what is usual.
    """

    width: int = 768
    height: int = 576
    rfilter: ReconstructionFilter = ReconstructionFilter()
    sample_border: bool = False
    crop: tuple[int, int, int, int] | None = None
    pixel_format: str = "rgb"
    backdrop: Spectrum | None = None
    component_format: str | None = None

    @property
    def has_alpha(self) -> bool:
        """Whether pictures have alpha."""
        return self.pixel_format == "rgba"

    @property
    def window(self) -> tuple[int, int, int, int]:
        """x, y, width and height of what is rendered."""
        return self.crop or (0, 0, self.width, self.height)


@dataclass(frozen=True)
class Sampler:
    """Samples per pixel and seed."""

    spp: int = 4
    seed: int = 0
