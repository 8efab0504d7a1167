"""What gets installed: the package and its kernels, nothing else, and it works away from the checkout."""

from __future__ import annotations

import shutil
import subprocess
import sys
import sysconfig
import tarfile
import zipfile
from pathlib import Path

import pytest
from places import ROOT

from clvol.version import __version__

COMPOSE = """
import site, sys
site.addsitedir(sys.argv[1])  # as site-packages, so that .pth files count
import clvol
sys.path += sys.argv[2:]  # what clvol depends on, and perhaps another clvol
from clvol.device.programs import stage_source
from clvol.planning.plan import Plan
from clvol.tables.prepare import prepare
volume = {"type": "gridvolume", "data": [[[0.0, 1.0], [2.0, 3.0]], [[0.0, 1.0], [2.0, 3.0]]]}
medium = {"type": "heterogeneous", "sigma_t": volume}
cube = {"type": "cube", "interior": medium, "bsdf": {"type": "null"}}
scene = clvol.load_dict({"type": "scene", "camera": {"type": "perspective"}, "cube": cube})
plan = prepare(scene, Plan.of(scene)).plan
for stage in plan.stages:
    assert f"{stage}_kernel" in stage_source(plan, stage)
print(clvol.__file__)
"""


def pip(*arguments: str | Path) -> None:
    """Run pip; on failure its output is the assertion's message."""
    command = [sys.executable, "-m", "pip", "--quiet", "--disable-pip-version-check", *map(str, arguments)]
    outcome = subprocess.run(command, capture_output=True, text=True)
    assert outcome.returncode == 0, outcome.stderr


@pytest.fixture(scope="module")
def source(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A copy of the checkout: a build leaves folders behind, and takes up what earlier ones left."""
    folder = tmp_path_factory.mktemp("source")
    for name in ("pyproject.toml", "README.md", "LICENSE"):
        shutil.copy(ROOT / name, folder)
    for name in ("clvol", "cl"):
        shutil.copytree(ROOT / name, folder / name, ignore=shutil.ignore_patterns("__pycache__"))
    return folder


@pytest.fixture(scope="module")
def wheel(source: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The wheel."""
    folder = tmp_path_factory.mktemp("wheel")
    pip("wheel", source, "--no-deps", "-w", folder)
    [path] = folder.glob("*.whl")
    return path


@pytest.fixture(scope="module")
def installed(wheel: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder that the wheel is installed in."""
    target = tmp_path_factory.mktemp("site")
    pip("install", "--no-deps", "--no-index", "--target", target, wheel)
    return target


def compose(folder: Path, site: Path) -> Path:
    """In `folder`, compose kernels with the clvol that `site` makes importable; where that clvol is."""
    dependencies = {sysconfig.get_path("purelib"), sysconfig.get_path("platlib")}
    command = [sys.executable, "-S", "-c", COMPOSE, str(site), *dependencies]
    outcome = subprocess.run(command, cwd=folder, capture_output=True, text=True)
    assert outcome.returncode == 0, outcome.stderr
    return Path(outcome.stdout.strip())


def test_wheel_holds_every_kernel_file_and_every_module(wheel: Path) -> None:
    expected = {f"clvol/_cl/{p.relative_to(ROOT / 'cl').as_posix()}" for p in (ROOT / "cl").rglob("*.*")}
    files = (p for p in (ROOT / "clvol").rglob("*.*") if "__pycache__" not in p.parts)
    expected |= {p.relative_to(ROOT).as_posix() for p in files}
    assert len(expected) > 50
    found = {name for name in zipfile.ZipFile(wheel).namelist() if name.startswith("clvol/")}
    assert found == expected
    assert "clvol/py.typed" in found, "type checkers ignore clvol's annotations without it"


def test_wheel_says_its_licence_and_holds_its_text(wheel: Path) -> None:
    with zipfile.ZipFile(wheel) as archive:
        [text] = [name for name in archive.namelist() if name.endswith("dist-info/licenses/LICENSE")]
        assert archive.read(text) == (ROOT / "LICENSE").read_bytes()
        [metadata] = [name for name in archive.namelist() if name.endswith("dist-info/METADATA")]
        assert b"\nLicense-Expression: Apache-2.0 AND BSD-3-Clause\n" in archive.read(metadata)


def test_the_citation_names_this_version_and_this_licence() -> None:
    lines = (ROOT / "CITATION.cff").read_text(encoding="utf-8").splitlines()
    assert f"version: {__version__}" in lines
    assert "license: Apache-2.0" in lines


def test_nothing_but_clvol_lands_in_site_packages(wheel: Path) -> None:
    top = {name.split("/")[0] for name in zipfile.ZipFile(wheel).namelist()}
    assert "clvol" in top
    assert all(name == "clvol" or name.endswith(".dist-info") for name in top), top
    assert len(top) == 2


def test_installed_clvol_composes_its_kernels_outside_the_checkout(installed: Path, tmp_path: Path) -> None:
    assert compose(tmp_path, installed).is_relative_to(installed)


def test_a_wheel_without_kernels_would_be_noticed(installed: Path, tmp_path: Path) -> None:
    broken = tmp_path / "site"
    shutil.copytree(installed, broken)
    shutil.rmtree(broken / "clvol" / "_cl")
    with pytest.raises(AssertionError, match="FileNotFoundError"):
        compose(tmp_path, broken)


@pytest.mark.contract
def test_editable_install_reads_the_kernels_of_its_checkout(source: Path, tmp_path: Path) -> None:
    site, elsewhere = tmp_path / "site", tmp_path / "elsewhere"
    elsewhere.mkdir()
    pip("install", "--no-deps", "--target", site, "--editable", source)
    assert not (site / "clvol").exists()
    assert compose(elsewhere, site) == source / "clvol" / "__init__.py"


@pytest.mark.contract
def test_source_distribution_holds_what_its_tests_need(tmp_path: Path) -> None:
    checkout = tmp_path / "checkout"
    left_out = shutil.ignore_patterns(
        ".git", ".venv", ".lowest", ".docs", "site", "build", "*.egg-info", "__pycache__", ".*_cache"
    )
    shutil.copytree(ROOT, checkout, ignore=left_out)
    command = [sys.executable, "-m", "build", "--sdist", "--outdir", str(tmp_path), str(checkout)]
    outcome = subprocess.run(command, capture_output=True, text=True)
    assert outcome.returncode == 0, outcome.stderr
    [path] = tmp_path.glob("*.tar.gz")
    with tarfile.open(path) as archive:
        found = {name.partition("/")[2] for name in archive.getnames()}
    assert {"LICENSE", "CITATION.cff", "README.md", "CHANGELOG.md", "CONTRIBUTING.md", "mkdocs.yml"} <= found
    for folder in ("clvol", "cl", "scenes", "tests", "tools", "docs"):
        files = [p for p in (ROOT / folder).rglob("*") if p.is_file() and p.suffix != ".pyc"]
        missing = {p.relative_to(ROOT).as_posix() for p in files} - found
        assert files and not missing


def test_every_dependency_has_a_lower_bound_that_can_be_asked_for() -> None:
    command = [sys.executable, str(ROOT / "tools" / "lowest.py")]
    outcome = subprocess.run(command, capture_output=True, text=True)
    assert outcome.returncode == 0, outcome.stderr
    lines = outcome.stdout.splitlines()
    assert "numpy==2.0" in lines
    assert "matplotlib==3.9" in lines  # of an extra that the tests take in
