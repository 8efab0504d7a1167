"""Renders with clvol on request; tools/bench.py runs it with the clvol of any commit.

It uses nothing but the public interface, which old commits have too.  Reads one JSON object a line and
answers each with one:

    {"load": "scene.xml", "defaults": {"res": "128"}, "threads": 2, "options": {}}
        ->  {"version": "0.1.0", "cpu": 0.3, "wall": 0.3}
    {"spp": 64, "seed": 1, "image": "out.npy"}  ->  {"cpu": 3.1, "wall": 1.6, "stats": {...}}

`cpu` is user plus system time of this process, round the loading or the whole of a render.
"""

from __future__ import annotations

import argparse
import json
import os
import sys
import time
from pathlib import Path
from typing import Any

import numpy as np


def load(request: dict[str, Any]) -> tuple[Any, dict[str, Any]]:
    """The scene asked for, and the answer."""
    os.environ["POCL_MAX_PTHREAD_COUNT"] = str(request["threads"])
    import clvol

    wall, cpu = time.perf_counter(), time.process_time()
    scene = clvol.load_file(request["load"], **request["defaults"])
    cost = {"cpu": time.process_time() - cpu, "wall": time.perf_counter() - wall}
    return scene, {"version": clvol.__version__} | cost


def render(scene: Any, request: dict[str, Any], options: dict[str, Any]) -> dict[str, Any]:
    """Render, write the image, and answer what the render cost."""
    import clvol

    wall, cpu = time.perf_counter(), time.process_time()
    result = clvol.render(scene, spp=request["spp"], seed=request["seed"], **options)
    answer = {"cpu": time.process_time() - cpu, "wall": time.perf_counter() - wall}
    np.save(request["image"], result.image)
    choices = {name: str(value) for name, value in result.metadata.items()}
    return answer | {"stats": result.stats | {"peak_bytes": peak_bytes(), "metadata": choices}}


def peak_bytes() -> int:
    """Peak memory of this process so far; 0 where the system does not say."""
    status = Path("/proc/self/status")
    text = status.read_text() if status.exists() else ""
    return 1024 * int(text.split("VmHWM:")[1].split()[0]) if "VmHWM:" in text else 0


def main() -> None:
    """Serve requests until the input ends."""
    form = argparse.RawDescriptionHelpFormatter
    argparse.ArgumentParser(description=__doc__, formatter_class=form).parse_args()
    answers = os.fdopen(os.dup(sys.stdout.fileno()), "w")
    os.dup2(sys.stderr.fileno(), sys.stdout.fileno())  # what is printed must not mix with the answers
    scene, options = None, {}
    for line in sys.stdin:
        request = json.loads(line)
        if "load" in request:
            scene, answer = load(request)
            options = request["options"]
        else:
            answer = render(scene, request, options)
        print(json.dumps(answer, default=float), file=answers, flush=True)


if __name__ == "__main__":
    main()
