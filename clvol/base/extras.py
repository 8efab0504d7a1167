"""Packages that only a part of clvol needs, in extras of their own (pyproject.toml)."""

from __future__ import annotations

from importlib import import_module
from typing import Any

from clvol.errors import OptionError


def need(module: str, what: str, extra: str) -> Any:
    """A module of a package that `extra` installs, which `what` needs.

    Raises OptionError, with the command that installs it, where it is missing.
    """
    try:
        return import_module(module)
    except ImportError as error:
        hint = f"install it with: pip install 'clvol[{extra}]'"
        package = module.partition(".")[0]
        raise OptionError(f"{what} needs {package} ({error})", hint=hint) from None


def need_matplotlib(what: str) -> None:
    """Raise OptionError, with the command that installs it, where matplotlib is missing; `what` needs it."""
    need("matplotlib", what, "report")
