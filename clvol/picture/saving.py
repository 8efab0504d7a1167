"""A picture as files: under the names it should have, and somewhere where that cannot be."""

from __future__ import annotations

import logging
import secrets
from collections.abc import Callable, Sequence

from clvol.base.memory import format_bytes
from clvol.base.output_files import (
    StrPath,
    check_file,
    check_room,
    kept_elsewhere,
    output_suffix,
    real,
    write_file,
)
from clvol.errors import Error, OptionError
from clvol.picture.formats import (
    FORMATS,
    SUFFIXES,
    check_component,
    check_holds,
    check_made,
    component_of,
    is_linear,
)
from clvol.picture.view_transform import View

log = logging.getLogger("clvol")
Encode = Callable[[str], bytes]
"""The whole file of a picture, by the suffix of its name."""
_SQUEEZED = 32
"""By how much compression may shrink a picture; noise hardly does by 2."""


def check_picture(
    path: StrPath,
    view: View | None = None,
    component: str | None = None,
    *,
    alpha: bool = False,
    size: tuple[int, int] | None = None,
) -> None:
    """Raise OptionError now for what `save` would refuse after a long render.

    view : how the picture is to be shown.  component : what numbers are to be.  size : width and height,
    where they are known, and `alpha`: whether it has alpha.
    """
    suffix = output_suffix(path, SUFFIXES)
    if component is not None:
        check_component(suffix, component)
    if not is_linear(component_of(suffix, component)):
        (view or View()).resolved()
    if size is not None:
        check_holds(path, alpha=alpha, size=size)
    check_made(path)
    check_file(path)


def check_disk(path: StrPath, pixels: int, aovs: int) -> None:
    """OptionError where a picture of so many pixels cannot fit on the disk, a warning where it may not."""
    suffix = output_suffix(path, SUFFIXES)
    planes = 8 + 3 * aovs if FORMATS[suffix].layers else 3  # colours, their variances, look-ups and samples
    most = pixels * planes * (4 if is_linear(component_of(suffix)) else 1)
    folder = real(path).parent
    try:
        check_room(folder, str(path), most)
    except OptionError:
        check_room(folder, str(path), most // _SQUEEZED)
        log.warning("%s: '%s' has no room for the %s it may take", path, folder, format_bytes(most))


def save_all(encode: Encode, paths: Sequence[StrPath]) -> dict[StrPath, Error]:
    """Write every picture that can be written; return what went wrong with the others.

    The error also says where the picture is then: in another of the files, or in one with a name of its own.
    """
    failed: dict[StrPath, str] = {}
    whole = ""
    for path in paths:
        try:
            suffix = output_suffix(path, SUFFIXES)
            write_file(path, encode(suffix))
            whole = whole or (str(path) if FORMATS[suffix].layers else "")
        except (Error, OSError, MemoryError) as error:
            failed[path] = getattr(error, "what", "") or str(error) or "out of memory"
    if not failed:
        return {}
    whole = whole or _keep(encode, next(iter(failed)))
    hint = f"the picture is kept as {whole}" if whole else "and there is no other place to keep the picture"
    return {path: OptionError(what, str(path), hint) for path, what in failed.items()}


def _keep(encode: Encode, path: StrPath) -> str:
    """Where the picture is instead, as .exr; "" if there is no room for it anywhere."""
    try:
        data = encode(".exr")
    except (Error, OSError, MemoryError):
        return ""
    name = f"clvol-{secrets.token_hex(4)}.exr"
    return str(kept_elsewhere(path, name, lambda place: write_file(place, data)) or "")
