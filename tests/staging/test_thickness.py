"""Coarse means keep what rays integrate, and thickness is that of closed forms."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np
import pytest
from places import SCENES

from clvol.staging.coarse import CELLS, coarse
from clvol.staging.framing import Axes, frame
from clvol.staging.source import Source
from clvol.staging.thickness import Rays, glow, thickness
from clvol.volumes import dense_from_array, read_vdb

if TYPE_CHECKING:
    from clvol.volumes.grid import SparseGrid

BOX = np.array([[0.0, 0, 0], [1, 1, 1]])
CORNERS = np.array([[x, y, z] for x in (0.0, 1) for y in (0.0, 1) for z in (0.0, 1)])


@pytest.mark.parametrize("shape", [(20, 30, 40), (5, 250, 97), (1, 1, 400)])
def test_means_of_dense_grids_keep_their_sum(shape: tuple[int, ...]) -> None:
    values = np.random.default_rng(1).random(shape, np.float32)
    means = coarse(dense_from_array(values))
    assert max(means.values.shape) <= CELLS
    edges = [
        np.minimum(means.block, n - means.block * np.arange(m))
        for n, m in zip(shape, means.values.shape, strict=True)
    ]
    sizes = edges[0][:, None, None] * edges[1][:, None] * edges[2]
    assert (means.values * sizes).sum() == pytest.approx(values.sum(), rel=1e-5)


def dense(grid: SparseGrid) -> np.ndarray:
    """All samples round the active box, from a multiple of 8 on."""
    origin = grid.active_box[0] // 8 * 8
    shape = (grid.active_box[1] + 8) // 8 * 8 - origin
    values = np.full(shape[::-1], np.mean(grid.background), np.float32)
    for start, size, value in zip(grid.tile_origins - origin, grid.tile_sizes, grid.tile_values, strict=True):
        x, y, z = np.maximum(start, 0)
        values[z : start[2] + size, y : start[1] + size, x : start[0] + size] = np.mean(value)
    for start, leaf in zip(grid.leaf_origins - origin, grid.leaf_values, strict=True):
        x, y, z = start
        values[z : z + 8, y : y + 8, x : x + 8] = leaf.reshape(8, 8, 8)
    return values


def assert_means(grid: SparseGrid) -> None:
    means = coarse(grid)
    expected = coarse(dense_from_array(dense(grid)))
    assert means.block == expected.block
    z, y, x = means.values.shape
    np.testing.assert_allclose(means.values, expected.values[:z, :y, :x], rtol=1e-4, atol=1e-6)


def test_means_of_sparse_grids_are_those_of_dense_ones() -> None:
    assert_means(read_vdb(SCENES / "fire.vdb"))


@pytest.mark.parametrize("background", [0.0, 0.25])
def test_tiles_count_with_all_their_samples(background: float) -> None:
    grid = read_vdb(SCENES / "fire.vdb")
    sizes, origins = np.array([8, 128], np.int32), np.array([[8, 8, 16], [128, 0, 0]], np.int32)
    values = np.array([2.0, 0.5], np.float32).reshape(-1, *grid.leaf_values.shape[4:])
    assert_means(
        replace(
            grid,
            leaf_origins=grid.leaf_origins[1:],
            leaf_values=grid.leaf_values[1:],
            leaf_active=grid.leaf_active[1:],
            tile_origins=origins,
            tile_sizes=sizes,
            tile_values=values,
            tile_active=np.ones(2, bool),
            background=np.full_like(grid.background, background),
            active_box=np.array([[5, 3, 7], [255, 127, 127]], np.int32),
        )
    )


def rays_from(azimuth: float, elevation: float) -> Rays:
    view = frame(CORNERS, Axes.of("y"), azimuth, elevation, (64, 64), 50.0)
    close = frame(CORNERS, Axes.of("y"), azimuth, elevation, (64, 64))
    assert view.distance > close.distance
    return Rays.through(BOX, close, (64, 64))


def test_thickness_of_a_cube_is_its_length_times_its_density() -> None:
    field = Source.of(np.full((12, 12, 12), 3.0)).open("")
    rays = rays_from(0, 0)
    lengths = rays.lengths * rays.places.shape[1]
    found = thickness(rays.sample(field.volume, field.means), rays)
    # Seen from the front nearly every ray goes through both faces, a little longer aslant.
    assert found == pytest.approx(3 * np.percentile(lengths[lengths > 0.9], 90), rel=0.03)
    assert 3.0 < found < 3.3


def test_what_lies_deep_in_a_medium_glows_less() -> None:
    rays = rays_from(0, 0)
    ones = np.ones(rays.places.shape[:2])
    assert glow(ones, 0 * ones, rays) == pytest.approx(thickness(ones, rays))
    # ∫ exp(-t s) dt over a length of about 1, for s = 20: nearly 1 / 20.
    assert glow(ones, 20 * ones, rays) == pytest.approx(1 / 20, rel=0.02)


def test_nothing_is_as_thick_as_nothing() -> None:
    field = Source.of(np.zeros((4, 4, 4))).open("")
    rays = rays_from(10, 20)
    assert thickness(rays.sample(field.volume, field.means), rays) == 0
