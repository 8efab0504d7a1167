"""Damaged files of every format that clvol reads: no crash, no hang, little memory, one clear error each.

    python tools/fuzz.py                                200 files of each format, and 200 scenes as dicts
    python tools/fuzz.py --count 20000 .vdb .nvdb       more, and of these
    python tools/fuzz.py --count 20000 dicts            scenes as dicts alone, by Hypothesis
    python tools/fuzz.py --atheris .vdb -- -runs=100000

Files are made of small whole ones by a seeded generator (tests/helpers/fuzzing.py), and dicts of plugins and
values of every kind (tests/helpers/fuzz_dicts.py); the tests in tests/fuzz use these too.  A file that was
not as it should be is left in the folder that --keep names, and a dict is printed.

With --atheris (`pip install atheris`) a reader's Python code is instrumented, and files are sought that lead
to places in it where none has led before.  What follows `--` are options of libFuzzer.
"""

from __future__ import annotations

import os
import subprocess
import sys
import tempfile
from contextlib import suppress
from pathlib import Path
from typing import NoReturn

import click
from folders import ROOT

from clvol.cli.messages import fail

HELPERS = ROOT / "tests" / "helpers"
sys.path.insert(0, str(HELPERS))
DICTS = "dicts"
"""What is no format of files."""
_PART = 2500
"""Files or scenes that a process reads."""


def guided(name: str, options: tuple[str, ...], keep: Path) -> NoReturn:
    """Have Atheris look for files that a reader does not bear."""
    try:
        import atheris
    except ImportError:
        fail("Atheris is not installed (pip install atheris)")
    loaded = [module for module in sys.modules if module.partition(".")[0] in ("clvol", "fuzz_seeds")]
    for module in loaded:
        del sys.modules[module]  # to be loaded again, instrumented
    with atheris.instrument_imports(include=["clvol"]):
        from fuzz_seeds import FORMATS

        from clvol.errors import Error
    kind, folder = FORMATS[name], tempfile.mkdtemp(prefix="clvol-fuzz-")
    path = Path(folder) / (name if name[0] != "." else f"file{name}")
    for number, whole in enumerate(kind.seeds(Path(folder))):
        (keep / f"whole-{number}").write_bytes(whole)

    def one(data: bytes) -> None:
        path.write_bytes(data)
        with suppress(Error):
            kind.read(path)

    usual = ["-timeout=10", "-rss_limit_mb=2048", f"-artifact_prefix={keep}/", str(keep)]
    atheris.Setup([sys.argv[0], *options, *usual], one)
    atheris.Fuzz()
    raise SystemExit


def seeded(name: str, count: int, seed: int, keep: Path) -> bool:
    """Read `count` damaged files of a format, or dicts, in processes of their own; whether all was well."""
    well = True
    for part in range(-(-count // _PART)):
        size = min(_PART, count - part * _PART)
        command = [sys.executable, HELPERS / "fuzzing.py", name, str(size), str(seed + part), "--keep", keep]
        if name == DICTS:
            command = [sys.executable, HELPERS / "fuzz_dicts.py", str(size), str(seed + part)]
        few_threads = {"MALLOC_ARENA_MAX": "1", "OPENBLAS_NUM_THREADS": "1"}
        done = subprocess.run(command, env=os.environ | few_threads, capture_output=True, text=True)
        click.echo(f"{name} {done.stdout.strip() or done.stderr[-2000:]}")
        well &= done.returncode == 0 and '"faults": []' in done.stdout
    return well


@click.command(help=__doc__)
@click.argument("names", nargs=-1, metavar="[FORMAT]...")
@click.option(
    "--count", type=click.IntRange(min=1), default=200, help="Files of each, and dicts; by default 200."
)
@click.option("--seed", type=int, default=1, help="Another seed, other files.")
@click.option("--keep", type=click.Path(path_type=Path), help="Folder for what went wrong.")
@click.option("--atheris", is_flag=True, help="Seek new paths through one format's reader.")
def main(names: tuple[str, ...], count: int, seed: int, keep: Path | None, atheris: bool) -> None:
    """Fuzz the formats one by one."""
    from fuzz_seeds import FORMATS

    names, options = (tuple(n for n in names if n[0] != "-"), tuple(n for n in names if n[0] == "-"))
    if unknown := set(names) - {*FORMATS, DICTS}:
        fail(f"no format {', '.join(sorted(unknown))}; there are {', '.join((*FORMATS, DICTS))}")
    keep = keep or Path(tempfile.mkdtemp(prefix="clvol-fuzz-"))
    keep.mkdir(exist_ok=True)
    if atheris:
        if len(names) != 1 or names[0] == DICTS:
            fail("give one format of files to --atheris")
        guided(names[0], options, keep)
    outcomes = [seeded(name, count, seed, keep) for name in names or (*FORMATS, DICTS)]
    sys.exit(not all(outcomes))


if __name__ == "__main__":
    main()
