"""Pictures of these tests are small, and cut into ranges nevertheless."""

import pytest


@pytest.fixture(autouse=True, scope="module")
def short_ranges():
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("clvol.cluster.ranges.LEAST_PATHS", 1)
        yield


@pytest.fixture(scope="module")
def client():
    """Two workers that are threads here: what they do is the same, and they start at once."""
    from dask_clusters import cluster, distributed

    with cluster(processes=False) as workers, distributed.Client(workers) as made:
        yield made
