"""What was chosen for a volume, in a line each."""

from __future__ import annotations

from typing import TYPE_CHECKING

from clvol.staging.looks import LOOKS
from clvol.staging.medium import albedo_of, glowing
from clvol.staging.options import VIEWS
from clvol.staging.thickness import PERCENTILE, thickness

if TYPE_CHECKING:
    from collections.abc import Iterator
    from types import SimpleNamespace

    from clvol.staging.framing import View
    from clvol.staging.medium import Grids
    from clvol.staging.source import Source
    from clvol.staging.stage import Fixed
    from clvol.staging.thickness import Rays


def said(
    source: Source, grids: Grids, options: SimpleNamespace, view: View, rays: Rays, fixed: Fixed
) -> Iterator[str]:
    """The lines; each names the option that changes it."""
    yield _density(grids, options, rays, fixed.scales.density)
    if grids.burns:
        yield _glow(grids, options, fixed)
    if grids.colour:
        yield f"colour   {_named(grids.colour.name)}: the albedo"
    axis, why = fixed.up
    yield f"up       {axis}{f': {why}' if why else ''}"
    name = next((n for n, pair in VIEWS.items() if pair == (view.azimuth, view.elevation)), "")
    placed = f"azimuth {view.azimuth:g}, elevation {view.elevation:g}, distance {view.distance:.4g}"
    yield f"camera   {name + ': ' if name else ''}{placed}"
    summary = LOOKS[options.light].summary if options.light in LOOKS else "an environment"
    dimmed = ", dimmed for what glows" if options.light in LOOKS and grids.burns else ""
    yield f"light    {options.light}: {summary}{dimmed}"


def _density(grids: Grids, options: SimpleNamespace, rays: Rays, scale: float) -> str:
    name = _named(grids.density.name)
    if grids.density.empty:
        return f"density  {name}: empty, there is nothing to see"
    cubic = ", voxels taken as cubes" if grids.density.cubic else ""
    albedo = ", ".join(f"{one:g}" for one in albedo_of(grids, options))
    thick = scale * thickness(rays.sample(grids.density.volume, grids.density.means), rays)
    return (
        f"density  {name} times {scale:g}: optical thickness {thick:.2g} at the {PERCENTILE:g}th percentile; "
        f"albedo {albedo}{cubic}"
    )


def _glow(grids: Grids, options: SimpleNamespace, fixed: Fixed) -> str:
    heat = grids.temperature or glowing(grids)
    scales = fixed.scales
    cold = f"; none up to {scales.coldest:g}" if scales.coldest else ""
    guessed = ", guessed" if options.temperature_scale is None and scales.kelvin != 1 else ""
    colour = (
        f"{_named(heat.name)} times {scales.kelvin:.4g} K{guessed}: up to {scales.hottest(heat.peak):.0f} K"
    )
    return (
        f"glow     {_named(glowing(grids).name)} times {scales.emission:g}, in the colour of {colour}{cold}"
    )


def _named(name: str) -> str:
    return f"grid {name}" if name else "the volume"
