"""A viewer that all tests of it share."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import pytest
from viewing import serving

if TYPE_CHECKING:
    from collections.abc import Iterator


@pytest.fixture(scope="session", autouse=True)
def extra() -> None:
    for module in ("starlette", "uvicorn", "websockets"):
        pytest.importorskip(module, reason=f"the viewer needs {module}, of the extra view")


@pytest.fixture(scope="module")
def server() -> Iterator[Any]:
    """One whose pictures are done after 4 samples."""
    server = serving(spp=4)
    yield server
    server.close()
    assert not server.alive()
