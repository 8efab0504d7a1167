"""Experiments that repeat what papers claim; tools/recipe.py runs them, and docs/recipes.md shows them."""

RECIPES = {
    "control": "delta against decomposition as the control grows",
    "probabilities": "max, average and history probabilities in a chromatic medium",
    "residual": "ratio against residual ratio tracking",
    "majorants": "global majorant, grid and kd-tree as a volume gets emptier",
}
"""Modules of this folder.  Each has run(output, quick), which draws a plot and returns a Markdown table."""
