"""What a render returns: the picture, how sure of it we are, what it cost, and how it was made.

A result keeps the float64 sums it is made from (`clvol.picture.estimate`), so that results of disjoint
samples merge without loss (`clvol.picture.merging`).
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from os import PathLike
from typing import TYPE_CHECKING, Any, Self

import numpy as np

from clvol.base.arguments import flag
from clvol.base.extras import need
from clvol.base.output_files import check_spares
from clvol.base.progress import format_noise
from clvol.errors import OptionError
from clvol.picture import denoising, image_io
from clvol.picture.dither import codes
from clvol.picture.encoding import encode_result, shown_layers
from clvol.picture.estimate import Estimate, Ranges, error_bias
from clvol.picture.image_io import ALPHA
from clvol.picture.saving import check_picture, save_all
from clvol.picture.view_transform import View

if TYPE_CHECKING:
    from os import PathLike

    import numpy.typing as npt

    from clvol.picture.profile import Profile
    from clvol.picture.scenery import Scenery


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
    component_format : str or None
        What the scene asks the numbers of its files to be, as "float16".
    denoised : float32 (height, width, 3) or None
        What `denoise` made of the image, with alpha (height, width, 4): to be looked at, and what is shown.
        Nothing is measured in it.
    scenery : `clvol.picture.scenery.Scenery` or None
        Where the one volume of the scene is in the picture, for labels.
    files : tuple of str
        What the scene was read from, which `save` does not replace.
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
    component_format: str | None = None
    denoised: np.ndarray | None = None
    scenery: Scenery | None = None
    files: tuple[str, ...] = ()

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
        about = f"{width} x {height}, {extent}, noise {format_noise(self.noise)}"
        return f"<{type(self).__name__} {', '.join([about, *how])}>"

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
        """The picture as a PNG: how a notebook shows a result."""
        return self.encode(".png")

    def __array__(self, dtype: npt.DTypeLike | None = None, copy: bool | None = None) -> np.ndarray:
        """The image: ``numpy.asarray(result)``."""
        if dtype is not None and np.dtype(dtype) != self.image.dtype:
            if copy is False:
                raise ValueError(f"the image is {self.image.dtype}: as {np.dtype(dtype)} it is a copy")
            return self.image.astype(dtype)
        return self.image.copy() if copy else self.image

    @property
    def display(self) -> np.ndarray:
        """What a .png shows: uint8 (height, width, 3), or with alpha (height, width, 4)."""
        return codes(image_io.shown_pixels(*shown_layers(self), View().resolved()))

    def to_pil(self) -> Any:
        """`display` as a ``PIL.Image.Image``; OptionError where Pillow is missing."""
        return need("PIL.Image", "Result.to_pil", "report").fromarray(self.display)

    def plot(
        self,
        axes: bool = True,
        scalar_bar: bool | None = None,
        box: bool = True,
        scale_bar: bool | float = False,
    ) -> Any:
        """The picture with labels, as a figure of matplotlib's (the extra `science` or `report`).

        Parameters
        ----------
        axes : the volume's sides with numbers, in its unit: coordinates, or lengths where it is turned.
        scalar_bar : the colours of values, and how opaque they are; by default where there is a transfer
            function.
        box : the sides of the volume's box, dashed behind it.
        scale_bar : a bar of a known length at the middle of the volume: True for a round one, or the length.

        Raises
        ------
        OptionError
            There is nothing to label, as its scene has not one volume; an argument is of the wrong kind; or
            matplotlib is missing.
        """
        from clvol.picture.plotting import plot

        axes, box = flag("axes", axes), flag("box", box)
        scalar_bar = None if scalar_bar is None else flag("scalar_bar", scalar_bar)
        return plot(self.display, self.scenery, axes, scalar_bar, box, scale_bar)

    @property
    def alpha(self) -> np.ndarray | None:
        """How opaque the picture is, float32 (height, width), where the film has it; else None.

        The share of paths that meet something.  The image is multiplied by it.
        """
        return self.aovs.get(ALPHA)

    def denoise(self) -> Self:
        """Add the layer `denoised`, by Open Image Denoise; returns the result itself.

        The image, its variance and noise stay as they are.  AOVs albedo and normal guide it where there are
        such; ``clvol.render(..., denoise=True)`` asks for them where they help.  `merge` leaves it out.

        Raises OptionError, with the command that installs it, where the extra `denoise` is missing.
        """
        guides = {name: self.aovs[name] for name in denoising.FEATURES if name in self.aovs}
        self.denoised = denoising.denoise(self.image, self.alpha, **guides)
        by = f" with {' and '.join(guides)}" if guides else ""
        self.metadata["denoised"] = f"{denoising.denoiser_name()}{by}"
        return self

    def encode(
        self,
        suffix: str,
        exposure: float | str = 0.0,
        *,
        display: str | None = None,
        view_transform: str | None = None,
        component_format: str | None = None,
    ) -> bytes:
        """The whole file that `save` would write under a name with this suffix."""
        return encode_result(self, suffix, View(exposure, display, view_transform), component_format)

    def save(
        self,
        path: str | PathLike[str],
        exposure: float | str = 0.0,
        *,
        display: str | None = None,
        view_transform: str | None = None,
        component_format: str | None = None,
    ) -> None:
        """Write the picture, in the format that the path's suffix says (`clvol.picture.formats`).

        An EXR holds R, G, B, variance.R/G/B and every AOV as channels of one part; with alpha it is A, which
        colours are multiplied by.  Formats of floats (.hdr, .pfm, .tif with float32) hold linear radiance.
        The others hold what a display shows, through a view of the colour configuration: colours are divided
        by alpha.  They show the denoised picture where there is one; an EXR has it as
        denoised.R/G/B beside the image.  All carry the metadata that they have a place for.  An earlier file
        of that name is replaced only once the new one is complete.

        Parameters
        ----------
        exposure
            Stops by which what a display shows is brighter, or "auto" (`clvol.picture.exposure`).
        display, view_transform
            Of the colour configuration, ACES or the one that the environment variable OCIO names: their names
            or parts of them; its defaults where None.
        component_format
            "uint8", "uint16", "float16" or "float32", where the format can hold it.

        Raises
        ------
        OptionError
            Unknown suffix, display or view, impossible exposure, or what the format cannot hold; a file that
            the scene is read from; a folder that is missing or cannot be written to; or a file that failed,
            as on a full disk: the picture is then kept where the message says.
        """
        view = View(exposure, display, view_transform)
        size = self.image.shape[1], self.image.shape[0]
        check_picture(path, view, component_format, alpha=self.alpha is not None, size=size)
        check_spares(path, self.files)
        for failure in save_all(lambda s: encode_result(self, s, view, component_format), [path]).values():
            raise failure


def said_ranges(ranges: Ranges) -> dict[str, Any]:
    """Metadata "samples" where their number does not tell: a range as `clvol.render` takes it, or several."""
    if ranges == ((0, ranges[0][1]),):
        return {}
    return {"samples": ranges[0] if len(ranges) == 1 else ranges}
