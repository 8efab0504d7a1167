"""The benchmark's scenes (tools/benchmarks), small: a quarter of the voxels along an axis, 16 x 16 pixels."""

import sys

from places import TOOLS

import clvol

SHRUNK, RES = 4, 16


def benched(name, folder):
    """One of them, loaded; its files are written to `folder`."""
    sys.path.append(str(TOOLS))
    try:
        from benchmarks.scenes import SCENES, write_scene
    finally:
        sys.path.remove(str(TOOLS))
    scene = SCENES[name]
    return clvol.load_file(write_scene(scene, folder, scene.size // SHRUNK), res=RES)
