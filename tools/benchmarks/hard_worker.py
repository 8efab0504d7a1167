"""Renders one hard case with Mitsuba 3; tools/hard_mitsuba.py runs it in Mitsuba's own environment.

Reads a scene as a pickled dict of clvol's, with arrays in it, and prints its pixels as JSON.
"""

from __future__ import annotations

import argparse
import json
import pickle
from pathlib import Path
from typing import Any

import numpy as np


def translated(mi: Any, node: Any) -> Any:
    """The same for `mitsuba.load_dict`: transforms and grids are objects there."""
    if not isinstance(node, dict):
        return node
    made = {key: translated(mi, value) for key, value in node.items()}
    if "to_world" in made:
        made["to_world"] = mi.ScalarTransform4f(np.asarray(made["to_world"], float))
    if made.get("type") == "heterogeneous" and isinstance(made.get("scale"), dict):
        colour = np.asarray(made.pop("scale")["value"], float)
        made["sigma_t"] = coloured(mi, node["sigma_t"], colour)
    elif made.get("type") == "gridvolume" and "data" in made:
        made = grid(mi, node)
    return made


def coloured(mi: Any, volume: dict[str, Any], colour: np.ndarray) -> dict[str, Any]:
    """A volume times a colour: `scale` is a number in Mitsuba."""
    return grid(mi, volume | {"data": np.asarray(volume["data"], float)[..., None] * colour})


def grid(mi: Any, node: dict[str, Any]) -> dict[str, Any]:
    """A gridvolume with its data as Mitsuba's object."""
    data = np.asarray(node["data"], np.float32)
    data = data if data.ndim == 4 else data[..., None]
    rest = {key: value for key, value in node.items() if key not in ("data", "to_world")}
    return rest | {
        "grid": mi.VolumeGrid(data),
        "to_world": mi.ScalarTransform4f(np.asarray(node["to_world"])),
    }


def main() -> None:
    """Render."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("scene", type=Path)
    parser.add_argument("spp", type=int)
    given = parser.parse_args()
    import drjit
    import mitsuba as mi

    mi.set_variant("scalar_rgb")
    mi.set_log_level(mi.LogLevel.Error)
    drjit.set_thread_count(1)
    scene = mi.load_dict(translated(mi, pickle.loads(given.scene.read_bytes())))
    image = np.array(mi.render(scene, spp=given.spp, seed=1))[..., :3]
    print(json.dumps({"version": mi.__version__, "pixels": image.reshape(-1, 3).astype(float).tolist()}))


if __name__ == "__main__":
    main()
