"""Packages that only a part of clvol needs, in extras of their own (pyproject.toml)."""

from __future__ import annotations

from importlib import import_module

from clvol.errors import OptionError


def need_matplotlib(what: str) -> None:
    """Raise OptionError, with the command that installs it, where matplotlib is missing; `what` needs it."""
    try:
        import_module("matplotlib")
    except ImportError as error:
        hint = "install it with: pip install 'clvol[report]'"
        raise OptionError(f"{what} needs matplotlib ({error})", hint=hint) from None
