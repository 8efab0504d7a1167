"""clvol: an OpenCL wavefront renderer for participating media.

    import clvol
    scene = clvol.load_file("scene.xml", spp=64)
    clvol.render(scene, technique="delta").save("out.exr")

Names are imported when first used, so that `import clvol` and `clvol --help` stay quick.
"""

import signal
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from importlib import import_module
from typing import TYPE_CHECKING

from clvol.version import __version__

if TYPE_CHECKING:
    from types import FrameType

_EXPORTS = {
    "compare": "clvol.lab.comparison",
    "DeviceError": "clvol.errors",
    "Error": "clvol.errors",
    "load_dict": "clvol.scene",
    "load_file": "clvol.scene",
    "look_at": "clvol.scene",
    "merge": "clvol.picture.merging",
    "OptionError": "clvol.errors",
    "render": "clvol.api",
    "RenderError": "clvol.errors",
    "Result": "clvol.picture.result",
    "rotate": "clvol.scene",
    "scale": "clvol.scene",
    "Scene": "clvol.scene.records",
    "SceneError": "clvol.errors",
    "selftest": "clvol.lab.selftest",
    "trace_ray": "clvol.lab.ray.trace",
    "translate": "clvol.scene",
    "VolumeError": "clvol.errors",
}

__all__ = ["__version__", *_EXPORTS]


def __getattr__(name: str) -> object:
    if name not in _EXPORTS:
        raise AttributeError(f"module 'clvol' has no attribute {name!r}")
    with _undisturbed():
        value = getattr(import_module(_EXPORTS[name]), name)
    globals()[name] = value
    return value


@contextmanager
def _undisturbed() -> Iterator[None]:
    """Ctrl-C waits until the block is through: pyopencl ends the process where its import is cut short."""
    previous = signal.getsignal(signal.SIGINT)
    if threading.current_thread() is not threading.main_thread() or not callable(previous):
        yield
        return
    pressed: list[FrameType | None] = []
    signal.signal(signal.SIGINT, lambda _number, frame: pressed.append(frame))
    try:
        yield
    finally:
        signal.signal(signal.SIGINT, previous)
    if pressed:
        previous(signal.SIGINT, pressed[0])
