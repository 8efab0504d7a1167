"""Thin lenses, crop windows and filters with negative parts, against float64 geometry and quadrature.

Numbers called Mitsuba's were printed by version 3.9.1 (scalar_rgb).  χ² and z-tests have a false-alarm rate
of 1e-4 each.
"""

from dataclasses import replace

import numpy as np
import pytest
from camera_paths import film_position, start_paths
from probe import medium_of, scene_of
from sampling import uniform_p_value
from stat_tests import FALSE_ALARM, largest_z

import clvol
from clvol.planning.plan import Plan
from clvol.scene.describe import describe_scene
from clvol.scene.records import Film, Perspective, ReconstructionFilter
from clvol.tables.camera import camera_rays
from clvol.tables.pixel_filter import FILTER_BINS, filter_cdf

VIEW = clvol.look_at((1, 2, 3), (0, 0.5, -1), (0, 1, 0))
BOX = ReconstructionFilter("box", 0.5)
MITCHELL = ReconstructionFilter("mitchell", 2.0)
LANCZOS = ReconstructionFilter("lanczos", 3.0)


def scene_with(sensor, film):
    return replace(scene_of(medium_of(1.0, albedo=0.5)), sensor=sensor, film=film)


# -- thin lenses -----------------------------------------------------------------------------------

LENS = Perspective(VIEW, 50.0, near_clip=1.0, aperture_radius=0.2, focus_distance=5.0)
MITSUBA_LENS_RAYS = {  # sensor.sample_ray: film position and lens position (u, v), origin, direction
    (0, 0, 0, 0): (
        (0.2939169407, 1.9502577782, 2.0983035564),
        (-0.6159482598, -0.0433923453, -0.7865907550),
    ),
    (0, 0, 1, 0): (
        (0.1386941522, 1.9502577782, 2.1371092796),
        (-0.5901691318, -0.0439941511, -0.8060799837),
    ),
    (0, 0, 0, 1): (
        (0.2806500793, 2.1006166935, 2.0452356339),
        (-0.6185559034, -0.0768672004, -0.7819717526),
    ),
    (0.75, 0.25, 1, 0): (
        (0.8301598430, 1.8041880131, 2.0190188885),
        (0.0230755750, -0.1868035793, -0.9821262956),
    ),
    (0.75, 0.25, 0, 1): (
        (0.9721157551, 1.9545470476, 1.9271454811),
        (-0.0109365257, -0.2258822769, -0.9740931988),
    ),
}


@pytest.mark.parametrize("sample", MITSUBA_LENS_RAYS)
def test_lens_rays_are_mitsubas(sample):
    """They start on the near plane, as deep at the lens's rim as at its middle."""
    film = Film(6, 4, BOX)
    rays = camera_rays(LENS, film, np.zeros(3), radius=1e3)
    x, y, (u, v) = sample[0] * film.width, sample[1] * film.height, sample[2:]
    lens = u * rays.lens_x + v * rays.lens_y
    origin = rays.position + x * rays.dx + y * rays.dy + rays.lens_start * lens
    direction = rays.base + x * rays.base_dx + y * rays.base_dy - rays.lens_bend * lens
    expected = MITSUBA_LENS_RAYS[sample]
    np.testing.assert_allclose(origin, expected[0], atol=2e-6)
    np.testing.assert_allclose(direction / np.linalg.norm(direction), expected[1], atol=2e-6)


def test_a_lens_that_starts_at_the_scene_sends_the_same_rays():
    """Far from the camera, rays start before what they can meet."""
    film, centre = Film(6, 4, BOX), np.array([-10.0, -13.0, -40.0])
    near = camera_rays(LENS, film, np.zeros(3), radius=1e3)
    far = camera_rays(LENS, film, centre, radius=2.0)
    for x, y, u, v in np.random.default_rng(1).uniform(-1, 4, (5, 4)):
        ends = []
        for rays, middle in ((near, 0), (far, centre)):
            lens = u * rays.lens_x + v * rays.lens_y
            origin = rays.position + x * rays.dx + y * rays.dy + rays.lens_start * lens + middle
            direction = rays.base + x * rays.base_dx + y * rays.base_dy - rays.lens_bend * lens
            ends.append((origin, direction))
        (o, d), (further, same) = ends
        np.testing.assert_allclose(d, same, rtol=1e-12)
        assert (further - o) @ d > 20
        np.testing.assert_allclose(np.cross(further - o, d), 0, atol=1e-9)


def test_rays_fill_the_lens_evenly_and_meet_at_the_focus_distance(device):
    """Film positions are drawn from their pixel at the focus distance and nowhere else."""
    film = Film(6, 4, BOX)
    scene = scene_with(LENS, film)
    started = start_paths(device, scene, 2000)
    focused = film_position(scene, started, depth=5.0)
    pixel = np.floor(focused).astype(int)
    assert (pixel[:, 1] * film.width + pixel[:, 0] == started.pixel).mean() > 0.998
    local = (started.origin - VIEW[:3, 3]) @ VIEW[:3, :3]
    towards = started.direction @ VIEW[:3, :3]
    lens = (local - towards * (local[:, 2] / towards[:, 2])[:, None])[:, :2] / 0.2
    radius = np.hypot(*lens.T)
    assert radius.max() < 1 + 1e-5
    ring = np.minimum(8 * radius**2, 7.999).astype(int)
    sector = np.floor(8 * (np.arctan2(lens[:, 1], lens[:, 0]) / (2 * np.pi) % 1)).astype(int) % 8
    for cells, count in ((8 * ring + sector, 64), (64 * (started.pixel % 6) + 8 * ring + sector, 384)):
        assert uniform_p_value(cells, count) > FALSE_ALARM
    blur = np.hypot(*(film_position(scene, started, depth=2.5) - focused).T).max()
    assert blur == pytest.approx(0.2 * (1 - 2.5 / 5) * 3 / (2.5 * np.tan(np.radians(25))), rel=1e-2)


def test_a_pinhole_needs_no_lens():
    assert Plan.of(scene_with(LENS, Film(6, 4, BOX))).features.lens
    pinhole = replace(LENS, aperture_radius=0.0)
    assert not Plan.of(scene_with(pinhole, Film(6, 4, BOX))).features.lens


# -- crop windows ----------------------------------------------------------------------------------


def test_a_crop_is_cut_out_of_the_whole_film(device):
    """Paths of its pixels start through the same places as the whole film's pixels at the crop's offset."""
    sensor = Perspective(VIEW, 50.0, principal_point_offset=(0.1, -0.2))
    whole, part = Film(9, 7, BOX), Film(9, 7, BOX, crop=(2, 3, 4, 2))
    a, b = (camera_rays(sensor, film, np.zeros(3), 1.0) for film in (whole, part))
    for x, y in ((0, 0), (4, 2), (1.5, 0.25)):
        for origin, dx, dy in (("position", "dx", "dy"), ("base", "base_dx", "base_dy")):
            of_whole = getattr(a, origin) + (x + 2) * getattr(a, dx) + (y + 3) * getattr(a, dy)
            of_part = getattr(b, origin) + x * getattr(b, dx) + y * getattr(b, dy)
            np.testing.assert_allclose(of_part, of_whole, atol=1e-12)
    scene = scene_with(replace(sensor, principal_point_offset=(0.0, 0.0)), part)
    started = start_paths(device, scene, 200)
    assert started.pixel.max() == 7
    pixel = np.floor(film_position(scene, started) + 1e-5).astype(int) - [2, 3]
    assert (pixel[:, 1] * 4 + pixel[:, 0] == started.pixel).mean() > 0.999


def test_a_cropped_picture_has_the_crops_size():
    sky = scene_with(LENS, Film(9, 7, LANCZOS, crop=(2, 3, 5, 2)))
    sky = replace(sky, shapes=(), sensor=replace(LENS, aperture_radius=0.0))
    result = clvol.render(sky, spp=2000, seed=2)
    assert result.image.shape == (2, 5, 3)
    # and a filter with negative parts shows a sky of 1 as 1, at the window's border too
    error = np.sqrt(result.variance)
    assert (error[..., 0] > 0).all()
    z = (result.image.astype(float) - 1)[..., 0] / error[..., 0]
    assert np.abs(z).max() < largest_z(z.size)
    assert error.max() < 0.03


# -- filters ---------------------------------------------------------------------------------------

AT = (0.3, 0.5, 1.0, 1.2, 1.5, 1.9)
MITSUBA_FILTERS = [  # rfilter.eval at AT, relative to that at 0
    (
        MITCHELL,
        np.array([0.7403889895, 0.5347222686, 0.0555556230, -0.0142222550, -0.0347219668, -0.00294424640])
        / 0.888888955,
    ),
    (replace(MITCHELL, b=0.0, c=0.5), [0.8155000210, 0.5625, 0, -0.0640001297, -0.0625, -0.0045002303]),
    (LANCZOS, [0.8443431258, 0.6079270840, 0, -0.1180005819, -0.1350949109, -0.0237698667]),
]


@pytest.mark.parametrize(("rfilter", "expected"), MITSUBA_FILTERS, ids=["mitchell", "catmullrom", "lanczos"])
def test_signed_filters_are_mitsubas(rfilter, expected):
    magnitude, net = filter_cdf(rfilter).reshape(2, FILTER_BINS + 1).astype(float)
    assert (magnitude[0], magnitude[-1], net[0]) == (0, 1, 0)
    edges = np.linspace(-rfilter.radius, rfilter.radius, FILTER_BINS + 1)
    found = np.interp(np.array([*AT, *(-np.array(AT))]), (edges[1:] + edges[:-1]) / 2, np.diff(net))
    middle = np.interp(0, (edges[1:] + edges[:-1]) / 2, np.diff(net))
    np.testing.assert_allclose(found / middle, [*expected, *expected], atol=3e-4)
    np.testing.assert_allclose(np.abs(np.diff(net)), np.diff(magnitude), atol=2e-7)
    assert net[-1] < 0.95


def mitchell(x):
    """Mitchell and Netravali's filter for B = C = 1/3, from their paper's equation 8."""
    x, b, c = np.abs(x), 1 / 3, 1 / 3
    inner = (12 - 9 * b - 6 * c) * x**3 + (-18 + 12 * b + 6 * c) * x**2 + 6 - 2 * b
    outer = (-b - 6 * c) * x**3 + (6 * b + 30 * c) * x**2 + (-12 * b - 48 * c) * x + 8 * b + 24 * c
    return np.where(x < 1, inner, np.where(x < 2, outer, 0)) / 6


def lanczos(x):
    return np.where(np.abs(x) < 3, np.sinc(x) * np.sinc(x / 3), 0)


def share_below(f, edge, pixels, border):
    """What each of a row's pixels sees of a picture that is 1 left of `edge` and 0 right of it."""
    x = np.linspace(-4, pixels + 4, 200_001)[:-1] + (pixels + 8) / 400_000
    inside = (x > 0) & (x < pixels) if border else np.ones_like(x, bool)
    weights = np.array([f(x - column - 0.5) * inside for column in range(pixels)])
    return (weights * (x < edge)).sum(axis=1) / weights.sum(axis=1)


@pytest.mark.parametrize(
    ("rfilter", "f", "crop", "sample_border"),
    [
        (MITCHELL, mitchell, None, False),
        (MITCHELL, mitchell, (3, 1, 6, 4), False),
        (LANCZOS, lanczos, None, True),
    ],
    ids=["mitchell", "cropped", "lanczos with its border"],
)
def test_weighted_samples_integrate_an_edge_as_quadrature_does(device, rfilter, f, crop, sample_border):
    """Also at the border, where the filter is cut and renormalised; and the weights' mean is 1."""
    scene = scene_with(
        Perspective(VIEW, 50.0),
        Film(6 if crop is None else 11, 4 if crop is None else 6, rfilter, sample_border, crop),
    )
    started = start_paths(device, scene, 20_000)
    column, row = film_position(scene, started).T - np.array(scene.film.window[:2])[:, None]
    assert ((started.weight < 0).mean() > 0.03) and (np.abs(started.weight) > 1).all()
    for place, count, axis in ((column, 6, started.pixel % 6), (row, 4, started.pixel // 6)):
        if not sample_border:
            assert place.min() > -1e-4 and place.max() < count + 1e-4
        for edge in (1.0, 2.3, 10.0):
            expected = share_below(f, edge, count, not sample_border)
            values = started.weight * (place < edge)
            for pixel in range(count):
                found = values[axis == pixel]
                error = found.std() / np.sqrt(found.size)
                assert abs(found.mean() - expected[pixel]) < largest_z(30) * error + 3e-4, (edge, pixel)
                assert error < 0.01


def test_positive_filters_carry_no_weight():
    gaussian = scene_with(Perspective(VIEW, 50.0), Film(6, 4))
    assert not Plan.of(gaussian).features.signed_filter
    assert filter_cdf(ReconstructionFilter()).shape == (FILTER_BINS + 1,)
    assert Plan.of(replace(gaussian, film=Film(6, 4, MITCHELL))).features.signed_filter


def test_descriptions_tell_lens_crop_and_filter():
    lines = describe_scene(scene_with(LENS, Film(9, 7, MITCHELL, crop=(2, 3, 4, 2))))
    assert lines[0].endswith(
        "thin lens at (1, 2, 3), field of view 50 degrees, aperture radius 0.2, in focus at 5"
    )
    assert "9 x 7 pixels, of them 4 x 2 from (2, 3), mitchell (B 0.3333333, C 0.3333333) filter" in lines[1]
