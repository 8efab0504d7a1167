"""Which grid of a file is what."""

from __future__ import annotations

import pytest

from clvol.errors import VolumeError
from clvol.staging.finding import Found, find_grids
from clvol.volumes import Listed


def found(*names: str, **asked: str) -> Found:
    return find_grids([Listed(name) for name in names], asked, "smoke.vdb")


def test_grids_are_found_by_their_usual_names() -> None:
    assert found("velocity", "density", "flame", "temperature", "Cd") == Found(
        "density", "temperature", "flame", "Cd"
    )
    assert found("Density", "heat", "fuel", "flames") == Found("Density", "heat", "flames")
    assert found("/sim/density", "/sim/temp") == Found("/sim/density", "/sim/temp")
    assert found("density", "v") == Found("density")


@pytest.mark.parametrize("names", [("",), ("scan",), ("scan", "vel"), ("scan", "heat")])
def test_the_only_grid_left_is_the_density(names: tuple[str, ...]) -> None:
    assert found(*names).density == names[0]


def test_vectors_are_no_density() -> None:
    listed = [Listed("scan"), Listed("speed", channels=3), Listed("flow", kind="staggered")]
    assert find_grids(listed, {}, "scan.vdb").density == "scan"


def test_what_burns_is_the_density_where_there_is_none() -> None:
    assert found("temperature", "flame") == Found("flame", "temperature", "flame")


def test_a_user_says_otherwise() -> None:
    mine = found("density", "density[1]", "temperature", "flame", density="density[1]", temperature="none")
    assert mine == Found("density[1]", None, "flame")


def test_what_cannot_be_told_is_asked() -> None:
    with pytest.raises(VolumeError, match=r"which of its grids is the density.*'a', 'b'"):
        found("a", "b")
    with pytest.raises(VolumeError, match="has no grid 'c'; its grids are 'a', 'b'"):
        found("a", "b", density="c")
    listed = [Listed("points", "its values are points"), Listed("density", "a frustum")]
    with pytest.raises(VolumeError, match=r"no grid to render.*'points': its values are points"):
        find_grids(listed, {}, "smoke.vdb")
    with pytest.raises(VolumeError, match="'density' cannot be read: a frustum"):
        find_grids(listed, {"density": "density"}, "smoke.vdb")
