"""Load every scene under a folder, and say which load, which render, and what is missing by how often.

    python tools/corpus.py FOLDER                # a line for each scene, then tables
    python tools/corpus.py FOLDER --stand-ins    # judge the XML where meshes, volumes, pictures are missing
    python tools/corpus.py FOLDER --render       # also 16 x 16 pixels of one sample

Each scene is read in a process of its own, with limits of time and memory.  Scenes that lack files, or
values that a command line gives, count as incomplete, unless --stand-ins puts small files in their place.
Those with plugins that no release of Mitsuba has are counted apart.  With --mitsuba PYTHON a line also says
whether Mitsuba 3 loads the scene; what is for version 2 or 3 and neither loads then counts as foreign too.
Scenes without a sensor are fragments.
"""

from __future__ import annotations

import json
import re
import resource
import struct
import subprocess
import sys
import tempfile
import zlib
from collections import Counter
from pathlib import Path
from typing import Any

import click
import numpy as np
from folders import ROOT
from mitsuba_names import is_foreign

HELPERS = ROOT / "tests" / "helpers"
SUFFIXES = (".xml", ".pbrt")
_ROOT = re.compile(rb"<scene\b[^>]*\bversion\s*=\s*[\"']([^\"']*)", re.DOTALL)
_SENSOR = re.compile(rb"<(sensor|camera|include)\b")
_MEDIA = re.compile(rb"<medium\b|MakeNamedMedium")
MITSUBA = """
import sys, mitsuba as mi
mi.set_variant("scalar_rgb")
def stand(name, other):  # for integrators that this variant has not
    def make(given):
        plain = {key: given[key] for key in given if isinstance(given[key], (bool, int, float))}
        return mi.load_dict({"type": other} | plain)
    mi.register_integrator(name, make)
stand("prbvolpath", "volpath")
for name in ("prb", "prb_basic", "prb_projective", "direct_projective"):
    stand(name, "path")
mi.load_file(sys.argv[1])
"""
WANTED = (("versions 2 and 3", "23", 0.95), ("versions before 2", "01", 0.9))
"""Of volumetric scenes: which, how these versions begin, and the share that should load."""
MESHES, PICTURES = (".obj", ".ply"), (".exr", ".png", ".jpg", ".jpeg", ".hdr", ".pfm", ".tga", ".bmp")


def scenes_in(folder: Path) -> list[Path]:
    """The files that are scenes, and no fragments."""
    found = sorted(path for path in folder.rglob("*") if path.suffix.lower() in SUFFIXES and path.is_file())
    return [path for path in found if _is_scene(path.read_bytes(), path.suffix.lower())]


def _is_scene(text: bytes, suffix: str) -> bool:
    if suffix == ".pbrt":
        return b"WorldBegin" in text
    return bool(_ROOT.search(text[: 1 << 16]) and _SENSOR.search(text))


def facts(path: Path) -> dict[str, Any]:
    """What a scene's text tells: its version, and whether it has media."""
    text = path.read_bytes()
    version = _ROOT.search(text[: 1 << 16])
    name = version[1].decode(errors="replace") if version else path.suffix[1:]
    return {"scene": str(path), "version": name, "media": bool(_MEDIA.search(text))}


def judge(path: Path, render: bool, stand_ins: bool, seconds: int, gigabytes: float) -> dict[str, Any]:
    """What reading one scene came to, in a process of its own."""
    options = ["--render"] * render + ["--stand-ins"] * stand_ins
    command = [sys.executable, __file__, str(path), "--one", "--memory", str(gigabytes), *options]
    try:
        done = subprocess.run(command, capture_output=True, text=True, timeout=seconds, check=False)
    except subprocess.TimeoutExpired:
        return {"state": "too slow", "faults": []}
    lines = done.stdout.strip().splitlines()
    if done.returncode or not lines:
        return {"state": "crash", "faults": [["crash", (done.stderr.strip().splitlines() or ["?"])[-1]]]}
    told: dict[str, Any] = json.loads(lines[-1])
    return told


def read_one(path: Path, render: bool, stand_ins: bool) -> dict[str, Any]:
    """In this process: how far it gets, and its faults as [kind, what]."""
    import clvol
    from clvol.scene.faults import MissingFileError, UnsupportedError

    made = _put_stand_ins() if stand_ins else []
    try:
        scene = clvol.load_file(path)
    except clvol.Error as error:
        faults = getattr(error, "errors", (error,))
        kinds = {MissingFileError: "missing", UnsupportedError: "unsupported"}
        told = [[kinds.get(type(fault), "mistake"), str(fault.what)] for fault in faults]
        told = [["missing" if what.endswith("has no value") else kind, what] for kind, what in told]
        state = "incomplete" if all(kind == "missing" for kind, _ in told) else "refused"
        return {"state": state, "faults": told, "stand_ins": len(made)}
    state = "loads"
    if render:
        try:
            clvol.render(scene, spp=1, size=(16, 16))
            state = "renders"
        except clvol.Error as error:
            return {"state": state, "faults": [["render", str(error.what)]], "stand_ins": len(made)}
    return {"state": state, "faults": [], "stand_ins": len(made)}


def _put_stand_ins() -> list[Path]:
    """Have the reader find a small file where one is missing; those that it was given."""
    import clvol.scene.files as files
    import clvol.scene.loader  # noqa: F401  # so that all who look for files are there
    from clvol.scene.faults import MissingFileError

    folder, found, given = Path(tempfile.mkdtemp()), files.find, []

    def find(name: str, folders: Any, where: str, folder_too: bool = False) -> Path:
        try:
            return found(name, folders, where, folder_too)
        except MissingFileError:
            given.append(_stand_in(folder, Path(name).suffix.lower()))
            if given[-1] is None:
                raise
            return given[-1]

    for module in [m for name, m in sys.modules.items() if name.startswith("clvol.scene.")]:
        if getattr(module, "find", None) is found:
            module.find = find  # type: ignore[attr-defined]
    return given


def _stand_in(folder: Path, suffix: str) -> Path | None:
    """A ball, a grid or a picture."""
    from clvol.volumes import write_vol

    path = folder / f"stand-in{suffix}"
    if suffix in MESHES:
        import trimesh

        trimesh.creation.icosphere(1).export(path)
    elif suffix == ".serialized":
        path.write_bytes(_serialized())
    elif suffix == ".vol":
        write_vol(path, np.full((2, 2, 2), 0.5, np.float32), ((0, 0, 0), (1, 1, 1)))
    elif suffix == ".nvdb":
        sys.path.append(str(HELPERS))
        from nvdb_writer import write_nvdb
        from vdb_writer import GridSpec

        leaf = {(0, 0, 0): (np.full((8, 8, 8), 0.5), np.ones((8, 8, 8), bool))}
        write_nvdb(path, [GridSpec(name, leaves=leaf) for name in ("density", "temperature")])
    elif suffix in PICTURES:
        import OpenImageIO as oiio  # noqa: N813

        picture = oiio.ImageBuf(oiio.ImageSpec(8, 8, 3, "float"))
        oiio.ImageBufAlgo.fill(picture, (0.5, 0.5, 0.5))
        picture.write(str(path))
    else:
        return None
    return path


def _serialized(copies: int = 64) -> bytes:
    """Mitsuba's format, version 4: a triangle as often as a shape_index may ask for it."""
    corners = (
        np.array([(0, 0, 0), (1, 0, 0), (0, 1, 0)], "<f4").tobytes() + np.arange(3, dtype="<u4").tobytes()
    )
    body = struct.pack("<I", 0x1000) + b"\0" + struct.pack("<QQ", 3, 1) + corners
    one = struct.pack("<HH", 0x041C, 4) + zlib.compress(body)
    starts = [len(one) * number for number in range(copies)]
    return one * copies + struct.pack(f"<{copies}QI", *starts, copies)


def is_incomplete(result: dict[str, Any]) -> bool:
    """Whether the scene lacks a file or a value, whatever else is wrong."""
    return any(kind == "missing" for kind, _ in result["faults"])


def is_of_others(result: dict[str, Any]) -> bool:
    """Whether the scene is for another program than a release of Mitsuba."""
    if result["state"] != "refused" or is_incomplete(result):
        return False
    newer = result["version"][:1] in ("2", "3")
    refused_twice = newer and result.get("mitsuba") is False
    return refused_twice or any(is_foreign(what) for kind, what in result["faults"] if kind == "unsupported")


def counts(results: list[dict[str, Any]]) -> tuple[int, int, int, int]:
    """How many scenes are incomplete, are for other programs, are neither, and load."""
    incomplete, foreign = sum(map(is_incomplete, results)), sum(map(is_of_others, results))
    good = sum(one["state"] in ("loads", "renders") for one in results)
    return incomplete, foreign, len(results) - incomplete - foreign, good


def table(results: list[dict[str, Any]]) -> list[str]:
    """How many load, by version and media; the shares that count; then what is refused, by how often."""
    lines = ["", "version     media  scenes  incomplete  foreign  left  load      %"]
    groups: dict[tuple[str, bool], list[dict[str, Any]]] = {}
    for one in results:
        version = one["version"] if one["version"] == "pbrt" else one["version"][:1] + ".x"
        groups.setdefault((version, one["media"]), []).append(one)
    for (version, media), mine in sorted(groups.items()):
        incomplete, foreign, left, good = counts(mine)
        share = f"{good / left:6.0%}" if left else "     –"
        row = f"{len(mine):>7} {incomplete:>11} {foreign:>8} {left:>5} {good:>5}"
        lines.append(f"{version:<11} {'yes' if media else 'no':<5} {row} {share}")
    lines.append("")
    for name, begin, wanted in WANTED:
        mine = [one for one in results if one["media"] and one["version"][:1] in tuple(begin)]
        _, _, left, good = counts(mine)
        share = f"{good / left:.0%} (at least {wanted:.0%} should)" if left else "none to tell of"
        lines.append(f"Complete volumetric scenes, {name}: {good} of {left} load, {share}")
    whats = Counter((kind, what) for one in results for kind, what in {tuple(f) for f in one["faults"]})
    lines += ["", "scenes  what is wrong"]
    lines += [f"{count:>6}  {kind}: {what[:100]}" for (kind, what), count in whats.most_common(60)]
    return lines


@click.command(help=__doc__)
@click.argument("folder", type=click.Path(exists=True, path_type=Path))
@click.option("--render", is_flag=True, help="Render 16 x 16 pixels of what loads.")
@click.option("--stand-ins", is_flag=True, help="Small files in the place of missing ones; labelled.")
@click.option("--mitsuba", metavar="PYTHON", help="A Python that has Mitsuba 3: does it load the scene?")
@click.option("--timeout", type=int, default=60, help="Seconds for a scene; 60 by default.")
@click.option("--memory", type=float, default=4.0, help="GiB for a scene; 4 by default.")
@click.option("--one", is_flag=True, hidden=True)
def main(
    folder: Path, render: bool, stand_ins: bool, mitsuba: str | None, timeout: int, memory: float, one: bool
) -> None:
    if one:
        limit = int(memory * 2**30)
        resource.setrlimit(resource.RLIMIT_AS, (limit, limit))
        click.echo(json.dumps(read_one(folder, render, stand_ins)))
        return
    results = []
    for path in scenes_in(folder):
        result = facts(path) | judge(path, render, stand_ins, timeout, memory)
        also = ""
        if mitsuba:
            command = [mitsuba, "-c", MITSUBA, str(path)]
            try:
                loads = subprocess.run(command, capture_output=True, timeout=timeout, check=False).returncode
            except subprocess.TimeoutExpired:
                loads = 1
            also = "  Mitsuba: no " if loads else "  Mitsuba: yes"
            result["mitsuba"] = not loads
        results.append(result)
        first = f"  {result['faults'][0][0]}: {result['faults'][0][1][:90]}" if result["faults"] else ""
        made = f"  ({result['stand_ins']} stand-ins)" if result.get("stand_ins") else ""
        name = path.relative_to(folder)
        click.echo(f"{result['state']:<10}  {result['version']:<6}{also}  {name}{made}{first}")
    click.echo("\n".join(table(results)))


if __name__ == "__main__":
    main()
