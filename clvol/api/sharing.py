"""Renders that several devices or machines share: what may be asked of them."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from clvol.device.device import names_several
from clvol.errors import OptionError, option
from clvol.planning import registry
from clvol.rendering.checkpoint import is_checkpoint

if TYPE_CHECKING:
    from collections.abc import Mapping


def is_spread(given: Mapping[str, Any]) -> bool:
    """Whether options of a render say that several devices or machines are to share it."""
    return given.get("client") is not None or names_several(given["device"])


def check_spread(given: Mapping[str, Any], batch: bool = False) -> None:
    """OptionError for what cannot be asked of a render that is shared, or of a `batch` of sensors."""
    several = names_several(given["device"])
    if several and given.get("client") is not None:
        what = f"{option('device')} names several devices, and each worker of a cluster takes one"
        raise OptionError(what, hint="start a worker for each, with CLVOL_DEVICE=NUMBER in its environment")
    shared = "a render by several devices" if several else "a render on a cluster"
    shared = "a batch of sensors" if batch else shared
    one = "take one of its sensors, whose numbers follow those of the scene's own" if batch else ""
    without = {
        "checkpoint": f"{option('resume')} goes on from a picture that was saved",
        "profile": one or "profile a render on one device",
    }
    for name, hint in without.items():
        if given.get(name):
            raise OptionError(f"{shared} takes no {option(name)}", hint=hint)
    if given["resume"] is not None and is_checkpoint(given["resume"]):
        what = f"{shared} cannot go on from a checkpoint"
        raise OptionError(what, hint=f"{option('resume')} takes a picture: an .exr that has its samples")
    if given["technique"] == registry.PILOT:
        hint = f"render with {option('spp', 1)} on one device, and name the technique that it chose"
        what = f"{shared} takes no {registry.PILOT}, which would choose on each anew"
        raise OptionError(what, hint=one or hint)
