"""The paths that `start_job` starts on the device: their rays, film positions and weights."""

from dataclasses import dataclass

import numpy as np
import pyopencl as cl
from probe import Probe

from clvol import layout
from clvol.rendering.session import render_record


@dataclass(frozen=True, eq=False)
class Started:
    """Rays relative to nothing (world space, float64 (n, 3)); pixel (n,); filter weight (n,)."""

    origin: np.ndarray
    direction: np.ndarray
    pixel: np.ndarray
    weight: np.ndarray


def start_paths(device, scene, samples):
    """`samples` paths of each pixel of the scene's window, pixel by pixel."""
    probe = Probe(device, scene)
    record = render_record(probe.prepared, seed=1)
    _, _, width, height = scene.film.window
    jobs = samples * width * height
    record["pass_samples"], record["pass_jobs"], record["ring_passes"] = samples, jobs, 1
    record["last_pass"], record["last_samples"] = 0, samples
    flags = cl.mem_flags.READ_ONLY | cl.mem_flags.COPY_HOST_PTR
    probe.buffers["render"] = cl.Buffer(device.context, flags, hostbuf=record)
    fields = layout.path_fields(probe.plan.macros)
    pixel, state = np.zeros(jobs, np.uint32), np.zeros((len(fields), jobs), np.uint32)
    body = """
        Scene with_state = *scene;
        with_state.state = out1;
        with_state.slot_stride = count;
        Draws draws;
        draws.key = job_key(&with_state, i);
        draws.segment = 0;
        start_job(&with_state, i, i, &draws);
        out0[i] = i;"""
    probe.run(["stages/generate.h"], body, [pixel, state], stage="generate")
    pixel = state[[f.name for f in fields].index("pixel")]
    values = {f.name: state[n].view(np.float32).astype(float) for n, f in enumerate(fields) if f.kind == "f"}
    return Started(
        np.stack([values[f"origin_{a}"] for a in "xyz"], axis=1) + probe.prepared.centre,
        np.stack([values[f"direction_{a}"] for a in "xyz"], axis=1),
        pixel,
        values.get("sample_weight", np.ones(jobs)),
    )


def film_position(scene, started, depth=1.0):
    """Where rays pass the plane at `depth`, in pixels of the whole film as its pinhole sees it, (n, 2).

    The field of view is along x.
    """
    sensor, film = scene.sensor, scene.film
    local = (started.origin - sensor.to_world[:3, 3]) @ sensor.to_world[:3, :3]
    towards = started.direction @ sensor.to_world[:3, :3]
    meet = local + towards * ((depth - local[:, 2]) / towards[:, 2])[:, None]
    tangent = np.tan(np.radians(sensor.fov) / 2)
    x = (1 - meet[:, 0] / (depth * tangent)) * film.width / 2
    y = film.height / 2 - meet[:, 1] / (depth * tangent) * film.width / 2
    return np.stack([x, y], axis=1)
