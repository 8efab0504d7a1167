"""Pictures of docs/mitsuba.md: `python tools/differences.py --mitsuba PYTHON`.

Each scene of docs/differences, as Mitsuba renders it and as clvol does.
"""

from __future__ import annotations

import os
from typing import TYPE_CHECKING

import click
import numpy as np
from benchmarks.mitsuba_side import MitsubaSide, mitsuba_python
from benchmarks.options import mitsuba_option
from docs_tables import ROOT
from matplotlib.figure import Figure
from recipes.drawing import save

import clvol

if TYPE_CHECKING:
    from pathlib import Path

DOCS = ROOT / "docs"
SCENES = sorted((DOCS / "differences").glob("*.xml"))
SPP = 256


def draw(scene: Path, python: str) -> Figure:
    """Mitsuba's picture of a scene, and clvol's."""
    with MitsubaSide(python, str(scene), {}, os.cpu_count() or 1) as worker:
        theirs, name = worker.render(SPP, 1)[0][..., :3], f"Mitsuba {worker.version}"
    ours = clvol.render(clvol.load_file(str(scene)), spp=SPP, seed=1).image
    figure = Figure(figsize=(8, 2.5), layout="constrained")
    for place, picture, title in zip(figure.subplots(1, 2), (theirs, ours), (name, "clvol"), strict=True):
        place.imshow(np.clip(np.asarray(picture), 0, 1) ** (1 / 2.2))
        place.set(xticks=[], yticks=[], title=title)
    return figure


@click.command(help=__doc__)
@mitsuba_option
def main(mitsuba: str | None) -> None:
    """Write a picture for each scene."""
    for scene in SCENES:
        save(draw(scene, mitsuba_python(mitsuba)), DOCS / "pictures" / f"mitsuba-{scene.stem}.png")


if __name__ == "__main__":
    main()
