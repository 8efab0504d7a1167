"""A scene on the device and kernels over it, other than a render's: single device functions run with them."""

from __future__ import annotations

from types import MappingProxyType
from typing import TYPE_CHECKING, Any, Self

import pyopencl as cl

from clvol.device import programs
from clvol.device.driver import driver_errors
from clvol.device.launch import run_kernel, scene_arguments
from clvol.planning.plan import Plan
from clvol.rendering.session import on_device, render_record
from clvol.rendering.upload import upload_scene
from clvol.tables.prepare import PreparedScene, prepare

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    import numpy as np

    from clvol.device.device import Device
    from clvol.layout.stages import Stage
    from clvol.planning.choices import Choices
    from clvol.scene.records import Scene


class SceneKernels:
    """A scene on the device with one plan.

    Parameters
    ----------
    prepared
        The scene, with a plan for this device.
    seed
        Of the record of a render that has not begun.
    """

    purpose = "the arrays of a kernel", ""
    """What arrays are for, and what helps where there is no room for them."""

    def __init__(self, device: Device, prepared: PreparedScene, seed: int = 0) -> None:
        self.device, self.prepared = device, prepared
        self.buffers: dict[str, cl.Buffer] = {}
        self.upload(seed)

    @classmethod
    def open(cls, device: Device, scene: Scene, choices: Choices) -> Self:
        """Plan, prepare and upload; OptionError for a combination that cannot be right."""
        return cls(device, on_device(prepare(scene, Plan.of(scene, choices)), device))

    @property
    def plan(self) -> Plan:
        """What is compiled."""
        return self.prepared.plan

    def upload(self, seed: int) -> None:
        """Write the prepared scene to the device (again)."""
        record = render_record(self.prepared, seed)
        with driver_errors(self.device.description):
            uploaded = self.device.memory.upload(record, "the camera")
            self.buffers = upload_scene(self.device, self.prepared, record) | {"render": uploaded}

    def run_unit(
        self,
        name: str,
        text: str,
        count: int,
        inputs: Sequence[np.ndarray],
        outputs: Sequence[np.ndarray],
        scalars: Sequence[Any] = (),
        macros: Mapping[str, int] = MappingProxyType({}),
        stage: Stage | None = None,
    ) -> None:
        """Compose `text` for the plan, and run its kernel `name` for `count` work-items.

        The kernel's arguments are the scene's, then `inputs`, `outputs`, which come back in place, and
        `scalars`.  `stage` is whose functions it calls, and whose contract holds.
        """
        source = programs.compose(self.plan, text, macros, stage)
        names = programs.arguments_of(source)
        with driver_errors(self.device.description):
            kernel = cl.Kernel(programs.build(self.device, source, name), name)
            unused = self.device.memory.allocate(4, "an argument", "")
            resident = scene_arguments(names, self.buffers, slot_stride=1, unused=unused)
            run_kernel(self.device, kernel, count, resident, inputs, outputs, scalars, purpose=self.purpose)
