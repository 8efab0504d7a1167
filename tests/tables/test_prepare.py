"""What is worked out without a device: one row per majorant cell, and only what is asked for."""

from dataclasses import replace

import numpy as np
import pytest
from probe import grid_volume, medium_of, scene_of
from trees import leaves_of

from clvol.accel import controls, costs
from clvol.accel.bounds import with_slack
from clvol.accel.kdtree import build_kdtree, pack_maximum, unpack_maximum
from clvol.errors import SceneError
from clvol.planning.needs import MajorantNeeds
from clvol.scene.medium_facts import number_matter
from clvol.tables.majorants import choose_majorants
from clvol.tables.prepare import prepare
from clvol.tables.volumes import prepare_volume
from clvol.volumes.bricks import BOUND_CELLS, BrickMap, build_bricks
from clvol.volumes.grid import DenseGrid

RNG = np.random.default_rng(21)
GREY = np.maximum(RNG.random((37, 41, 33)) - 0.3, 0) * np.linspace(0.1, 1, 33)
COLOURED = GREY[..., None] * [1.0, 0.5, 0.1] + RNG.random((37, 41, 33, 1)) * 0.05
KINDS = ["global", "grid", "kdtree"]


MEDIUM_SCALE = 500.0


def prepared(values, medium_scale=MEDIUM_SCALE, **needs):
    """The majorants of a medium in the unit cube, and its cells."""
    matter = number_matter([medium_of(values, medium_scale, 0.5)])
    volumes = [prepare_volume(volume, np.full(3, 0.5)) for volume in matter.volumes]
    found = choose_majorants(matter, volumes, MajorantNeeds(**needs))
    return found, found.tables[0]


def bounds_of(values):
    values = values if values.ndim == 4 else values[..., None]
    bricks = build_bricks(DenseGrid(values.astype(np.float32), np.zeros((2, 3))))
    return with_slack(bricks.minimum, bricks.maximum, BOUND_CELLS, bricks.means())


def rows_of(found, values):
    """Extrema and means, row by row, found from the finest lattice and the majorant's cells alone."""
    bounds = bounds_of(values)
    while bounds.cell_size < found.cell_size:
        bounds = bounds.coarser()
    assert bounds.cells == found.cells
    arrays = bounds.minimum, bounds.maximum, bounds.mean
    combine = np.min, np.max, np.mean
    if found.nodes is None and len(found.majorant) == 1:
        boxes = [(slice(None),) * 3]
    elif found.nodes is None:
        boxes = [tuple(slice(i, i + 1) for i in place) for place in np.ndindex(bounds.cells[::-1])]
    else:
        boxes = [None] * len(found.majorant)
        for index, lower, upper, _ in leaves_of(found.nodes, bounds):
            boxes[found.nodes[index, 1]] = tuple(
                slice(a, b) for a, b in zip(lower[::-1], upper[::-1], strict=True)
            )
    empty = np.zeros(arrays[0].shape[-1])
    return tuple(
        np.float32([f(a[b], axis=(0, 1, 2)) if a[b].size else empty for b in boxes])
        for f, a in zip(combine, arrays, strict=True)
    )


@pytest.mark.parametrize("scale", [1.0, 0.7, 2.0])
@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("values", [GREY, COLOURED], ids=["grey", "coloured"])
def test_every_row_holds_the_bound_and_the_controls_of_its_cell(values, kind, scale):
    chosen, found = prepared(values, majorant=kind, control="fitted", residual="mean", scale=scale)
    assert chosen.kind == kind
    low, high, mean = rows_of(found, values)
    bound = controls.scaled_majorant(high, scale)
    if kind == "kdtree":
        bound = unpack_maximum(pack_maximum(bound))
        assert len(bound) > 4
    assert found.majorant.dtype == np.float32 and (found.majorant == bound).all()
    longest = np.full(low.shape[-1], MEDIUM_SCALE * np.sqrt(3))
    subtracted = controls.control(low, high, mean, "fitted", scale, longest)
    assert np.allclose(found.control, subtracted, rtol=1e-5)
    chosen, majorant = controls.residual(low, high, mean, "mean", scale, longest)
    assert found.residual.dtype == found.control.dtype == np.float32
    assert np.allclose(found.residual, np.column_stack([chosen, majorant]), rtol=1e-4)
    assert (found.control <= found.majorant[:, None]).all()


@pytest.mark.parametrize("kind", KINDS)
def test_a_tracker_that_asks_for_nothing_gets_no_tables_and_pays_for_no_means(kind, monkeypatch):
    monkeypatch.setattr(BrickMap, "means", lambda self: pytest.fail("read the volume again for its means"))
    for needs in ({}, {"control": "min", "residual": "max"}):
        _, found = prepared(GREY, majorant=kind, **needs)
        assert (found.control is None) == (found.residual is None) == (not needs)
        assert (found.nodes is None) == (kind != "kdtree")


def test_the_minimum_is_subtracted_as_it_is_and_bounds_the_residual():
    _, found = prepared(COLOURED, majorant="grid", control="min", residual="min")
    low, high, _ = rows_of(found, COLOURED)
    assert (found.control == low).all() and (found.residual[:, :-1] == low).all()
    assert (found.residual[:, -1] >= (high - low).max(axis=1)).all()


def test_tables_are_in_the_units_of_the_volume_whatever_the_medium_scales():
    needs = {"majorant": "global", "control": "fitted", "residual": "mean"}
    _, thin = prepared(COLOURED, 0.01, **needs)
    _, thicker = prepared(COLOURED, (4.0, 0.1, 0.7), **needs)
    for name in ("majorant", "control", "residual"):
        assert (getattr(thin, name) == getattr(thicker, name)).all()


def test_controls_are_nearer_the_minimum_where_the_medium_is_thick():
    needs = {"majorant": "global", "control": "fitted", "residual": "mean"}
    _, thin = prepared(COLOURED, 1.0, **needs)
    _, thick = prepared(COLOURED, 1e4, **needs)
    assert (thick.majorant == thin.majorant).all()
    assert (thick.control < thin.control).all() and (thick.residual[:, :-1] < thin.residual[:, :-1]).all()


@pytest.mark.parametrize("control", ["none", "min", "fitted"])
def test_auto_takes_what_costs_least_for_the_technique(control):
    base = 0.6 + 0.4 * GREY
    chosen, _ = prepared(base, 400.0, control=control)
    bounds, rate = bounds_of(base), 400.0
    edges = BOUND_CELLS / np.array(base.shape[::-1])
    tree = build_kdtree(bounds, edges, rate, costs.LEAF_COST, costs.STEP_COST, control)
    expected = {
        "global": costs.global_cost(bounds, edges, rate, control),
        "grid": costs.best_grid(bounds, edges, rate, control)[1],
        "kdtree": tree.cost,
    }
    assert chosen.kind == min(expected, key=expected.get)


def test_scenes_without_grids_have_no_majorant():
    found = prepare(scene_of(medium_of(1.0)))
    assert (found.plan.chosen["majorant"], found.majorants, found.volumes) == ("none", (None,), ())
    assert found.plan.needs == MajorantNeeds()


def test_volumes_of_emission_and_temperature_are_prepared_once_each():
    albedo, emission, temperature = (grid_volume(np.full((3, 4, 5), v)) for v in (0.5, 2.0, 1000.0))
    medium = replace(
        medium_of(GREY), albedo=albedo, emission=emission, temperature=temperature, temperature_scale=1.0
    )
    found = prepare(scene_of(medium))
    volumes = [prepared.volume for prepared in found.volumes]
    assert len(volumes) == 4 and len(found.majorants) == 1
    assert all(a is b for a, b in zip(volumes, (medium.sigma_t, albedo, emission, temperature), strict=True))


def test_bounds_beyond_a_float_are_refused_with_the_factor_that_did_it():
    with pytest.raises(SceneError, match="too large for a float"):
        prepared(GREY * 1e20, 1e20)
    with pytest.raises(SceneError, match="majorant_scale=1e\\+30 is too large for a float"):
        prepared(GREY * 1e20, 1.0, scale=1e30)
