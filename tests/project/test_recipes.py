"""Recipes: each stands on its page with its command, plot and table, and shows what it claims to."""

from __future__ import annotations

import pytest
from click.testing import CliRunner

NAMES = ("control", "probabilities", "residual", "majorants")


def test_every_recipe_is_on_the_page_with_its_command_plot_and_table(tool) -> None:
    page = (tool("folders").ROOT / "docs" / "recipes.md").read_text(encoding="utf-8")
    assert tuple(tool("recipes").RECIPES) == NAMES
    for name in NAMES:
        assert f"\npython tools/recipe.py {name} -o {name}.png\n" in page
        assert (tool("folders").ROOT / "docs" / "pictures" / f"recipe-{name}.png").is_file()
        _, _, rest = page.partition(f"<!-- {name}: written by tools/docs.py -->\n\n")
        table, ended, _ = rest.partition(f"\n\n<!-- end of {name} -->")
        assert ended and table.startswith("| ") and len(table.splitlines()) > 5


def rows(tool, name: str, tmp_path) -> list[list[str]]:
    """The table of a recipe that ran in short."""
    output = tmp_path / f"{name}.png"
    found = CliRunner().invoke(tool("recipe").main, [name, "--quick", "-o", str(output)])
    assert found.exit_code == 0, found.output
    assert output.read_bytes().startswith(b"\x89PNG")
    lines = [line for line in found.output.splitlines() if line.startswith("| ")]
    return [[cell.strip() for cell in line.strip("|").split("|")] for line in lines[2:]]


@pytest.mark.contract
def test_look_ups_of_decomposition_fall_as_the_control_grows(tool, tmp_path) -> None:
    found = rows(tool, "control", tmp_path)
    assert len(found) == 3
    for share, by_global, *_ in found:
        assert float(by_global) == pytest.approx(1 - float(share), abs=0.05)


@pytest.mark.contract
def test_variances_of_ratio_and_residual_ratio_are_the_exact_ones(tool, tmp_path) -> None:
    found = [row for row in rows(tool, "residual", tmp_path) if float(row[3]) > 1e-3]
    assert len(found) == 9
    for _, _, measured, exact, *_ in found:
        assert float(measured) == pytest.approx(float(exact), rel=0.2)  # 4096 walks


def test_a_recipe_that_is_none_is_told(tool) -> None:
    found = CliRunner().invoke(tool("recipe").main, ["residuum"])
    assert found.exit_code == 2 and "'residual'" in found.output
