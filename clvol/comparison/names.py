"""What a user asks to compare: names by family.  Light, for the command line's sake."""

from __future__ import annotations

from collections.abc import Iterable, Mapping

from clvol.errors import OptionError
from clvol.registry import FAMILIES, check_choice


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
        asked[family] = split_names(family, value)
    return {family: asked.get(family, ("auto",)) for family in FAMILIES}


def split_names(family: str, value: str | Iterable[str]) -> tuple[str, ...]:
    """Names of one family, in the order given and each once."""
    parts = value.split(",") if isinstance(value, str) else list(value)
    names = dict.fromkeys(str(part).strip() for part in parts)
    names.pop("", None)
    if not names:
        raise OptionError(f"no {family} is given", hint="give a name, several with commas, or auto")
    return tuple(check_choice(family, name) for name in names)
