"""What a pilot tells its user: what it is about to do, and the command that repeats its render."""

from __future__ import annotations

import shlex
from typing import TYPE_CHECKING, Any

from clvol.lab.combinations import unbiased
from clvol.lab.pilot import CHOSEN

if TYPE_CHECKING:
    from collections.abc import Iterable, Mapping

    from clvol.scene.records import Scene


def announcement(scene: Scene, asked: Mapping[str, Any]) -> str:
    """One line for before the first kernels are built, which is long before anything else can be shown.

    asked : the caller's names by family; the scene's own hold where they are "auto".
    """
    own = scene.integrator.choices
    left = [f for f in CHOSEN if f == "technique" or (asked[f] == "auto" and own.get(f, "auto") == "auto")]
    most = 1 + sum(len(unbiased(family)) - 1 for family in left)
    return (
        f"pilot: building and measuring up to {most} combinations, "
        "which takes about a minute the first time on a scene's kernels"
    )


def repeat_command(scene: Scene, chosen: str, options: Mapping[str, Any]) -> str:
    """The whole command, quoted for a shell.

    The scene does not know what `-D` filled in: `with_definitions` adds it.

    Parameters
    ----------
    chosen : the pilot's options.  options : the others by name; no None, a tuple one by one.
    """
    words = ["clvol", "render", scene.source or "SCENE.xml", "-o", "OUT.exr", *chosen.split()]
    for name, value in options.items():
        for one in value if isinstance(value, tuple) else (value,):
            words += [] if one is None else [f"--{name.replace('_', '-')}", str(one)]
    return shlex.join(words)


def with_definitions(
    command: str, definitions: Mapping[str, str], assignments: Iterable[tuple[str, str]] = ()
) -> str:
    """The command with what `-D` filled into the scene, and what `--set` set in it."""
    words = [word for name, value in definitions.items() for word in ("-D", f"{name}={value}")]
    words += [word for name, value in assignments for word in ("--set", f"{name}={value}")]
    return " ".join([command, *map(shlex.quote, words)])
