"""Start-up, loading and memory: what a render costs before and beside its samples."""

from __future__ import annotations

import os
import subprocess
import sys
import tempfile
import time
from pathlib import Path
from typing import Any

import click
from folders import SCENES

import clvol
from benchmarks import big_grids
from benchmarks.efficiency import spread
from benchmarks.processes import output_of
from benchmarks.tables import Figures, Row, at_most, ranged, show
from clvol.tables.prepare import prepare

COLD_TARGET, WARM_TARGET, LOAD_TARGET = 15.0, 3.0, 3.0
MEMORY_TARGET = 3.0


def measure_startup(rounds: int) -> Figures:
    """Wall seconds of `clvol render`, 64 x 64 and 1 sample, per scene, with empty and with filled caches."""
    small = {"cloud": ["-D", "res=64"], "fire": ["-D", "width=64", "-D", "height=64"]}
    seconds: dict[str, dict[str, list[float]]] = {name: {"cold": [], "warm": []} for name in small}
    for _ in range(rounds):
        for name, size in small.items():
            with tempfile.TemporaryDirectory(prefix="clvol-bench-") as folder:
                caches = {"POCL_CACHE_DIR": f"{folder}/pocl", "XDG_CACHE_HOME": f"{folder}/xdg"}
                Path(folder, "pocl").mkdir()
                command = [
                    sys.executable,
                    "-m",
                    "clvol",
                    "render",
                    str(SCENES / f"{name}.xml"),
                    *size,
                ]
                command += ["--spp", "1", "--quiet", "-o", f"{folder}/image.exr"]
                for state in ("cold", "warm"):
                    started = time.perf_counter()
                    subprocess.run(command, check=True, env=os.environ | caches, stderr=subprocess.DEVNULL)
                    seconds[name][state].append(time.perf_counter() - started)
    return {name: {state: spread(v) for state, v in states.items()} for name, states in seconds.items()}


def show_startup(figures: Figures) -> None:
    """Cold and warm."""
    rows = [
        (f"{name}.xml, {state} caches", ranged(value))
        for name, states in figures.items()
        for state, value in states.items()
    ]
    show("startup: time to first pixel, 64 x 64, 1 spp", ["", "seconds"], rows)


def startup_rows(figures: Figures) -> list[Row]:
    """Cold and warm, both scenes in one row."""
    texts = {
        "cold": ("time to first pixel, 64 × 64, 1 spp, cold kernel caches", COLD_TARGET),
        "warm": ("the same with warm caches", WARM_TARGET),
    }
    rows = []
    for state, (text, target) in texts.items():
        cloud, fire = (figures[name][state]["median"] for name in ("cloud", "fire"))
        rows.append(at_most(text, f"{cloud:.1f} s (fire.xml {fire:.1f} s)", target, " s", cloud, fire))
    return rows


def grid_scene(path: Path, res: int) -> dict[str, Any]:
    """The grid in `path` as a cloud that fills the unit cube, under a white sky."""
    film = {"type": "hdrfilm", "width": res, "height": res, "rfilter": {"type": "box"}}
    to_world = clvol.look_at(origin=[0.5, 0.5, -1.2], target=[0.5, 0.5, 0.5], up=[0, 1, 0])
    medium = {
        "type": "heterogeneous",
        "sigma_t": {"type": "gridvolume", "filename": str(path)},
        "albedo": 0.9,
        "scale": 50.0,
    }
    return {
        "type": "scene",
        "integrator": {"type": "volpath"},
        "sensor": {"type": "perspective", "fov": 40.0, "to_world": to_world, "film": film},
        "sky": {"type": "constant"},
        "cloud": {
            "type": "cube",
            "to_world": clvol.translate([0.5, 0.5, 0.5]) @ clvol.scale(0.5),
            "bsdf": {"type": "null"},
            "interior": medium,
        },
    }


def measure_load(size: int, rounds: int) -> Figures:
    """Wall seconds from a .npy file (in the page cache) to bricks and majorants, `auto`."""
    seconds: dict[str, list[float]] = {"load": [], "prepare": [], "both": []}
    with tempfile.TemporaryDirectory(prefix="clvol-bench-") as folder:
        path = Path(folder, "grid.npy")
        big_grids.write_npy(path, big_grids.cloud_slabs(size), size)
        for _ in range(rounds):
            started = time.perf_counter()
            scene = clvol.load_dict(grid_scene(path, 16))
            loaded = time.perf_counter()
            prepare(scene)
            done = time.perf_counter()
            for name, value in (
                ("load", loaded - started),
                ("prepare", done - loaded),
                ("both", done - started),
            ):
                seconds[name].append(value)
    return {"size": size} | {name: spread(values) for name, values in seconds.items()}


def show_load(figures: Figures) -> None:
    """The two steps and their sum."""
    names = {"load": "load_dict", "prepare": "prepare: bricks and majorants", "both": "both"}
    rows = [(text, ranged(figures[name])) for name, text in names.items()]
    show(f"load: a grid of {figures['size']}³ voxels", ["", "seconds"], rows)


def load_rows(figures: Figures) -> list[Row]:
    """Both steps together."""
    seconds = figures["both"]["median"]
    text = f"loading a {figures['size']}³ grid and building its majorants"
    return [at_most(text, f"{seconds:.2f} s", LOAD_TARGET, " s", seconds)]


def peak_bytes() -> int:
    """Peak memory of this program: VmHWM, since ru_maxrss also counts the parent it was forked from."""
    status = Path("/proc/self/status").read_text()
    return 1024 * int(status.split("VmHWM:")[1].split()[0])


def render_grid(path: Path) -> int:
    """Render the grid in `path` at 16 x 16 and 1 sample; this process' peak memory in bytes."""
    clvol.render(clvol.load_dict(grid_scene(path, 16)), spp=1)
    return peak_bytes()


def measure_memory(size: int) -> Figures:
    """Peak memory of a process of its own, per kind of grid."""
    kinds = {
        "tiny": (big_grids.noise_slabs, 8),
        "cloud": (big_grids.cloud_slabs, size),
        "noise": (big_grids.noise_slabs, size),
    }
    peaks = {}
    for kind, (slabs, edge) in kinds.items():
        with tempfile.TemporaryDirectory(prefix="clvol-bench-") as folder:
            path = Path(folder, "grid.npy")
            big_grids.write_npy(path, slabs(edge), edge)
            peaks[kind] = {"grid": 4 * edge**3, "peak": int(output_of("costs", str(path)))}
    return {"size": size} | peaks


def show_memory(figures: Figures) -> None:
    """Peaks in MiB and as multiples of the grid."""
    texts = {
        "tiny": "8³ voxels: the program itself",
        "cloud": f"{figures['size']}³ voxels, a cloud",
        "noise": f"{figures['size']}³ voxels, all different",
    }
    rows = []
    for kind, text in texts.items():
        grid, most = figures[kind]["grid"], figures[kind]["peak"]
        times = "-" if kind == "tiny" else f"{most / grid:.2f}"
        rows.append((text, f"{grid / 2**20:.0f}", f"{most / 2**20:.0f}", times))
    show(
        "memory: peak of a render of 16 x 16 pixels, 1 spp",
        ["", "grid MiB", "peak MiB", "ratio"],
        rows,
    )


def memory_rows(figures: Figures) -> list[Row]:
    """Both kinds of grids in one row."""
    cloud, noise = (figures[kind]["peak"] / figures[kind]["grid"] for kind in ("cloud", "noise"))
    grid = f"{figures['size']}³ grid ({figures['noise']['grid'] / 2**20:.0f} MiB)"
    text = f"peak memory with a {grid}, as a multiple of the grid"
    return [at_most(text, f"{cloud:.1f} (a cloud) to {noise:.1f} (noise)", MEMORY_TARGET, "", cloud, noise)]


@click.command()
@click.argument("grid", type=click.Path(path_type=Path))
def main(grid: Path) -> None:
    """Print the peak memory in bytes of a process that renders GRID, a .npy file: this one."""
    click.echo(render_grid(grid))


if __name__ == "__main__":
    main()
