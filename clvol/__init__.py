"""clvol: an OpenCL wavefront renderer for participating media.

    import clvol
    scene = clvol.load_file("scene.xml", spp=64)
    clvol.render(scene, technique="delta").save("out.exr")

Names are imported when first used, so that `import clvol` and `clvol --help` stay quick.  Nothing but the
version is imported here: until the command has done so, Ctrl-C prints what was being imported (__main__.py).
"""

from clvol.version import __version__

TYPE_CHECKING = False
"""That of `typing`, which those that read the package look for by this name."""

if TYPE_CHECKING:
    from types import FrameType, ModuleType

    from clvol.api.about import Text, devices, info
    from clvol.api.frames import Frame, Frames, progressive
    from clvol.api.renders import plan, render
    from clvol.api.show import show
    from clvol.device.device import DeviceInfo
    from clvol.errors import (
        DeviceError,
        Error,
        OptionError,
        RenderError,
        SceneError,
        UnknownOptionError,
        VolumeError,
    )
    from clvol.lab.comparison import Comparison, compare
    from clvol.lab.ray.trace import trace_ray
    from clvol.lab.ray.view import RayView
    from clvol.lab.selftest import selftest
    from clvol.lab.verdict import SelfTest
    from clvol.picture.loading import load_result
    from clvol.picture.merging import merge
    from clvol.picture.result import Result
    from clvol.planning.plan import Plan
    from clvol.scene import (
        SceneParameters,
        load_dict,
        load_file,
        load_string,
        look_at,
        rotate,
        scale,
        skip_unsupported,
        translate,
        traverse,
    )
    from clvol.scene.records import Scene
    from clvol.staging.transfer import transfer
    from clvol.staging.volume import volume_scene
    from clvol.viewer.live import Live, live
    from clvol.volumes.grid import DenseGrid, SparseGrid
    from clvol.volumes.loading import load_volume

__all__ = [
    "Comparison",
    "DenseGrid",
    "DeviceError",
    "DeviceInfo",
    "Error",
    "Frame",
    "Frames",
    "Live",
    "OptionError",
    "Plan",
    "RayView",
    "RenderError",
    "Result",
    "Scene",
    "SceneError",
    "SceneParameters",
    "SelfTest",
    "SparseGrid",
    "Text",
    "UnknownOptionError",
    "VolumeError",
    "__version__",
    "compare",
    "devices",
    "info",
    "live",
    "load_dict",
    "load_file",
    "load_result",
    "load_string",
    "load_volume",
    "look_at",
    "merge",
    "plan",
    "progressive",
    "render",
    "rotate",
    "scale",
    "selftest",
    "show",
    "skip_unsupported",
    "trace_ray",
    "transfer",
    "translate",
    "traverse",
    "volume_scene",
]

_MODULES = {
    "clvol.api.about": ["Text", "devices", "info"],
    "clvol.api.frames": ["Frame", "Frames", "progressive"],
    "clvol.api.renders": ["plan", "render"],
    "clvol.api.show": ["show"],
    "clvol.device.device": ["DeviceInfo"],
    "clvol.errors": [
        "DeviceError",
        "Error",
        "OptionError",
        "RenderError",
        "SceneError",
        "UnknownOptionError",
        "VolumeError",
    ],
    "clvol.lab.comparison": ["Comparison", "compare"],
    "clvol.lab.ray.trace": ["trace_ray"],
    "clvol.lab.ray.view": ["RayView"],
    "clvol.lab.selftest": ["selftest"],
    "clvol.lab.verdict": ["SelfTest"],
    "clvol.picture.loading": ["load_result"],
    "clvol.picture.merging": ["merge"],
    "clvol.picture.result": ["Result"],
    "clvol.planning.plan": ["Plan"],
    "clvol.scene": [
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
    ],
    "clvol.scene.records": ["Scene"],
    "clvol.staging.volume": ["volume_scene"],
    "clvol.staging.transfer": ["transfer"],
    "clvol.viewer.live": ["Live", "live"],
    "clvol.volumes.grid": ["DenseGrid", "SparseGrid"],
    "clvol.volumes.loading": ["load_volume"],
}
"""The imports above, for those that run clvol rather than read it."""
_EXPORTS = {name: module for module, names in _MODULES.items() for name in names}

if not TYPE_CHECKING:  # who reads it looks the names up above, and finds those that are not there

    def __getattr__(name: str) -> object:
        """Import a public name when it is first used."""
        if name not in _EXPORTS:
            raise AttributeError(f"module 'clvol' has no attribute {name!r}")
        value = getattr(_undisturbed(_EXPORTS[name]), name)
        globals()[name] = value
        return value

    def __dir__() -> list[str]:
        """The public names, which completion offers."""
        return sorted({*__all__, *_EXPORTS})


def _undisturbed(name: str) -> "ModuleType":
    """Import a module while Ctrl-C waits: pyopencl ends the process where its import is cut short."""
    import importlib
    import signal
    import threading

    previous = signal.getsignal(signal.SIGINT)
    if threading.current_thread() is not threading.main_thread() or not callable(previous):
        return importlib.import_module(name)
    pressed: list[FrameType | None] = []
    signal.signal(signal.SIGINT, lambda _number, frame: pressed.append(frame))
    try:
        module = importlib.import_module(name)
    finally:
        signal.signal(signal.SIGINT, previous)
    if pressed:
        previous(signal.SIGINT, pressed[0])
    return module
