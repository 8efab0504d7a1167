"""Scenes: from Mitsuba 3 XML files and dicts to the plain records of `clvol.scene.records`.

Syntax, defaults and checks live here; nothing of OpenCL, and nothing that reads voxels from a file.
"""

from clvol.scene.faults import skip_unsupported
from clvol.scene.loader import load_dict, load_file, load_string
from clvol.scene.parameters import SceneParameters, traverse
from clvol.scene.transforms import look_at, rotate, scale, translate

__all__ = [
    "SceneParameters",
    "load_dict",
    "load_file",
    "load_string",
    "look_at",
    "rotate",
    "scale",
    "skip_unsupported",
    "translate",
    "traverse",
]
