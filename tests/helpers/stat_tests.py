"""Statistical tests with a stated false-alarm rate.

Every test that calls these raises a false alarm with probability FALSE_ALARM at most, over all its
comparisons together (Šidák); seeds are fixed, so that a test that passes keeps passing.
"""

import zlib

import numpy as np
from scipy import stats

FALSE_ALARM = 1e-4


def sidak(alpha, comparisons):
    """Level of each of several independent comparisons that keeps their joint rate at alpha."""
    return -np.expm1(np.log1p(-alpha) / comparisons)


def seed_of(*what):
    """A fixed seed for what is described, so that renders whose results are pooled are independent."""
    return zlib.crc32(repr(what).encode())


def chi2_p_value(observed, expected, least=10.0):
    """p-value of counts against expected counts; bins with fewer than `least` expected are pooled.

    A count where nothing at all is expected is impossible: p = 0.
    """
    observed, expected = np.asarray(observed, float), np.asarray(expected, float)
    if observed[expected <= 0].any():
        return 0.0
    order = np.argsort(expected)
    groups = np.minimum(np.cumsum(expected[order]) // least, 1e9).astype(int)
    _, group = np.unique(groups, return_inverse=True)
    o, e = np.bincount(group, observed[order]), np.bincount(group, expected[order])
    if len(o) > 1 and e[-1] < least:
        o[-2:-1] += o[-1]
        e[-2:-1] += e[-1]
        o, e = o[:-1], e[:-1]
    if len(o) < 2:
        return 1.0
    statistic = ((o - e) ** 2 / e).sum()
    return float(stats.chi2.sf(statistic, len(o) - 1))


def z_score(mean, variance_of_mean, reference, reference_variance=0.0):
    """Deviation in standard errors; 0/0 counts as agreement."""
    difference = np.asarray(np.asarray(mean, float) - reference)
    error = np.broadcast_to(
        np.sqrt(np.asarray(variance_of_mean, float) + reference_variance), difference.shape
    )
    certain = np.where(difference == 0, 0.0, np.inf)
    return np.divide(difference, error, out=certain, where=error > 0)


def largest_z(comparisons, alpha=FALSE_ALARM):
    """Two-sided bound on |z| over several comparisons with joint false-alarm rate alpha."""
    return float(stats.norm.isf(sidak(alpha, comparisons) / 2))


def pooled(deviations, errors):
    """Mean of independent deviations along the first axis, weighted by their precision, and its error."""
    weights = 1 / np.square(np.asarray(errors, float))
    return (weights * deviations).sum(axis=0) / weights.sum(axis=0), weights.sum(axis=0) ** -0.5


class TooNoisyError(AssertionError):
    """An estimate may be right or wrong, its noise hides which: a failure with words of its own."""


def require_precision(error, most, what):
    """Raise TooNoisyError where a standard error is above what a test needs to see what it is to see."""
    error, most = np.broadcast_arrays(np.asarray(error, float), most)
    if not (error <= most).all():
        raise TooNoisyError(f"{what}: too noisy to tell right from wrong: error {error}, {most} is needed")


def require_samples(expected, weights, what, least=10.0):
    """Raise TooNoisyError where a sum of `expected`, of these weights, may hang on too few, below `least`.

    It is far from normal then, its variance unknown, and a deviation from it means nothing.
    """
    largest = float(np.abs(weights).max(initial=0.0))
    if expected < least * largest:
        sizes = f"weights of up to {largest:.3g} for a sum of {expected:.3g}"
        raise TooNoisyError(f"{what}: too noisy to tell right from wrong: {sizes}")


def tile_means(image, variance, tile):
    """Means and their variances over square tiles of a (h, w, c) image: (tiles, c) each."""
    h, w, c = image.shape
    ny, nx = h // tile, w // tile
    blocks = image[: ny * tile, : nx * tile].reshape(ny, tile, nx, tile, c).astype(float)
    variances = variance[: ny * tile, : nx * tile].reshape(ny, tile, nx, tile, c).astype(float)
    return blocks.mean((1, 3)).reshape(-1, c), variances.mean((1, 3)).reshape(-1, c) / tile**2


def image_mean(result):
    """Mean over the pixels and its variance, per channel."""
    count = result.image.shape[0] * result.image.shape[1]
    return result.image.mean((0, 1), dtype=float), result.variance.sum((0, 1), dtype=float) / count**2


def assert_same_picture(a, b, tile=8, alpha=FALSE_ALARM):
    """Image mean and every tile of two independent Results agree."""
    for what, (mean_a, variance_a), (mean_b, variance_b) in (
        ("a tile", *(tile_means(r.image, r.variance, tile) for r in (a, b))),
        ("the image mean", *(image_mean(r) for r in (a, b))),
    ):
        z = np.abs(z_score(mean_a, variance_a, mean_b, variance_b))
        assert z.max() < largest_z(z.size, alpha / 2), f"{what} deviates by {z.max():.2f} sigma"
