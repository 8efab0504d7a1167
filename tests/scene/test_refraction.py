"""Refractive indices by name are those of Mitsuba 3.9, all of them; and what a wrong name is told."""

import importlib
import os
import subprocess

import numpy as np
import pytest
from places import TOOLS

from clvol.scene.refraction import COMMON_NAMES, INDICES, METALS
from clvol.scene.vocabulary import close_ones

OF_MITSUBA = """
import mitsuba as mi, os
mi.set_variant("scalar_rgb")
def of(**bsdf):
    return mi.traverse(mi.load_dict(bsdf))
def show(name, *values):
    print(name + "=" + " ".join(str(value) for value in values))
folder = os.path.join(os.path.dirname(mi.__file__), "data", "ior")
for file in os.listdir(folder):
    if file.endswith(".eta.spd"):
        name = file.removesuffix(".eta.spd")
        found = of(type="conductor", material=name)
        show(name, *found["eta.value"], *found["k.value"])
try:
    of(type="dielectric", int_ior="nothing")
except RuntimeError as error:
    for name in str(error).split("Valid choices are:")[1].strip().split(", "):
        show("index " + name, of(type="dielectric", int_ior=name)["eta"])
"""


@pytest.mark.mitsuba
def test_they_are_mitsubas():
    """In Mitsuba's process: the metals that it has files of, by what its mirrors show, and all indices."""
    with pytest.MonkeyPatch.context() as patch:
        patch.syspath_prepend(TOOLS)
        side = importlib.import_module("benchmarks.mitsuba_side")
    python = side.mitsuba_python(os.environ.get("CLVOL_MITSUBA"))
    done = subprocess.run([python, "-c", OF_MITSUBA], capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    said = done.stdout.replace("\x1b[0m", "")  # after its warnings of colours out of the gamut
    lines = [line.split("=") for line in said.splitlines() if "=" in line]
    theirs = {name: [float(value) for value in values.split()] for name, values in lines}
    assert set(theirs) == {*METALS, *(f"index {name}" for name in INDICES)}
    for name, values in METALS.items():
        assert np.allclose(np.ravel(values), theirs[name], rtol=1e-5, atol=1e-12), name
    for name, index in INDICES.items():
        assert np.allclose(index / INDICES["air"], theirs[f"index {name}"], rtol=1e-6), name


def test_common_names_mean_metals_that_there_are():
    assert set(COMMON_NAMES.values()) <= {"none", *METALS}
    assert not set(COMMON_NAMES) & set(METALS)


@pytest.mark.parametrize(
    ("name", "expected"),
    [
        ("au", "did you mean 'Au'?"),
        ("TIO2", "did you mean 'TiO2' or 'TiO2-e'?"),
        ("unobtainium", ""),
        ("x" * 100, ""),
    ],
)
def test_names_that_are_close_are_listed(name, expected):
    assert close_ones(name, ["Au", "TiO2", "TiO2-e", "Mo", "W"]) == expected
