"""Clusters of Dask on this machine."""

import pytest

distributed = pytest.importorskip(
    "distributed", reason="needs the extra cluster: pip install 'clvol[cluster]'"
)


def cluster(**options):
    return distributed.LocalCluster(
        threads_per_worker=1, dashboard_address="127.0.0.1:0", silence_logs=50, **{"n_workers": 2} | options
    )
