"""Scenes whose pictures are known, the float64 geometry their answers need, and how a picture is held to one.

Many tests share few kernel configurations: a light of value 0, a medium of extinction 0 and a depth
limit out of reach leave the configuration as it is.
"""

import numpy as np
from probe import grid_volume
from stat_tests import FALSE_ALARM, TooNoisyError, largest_z, pooled, z_score

import clvol
from clvol.scene.records import (
    ConstVolume,
    Film,
    Integrator,
    Medium,
    Perspective,
    Phase,
    ReconstructionFilter,
    Scene,
    Shape,
)

UNREACHED_DEPTH = 1_000_000
ISOTROPIC = Phase()

# -- scenes ----------------------------------------------------------------------------------------


def hg(g):
    return Phase("hg", g)


def spectrum(value):
    return tuple(float(v) for v in np.atleast_1d(value))


def homogeneous(sigma_t, albedo=0.0, phase=ISOTROPIC):
    """A homogeneous medium; numbers or rgb triples."""
    albedo = albedo if hasattr(albedo, "grid") else ConstVolume(spectrum(albedo))
    return Medium(ConstVolume(spectrum(sigma_t)), albedo, phase=phase)


def gridded(volume, albedo=0.0, phase=ISOTROPIC, scale=1.0):
    """A heterogeneous medium of a grid volume."""
    albedo = albedo if hasattr(albedo, "grid") else ConstVolume(spectrum(albedo))
    return Medium(volume, albedo, scale, phase, homogeneous=False)


def volume(values, lower, upper, filter_type="trilinear"):
    """Array [z, y, x(, channel)] as a gridvolume that fills the box lower..upper."""
    found = grid_volume(values, filter_type)
    place = np.eye(4)
    place[:3, :3], place[:3, 3] = np.diag(np.subtract(upper, lower)), lower
    return type(found)(found.grid, place @ found.index_to_world, found.lower, found.upper, filter_type)


def box(lower, upper, medium=None):
    """A cube shape from corner to corner."""
    lower, upper = np.asarray(lower, float), np.asarray(upper, float)
    to_world = np.diag([*(upper - lower) / 2, 1.0])
    to_world[:3, 3] = (lower + upper) / 2
    return Shape("cube", to_world, medium)


def ball(centre, radius, medium=None):
    """A sphere shape."""
    to_world = np.diag([radius, radius, radius, 1.0])
    to_world[:3, 3] = centre
    return Shape("sphere", to_world, medium)


def picture(shapes, emitters, eye, target, fov=30.0, size=(4, 4), up=(0, 1, 0), **integrator):
    """A scene with a box filter; keywords go to the Integrator."""
    sensor = Perspective(clvol.look_at(eye, target, up), fov)
    film = Film(*size, ReconstructionFilter("box", 0.5))
    return Scene(sensor, film, Integrator(**integrator), tuple(shapes), tuple(emitters), spp=16)


# -- answers ---------------------------------------------------------------------------------------


def unit(v):
    return np.asarray(v, float) / np.linalg.norm(v)


def gauss(lower, upper, nodes):
    """Gauss-Legendre nodes and weights on [lower, upper]; the bounds may be arrays (nodes come last)."""
    x, w = np.polynomial.legendre.leggauss(nodes)
    half = (np.asarray(upper) - np.asarray(lower))[..., None] / 2
    return np.asarray(lower)[..., None] + half * (x + 1), half * w


def camera_rays(scene, nodes=3):
    """Eye (3,), directions (h, w, nodes², 3) and weights (nodes²,) that integrate over each pixel's area."""
    width, height = scene.film.width, scene.film.height
    x, w = gauss(0.0, 1.0, nodes)
    v, u = (a.reshape(-1) for a in np.meshgrid(x, x, indexing="ij"))
    column, row = np.arange(width)[None, :, None] + u, np.arange(height)[:, None, None] + v
    tangent = np.tan(np.radians(scene.sensor.fov) / 2)
    column, row = np.broadcast_arrays(column, row)
    left, top = tangent * (1 - 2 * column / width), tangent * (height - 2 * row) / width
    local = np.stack([left, top, np.ones_like(left)], axis=-1)
    directions = local @ scene.sensor.to_world[:3, :3].T
    directions /= np.linalg.norm(directions, axis=-1, keepdims=True)
    return scene.sensor.to_world[:3, 3], directions, np.outer(w, w).reshape(-1)


def ball_interval(o, d, centre, radius):
    """Ray parameters (enter, leave), from 0 on, of a sphere that every ray meets."""
    o = np.asarray(o) - centre
    middle = -(o * d).sum(-1)
    half = np.sqrt(middle**2 + radius**2 - (o * o).sum(-1))
    return np.maximum(middle - half, 0), middle + half


def box_interval(o, d, lower, upper):
    """Ray parameters (enter, leave), from 0 on, of a box; a ray that misses gets an empty interval (0, 0)."""
    with np.errstate(divide="ignore"):
        a, b = (np.asarray(lower) - o) / d, (np.asarray(upper) - o) / d
    enter, leave = np.maximum(np.minimum(a, b).max(-1), 0), np.maximum(a, b).min(-1)
    return np.where(leave > enter, enter, 0.0), np.where(leave > enter, leave, 0.0)


def hg_value(g, cosine):
    """The Henyey-Greenstein phase function, per steradian; cosine 1 is straight on."""
    return (1 - g * g) / (4 * np.pi * (1 + g * g - 2 * g * cosine) ** 1.5)


# -- comparisons -----------------------------------------------------------------------------------


def mean_and_error(result):
    """Image mean and its standard error, per channel."""
    pixels = result.image.shape[0] * result.image.shape[1]
    error = np.sqrt(result.variance.astype(float).sum((0, 1))) / pixels
    return result.image.astype(float).mean((0, 1)), error


def deviations(result, expected):
    """|z| of every pixel, and of the image mean, against the expected picture (anything that broadcasts)."""
    expected = np.broadcast_to(expected, result.image.shape).astype(float)
    pixels = np.abs(z_score(result.image, result.variance, expected))
    mean, error = mean_and_error(result)
    return pixels, np.abs(z_score(mean, error**2, expected.mean((0, 1))))


def assert_mean(result, expected, bias=0.005):
    """The image mean of one channel is within half of `bias` of what is expected, beyond doubt."""
    mean, error = (float(a[0]) for a in mean_and_error(result))
    doubt = largest_z(1) * error
    assert doubt < bias / 2 * expected, "too noisy"
    assert abs(mean - expected) < bias / 2 * expected + doubt, f"{mean} for {expected}"


def assert_matches(result, expected, bias=0.005, alpha=FALSE_ALARM):
    """Every pixel and the image mean agree with the expected picture, and nobody lost energy unseen.

    False alarms: alpha over all pixels and channels together (Šidák).  The comparison proves its own
    power: with an expectation that is off by the fraction `bias`, up or down, it would have failed.
    """
    for name in ("non_finite", "majorant_violations", "walks_exhausted"):
        assert result.stats[name] == 0, f"{name}: {result.stats[name]}"
    pixels, means = deviations(result, expected)
    assert pixels.max() < largest_z(pixels.size, alpha / 2), f"a pixel deviates by {pixels.max():.2f} sigma"
    bound = largest_z(means.size, alpha / 2)
    mean, error = mean_and_error(result)
    assert means.max() < bound, f"the mean {mean} deviates by {means} sigma"
    for factor in (1 - bias, 1 + bias):
        off = factor * np.broadcast_to(expected, result.image.shape).astype(float).mean((0, 1))
        seen = np.abs(mean - off) > bound * error
        if not seen.all():
            raise TooNoisyError(f"too noisy to see a bias of {bias}: {error / mean}")


def assert_pooled(pictures, bias=0.005, alpha=FALSE_ALARM):
    """Means of independent pictures, each with what is expected of it, agree with that together.

    `pictures` are (Result, expected) pairs.  In each channel relative deviations are weighted by their
    precision, which shows a bias that all have in common and none shows by itself.  False alarms and power
    are those of `assert_matches`: all expectations off by the fraction `bias`, up or down, would have failed.
    """
    deviations, errors = [], []
    for result, expected in pictures:
        mean, error = mean_and_error(result)
        expected = np.broadcast_to(expected, result.image.shape).astype(float).mean((0, 1))
        deviations.append(mean / expected - 1)
        errors.append(error / expected)
    deviation, error = pooled(deviations, errors)
    bound = largest_z(deviation.size, alpha) * error
    assert (np.abs(deviation) < bound).all(), f"together {deviation} off, with an error of {error}"
    if not (bias - np.abs(deviation) > bound).all():
        raise TooNoisyError(f"too noisy to see a bias of {bias}: {error}")
