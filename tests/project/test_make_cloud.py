"""The committed cloud is what its script says, and what the benchmark relies on."""

from __future__ import annotations

import importlib
from typing import TYPE_CHECKING

import numpy as np
import pytest
from places import SCENES, TOOLS

if TYPE_CHECKING:
    from pathlib import Path

CLOUD = SCENES / "cloud.vol"


@pytest.fixture(scope="module")
def cloud() -> np.ndarray:
    """The committed densities, (128, 128, 128) in z, y, x order."""
    data = CLOUD.read_bytes()
    assert data[:4] == b"VOL\x03"
    assert np.frombuffer(data, "<i4", 5, 4).tolist() == [1, 128, 128, 128, 1]
    assert np.frombuffer(data, "<f4", 6, 24).tolist() == [0, 0, 0, 1, 1, 1]
    return np.frombuffer(data, "<f4", offset=48).reshape(128, 128, 128)


@pytest.mark.contract
def test_script_reproduces_the_committed_cloud_bit_for_bit(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.syspath_prepend(TOOLS)
    importlib.import_module("make_cloud").main.callback(tmp_path / "cloud.vol")
    assert (tmp_path / "cloud.vol").read_bytes() == CLOUD.read_bytes()


def test_outermost_voxels_are_empty_so_that_border_rules_do_not_matter(cloud: np.ndarray) -> None:
    inner = cloud.copy()
    inner[1:-1, 1:-1, 1:-1] = 0
    assert not inner.any()


def test_densities_are_multiples_of_a_255th_up_to_one(cloud: np.ndarray) -> None:
    steps = np.rint(cloud * np.float32(255))
    np.testing.assert_array_equal(cloud, steps / np.float32(255))
    assert cloud.min() == 0 and cloud.max() == 1


def test_core_is_opaque_and_has_no_holes(cloud: np.ndarray) -> None:
    centres = (np.arange(128) + 0.5) / 128 - 0.5
    z, y, x = np.meshgrid(centres, centres, centres, indexing="ij", sparse=True)
    core = cloud[np.sqrt(x * x + y * y + z * z) < 0.15]
    assert core.min() > 0.2
    assert 50 * 0.3 * core.mean() > 5  # optical depth across the core at the scene's scale


def test_there_are_translucent_wisps_as_well_as_empty_space(cloud: np.ndarray) -> None:
    filled = cloud > 0
    assert 0.1 < filled.mean() < 0.5
    assert (cloud[filled] < 0.25).mean() > 0.05
