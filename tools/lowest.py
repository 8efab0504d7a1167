#!/usr/bin/env python3
"""The lowest versions that pyproject.toml declares, as constraints for pip.

python tools/lowest.py > lowest.txt && pip install -c lowest.txt '.[test]'
"""

from __future__ import annotations

import tomllib
from typing import TYPE_CHECKING

import click
from folders import ROOT
from packaging.requirements import Requirement

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator

PROJECT = ROOT / "pyproject.toml"


def expanded(name: str, extras: dict[str, list[str]], requirements: Iterable[str]) -> Iterator[Requirement]:
    """The requirements, with the project's own extras (`name[extra]`) as what these consist of."""
    for requirement in map(Requirement, requirements):
        if requirement.name != name:
            yield requirement
        for extra in requirement.extras if requirement.name == name else ():
            yield from expanded(name, extras, extras[extra])


def lowest(requirements: Iterable[Requirement]) -> Iterator[str]:
    """`name==version` of each requirement's lower bound, which each must have."""
    for requirement in requirements:
        bounds = [spec.version for spec in requirement.specifier if spec.operator == ">="]
        if len(bounds) != 1:
            raise SystemExit(f"{PROJECT.name}: {requirement} has no lower bound")
        marker = f" ; {requirement.marker}" if requirement.marker else ""
        yield f"{requirement.name}=={bounds[0]}{marker}"


@click.command(help=__doc__)
def main() -> None:
    project = tomllib.loads(PROJECT.read_text(encoding="utf-8"))["project"]
    wanted = [*project["dependencies"], f"{project['name']}[test]"]
    print("\n".join(lowest(expanded(project["name"], project["optional-dependencies"], wanted))))


if __name__ == "__main__":
    main()
