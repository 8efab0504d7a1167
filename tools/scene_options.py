"""What the tools share: options for a scene, and the scene prepared as `clvol render` does it."""

from __future__ import annotations

import time
from dataclasses import dataclass
from typing import TYPE_CHECKING, NamedTuple

from clvol.cli.options import device_option, family_options
from clvol.device.device import Device, open_device
from clvol.planning.choices import Choices
from clvol.planning.plan import Plan
from clvol.rendering.outcome import make_result
from clvol.rendering.session import Session, on_device
from clvol.scene import load_file
from clvol.tables.prepare import PreparedScene, prepare

if TYPE_CHECKING:
    from collections.abc import Callable

    from clvol.picture.result import Result
    from clvol.scene.records import Scene


class Timed(NamedTuple):
    """A render, and the CPU and wall seconds that it took."""

    result: Result
    cpu: float
    wall: float


@dataclass(frozen=True, eq=False)
class OpenScene:
    """A scene on the host, and the device it will be rendered on."""

    device: Device
    prepared: PreparedScene

    @classmethod
    def of(cls, device: Device, scene: Scene, choices: Choices) -> OpenScene:
        """Prepare a scene for the choices."""
        return cls(device, prepare(scene, Plan.of(scene, choices)))

    @property
    def plan(self) -> Plan:
        """What is compiled for it."""
        return on_device(self.prepared, self.device).plan

    def render(self, spp: int, seed: int, pool: int | None = None) -> Timed:
        """Render the first `spp` samples; the kernels are built, and loaded, before the clocks start."""
        session = self.session(seed, pool)
        wall, cpu = time.perf_counter(), time.process_time()
        result = make_result(session, 0, session.run(0, spp))
        return Timed(result, time.process_time() - cpu, time.perf_counter() - wall)

    def session(self, seed: int, pool: int | None = None) -> Session:
        """Kernels built, scene uploaded, an empty film."""
        return Session.open(self.device, self.prepared, seed, pool)


def open_scene(
    path: str, defaults: dict[str, object], choices: dict[str, str], pattern: str | None = None
) -> OpenScene:
    """Load and prepare a scene; a choice of "auto" becomes the scene's own where it has one."""
    scene = load_file(path, **defaults)
    return OpenScene.of(open_device(pattern), scene, Choices.for_scene(scene, choices))


def choice_options(command: Callable) -> Callable:
    """One option for each family of choices in `clvol.planning.registry`, and the device."""
    return family_options()(device_option(command))
