"""Fixtures every test may use: the device under test, and where the real volumes are."""

import os
from pathlib import Path

import pytest

SCENES = Path(__file__).resolve().parent.parent / "scenes"


@pytest.fixture(scope="session")
def device():
    """The device that CLVOL_DEVICE selects, else the default one."""
    from clvol.device import open_device

    return open_device()


@pytest.fixture(scope="session")
def data():
    """Folder with the volumes that are not part of the project."""
    folder = os.environ.get("CLVOL_DATA")
    if not folder:
        pytest.skip("CLVOL_DATA is not set: it names the folder with the volumes that are not in the project")
    return Path(folder)
