"""Runs single device functions: a tiny kernel round them, one work-item per number, on a real scene."""

from types import MappingProxyType

import numpy as np

from clvol import layout
from clvol.planning.choices import Choices
from clvol.planning.plan import Plan
from clvol.rendering.scene_kernels import SceneKernels
from clvol.rendering.session import on_device
from clvol.scene.records import (
    ConstantEmitter,
    ConstVolume,
    Film,
    GridVolume,
    Integrator,
    Medium,
    Perspective,
    ReconstructionFilter,
    Scene,
    Shape,
)
from clvol.tables.prepare import prepare
from clvol.volumes.grid import DenseGrid

UNIT_BOX = np.array([[0.0, 0.0, 0.0], [1.0, 1.0, 1.0]])


def grid_volume(values, filter_type="trilinear"):
    """A gridvolume in the unit cube from an array [z, y, x] or [z, y, x, channel]."""
    values = np.ascontiguousarray(values, np.float32)
    values = values[..., None] if values.ndim == 3 else values
    nz, ny, nx, _ = values.shape
    size = np.array([nx, ny, nz], float)
    to_world = np.eye(4)
    to_world[[0, 1, 2], [0, 1, 2]] = 1 / size
    to_world[:3, 3] = 0.5 / size
    lower = np.full(3, -0.5)
    return GridVolume(DenseGrid(values, UNIT_BOX), to_world, lower, size - 0.5, filter_type)


def unit_cube():
    """Shape transform of the cube (0, 1)³."""
    to_world = np.eye(4) * 0.5
    to_world[:3, 3], to_world[3, 3] = 0.5, 1.0
    return to_world


WHITE = (ConstantEmitter(),)


def scene_of(medium, emitters=WHITE, integrator=None, size=(8, 8), sensor=None, to_world=None):
    """One medium in the unit cube before a camera that looks along +z."""
    if sensor is None:
        eye = np.eye(4)
        eye[:3, 3] = 0.5, 0.5, -1.2
        sensor = Perspective(eye, 40.0)
    film = Film(*size, ReconstructionFilter("box", 0.5))
    shape = Shape("cube", unit_cube() if to_world is None else to_world, medium)
    return Scene(sensor, film, integrator or Integrator(), (shape,), tuple(emitters), spp=16)


def medium_of(values, scale=1.0, albedo=0.0, **keywords):
    """Heterogeneous medium from an array, or a homogeneous one from a number."""
    if np.ndim(values) == 0:
        return Medium(ConstVolume((float(values),)), ConstVolume((albedo,)), scale, **keywords)
    return Medium(grid_volume(values), ConstVolume((albedo,)), scale, homogeneous=False, **keywords)


class Probe(SceneKernels):
    """A scene on the device, and kernels of one line over it."""

    def __init__(self, device, scene, **choices):
        plan = Plan.of(scene, Choices(**({"majorant": "grid", "background": "sampled"} | choices)))
        super().__init__(device, on_device(prepare(scene, plan), device), seed=1)

    def upload(self, seed=1):
        """Write the prepared scene to the device (again)."""
        super().upload(seed)

    def run(self, headers, body, outputs, inputs=(), stage=None, macros=MappingProxyType({})):
        """Run `body` for `outputs[0].size` work-items with index `i`; arrays are in0, in1, out0, and so on.

        `stage` names the stage whose functions it calls, and whose contract holds; `macros`: more of them.
        """
        inputs = [np.ascontiguousarray(a) for a in inputs]
        names = [(f"in{n}", a) for n, a in enumerate(inputs)] + [
            (f"out{n}", a) for n, a in enumerate(outputs)
        ]
        c_types = {"f": "float", "u": "uint", "i": "int"}
        extra = "".join(f", __global {c_types[a.dtype.kind]} *{name}" for name, a in names)
        text = (
            "".join(
                f'#include "{name}"\n' if name.endswith(".h") else f"#include {name}\n" for name in headers
            )
            + '#include "core/sampler.h"\n'
            f"__kernel void probe(CLVOL_ARGUMENTS{extra}, uint count)\n{{\n"
            "    const Scene scene_ = CLVOL_SCENE;\n    const Scene *scene = &scene_;\n"
            f"    const uint i = get_global_id(0);\n    if (i >= count)\n        return;\n{body}\n}}\n"
        )
        count = outputs[0].shape[0]
        contract = stage and layout.stage(stage)
        self.run_unit("probe", text, count, inputs, outputs, [np.uint32(count)], macros, contract)
        return outputs
