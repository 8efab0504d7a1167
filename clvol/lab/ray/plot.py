"""A ray's view as a figure: to the left what each technique walks, to the right what its walks estimate."""

from __future__ import annotations

from matplotlib.figure import Figure
from matplotlib.layout_engine import ConstrainedLayoutEngine

from clvol.errors import printable
from clvol.lab.ray.estimates import estimates
from clvol.lab.ray.walks import UNNAMED
from clvol.lab.ray.walks_panel import symbols, walks_panel
from clvol.lab.ray.watched import CHANNEL_NAMES, WatchedRay


def draw(view: WatchedRay) -> Figure:
    """The whole figure, for a slide: 16 inches wide, as high as what is watched needs."""
    rows = len(view.watched)
    layout = ConstrainedLayoutEngine(w_pad=0.06, h_pad=0.05, wspace=0.03, hspace=0.0)
    figure = Figure(figsize=(16, max(9.0, 1.75 * rows + 1.9)), layout=layout)
    columns = figure.add_gridspec(1, 2, width_ratios=(1.15, 1.0))
    panels = columns[0].subgridspec(rows, 1, hspace=0.1)
    first = None
    for row, watched in enumerate(view.watched):
        first = walks_panel(figure, panels[row], view, watched, first, row == rows - 1)
    estimates(figure, columns[1], view, first)
    figure.suptitle(_title(view), fontsize=15, fontweight="bold", parse_math=False)
    figure.legend(
        handles=symbols(view),
        loc="outside lower center",
        ncols=5,
        frameon=False,
        fontsize=10,
        title="  ".join([*view.notes, *view.bound_notes]) or None,
        title_fontsize=9,
    )
    return figure


def _title(view: WatchedRay) -> str:
    channel = f", {CHANNEL_NAMES[view.channel]} channel" if len(view.sigma_t) > 1 else ""
    x, y = view.pixel
    where = "" if view.medium == UNNAMED else f", in {view.medium}"
    return f"{printable(view.scene)}, ray through pixel ({x}, {y}){where}{channel}"
