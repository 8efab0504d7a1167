"""A plan in lines of text: what `clvol info SCENE` and `clvol render -v` print of it."""

from __future__ import annotations

import textwrap
from typing import TYPE_CHECKING

from clvol import layout
from clvol.planning.compiled import filled_slots, plan_macros
from clvol.planning.in_force import reasons, used_names
from clvol.planning.lanes import said, widths

if TYPE_CHECKING:
    from collections.abc import Iterator

    from clvol.planning.decisions import Decisions

WIDTH = 110


def describe_plan(plan: Decisions) -> Iterator[str]:
    """Choices with their reasons, features, channels, stages, the path's state, and what is compiled."""
    yield "choices"
    why, macros = reasons(plan), plan_macros(plan)
    for family, name in used_names(plan).items():
        yield f"  {family:<14} {name:<22} {why[family]}".rstrip()
    yield from _paragraph("features", plan.features.found() or "none")
    yield f"channels: {_channels(plan)}"
    if plan.walks_majorants:
        yield f"majorant cells: {_cells(plan)}"
    if widths(plan):
        yield from _paragraph("lanes", said(plan))
    yield "stages, in the order of launches: from which queue, to which"
    for name in layout.launched(macros):
        stage = layout.stage(name)
        towards = layout.targets(stage, macros)
        yield f"  {name:<21} {stage.empties:<10} {', '.join(towards)}"
    fields = layout.path_fields(macros)
    yield from _paragraph("path state", f"{4 * len(fields)} bytes per slot: {_values(macros)}")
    yield from _paragraph("headers chosen, in cl/", ", ".join(chosen_headers(plan)))
    yield from _paragraph("macros other than 0, CLVOL_", ", ".join(_defined(plan, macros)))


def _defined(plan: Decisions, macros: layout.Macros) -> Iterator[str]:
    """Macros other than 0; numbered choices in force by name; sizes of groups once a device has said them."""
    used = used_names(plan)
    for macro, value in macros.items():
        name = macro.removeprefix("CLVOL_")
        if name in ("LOCAL_SIZE", "GROUP_SLOTS") and not plan.tuning.known:
            continue
        if name in ("ABSORPTION", "ROULETTE", "PROBABILITY"):
            if used[name.lower()] != "none":
                yield f"{name}={layout.ENUMS[name][value]}"
        elif value:
            yield f"{name}={value}"


def _values(macros: layout.Macros) -> str:
    """The path's values, and of how many fields each is where there are several."""
    counts = {declared.name: len(declared.fields(macros)) for declared in layout.PATH_STATE}
    return ", ".join(f"{name} ({n})" if n > 1 else name for name, n in counts.items() if n)


def chosen_headers(plan: Decisions) -> list[str]:
    """Headers of the choices in force, under cl/."""
    slots = filled_slots(plan)
    used = ["sampler"]
    if plan.features.heterogeneous:
        used += ["lookup", "technique", *(["transmittance"] if plan.nee else [])]
    if plan.walks_majorants:
        used.append("majorant")
    return [f"{family} {slots[family]}" for family in used if family in slots]


def _channels(plan: Decisions) -> str:
    if plan.channels == 1:
        return "1, everything is grey"
    if plan.one_channel_per_path:
        return "3, a path follows one of them, and a sample is a path for each"
    apart = "attenuated differently" if plan.extinction == 3 else "attenuated alike"
    return f"3, a path follows all of them, which are {apart}"


def _cells(plan: Decisions) -> str:
    """What the cells of the majorant carry."""
    needs = plan.needs
    found = [f"a bound of the density{f', times {needs.scale:g}' if needs.scale != 1 else ''}"]
    if plan.needs_controls:
        found.append(f"the technique's control ({needs.control})")
    if plan.needs_residuals:
        found.append(f"residual-ratio's control ({needs.residual}) and the bound of what it leaves")
    return "; ".join(found)


def _paragraph(title: str, text: str) -> list[str]:
    return textwrap.wrap(f"{title}: {text}", WIDTH, subsequent_indent="  ", break_on_hyphens=False)
