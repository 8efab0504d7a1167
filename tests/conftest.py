"""Fixtures every test may use: the device under test, and where the real volumes are."""

import os
import signal
from pathlib import Path

import pytest

SCENES = Path(__file__).resolve().parent.parent / "scenes"


def pytest_addoption(parser):
    parser.addoption(
        "--mitsuba",
        action="store_true",
        help="compare with Mitsuba 3.9 too, in an environment made for it unless CLVOL_MITSUBA names a "
        "Python that has it",
    )


def pytest_collection_modifyitems(config, items):
    """Tests marked `mitsuba` run when asked for: they take minutes, and may install Mitsuba."""
    if config.getoption("--mitsuba") or os.environ.get("CLVOL_MITSUBA"):
        return
    skip = pytest.mark.skip(reason="compares with Mitsuba 3.9: give --mitsuba, or set CLVOL_MITSUBA")
    for item in items:
        if item.get_closest_marker("mitsuba"):
            item.add_marker(skip)


@pytest.fixture(scope="session", autouse=True)
def independent_samples():
    """Tests judge single pixels by their variance, which has many degrees of freedom where samples are
    independent: that is the default here.  Low-discrepancy samples are asked for by name (test_sobol.py)."""
    from clvol import choices

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(choices, "DEFAULT_SAMPLER", "independent")
        yield


@pytest.fixture
def ctrl_c():
    """Ctrl-C as in a terminal: background jobs of a script, where these tests may run, ignore it."""
    previous = signal.signal(signal.SIGINT, signal.default_int_handler)
    yield
    signal.signal(signal.SIGINT, previous)


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
