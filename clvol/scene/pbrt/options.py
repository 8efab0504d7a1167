"""The `Option` statement: a name, and one value without a type."""

from __future__ import annotations

from typing import TYPE_CHECKING

from clvol.errors import SceneError, shortened
from clvol.scene.faults import UnsupportedError
from clvol.scene.vocabulary import did_you_mean, join_hints, listed

if TYPE_CHECKING:
    from clvol.scene.pbrt.statements import Read
    from clvol.scene.pbrt.tokens import Token

_FLAGS = (
    *("disablepixeljitter", "disabletexturefiltering", "disablewavelengthjitter"),
    *("forcediffuse", "pixelstats", "wavefront"),
)
_OTHERS = ("displacementedgescale", "msereferenceimage", "msereferenceout", "rendercoordsys", "seed")


def take_option(read: Read, name: str, value: Token | None, where: str) -> None:
    """Take an option into what was read; most are of pbrt's own work.

    Raises
    ------
    SceneError
        An unknown name, or a value that it cannot have.
    UnsupportedError
        What would change the picture.
    """
    plain = name.split()[-1].replace("-", "").replace("_", "").lower() if name.split() else ""
    if plain not in (*_FLAGS, *_OTHERS):
        hint = join_hints(did_you_mean(plain, (*_FLAGS, *_OTHERS)), f"known: {listed((*_FLAGS, *_OTHERS))}")
        raise SceneError(f"unknown Option '{shortened(name, 60)}'", where, hint)
    given = [] if value is None else [value.text] if value.values is None else list(value.values)
    if plain in _FLAGS and (len(given) != 1 or given[0] not in ("true", "false")):
        raise SceneError(f"the Option '{plain}' is true or false", where)
    if len(given) != 1:
        raise SceneError(f"the Option '{plain}' has no value", where)
    if plain == "seed":
        if isinstance(given[0], str) or given[0] != int(given[0]) or not 0 <= given[0] < 2**31:
            raise SceneError("the Option 'seed' is a whole number from 0 to 2147483647", where)
        read.seed = int(given[0])
    elif plain == "forcediffuse" and given[0] == "true":
        what = "the Option 'forcediffuse', by which every surface is diffuse, cannot be rendered"
        raise UnsupportedError(what, where, "leave it out")
    elif plain == "disablepixeljitter" and given[0] == "true":
        read.said.append(("samples lie all over pixels, not in their middles", where))
