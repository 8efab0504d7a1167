"""Pictures of these tests are small, and cut into ranges nevertheless."""

import pytest


@pytest.fixture(autouse=True, scope="module")
def short_ranges():
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("clvol.cluster.ranges.LEAST_PATHS", 1)
        yield
