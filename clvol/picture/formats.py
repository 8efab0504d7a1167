"""Formats of picture files: by suffix, what OpenImageIO writes and what each can hold."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from clvol.base.output_files import output_suffix
from clvol.errors import OptionError, option, shown

if TYPE_CHECKING:
    from clvol.base.output_files import StrPath

COMPONENTS = {"uint8": np.uint8, "uint16": np.uint16, "float16": np.float16, "float32": np.float32}
"""Types of a file's numbers, as Mitsuba's `component_format` calls them."""
_LARGE = 2**31


@dataclass(frozen=True)
class Format:
    """One format of picture files.

    Parameters
    ----------
    plugin : OpenImageIO's name of it.
    components : what its numbers may be, the usual one first; whole numbers are of a display.
    alpha, layers : whether it holds alpha, and further pictures beside the colours.
    exact : its pixels are read back as they were written.
    least, most : pixels of a side.
    needs_suffix : OpenImageIO goes by the file's name.
    """

    plugin: str
    components: tuple[str, ...]
    alpha: bool = True
    layers: bool = False
    exact: bool = True
    least: int = 1
    most: int = _LARGE
    needs_suffix: bool = False


_JPEG = Format("jpeg", ("uint8",), alpha=False, exact=False, most=65500)
_TIFF = Format("tiff", ("uint8", "uint16", "float32"))
FORMATS = {
    ".exr": Format("openexr", ("float32", "float16"), layers=True),
    ".png": Format("png", ("uint8", "uint16")),
    ".jpg": _JPEG,
    ".jpeg": _JPEG,
    ".tif": _TIFF,
    ".tiff": _TIFF,
    ".webp": Format("webp", ("uint8",), exact=False, most=16383),
    ".jp2": Format("jpeg2000", ("uint8", "uint16"), least=32, needs_suffix=True),
    ".jxl": Format("jpegxl", ("uint8", "uint16")),
    ".bmp": Format("bmp", ("uint8",)),
    ".tga": Format("targa", ("uint8",), most=65535),
    ".ppm": Format("pnm", ("uint8",), alpha=False),
    ".dpx": Format("dpx", ("uint8", "uint16")),
    ".hdr": Format("hdr", ("rgbe",), alpha=False, exact=False),
    ".pfm": Format("pnm", ("float32",), alpha=False),
}
"""By suffix."""
SUFFIXES = tuple(FORMATS)


def is_linear(component: str) -> bool:
    """Whether numbers of this kind are radiance, not what a display shows of it."""
    return component not in ("uint8", "uint16")


def component_of(suffix: str, *wishes: str | None) -> str:
    """What the numbers of such a file are: the first of the wishes that it can hold, else what is usual."""
    if not isinstance(suffix, str) or suffix not in FORMATS:
        raise OptionError(f"unknown format {shown(suffix)}", hint=f"choose one of {', '.join(SUFFIXES)}")
    known = FORMATS[suffix].components
    return next((wish for wish in wishes if isinstance(wish, str) and wish in known), known[0])


def check_component(suffix: str, asked: str) -> None:
    """OptionError where such a file cannot hold these numbers."""
    if not isinstance(asked, str) or asked not in COMPONENTS:
        hint = f"choose among {', '.join(COMPONENTS)}"
        raise OptionError(f"unknown {option('component_format')} {shown(asked)}", hint=hint)
    known = FORMATS[suffix].components
    if asked not in known:
        holding = [other for other, form in FORMATS.items() if asked in form.components]
        raise OptionError(
            f"a {suffix} file cannot hold {asked}",
            hint=f"it holds {' or '.join(known)}; {asked} is held by {', '.join(holding)}",
        )


def check_holds(path: StrPath, *, alpha: bool, size: tuple[int, int]) -> None:
    """OptionError where a file of that name cannot hold a picture of size (width, height), or its alpha."""
    suffix = output_suffix(path, SUFFIXES)
    form = FORMATS[suffix]
    if alpha and not form.alpha:
        with_alpha = [name for name, other in FORMATS.items() if other.alpha]
        raise OptionError(f"a {suffix} file cannot hold alpha", str(path), f"write {', '.join(with_alpha)}")
    if max(size) > form.most or min(size) < form.least:
        limits = f"{form.least} to {form.most}" if form.most < _LARGE else f"at least {form.least}"
        what = f"a {suffix} file has {limits} pixels a side, not {size[0]} x {size[1]}"
        raise OptionError(what, str(path), "write .exr, .png or .tif, or another size")


def check_made(path: StrPath) -> None:
    """OptionError where the installed OpenImageIO makes no such files."""
    import OpenImageIO as oiio  # noqa: N813

    suffix = output_suffix(path, SUFFIXES)
    if oiio.ImageOutput.create(FORMATS[suffix].plugin) is None:
        oiio.geterror()  # or it is printed at the end
        hint = "write .exr or .png, or install a newer OpenImageIO"
        raise OptionError(f"the installed OpenImageIO makes no {suffix} files", str(path), hint)
