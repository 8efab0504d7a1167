"""An emission_density in media that overlap, are bounded by surfaces, fill all space, or are thin.

False alarms: 1e-4 for each comparison, at fixed seeds.
"""

import functools
from dataclasses import replace

import numpy as np
import pytest
from pictures import assert_matches, assert_pooled, box, hg, volume
from stat_tests import seed_of
from test_glow import COLOURED, CUBE, GREY, TECHNIQUES, along, const, gathered, layers, seen
from tiers import quick_first

from clvol import render
from clvol.device import programs
from clvol.errors import SceneError
from clvol.scene.materials import Diffuse
from clvol.scene.primitives import mesh_of
from clvol.scene.records import ConstantEmitter, Medium, Shape
from clvol.tables.prepare import prepare

DENSITY, OTHER = (0.3, 1.0, 0.1, 0.6), (1.0, 0.2, 0.8)
FIRST, SECOND = (-1.0, 0.4), (-0.5, 1.0)
"""Spans of two boxes along z, which overlap."""


def crossing(scale):
    """Two boxes that overlap, of grids, each with a glow of its own, and a third without extinction."""
    shapes = []
    parts = (FIRST, DENSITY, (2.0, 0.5)), (SECOND, OTHER, (0.2, 1.0, 3.0))
    for n, (span, density, glow) in enumerate(parts):
        medium = Medium(
            *(layers(density, *span), const(0), scale if n else GREY),
            homogeneous=False,
            emission_density=layers(glow, *span),
        )
        shapes.append(box((-1, -1, span[0]), (1, 1, span[1]), medium))
    shapes.append(box((-2, -2, 0.1), (2, 2, 0.6), Medium(const(0), const(0), emission_density=const(0.7))))
    return seen(*shapes)


def of_crossing(scale):
    """What is seen of them, by quadrature."""
    first, second = along(DENSITY, *FIRST), along(OTHER, *SECOND)
    glow = along((2.0, 0.5), *FIRST) + along((0.2, 1.0, 3.0), *SECOND) + 0.7 * along((1.0, 1.0), 0.1, 0.6)
    return gathered(GREY[0] * first + np.array(scale)[:, None] * second, glow)


@functools.cache
def crossed(technique, scale, **options):
    options = {"spp": 1 << 16, "seed": seed_of("crossing", technique, scale)} | options
    return render(crossing(scale), technique=technique, **options)


@quick_first(("technique", "scale"), [("delta", GREY), ("spectral", COLOURED)])
def test_media_that_overlap_glow_as_quadrature_has_it(technique, scale):
    assert_matches(crossed(technique, scale), of_crossing(scale), bias=0.03)


@pytest.mark.contract
@pytest.mark.parametrize("scale", [GREY, COLOURED])
@pytest.mark.parametrize("technique", TECHNIQUES)
def test_they_do_by_every_technique(technique, scale):
    assert_matches(crossed(technique, scale), of_crossing(scale), bias=0.03)


@pytest.mark.contract
@pytest.mark.parametrize("scale", [GREY, COLOURED])
def test_half_a_percent_would_show_where_media_overlap(scale):
    assert_pooled([(crossed(technique, scale), of_crossing(scale)) for technique in TECHNIQUES])


@pytest.mark.contract
def test_legs_of_walks_through_both_lose_and_double_nothing(bounds):
    bounds(WALK_STEPS=2)
    result = crossed("spectral", COLOURED, seed=8, majorant="grid")
    assert_matches(result, of_crossing(COLOURED), bias=0.03)


@pytest.mark.contract
def test_a_glow_that_goes_on_behind_the_first_collision_is_noticed(monkeypatch):
    original = programs.kernel_source
    ends = "walked.t, reach, limit, &segment"

    def source(name):
        text = original(name)
        if name == "stages/glow.h":
            assert ends in text
            return text.replace(ends, "walked.t, 1e9f, limit, &segment")
        return text

    monkeypatch.setattr(programs, "kernel_source", source)
    with pytest.raises(AssertionError, match="deviates"):
        assert_matches(crossed("delta", GREY, seed=10), of_crossing(GREY), bias=0.03)


def mesh_box(lower, upper, medium, **sides):
    """A box of triangles, which is a boundary."""
    shape = box(lower, upper, medium)
    return replace(shape, kind="mesh", mesh=mesh_of(shape), **sides)


@pytest.mark.parametrize("sigma", [0.0, 0.8])
def test_null_boundaries_hold_it_and_hold_it_twice(sigma):
    """Of one medium in two meshes that overlap; a third, empty mesh is crossed on the way."""
    medium = Medium(const(sigma), const(0), emission_density=const(1.5))
    shapes = [mesh_box((-1, -1, -1), (1, 1, 0.5), medium), mesh_box((-1, -1, -0.5), (1, 1, 1), medium)]
    empty = Medium(const(0.1), const(0))
    result = render(seen(*shapes, mesh_box((-2, -2, 0.8), (2, 2, 3), empty)), spp=1 << 14, seed=2)
    count = along((1, 1), -1, 0.5) + along((1, 1), -0.5, 1)
    more = 0.1 * along((1, 1), 0.8, 3.0)
    assert_matches(result, gathered(sigma * count + more, 1.5 * count), bias=0.02)


@pytest.mark.contract
def test_in_lanes_boundaries_hold_it_too():
    medium = Medium(layers(DENSITY), const(0), GREY, homogeneous=False, emission_density=const(1.5))
    options = {"technique": "delta", "lanes": "8", "majorant": "grid"}
    result = render(seen(mesh_box(*CUBE, medium)), spp=1 << 14, seed=3, **options)
    assert result.metadata["lanes"] == "8"
    assert_matches(result, gathered(GREY[0] * along(DENSITY), 1.5), bias=0.02)


def test_a_surface_ends_it():
    medium = Medium(const(0), const(0), emission_density=const(2))
    wall = Shape("rectangle", np.diag([9.0, 9.0, 1.0, 1.0]), bsdf=Diffuse((0.0,)))
    assert render(seen(box(*CUBE, medium), wall), spp=4, seed=1).image == pytest.approx(2.0, rel=1e-5)


def everywhere(medium, *shapes):
    scene = seen(*shapes, max_depth=1_000_000)
    return replace(scene, sensor=replace(scene.sensor, medium=medium))


def test_a_medium_without_an_end_has_the_radiance_of_its_inside():
    """It is q / sigma_a, by equilibrium, whatever scatters."""
    medium = Medium(const(0.5, 1, 2), const(0.4), phase=hg(0.5), emission_density=const(1, 2, 3))
    result = render(everywhere(medium), spp=1 << 15, seed=6)
    assert_matches(result, np.array([1, 2, 3]) / (0.6 * np.array([0.5, 1, 2])), bias=0.02)


@pytest.mark.parametrize(
    ("sigma_t", "albedo"), [(const(0), const(0)), (const(1, 0, 1), const(0)), (const(1), const(0.5, 1, 0.5))]
)
def test_one_that_would_be_infinitely_bright_is_refused(sigma_t, albedo):
    medium = Medium(sigma_t, albedo, emission_density=const(1))
    with pytest.raises(SceneError, match="has no end and emits what it does not absorb"):
        prepare(everywhere(medium))
    if max(sigma_t.value) > 0:
        prepare(everywhere(replace(medium, emission_density=const(1, 0, 2))))


def test_a_thin_sheet_far_away_glows_through_its_thickness():
    sheet = box((-50, -50, 0.0), (50, 50, 0.01), Medium(const(30), const(0), emission_density=const(100)))
    result = render(seen(sheet), spp=1 << 14, seed=7)
    assert_matches(result, 100 * -np.expm1(-0.3) / 30, bias=0.01)


def test_paths_that_may_not_take_a_step_see_none_and_others_do():
    medium = Medium(const(0), const(0), emission_density=const(1))
    for depth, value in ((0, 0.0), (1, 2.0)):
        assert render(seen(box(*CUBE, medium), max_depth=depth), spp=4).image == pytest.approx(value)


@pytest.mark.contract
def test_nothing_is_expected_behind_it():
    """It is gathered up to the collision, which walks that expect light do not end at."""
    field = volume(np.ones((3, 3, 3)), *CUBE)
    medium = Medium(field, const(0.5), homogeneous=False, emission_density=const(1))
    scene = seen(box(*CUBE, medium), emitters=[ConstantEmitter((0.0,))], max_depth=1)
    result = render(scene, spp=1 << 14, seed=1, technique="delta", background="expected")
    assert result.metadata["background"] == "none"
    assert_matches(result, -np.expm1(-2.0), bias=0.02)


def test_it_leaves_no_trace_in_alpha():
    medium = Medium(const(0), const(0), emission_density=const(1))
    scene = seen(box(*CUBE, medium))
    result = render(replace(scene, film=replace(scene.film, pixel_format="rgba")), spp=4)
    assert result.alpha == pytest.approx(0.0)
    assert result.image == pytest.approx(2.0)
