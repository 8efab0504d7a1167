"""What papers claim, with this renderer's own figures: `python tools/recipe.py NAME -o NAME.png`.

Prints a table and draws a plot. Each takes less than two minutes on two cores; docs/recipes.md says what they
show.
"""

from __future__ import annotations

import importlib
from pathlib import Path

import click
from documents import writable
from recipes import RECIPES


@click.command(help=f"{__doc__}\n\n\b\n" + "\n".join(f"{name:14} {what}" for name, what in RECIPES.items()))
@click.argument("name", type=click.Choice(list(RECIPES)))
@click.option(
    "-o",
    "--output",
    type=click.Path(path_type=Path),
    callback=writable,
    metavar="FILE.png",
    help="Plot; NAME.png by default.",
)
@click.option("--quick", is_flag=True, help="Much smaller, to see that it runs; its figures mean little.")
def main(name: str, output: Path | None, quick: bool) -> None:
    click.echo(importlib.import_module(f"recipes.{name}").run(output or Path(f"{name}.png"), quick))


if __name__ == "__main__":
    main()
