"""`clvol.show`: a volume's picture in one line."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from clvol.api.renders import render
from clvol.staging.volume import volume_scene

if TYPE_CHECKING:
    from clvol.base.progress import ProgressCallback
    from clvol.picture.result import Result

SPP = 32


def show(
    volume: Any,
    *,
    spp: int = SPP,
    seed: int | None = None,
    device: str | None = None,
    progress: bool | ProgressCallback = False,
    **look: Any,
) -> Result:
    """Render a volume, framed, scaled and lit, in one line: in a notebook the picture.

    Parameters
    ----------
    volume
        An array [z, y, x], a file's name, or anything else that `volume_scene` takes.
    spp, seed, device, progress
        As `render` takes them.
    look
        Options of `volume_scene`, as ``transfer="bone"``, ``view="front"``, ``size=(800, 600)``.

    Returns
    -------
    Result
        The picture, which a notebook shows; `Result.plot` adds labels.

    Raises
    ------
    OptionError, VolumeError, SceneError
        A volume or an option that won't do.
    TypeError
        A keyword that is no option.
    """
    scene = volume_scene(volume, **look)
    return render(scene, spp=spp, seed=seed, device=device, progress=progress)
