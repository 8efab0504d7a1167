"""Wide slabs seen from straight above, whose reflection and transmission are published."""

from dataclasses import replace

import numpy as np
from pictures import box, gridded, hg, homogeneous, mean_and_error, picture, volume
from stat_tests import largest_z, require_precision, z_score

from clvol import render
from clvol.scene.records import ConstVolume, EnvmapEmitter

SLABS = [  # albedo, g, optical thickness, R, T: van de Hulst 1980 (the last R by adding-doubling)
    (0.9, 0.75, 2.0, 0.09739, 0.66096),
    (1.0, 0.0, 1.0, 0.34133, 0.65867),
    (1.0, 0.5, 1.0, 0.17611, 0.82389),
    (0.9, 0.5, 1.0, 0.12979, 0.73909),
]
HALF_SPACES = {0.5: 0.115226, 0.8: 0.285255, 0.9: 0.414947, 0.99: 0.752721}
"""Albedo to what an isotropic half-space reflects of normal light: Chandrasekhar 1960."""


def lit_slab(medium, lower, upper, above, below, **integrator):
    """Looks down at a wide box of a medium, lit from above and below."""
    radiance = np.zeros((512, 8, 3), np.float32)
    radiance[:256], radiance[256:] = above, below
    eye, sky = (0.1, upper[1] + 1, 0.2), EnvmapEmitter(radiance, np.eye(4))
    return picture(
        [box(lower, upper, medium)], [sky], eye, (0.1, 0, 0.2), 0.01, (2, 2), up=(0, 0, 1), **integrator
    )


def homogeneous_slab(albedo, g, thickness, edge=1e4, **integrator):
    """A slab of sigma_t 1 under red light from above and green light from below."""
    lower, upper = (-edge / 2, 0, -edge / 2), (edge / 2, thickness, edge / 2)
    medium = homogeneous(1.0, albedo, hg(g))
    return lit_slab(medium, lower, upper, (1, 0, 0), (0, 1, 0), **integrator)


def graded_slab(albedo, g, thickness, above, below, scale=(1.0,), edge=1e4, **integrator):
    """A slab of linearly growing density: only its optical thickness matters."""
    lower, upper = (-edge / 2, 0, -edge / 2), (edge / 2, thickness, edge / 2)
    profile = np.linspace(0.1, 1.9, 10)
    values = np.broadcast_to(profile[None, :, None], (3, 10, 3))
    medium = gridded(volume(values, lower, upper), 0.0, hg(g), scale=scale)
    medium = replace(medium, albedo=ConstVolume(tuple(np.atleast_1d(albedo))))
    return lit_slab(medium, lower, upper, above, below, **integrator)


def assert_a_white_slab_loses_nothing(technique, transmittance):
    """R + T = 1 at albedo 1, where no slab is thick enough to be a half-space."""
    scene = graded_slab(1.0, 0.0, 8.0, (1, 0, 1), (0, 1, 1))
    result = render(scene, spp=1 << 14, seed=11, technique=technique, transmittance=transmittance)
    (r, t, both), error = mean_and_error(result)
    require_precision(error[:2], 0.003, "R and T")
    assert abs(z_score(r + t, error[0] ** 2 + error[1] ** 2, 1.0)) < largest_z(2)
    assert abs(z_score(both, error[2] ** 2, 1.0)) < largest_z(2) or abs(both - 1) < 1e-4
