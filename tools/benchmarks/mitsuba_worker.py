"""Renders with Mitsuba 3 on request; tools/bench.py runs it in Mitsuba's own environment.

Reads one JSON object a line and answers each with one:

    {"load": "scene.xml", "defaults": {"res": "128"}, "threads": 2}
        ->  {"version": "3.9.1", "cpu": 0.3, "wall": 0.3}
    {"spp": 64, "seed": 1, "image": "out.npy"}  ->  {"cpu": 3.1, "wall": 1.6}

`cpu` is user plus system time of this process, round the loading or the render alone.  The image is float32
(height, width, 3).
"""

from __future__ import annotations

import argparse
import json
import os
import sys
import time
from typing import TYPE_CHECKING, Any

import numpy as np

if TYPE_CHECKING:
    import mitsuba


def load(request: dict[str, Any]) -> tuple[mitsuba.Scene, dict[str, Any]]:
    """The scene asked for, and the answer."""
    import drjit
    import mitsuba

    mitsuba.set_variant("scalar_rgb")
    drjit.set_thread_count(request["threads"])
    wall, cpu = time.perf_counter(), time.process_time()
    scene = mitsuba.load_file(request["load"], **request["defaults"])
    cost = {"cpu": time.process_time() - cpu, "wall": time.perf_counter() - wall}
    return scene, {"version": mitsuba.__version__} | cost


def render(scene: mitsuba.Scene, request: dict[str, Any]) -> dict[str, Any]:
    """Render, write the image, and answer what the render cost."""
    import mitsuba

    wall, cpu = time.perf_counter(), time.process_time()
    image = np.array(mitsuba.render(scene, spp=request["spp"], seed=request["seed"]))
    answer = {"cpu": time.process_time() - cpu, "wall": time.perf_counter() - wall}
    np.save(request["image"], image.astype(np.float32))
    return answer


def main() -> None:
    """Serve requests until the input ends."""
    form = argparse.RawDescriptionHelpFormatter
    argparse.ArgumentParser(description=__doc__, formatter_class=form).parse_args()
    answers = os.fdopen(os.dup(sys.stdout.fileno()), "w")
    os.dup2(sys.stderr.fileno(), sys.stdout.fileno())  # what Mitsuba prints must not mix with the answers
    scene = None
    for line in sys.stdin:
        request = json.loads(line)
        if "load" in request:
            scene, answer = load(request)
        else:
            answer = render(scene, request)
        print(json.dumps(answer), file=answers, flush=True)


if __name__ == "__main__":
    main()
