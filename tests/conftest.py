"""Fixtures every test may use: the device under test, and where the real volumes are."""

import functools
import os
import re
import signal
from pathlib import Path

import pytest

for variable in ("CLVOL_BUILD_PROCESSES", "OPENBLAS_NUM_THREADS"):
    os.environ.setdefault(variable, "1")  # the tests' own processes use every core

OTHERS = {
    "mitsuba": ("Mitsuba 3.9", "CLVOL_MITSUBA"),
    "openvdb": ("OpenVDB 12", "CLVOL_OPENVDB"),
}
"""Programs that tests compare with when asked to, since they may have to be installed: marker and option, the
program's name, and the variable that names a Python that has it."""


def pytest_addoption(parser):
    for option, (program, variable) in OTHERS.items():
        parser.addoption(
            f"--{option}",
            action="store_true",
            help=f"compare with {program} too, in an environment made for it unless {variable} names a "
            "Python that has it",
        )


def pytest_configure(config):
    for option, (program, variable) in OTHERS.items():
        config.addinivalue_line(
            "markers", f"{option}: compares with {program}; skipped but for --{option}, or {variable}"
        )


def pytest_collection_modifyitems(config, items):
    """Tests that compare with other programs run when asked for: they may take minutes, and install them."""
    for option, (program, variable) in OTHERS.items():
        if config.getoption(f"--{option}") or os.environ.get(variable):
            continue
        skip = pytest.mark.skip(reason=f"compares with {program}: give --{option}, or set {variable}")
        for item in items:
            if item.get_closest_marker(option):
                item.add_marker(skip)


@pytest.fixture(scope="session", autouse=True)
def independent_samples():
    """Tests judge single pixels by their variance, from independent samples.

    These have many degrees of freedom.  Low-discrepancy samples are asked for by name (test_sobol.py).
    """
    from clvol.planning import auto

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(auto, "DEFAULT_SAMPLER", "independent")
        yield


@pytest.fixture(scope="session", autouse=True)
def colours_are_read_once():
    """The colour configuration that is built in is opened once, and not anew for every PNG."""
    from clvol.picture import view_transform

    opened = view_transform._config
    kept = functools.cache(opened)

    def config(name):
        return (kept if name == view_transform.BUILT_IN else opened)(name)

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(view_transform, "_config", config)
        yield


@pytest.fixture
def bounds(monkeypatch):
    """Compiles other bounds into the kernels, as WALK_STEPS=3."""
    from clvol.device import programs

    compose = programs.compose

    def set_to(**counts):
        def with_bounds(*arguments, **stage):
            text = compose(*arguments, **stage)
            for name, count in counts.items():
                text = re.sub(rf"#define {name} \(.*\)", f"#define {name} {count}u", text)
            return text

        monkeypatch.setattr(programs, "compose", with_bounds)

    return set_to


@pytest.fixture
def ctrl_c():
    """Ctrl-C as in a terminal: background jobs of a script, where these tests may run, ignore it."""
    previous = signal.signal(signal.SIGINT, signal.default_int_handler)
    yield
    signal.signal(signal.SIGINT, previous)


@pytest.fixture(scope="session")
def device():
    """The device that CLVOL_DEVICE selects, else the default one."""
    from clvol.device.device import open_device

    return open_device()


@pytest.fixture(scope="session")
def data():
    """Folder with the volumes that are not part of the project."""
    folder = os.environ.get("CLVOL_DATA")
    if not folder:
        pytest.skip("CLVOL_DATA is not set: it names the folder with the volumes that are not in the project")
    return Path(folder)
