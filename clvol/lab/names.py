"""What a user asks to compare or to watch: names by family.  Light, for the command line's sake."""

from __future__ import annotations

import logging
from typing import TYPE_CHECKING

from clvol.base.arguments import listed
from clvol.errors import OptionError, shown
from clvol.planning.registry import FAMILIES, PILOT, check_choice

if TYPE_CHECKING:
    from collections.abc import Iterable, Mapping

log = logging.getLogger("clvol")


def plural(family: str) -> str:
    """A family's name for several of its names: "techniques"."""
    return f"{family[:-1]}ies" if family.endswith("y") else f"{family}s"


def names_asked(options: Mapping[str, str | Iterable[str]]) -> dict[str, tuple[str, ...]]:
    """Names by family from keywords such as ``techniques=["delta", "spectral"]`` or ``technique="delta"``.

    Names may be given as a list, or as one string with commas; a family may be in the singular or the plural.
    OptionError for an unknown family or name, a family given twice, and an empty list.
    """
    families = {spelling: family for family in FAMILIES for spelling in (family, plural(family))}
    asked: dict[str, tuple[str, ...]] = {}
    for spelling, value in options.items():
        if spelling not in families:
            raise OptionError(
                f"unknown family {spelling!r}", hint=f"choose from {', '.join(map(plural, FAMILIES))}"
            )
        family = families[spelling]
        if family in asked:
            raise OptionError(f"{family} is given twice", hint=f"give {plural(family)} once, as a list")
        asked[family] = _each_once(family, split_names(family, value))
    return {family: asked.get(family, ("auto",)) for family in FAMILIES}


def split_names(family: str, value: str | Iterable[str]) -> tuple[str, ...]:
    """Names of one family, in the order given; OptionError for none, and for one that won't do here."""
    parts = value.split(",") if isinstance(value, str) else listed(value)
    if parts is None:
        raise OptionError(f"{family}: {shown(value)} is not a list of names", hint="give strings")
    names = [name for part in parts if (name := str(part).strip())]
    if not names:
        raise OptionError(f"no {family} is given", hint="give a name, several with commas, or auto")
    if PILOT in names:
        raise OptionError(f"{PILOT} is for clvol render only", hint=f"name each {family} here, or auto")
    return tuple(check_choice(family, name) for name in names)


def _each_once(family: str, names: tuple[str, ...]) -> tuple[str, ...]:
    once = tuple(dict.fromkeys(names))
    for name in once:
        if names.count(name) > 1:
            log.warning("%s %s is asked for more than once, and measured once", family, name)
    return once
