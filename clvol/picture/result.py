"""What a render returns: the picture, how sure of it we are, what it cost, and how it was made.

A result keeps the float64 sums it is made from (`clvol.picture.estimate`), so that results of disjoint
samples merge without loss (`clvol.picture.merging`).
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from os import PathLike
from typing import TYPE_CHECKING, Any

import numpy as np

from clvol.errors import OptionError
from clvol.picture import image_io
from clvol.picture.estimate import Estimate, error_bias
from clvol.picture.saving import check_picture, save_all

if TYPE_CHECKING:
    from os import PathLike

    from clvol.picture.profile import Profile

Ranges = tuple[tuple[int, int], ...]
"""Sample ranges as (first, count), ascending, disjoint, not touching."""


def relative_noise(image: np.ndarray, variance: np.ndarray, dof: float = math.inf) -> float:
    """Mean standard error of the pixels over their mean radiance; nan where that is unknown.

    Standard errors from few degrees of freedom are too small on the mean, which is corrected.

    Both means run over the pixels and channels whose value and variance are finite, so that a dark
    background neither counts as infinitely noisy nor hides one bad pixel's nan.
    """
    known = np.isfinite(image) & np.isfinite(variance)
    level = float(np.abs(image[known]).sum(dtype=np.float64))
    if level == 0.0:
        return math.nan
    return float(np.sqrt(variance[known]).sum(dtype=np.float64)) / level / error_bias(dof)


def unseen_noise(paths: int, samples: int) -> float:
    """Bound of `relative_noise` where all samples are the same although media might have changed them.

    What none of `paths` paths met has a probability of 3 / paths at most (rule of three, 95 %); if it changes
    a sample by its own size, the means of `samples` samples have an error of √(3 / (paths · samples)).
    """
    return math.sqrt(3 / (max(paths, 1) * max(samples, 1)))


@dataclass(eq=False)
class Result:
    """A rendered picture.

    Parameters
    ----------
    image : float32 (height, width, 3)
        Mean linear radiance.
    variance : float32 (height, width, 3)
        Variance of that mean, per pixel; inf after a single sample.  It has `dof` degrees of freedom: with
        samplers sobol and joint that of a single pixel is rough, sums over tiles and the image are good; with
        joint they are somewhat too large on the mean.
    stats : dict
        What it cost and what went wrong on the way: seconds by stage, paths, look-ups, violations, …
    aovs : dict of str to array (height, width) or (height, width, channels)
        Further pictures, means per path, e.g. "lookups".
    metadata : dict
        How the picture was made: scene, choices, spp, seed, device, version, seconds; and "samples" where
        they are not the first.
    samples : (int, int)
        First sample and number of samples of each pixel.
    estimate : `clvol.picture.estimate.Moments` or `Replicates` of shape (height, width, 3)
        Sums over the samples, by which results merge.
    ranges : tuple of (int, int)
        The same as `samples`, but exact where merged ranges leave gaps.
    profile : `clvol.picture.profile.Profile` or None
        Where the time went, of a render that was asked for it.
    """

    image: np.ndarray
    variance: np.ndarray
    stats: dict[str, Any]
    aovs: dict[str, np.ndarray]
    metadata: dict[str, Any]
    samples: tuple[int, int]
    estimate: Estimate
    ranges: Ranges = ()
    profile: Profile | None = None

    def __post_init__(self) -> None:
        self.ranges = self.ranges or (self.samples,)

    @classmethod
    def from_estimate(
        cls,
        estimate: Estimate,
        samples: tuple[int, int],
        aovs: dict[str, np.ndarray],
        stats: dict[str, Any],
        metadata: dict[str, Any],
    ) -> Result:
        """Make a result of the sums over ``samples = (first, count)``; count must be at least 1."""
        first, count = (int(number) for number in samples)
        if count < 1:
            raise OptionError("a result needs at least one sample per pixel")
        mean, variance = estimate.mean_and_variance()
        return cls(
            image=mean.astype(np.float32),
            variance=variance.astype(np.float32),
            stats=stats,
            aovs=aovs,
            metadata=metadata,
            samples=(first, count),
            estimate=estimate,
        )

    def __repr__(self) -> str:
        height, width = self.image.shape[:2]
        keys = ("technique", "transmittance", "majorant")
        how = [str(self.metadata[key]) for key in keys if key in self.metadata]
        (first, _), spp = self.ranges[0], self.samples[1]
        extent = f"{spp} spp from sample {first} on" if first else f"{spp} spp"
        about = f"{width} x {height}, {extent}, noise {self.noise:.2%}"
        return f"<Result {', '.join([about, *how])}>"

    @property
    def dof(self) -> int:
        """Degrees of freedom of each pixel's variance."""
        return self.estimate.dof

    @property
    def noise(self) -> float:
        """Mean relative standard error of the image (`relative_noise`).

        It is nan, that is unknown, where no sample met any light.

        Where all samples of each pixel are the same it is 0, unless paths crossed media and met nothing in
        them: then it is the bound `unseen_noise`.
        """
        noise = relative_noise(self.image, self.variance, self.dof)
        if noise == 0.0 and self.met_nothing:
            return unseen_noise(self.stats.get("paths", 0), self.samples[1])
        return noise

    @property
    def met_nothing(self) -> bool:
        """Paths crossed media, as far as is known, and no collision was real.

        What these media do to the picture has not been seen.
        """
        analytic = self.metadata.get("technique") == "analytic"
        crossed = analytic or self.stats.get("cells_crossed", 0) or self.stats.get("lookups", 0)
        return bool(crossed) and not self.stats.get("real_collisions", 0)

    def _repr_png_(self) -> bytes:
        """The picture as a PNG, tone-mapped: how a notebook shows a result."""
        return self.encode(".png")

    def encode(self, suffix: str, exposure: float = 0.0) -> bytes:
        """The whole file: a tone-mapped .png, or an .exr with picture, variance and every AOV."""
        if suffix == ".png":
            return image_io.encode_png(self.image, self.metadata, exposure)
        channels: dict[str, np.ndarray] = {}
        for name, image in [("", self.image), ("variance", self.variance), *self.aovs.items()]:
            channels |= image_io.split_channels(name, image)
        return image_io.encode_exr(channels, self.metadata | {"dof": self.dof})

    def save(self, path: str | PathLike[str], exposure: float = 0.0) -> None:
        """Write the picture as .exr (everything, linear) or .png (tone-mapped), by the path's suffix.

        An EXR holds R, G, B, variance.R/G/B and every AOV as float32 channels of one part.  A PNG is
        raised by `exposure` stops and goes through `clvol.picture.image_io.tone_map`.  Both carry the
        metadata.  An earlier file of that name is replaced only once the new one is complete.

        Raises
        ------
        OptionError
            Unknown suffix, impossible exposure, or a folder that is missing or cannot be written to; or a
            file that failed, as on a full disk: the picture is then kept where the message says.
        """
        check_picture(path, exposure)
        for failure in save_all(lambda suffix: self.encode(suffix, exposure), [path]).values():
            raise failure


def said_ranges(ranges: Ranges) -> dict[str, Any]:
    """Metadata "samples" where their number does not tell: a range as `clvol.render` takes it, or several."""
    if ranges == ((0, ranges[0][1]),):
        return {}
    return {"samples": ranges[0] if len(ranges) == 1 else ranges}
