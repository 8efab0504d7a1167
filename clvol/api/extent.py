"""How much of a picture to render: what may be asked for, whatever the scene."""

from __future__ import annotations

import math
from os import PathLike
from typing import TYPE_CHECKING, Any

from clvol.api.sharing import check_spread, is_spread
from clvol.base.arguments import check_seed, index, positive
from clvol.errors import OptionError, either, option, shown
from clvol.planning import registry
from clvol.planning.choices import Choices
from clvol.planning.refusals import nothing_marches
from clvol.rendering.checkpoint import is_checkpoint
from clvol.rendering.session import MAX_SAMPLES

if TYPE_CHECKING:
    from collections.abc import Mapping

MARCHES = ("technique", "transmittance")
"""Families of which one marches where there are steps."""


def check_alone(given: Mapping[str, Any], scene_chooses: bool = True) -> None:
    """OptionError for options of `clvol.render` that won't do whatever the scene: reading it may take long.

    given : all of them, by name.  scene_chooses : the scene may take the place of "auto" by a choice of its
        own.
    """
    for family in registry.FAMILIES:
        registry.check_choice(family, given[family], pilot=True)
    numbers = {name: given[name] for name in ("majorant_scale", "step", "target_error", "aov")}
    Choices(**numbers)
    if given["target_error"] is not None and given["samples"] is not None:
        raise OptionError(
            f"{option('target_error')} and {option('samples')} exclude each other",
            hint=f"{option('spp')} says how many at most",
        )
    sample_range(1, given["spp"], given["time_limit"], given["samples"])
    if given["seed"] is not None:
        check_seed(given["seed"])
    if is_spread(given):
        check_spread(given)
    goes_on = is_checkpoint(given["resume"])
    if given["resume"] is not None and not goes_on:
        check_resumed(given)
    if given["checkpoint"] is not None or goes_on:
        check_checkpoints(given, "checkpoint" if given["checkpoint"] is not None else "resume")
    names = [given[family] for family in MARCHES]
    if given["step"] is not None and "marching" not in names and not (scene_chooses and "auto" in names):
        raise nothing_marches()


def check_resumed(given: Mapping[str, Any]) -> None:
    """OptionError for what cannot be asked of a render that goes on from a picture."""
    if given["technique"] == registry.PILOT:
        what = f"{option('resume')} goes on with the choices of a picture"
        raise OptionError(what, hint=f"leave {registry.PILOT} out")
    if given["target_error"] is not None:
        raise OptionError(
            "a picture to a target error cannot go on from another",
            hint=f"give {option('spp')} or {option('time_limit')} instead",
        )
    if given["samples"] is not None:
        raise OptionError(
            f"{option('resume')} and {option('samples')} exclude each other",
            hint=f"{option('spp')} says how many there are to be",
        )


def check_checkpoints(given: Mapping[str, Any], name: str) -> None:
    """OptionError for what cannot be asked of a render that leaves checkpoints, or goes on from one.

    name : of the option that says so.
    """
    what = option(name)
    if not isinstance(given[name], str | PathLike):
        raise OptionError(f"{what} takes a file's name, not {shown(given[name])}")
    positive(f"{option('checkpoint_every')} ", given["checkpoint_every"], " of seconds")
    if given["resume"] is not None and not is_checkpoint(given["resume"]):
        hint = f"to go on from a checkpoint, {option('resume')} takes its name"
        raise OptionError(f"{what} and a picture to {option('resume')} exclude each other", hint=hint)
    if given["target_error"] is not None:
        raise OptionError(
            f"{what} is for renders with as many samples of each pixel, not for {option('target_error')}",
            hint=f"give {option('spp')} or {option('time_limit')} instead",
        )
    if given["technique"] == registry.PILOT:
        raise OptionError(
            f"{what} keeps the samples of one technique, and {registry.PILOT} may choose another each time",
            hint="name the technique that it chose",
        )


def sample_range(
    usual: int, spp: int | None, time_limit: float | None, samples: tuple[int, int] | None
) -> tuple[int, int]:
    """First sample and how many, `usual` ones where nothing says; a time limit alone sets no end."""
    if samples is not None and spp is not None:
        hint = f"{either('samples=(first, count)', '--samples FIRST,COUNT')} says both"
        raise OptionError(f"{option('spp')} and {option('samples')} exclude each other", hint=hint)
    if time_limit is not None and not (isinstance(time_limit, float) and time_limit == math.inf):
        positive("time limit ", time_limit, " of seconds")
    if samples is not None:
        if not isinstance(samples, tuple | list) or len(samples) != 2:
            what = f"{option('samples')} {shown(samples)} is not a pair"
            raise OptionError(what, hint="give (first, count)")
        first, count = samples
    elif time_limit is not None and spp is None:
        first, count = 0, MAX_SAMPLES
    else:
        first, count = 0, usual if spp is None else spp
    try:
        first, count = index(first), index(count)
    except TypeError:
        given = f"not {shown(first)} and {shown(count)}"
        raise OptionError("numbers of samples must be whole", hint=given) from None
    if first < 0 or count < 1 or first + count > MAX_SAMPLES:
        raise OptionError(
            f"cannot render {count} samples per pixel from sample {first} on",
            hint=f"give at least 1 sample, and at most {MAX_SAMPLES} in all",
        )
    return first, count
