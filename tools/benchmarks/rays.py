"""Rays per second on one thread, closest hit, beside Embree (through embreex), and what the hierarchy costs.

Both sides trace the same rays through the same mesh by turns.  They are not timed quite alike: ours is the
kernel's time by the device's clock, with rays and hits in the device's memory; Embree's is that of the one
Python call that traces them all, one rtcIntersect1 a ray, and so counts about 5 microseconds for the call and
the filling of rays and results, in C.  On a million rays that are all outside a mesh's bounds it takes about
55 ns a ray, where rays that traverse a mesh take 250 and more: so much at most the ratio flatters us by.

Measuring is left to a process of its own, since PoCL reads its number of threads when it starts.
"""

from __future__ import annotations

import importlib.util
import json
import os
import subprocess
import sys
import time
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click
import numpy as np
import pyopencl as cl
from folders import cached

from benchmarks.costs import peak_bytes
from benchmarks.efficiency import spread
from benchmarks.processes import output_of
from benchmarks.tables import Figures, Row, Unavailable, at_least, judge, ranged, show
from clvol.accel.bvh import Bvh, build_bvh
from clvol.device import programs
from clvol.device.device import Device, open_device
from clvol.device.launch import run_kernel

if TYPE_CHECKING:
    from collections.abc import Sequence

REQUIREMENT = "embreex"
SIZES = (70_000, 1_000_000)
EDGE = 1024
RATIO_TARGET, BUILD_TARGET, MEMORY_TARGET = 0.5, 15.0, 10.0
AGREE_TARGET = 0.999
"""Share of the rays that must hit the same triangle on both sides; those along edges may go to either."""
KERNEL = """
__kernel void trace(__global const float8 *nodes, __global const float8 *triangles, __global const float *o,
                    __global const float *d, __global uint *primitive, uint count)
{
    const Scene scene = {.bvh_nodes = nodes, .bvh_triangles = triangles};
    const size_t i = get_global_id(0);
    if (i >= count)
        return;
    const Ray ray = {vload3(i, o), vload3(i, d)};
    primitive[i] = closest_hit(&scene, ray, 0.0f, NO_PRIMITIVE, INFINITY).primitive;
}
"""


def knobbly_sphere(triangles: int) -> tuple[np.ndarray, np.ndarray]:
    """A closed surface of about so many triangles: six squares on a sphere, with dents of two sizes.

    Returns vertices, float32 (n, 3), and faces, int32 (m, 3).
    """
    edge = round((triangles / 12) ** 0.5)
    a, b = np.meshgrid(*2 * [np.tan(np.linspace(-1, 1, edge + 1) * np.pi / 4)], indexing="ij")
    number = np.arange((edge + 1) ** 2, dtype=np.int32).reshape(edge + 1, edge + 1)
    square = np.stack([number[:-1, :-1], number[1:, :-1], number[1:, 1:], number[:-1, 1:]], axis=-1)
    square = square.reshape(-1, 4)
    points, faces = [], []
    for side in range(6):
        at = np.stack([np.full(a.shape, 1 - 2 * (side % 2)), a, b], axis=-1).reshape(-1, 3)
        faces += [square[:, [0, 1, 2]] + side * number.size, square[:, [0, 2, 3]] + side * number.size]
        points.append(np.roll(at / np.linalg.norm(at, axis=1, keepdims=True), side // 2, axis=1))
    x, y, z = np.concatenate(points).T
    radius = 1 + 0.15 * np.sin(7 * x + 1) * np.sin(6 * y) * np.sin(5 * z + 2)
    radius += 0.03 * np.sin(40 * x) * np.sin(37 * y) * np.sin(43 * z)
    return (np.stack([x, y, z], axis=1) * radius[:, None]).astype(np.float32), np.concatenate(faces)


def incoherent_rays(vertices: np.ndarray, edge: int) -> tuple[np.ndarray, np.ndarray]:
    """From points in the bounding box, to everywhere: origins and directions, float32 (edge², 3)."""
    generator = np.random.default_rng(1)
    o = generator.uniform(vertices.min(axis=0), vertices.max(axis=0), (edge**2, 3))
    d = generator.normal(size=o.shape)
    return o.astype(np.float32), (d / np.linalg.norm(d, axis=1, keepdims=True)).astype(np.float32)


def coherent_rays(vertices: np.ndarray, edge: int) -> tuple[np.ndarray, np.ndarray]:
    """A pinhole camera's, row by row; the mesh fills most of the picture."""
    across = (np.arange(edge) + 0.5) / edge - 0.5
    d = np.stack([*np.meshgrid(0.8 * across, 0.8 * across), np.ones((edge, edge))], axis=-1).reshape(-1, 3)
    o = np.tile(np.add(vertices.mean(axis=0), [0.1, 0.05, -3.2]), (len(d), 1))
    return o.astype(np.float32), (d / np.linalg.norm(d, axis=1, keepdims=True)).astype(np.float32)


RAYS = {"incoherent": incoherent_rays, "coherent": coherent_rays}


class OurSide:
    """The hierarchy on the device and a kernel over it."""

    def __init__(self, device: Device, bvh: Bvh) -> None:
        flags = {"CLVOL_SPECTRUM": 1, "CLVOL_EXTINCTION": 1, "CLVOL_ONE_CHANNEL_PER_PATH": 0}
        flags |= {"CLVOL_HAS_SURFACES": 1, "CLVOL_HAS_TRIANGLES": 1, "CLVOL_HAS_QUADRICS": 0}
        flags["CLVOL_BVH_STACK"] = bvh.stack
        text = programs.expand('#include "geometry/bvh.h"\n' + KERNEL, flags, {})
        self.device = device
        self.kernel = cl.Kernel(programs.build(device, text, "rays"), "trace")
        self.tree = [device.memory.upload(array, "the hierarchy") for array in (bvh.nodes, bvh.packets)]

    def trace(self, o: np.ndarray, d: np.ndarray) -> tuple[float, np.ndarray]:
        """Seconds, and the primitives hit, int32 (rays,), -1 for none."""
        primitive = np.empty(len(o), np.int32)
        event = run_kernel(
            self.device, self.kernel, len(o), self.tree, [o, d], [primitive], [np.uint32(len(o))]
        )
        return 1e-9 * (event.profile.end - event.profile.start), primitive


class EmbreeSide:
    """Embree's scene, with its defaults."""

    def __init__(self, vertices: np.ndarray, faces: np.ndarray) -> None:
        from embreex.mesh_construction import TriangleMesh
        from embreex.rtcore_scene import EmbreeScene

        self.scene = EmbreeScene()
        self.mesh = TriangleMesh(self.scene, vertices[faces])
        self.scene.run(vertices[:1], vertices[:1])  # builds

    def trace(self, o: np.ndarray, d: np.ndarray) -> tuple[float, np.ndarray]:
        """Seconds, and the primitives hit, int32 (rays,), -1 for none."""
        started = time.perf_counter()
        primitive = self.scene.run(o, d, query="INTERSECT")
        return time.perf_counter() - started, primitive


def rates(rounds: int, sizes: Sequence[int], edge: int) -> Figures:
    """Rays per second of both sides, by size and kind of rays, and the share of rays on which they agree."""
    figures: Figures = {}
    device = open_device()
    for size in sizes:
        vertices, faces = knobbly_sphere(size)
        sides = {
            "clvol": OurSide(device, build_bvh(vertices, faces, np.empty((0, 2, 3), np.float32))),
            "embree": EmbreeSide(vertices, faces),
        }
        for kind, make in RAYS.items():
            o, d = make(vertices, edge)
            found = {name: side.trace(o, d)[1] for name, side in sides.items()}  # and warms up
            measured: dict[str, list[float]] = {name: [] for name in sides}
            for _ in range(rounds):
                for name, side in sides.items():
                    measured[name].append(len(o) / side.trace(o, d)[0])
            ratios = np.divide(measured["clvol"], measured["embree"])
            figures[f"{len(faces)} {kind}"] = {name: spread(v) for name, v in measured.items()} | {
                "ratio": spread(ratios),
                "agree": float(np.mean(found["clvol"] == found["embree"])),
            }
    return figures


def build_costs(size: int) -> Figures:
    """Seconds, and peak memory above what the program had, with the mesh, for a mesh of this size."""
    vertices, faces = knobbly_sphere(8)
    build_bvh(vertices, faces, np.empty((0, 2, 3), np.float32))
    vertices, faces = knobbly_sphere(size)
    mesh = vertices.nbytes + faces.nbytes
    Path("/proc/self/clear_refs").write_text("5")  # the peak is now what there is
    before = peak_bytes() - mesh
    started = time.perf_counter()
    bvh = build_bvh(vertices, faces, np.empty((0, 2, 3), np.float32))
    seconds = time.perf_counter() - started
    return {
        "triangles": len(faces),
        "seconds": seconds,
        "mesh": mesh,
        "peak": peak_bytes() - before,
        "nodes": len(bvh.nodes),
        "packets": len(bvh.packets),
        "depth": bvh.depth,
        "stack": bvh.stack,
    }


def embree_environment() -> dict[str, str]:
    """Variables with which Python finds embreex: its own, else that of a cached folder, filled when empty."""
    if importlib.util.find_spec("embreex"):
        return {}
    folder = cached("embreex")
    if not (folder / "embreex").exists():
        click.echo(f"installing {REQUIREMENT} in {folder}", err=True)
        pip = [sys.executable, "-m", "pip", "install", "--quiet", "--no-deps", "--target", str(folder)]
        if subprocess.run([*pip, REQUIREMENT]).returncode:
            raise Unavailable(f"no {REQUIREMENT} to be had", "what pip said stands above")
    return {"PYTHONPATH": os.pathsep.join(filter(None, [str(folder), os.environ.get("PYTHONPATH")]))}


def measure_rays(rounds: int, sizes: Sequence[int] = SIZES, edge: int = EDGE) -> Figures:
    """Both measurements, each in a process of its own and on one thread.

    Parameters
    ----------
    sizes : triangles of the meshes, about.  edge : its square is the number of rays.

    Raises Unavailable where there is no embreex.
    """
    one_thread = embree_environment() | {"POCL_MAX_PTHREAD_COUNT": "1"}
    figures = {}
    for name, arguments in (("build", [max(sizes)]), ("rates", [rounds, sizes, edge])):
        output = output_of("rays", name, json.dumps(arguments), environment=one_thread)
        figures[name] = json.loads(output)
    return figures


def show_rays(figures: Figures) -> None:
    """Rates beside Embree's, then the build."""
    rows = []
    for name, rate in figures["rates"].items():
        size, kind = name.split()
        millions = [ranged({k: v / 1e6 for k, v in rate[side].items()}) for side in ("clvol", "embree")]
        agree = f"{100 * rate['agree']:.4f} %"
        rows.append((f"{int(size):,} triangles, {kind}", *millions, ranged(rate["ratio"]), agree))
    columns = ["", "clvol: its kernel", "Embree: with its call", "ratio", "same hits"]
    show("rays: millions a second, closest hit, one thread", columns, rows)
    build = figures["build"]
    times = build["peak"] / build["mesh"]
    rows = [
        ("seconds", f"{build['seconds']:.3g}"),
        (f"peak memory, as a multiple of the mesh of {build['mesh'] / 2**20:.0f} MiB", f"{times:.2f}"),
    ]
    show(f"rays: the hierarchy of {build['triangles']:,} triangles", ["", ""], rows)


def ray_rows(figures: Figures) -> list[Row]:
    """The ratios, a row for each size; whether hits agree; the build."""
    by_size: dict[int, dict[str, Figures]] = {}
    for name, rate in figures["rates"].items():
        size, kind = name.split()
        by_size.setdefault(int(size), {})[kind] = rate
    rows = []
    for size, kinds in by_size.items():
        text = f"closest hits a second on one thread, kernel over Embree's call, {size:,} triangles"
        ratios = [f"{ranged(rate['ratio'])} times {kind}" for kind, rate in kinds.items()]
        medians = [rate["ratio"]["median"] for rate in kinds.values()]
        rows.append(at_least(text, ", ".join(ratios), RATIO_TARGET, *medians))
    agree = min(rate["agree"] for rate in figures["rates"].values())
    text = "share of those rays that hit the same triangle as Embree's, the least of all"
    rows.append(at_least(text, f"{agree:.6f}", AGREE_TARGET, agree))
    build = figures["build"]
    times = build["peak"] / build["mesh"]
    rows.append(
        Row(
            f"building that hierarchy of {build['triangles']:,} triangles",
            f"{build['seconds']:.1f} s, {times:.1f} times the mesh's memory",
            f"at most {BUILD_TARGET:g} s, {MEMORY_TARGET:g} times",
            build["seconds"] <= BUILD_TARGET and times <= MEMORY_TARGET,
        )
    )
    return rows


@click.command()
@click.argument("part", type=click.Choice(["build", "rates"]), required=False)
@click.argument("arguments", default="[]", type=json.loads, metavar="[ARGUMENTS]")
def main(part: str | None, arguments: list[Any]) -> None:
    """Measure rays beside Embree, and print figures and aims; exit 1 if one is missed.

    With a PART and its ARGUMENTS, a JSON list: only that, in this process, and its figures as JSON.
    """
    if part is None:
        figures = measure_rays(5)
        show_rays(figures)
        sys.exit(judge(ray_rows(figures)))
    measure = {"build": build_costs, "rates": rates}[part]
    click.echo(json.dumps(measure(*arguments)))


if __name__ == "__main__":
    main()
