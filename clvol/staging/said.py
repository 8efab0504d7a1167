"""What was chosen for a volume, in a line each."""

from __future__ import annotations

from typing import TYPE_CHECKING

from clvol.staging.looks import LOOKS
from clvol.staging.medium import glowing
from clvol.staging.options import VIEWS
from clvol.staging.thickness import PERCENTILE, thickness

if TYPE_CHECKING:
    from collections.abc import Iterator
    from types import SimpleNamespace

    from clvol.staging.fixed import Fixed
    from clvol.staging.framing import View
    from clvol.staging.medium import Grids, Scales
    from clvol.staging.thickness import Rays


def said(
    grids: Grids, options: SimpleNamespace, view: View, rays: Rays, fixed: Fixed, scales: Scales
) -> Iterator[str]:
    """The lines."""
    yield _density(grids, options, rays, scales.density)
    if grids.burns:
        yield _glow(grids, options, scales)
    if grids.colour:
        yield f"colour   {_named(grids.colour.name)}: the albedo"
    axis, why = fixed.up
    yield f"up       {axis}{f': {why}' if why else ''}"
    name = next((n for n, pair in VIEWS.items() if pair == (view.azimuth, view.elevation)), "")
    placed = f"azimuth {view.azimuth:g}, elevation {view.elevation:g}, distance {view.distance:.4g}"
    yield f"camera   {name + ': ' if name else ''}{placed}"
    summary = LOOKS[options.light].summary if options.light in LOOKS else "an environment"
    dimmed = ", dimmed for what glows" if options.light in LOOKS and fixed.burns else ""
    yield f"light    {options.light}: {summary}{dimmed}"
    for option, why in _unused(options, fixed):
        yield f"unused   {option}: {why}"


def _unused(options: SimpleNamespace, fixed: Fixed) -> Iterator[tuple[str, str]]:
    """What was given and changes nothing, and why."""
    if options.sun_direction is not None and not (options.light in LOOKS and LOOKS[options.light].lamps):
        yield "the sun's direction", f"light {options.light} has no lamp of its own"
    if options.temperature_scale is not None and not fixed.burns:
        yield "the temperature's scale", "nothing glows"
    if options.emission_scale and not fixed.burns:
        yield "the emission's scale", "nothing glows"


def _density(grids: Grids, options: SimpleNamespace, rays: Rays, scale: float) -> str:
    name = _named(grids.density.name)
    if grids.density.empty:
        return f"density  {name}: empty, there is nothing to see"
    look = grids.density.look
    if look is not None:
        shown = f"by the preset {look.name}" if look.name else "by its transfer function"
        return f"density  values of {name} {shown}, times {scale:.4g}"
    cubic = ", voxels taken as cubes" if grids.density.cubic else ""
    albedo = "" if grids.colour else f"; albedo {', '.join(f'{one:g}' for one in options.albedo)}"
    thick = scale * thickness(rays.sample(grids.density.volume, grids.density.means), rays)
    depth = f"optical thickness {thick:.2g} at the {PERCENTILE:g}th percentile"
    return f"density  {name} times {scale:.4g}: {depth}{albedo}{cubic}"


def _glow(grids: Grids, options: SimpleNamespace, scales: Scales) -> str:
    bright = f"glow     {_named(glowing(grids).name)} times {scales.emission:g}"
    heat = grids.heat
    if heat is None:
        return f"{bright}, in its own colours"
    cold = f"; none up to {scales.coldest:g}" if scales.coldest else ""
    guessed = ", guessed" if options.temperature_scale is None and scales.kelvin != 1 else ""
    kelvin = f"times {scales.kelvin:.4g} K{guessed}: up to {scales.hottest(heat.peak):.0f} K{cold}"
    return f"{bright}, in the colour of {_named(heat.name)} {kelvin}"


def _named(name: str) -> str:
    return f"grid {name}" if name else "the volume"
