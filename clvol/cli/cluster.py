"""--scheduler and --workers: renders that the workers of a cluster share."""

from __future__ import annotations

from contextlib import AbstractContextManager, nullcontext
from typing import Any

import click

MOST_WORKERS = 1024


def cluster_options(command: Any) -> Any:
    """Options that say where the workers are."""
    for option in (
        click.option(
            "--workers",
            type=click.IntRange(1, MOST_WORKERS),
            metavar="N",
            help="Start N workers on this machine, which share the samples.",
        ),
        click.option(
            "--scheduler",
            metavar="ADDRESS",
            help="Workers of this Dask scheduler share the samples, as tcp://10.0.0.1:8786.",
        ),
    ):
        command = option(command)
    return command


def client_of(scheduler: str | None, workers: int | None) -> AbstractContextManager[Any]:
    """A client of those workers, or None; click.UsageError for both at once."""
    if scheduler is not None and workers is not None:
        raise click.UsageError("give --scheduler or --workers, not both")
    from clvol.cluster import connecting

    if scheduler is not None:
        return connecting.connected(scheduler)
    return nullcontext() if workers is None else connecting.started(workers)
