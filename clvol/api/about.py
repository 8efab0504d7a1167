"""`clvol.devices` and `clvol.info`: what there is to render on, and what a volume, scene or picture is."""

from __future__ import annotations

import os
import platform
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from typing import TYPE_CHECKING, Any

from clvol.api.renders import plan
from clvol.device.device import list_devices
from clvol.errors import DeviceError, Error, OptionError, SceneError, Told, printable, shown
from clvol.lab.quiet import log_filter
from clvol.picture.loading import load_result
from clvol.picture.result import Result
from clvol.planning.in_force import warnings
from clvol.planning.registry import FAMILIES
from clvol.scene.describe import describe_scene, describe_volume
from clvol.scene.faults import skip_unsupported
from clvol.scene.loader import is_scene_file, load_file
from clvol.scene.records import Scene
from clvol.version import __version__

if TYPE_CHECKING:
    from os import PathLike

    from clvol.device.device import DeviceInfo

_PACKAGES = ("numpy", "pyopencl", "pocl-binary-distribution", "OpenImageIO")


class Text(str):
    """Lines that show themselves as they are, in a shell and a notebook too."""

    def __repr__(self) -> str:
        return str(self)


def devices() -> list[DeviceInfo]:
    """The OpenCL devices, in the order in which `clvol.render` numbers them: ``device=0`` is the first.

    Parameters
    ----------
    None

    Returns
    -------
    list of DeviceInfo
        Name, platform, version, kind, compute units and memory of each.

    Raises
    ------
    DeviceError
        There is none.
    """
    return list_devices()


def info(
    what: Scene | Result | str | PathLike[str] | None = None, *, grid: str | None = None, **choices: Any
) -> Text:
    """Say what something is: what `clvol info` prints.

    Parameters
    ----------
    what
        A scene, or a file with one: its camera, film, media and lights, and the plan of its render.  A volume
        file: its grids.  A picture that clvol wrote, or a result: how it was made.  Nothing: this clvol, what
        it runs on, and the devices.
    grid
        Of a volume file, only this one.
    choices
        Of a scene's render, as `plan` takes them.

    Returns
    -------
    Text
        A string of lines, which shows itself.

    Raises
    ------
    OptionError, SceneError, VolumeError
        Something else, or a file that cannot be read.
    """
    return Text("\n".join(map(printable, _lines(what, grid, choices))))


def _lines(what: object, grid: str | None, choices: dict[str, Any]) -> list[str]:
    is_scene = isinstance(what, Scene) or (isinstance(what, str | os.PathLike) and is_scene_file(what))
    if choices and not is_scene:
        hint = "give a scene, or leave it out"
        raise OptionError(f"{min(choices)} is for the render of a scene", hint=hint)
    is_file = isinstance(what, str | os.PathLike)
    if grid is not None and (is_scene or not is_file):
        raise OptionError("grid chooses from a volume file, and this is none")
    if what is None:
        return _installation()
    if isinstance(what, Scene):
        return scene_lines(what, choices)
    if isinstance(what, Result):
        return _result_lines(what)
    if not isinstance(what, str | os.PathLike):
        hint = "give a scene, a result, or the name of a file"
        raise OptionError(f"info does not know what {shown(what)} is", hint=hint)
    if is_scene:
        return scene_file_lines(what, {}, choices)
    if Path(what).suffix.lower() == ".exr":
        return _result_lines(load_result(what))
    return describe_volume(str(what), grid)


def scene_file_lines(
    path: str | PathLike[str], definitions: dict[str, str], choices: dict[str, Any]
) -> list[str]:
    """`scene_lines` of a scene's file, without what is not supported in it, which has lines of its own."""
    with log_filter(lambda record: False):
        try:
            scene = load_file(Path(path), **definitions)
        except SceneError as faults:
            try:
                with skip_unsupported():
                    scene = load_file(Path(path), **definitions)
            except Error:
                raise faults from None  # they are not all of what can be left out
    return [
        *scene_lines(scene, choices),
        *(Told(f"refused  {said.marked}") for said in scene.left_out),
        *(Told(f"taken    {said.marked}") for said in scene.approximated),
    ]


def scene_lines(scene: Scene, choices: dict[str, Any]) -> list[str]:
    """What a scene contains, and the plan of its render, or why there is none."""
    try:
        planned = plan(scene, **choices)
    except OptionError as refused:
        if any(value not in ("auto", 1.0, None) for value in choices.values()):
            raise
        lines = [f"note: cannot be rendered as it is: {refused}"]  # by its own choices
    else:
        asked = {family: choices.get(family, "auto") for family in FAMILIES}
        notes = (Told(f"note: {warning.marked}") for warning in warnings(planned, asked))
        lines = [*planned.describe(), *notes]
    return [*describe_scene(scene), "", *lines]


def _result_lines(result: Result) -> list[str]:
    height, width = result.image.shape[:2]
    ranges = ", ".join(f"{first} to {first + count - 1}" for first, count in result.ranges)
    lines = [
        f"picture  {width} x {height} pixels, {result.samples[1]} spp, noise {result.noise:.2%}",
        f"samples  {ranges}",
        f"layers   variance, {', '.join(result.aovs)}",
    ]
    return [*lines, *(f"{name:<8} {value}" for name, value in result.metadata.items())]


def _installation() -> list[str]:
    lines = [f"clvol    {__version__}", f"python   {platform.python_version()}, {platform.platform()}"]
    for package in _PACKAGES:
        try:
            lines.append(f"{package:<8} {version(package)}")
        except PackageNotFoundError:
            lines.append(f"{package:<8} is not installed")
    try:
        found = devices()
    except DeviceError as error:
        return [*lines, f"devices  {error}"]
    return [*lines, *(f"device {one.index} {one.name} ({one.platform}, {one.version})" for one in found)]
