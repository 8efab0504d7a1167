"""`clvol.trace_ray`: what techniques do along one camera ray; the view that teaches and debugs."""

from __future__ import annotations

import logging
import os
from typing import TYPE_CHECKING, Any

import numpy as np

from clvol.base.arguments import check_seed, whole
from clvol.device.device import open_device
from clvol.errors import OptionError, shown
from clvol.lab.names import split_names
from clvol.lab.ray.kernels import RayKernels
from clvol.lab.ray.place import Place, find_places, pixel_hint
from clvol.lab.ray.view import RayView
from clvol.lab.ray.walks import UNNAMED, Watched, read_walk
from clvol.planning import registry
from clvol.planning.choices import Choices
from clvol.scene.medium_facts import is_homogeneous
from clvol.scene.records import Scene

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

log = logging.getLogger("clvol")
POINTS = 3 * 2731
"""Steps of the midpoint rule along the ray; a multiple of 3, see `WatchedRay.depth_error`."""
MANY = 1 << 16
"""Walks that histograms and means are made of."""
MOST_SHOWN = 100


def _split(family: str, names: Sequence[str] | None) -> Sequence[str] | None:
    """The names of a family, where there are any: neither None nor an empty list."""
    if names is None or (isinstance(names, str | list | tuple) and not names):
        return names
    return split_names(family, names)


def trace_ray(
    scene: Scene,
    x: int,
    y: int,
    *,
    techniques: Sequence[str] | None = None,
    transmittances: Sequence[str] | None = None,
    channel: int | None = None,
    walks: int = 6,
    many: int = MANY,
    seed: int | None = None,
    device: str | None = None,
    progress: Callable[[int, int, str], None] | None = None,
    **choices: Any,
) -> RayView:
    """Watch walks along the camera ray through the centre of pixel (x, y), in the first medium it enters.

    The walks are those of a render: the same kernels' functions on the same buffers, with random numbers of
    their own.

    Parameters
    ----------
    scene
        From `load_file` or `load_dict`.
    x, y
        Pixel of the picture, from the left and from the top.
    techniques, transmittances
        Names of `clvol.planning.registry`. The default is three techniques that differ, and ratio tracking
        with and without a control.
    channel
        0, 1 or 2 for red, green or blue. The default is the one that the ray's medium attenuates most.
    walks
        How many to show event by event.
    many
        How many make up densities and means.
    seed
        64 bits. The default is the scene's.
    device
        Index or part of the name of an OpenCL device.
    progress
        Called with (steps done, steps in all, what is next).
    **choices
        majorant, lookup, absorption, roulette, gathering, background, probability, control, majorant_scale
        and step, as for `render`.

    Returns
    -------
    RayView
        The ray and what walks did along it.

    Raises
    ------
    OptionError
        A pixel outside the picture, a ray that meets no medium, an impossible choice.
    """
    if not isinstance(scene, Scene):
        raise OptionError(
            f"trace_ray takes a Scene, not {type(scene).__name__}", hint="make one with load_file"
        )
    x, y, walks, many = (whole(*given) for given in (("x", x), ("y", y), ("walks", walks), ("many", many)))
    if not 1 <= walks <= MOST_SHOWN or not max(walks, 2) <= many <= 1 << 24:
        raise OptionError(f"cannot show {walks} of {many} walks", hint=f"show 1 to {MOST_SHOWN}")
    if channel is not None and whole("channel", channel) not in range(3):
        raise OptionError(f"no channel {shown(channel)}", hint="0, 1 and 2 are red, green and blue")
    known = {*registry.FAMILIES, "majorant_scale", "step"} - {"technique", "transmittance"}
    unknown = set(choices) - known
    if unknown:
        raise OptionError(f"trace_ray has no choice {min(unknown)!r}")
    techniques, transmittances = _split("technique", techniques), _split("transmittance", transmittances)
    asked = {*(techniques or ()), *(transmittances or ())}
    if choices.get("step") is not None and "marching" not in asked:
        raise OptionError("step is for ray marching, and nothing marches here", hint="name marching too")
    if "none" in asked:
        raise OptionError("transmittance 'none' estimates nothing to show", hint="leave it out")
    seed, opened = check_seed(scene.seed if seed is None else seed), open_device(device)
    tell = progress or (lambda done, total, what: None)
    tell(0, 1, "the ray")
    first = {"technique": techniques[0]} if techniques else {}
    base = RayKernels.open(opened, scene, _choices(scene, choices | first))
    place, sigma_t = _first_matter(base, x, y)
    channel = _channel(sigma_t, channel)
    medium = base.prepared.boundaries.entries[place.medium].medium
    heterogeneous = not is_homogeneous(medium)
    todo, notes = _to_watch(base, techniques, transmittances, heterogeneous)
    watched = []
    for number, (family, name) in enumerate(todo):
        tell(number, len(todo), name)
        kernels = RayKernels.open(opened, scene, _choices(scene, choices | first | {family: name}))
        watched.append(_watch(kernels, place, family, channel, (seed, many, walks), heterogeneous))
    tell(len(todo), len(todo), "")
    return RayView(
        os.path.basename(scene.source or "") or "scene",
        *((x, y), _name(medium), seed, opened.description, place, channel),
        *(sigma_t, tuple(watched), (*place.notes, *notes), scene.files),
    )


def _first_matter(base: RayKernels, x: int, y: int) -> tuple[Place, np.ndarray]:
    """The first part of the ray with any density, and sigma_t along it, float64 (channels, POINTS)."""
    places = find_places(base, x, y)
    for place in places:
        found, _ = base.tables(_given(place, 0), None, POINTS)
        if found.any():
            grey = (found == found[0]).all()
            return place, found[:1].astype(np.float64) if grey else found.astype(np.float64)
    name = _name(base.prepared.boundaries.entries[places[0].medium].medium)
    raise OptionError(
        f"the ray through pixel ({x}, {y}) meets no density: {name} is empty along it",
        hint=pixel_hint(base.prepared, x, y),
    )


def _name(medium: Any) -> str:
    return f"medium '{medium.name}'" if medium.name else UNNAMED


def _choices(scene: Scene, given: dict[str, Any]) -> Choices:
    """The caller's choices, else the scene's, else auto; walks are watched up to their collisions."""
    if given.get("background") == "expected":
        raise OptionError(
            "a ray shows where walks collide, behind which those of background 'expected' go on",
            hint="leave the background out",
        )
    names = {family: given[family] for family in registry.FAMILIES if family in given}
    names["background"] = "sampled"
    choices = Choices.for_scene(scene, names, majorant_scale=given.get("majorant_scale", 1.0))
    return choices.but(step=given.get("step") if "marching" in choices.names.values() else None)


def _to_watch(
    base: RayKernels,
    techniques: Sequence[str] | None,
    transmittances: Sequence[str] | None,
    heterogeneous: bool,
) -> tuple[list[tuple[str, str]], list[str]]:
    """(family, name) of everything to watch, and notes on what is left out."""
    notes = []
    resolved = base.plan.chosen
    if not heterogeneous:
        if base.plan.features.heterogeneous or techniques or transmittances:
            notes.append("This medium is homogeneous: every technique follows it in closed form.")
        return [("technique", resolved["technique"])], notes
    chromatic = base.plan.features.chromatic_extinction
    if techniques is None:
        techniques = (
            ("delta", "spectral", "spectral-decomposition")
            if chromatic
            else ("delta", "decomposition", "weighted-decomposition")
        )
    if transmittances is None:
        transmittances = ("ratio", "residual-ratio")
    found = [("technique", resolved["technique"] if n == "auto" else n) for n in techniques]
    shadows = [("transmittance", resolved["transmittance"] if n == "auto" else n) for n in transmittances]
    shadows = [pair for pair in shadows if pair[1] != "none"]  # what auto may come to
    if shadows and not (base.plan.features.samples_lights and base.plan.features.scattering):
        notes.append("No light is sampled in this scene's media, so that renders estimate no transmittance.")
        shadows = []
    if not found + shadows:
        raise OptionError("nothing to show", hint="name at least one technique")
    once = list(dict.fromkeys(found + shadows))
    notes += [
        f"{p[1]} is asked for more than once, and shown once." for p in once if (found + shadows).count(p) > 1
    ]
    return once, notes


def _channel(sigma_t: np.ndarray, channel: int | None) -> int:
    """The channel asked for, else the one attenuated most."""
    if channel is None or len(sigma_t) == 1:
        return int(sigma_t.sum(axis=1, dtype=np.float64).argmax())
    return channel


def _given(place: Place, channel: int) -> np.ndarray:
    """The ray as cl/ray/given.h reads it."""
    values = [*place.origin, *place.direction, place.length, place.presence, place.medium, channel]
    return np.array(values, np.float32)


def _watch(
    kernels: RayKernels,
    place: Place,
    family: str,
    channel: int,
    numbers: tuple[int, int, int],
    heterogeneous: bool,
) -> Watched:
    """Walks of one technique or transmittance, and the majorant it walks."""
    seed, many, shown = numbers
    plan, given = kernels.plan, _given(place, channel)
    _, cells = kernels.tables(given, family if heterogeneous else None, 1)
    outcomes, events = kernels.walks(given, family, seed, many, shown)
    name = plan.chosen[family]
    if outcomes["flaws"].any():
        flawed = int((outcomes["flaws"] > 0).sum())
        log.warning(
            "%s: %d of %d walks met a density above the majorant, or were given up", name, flawed, many
        )
    walks = [read_walk(*pair) for pair in zip(outcomes, events, strict=False)]
    biased = heterogeneous and registry.FAMILIES[family][name].biased
    return Watched(
        family,
        name if heterogeneous else "analytic",
        plan.chosen["majorant"] if cells is not None else "none",
        biased,
        cells,
        outcomes,
        walks,
    )
