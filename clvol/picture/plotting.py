"""A picture with labels: the volume's box and axes, the colours of values, a bar of a known length."""

from __future__ import annotations

from itertools import product
from typing import TYPE_CHECKING, Any

import numpy as np

from clvol.base.extras import need
from clvol.errors import OptionError, shown

if TYPE_CHECKING:
    from clvol.picture.scenery import Scenery
    from clvol.volumes.transfer import Transfers

LINE, HIDDEN = {"color": "#e8e8e8", "linewidth": 1.0}, {"linestyle": (0, (2, 3)), "alpha": 0.6}
EDGE = "#1a1a1a"
"""Behind lines and letters, so that they are read on any picture."""
DOTS_PER_INCH = 100
LEAST_INCHES = 4.0
BAR_INCHES = 1.1
"""Width of the bar of colours with its numbers."""
AROUND, LETTERS = "#262626", "#f4f4f4"
"""Behind what lies outside of the picture, and of letters."""
TICK = 0.02
"""Length of a tick, as a share of the picture's shorter side."""
MOST_TICKS = 20
"""Along an axis, however large it is in the picture."""
GAP = 3
"""Dots that are free round letters."""
SCALE_BAR = 0.22
"""Share of the picture's width that a scale bar of no given length has at most."""


def plot(
    picture: np.ndarray,
    scenery: Scenery | None,
    axes: bool,
    scalar_bar: bool | None,
    box: bool,
    scale_bar: Any,
) -> Any:
    """The figure of a picture, uint8 (height, width, 3 or 4)."""
    need("matplotlib", "a plot", "science")
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    has_bar = scalar_bar if scalar_bar is not None else bool(scenery and scenery.transfers)
    wants_length = scale_bar is not None and scale_bar is not False
    if scenery is None and (axes or has_bar or box or wants_length):
        raise OptionError(
            "the picture knows no volume to label",
            hint="plot the result of a render of one volume; axes=False, box=False shows the picture alone",
        )
    if has_bar and (scenery is None or scenery.transfers is None):
        hint = "render it with transfer=..., or leave scalar_bar out"
        raise OptionError("the volume has no transfer function to show the colours of", hint=hint)
    height, width = picture.shape[:2]
    figure = Figure(dpi=DOTS_PER_INCH, facecolor=AROUND)
    FigureCanvasAgg(figure)
    place = figure.add_axes((0, 0, 1, 1))
    place.imshow(
        picture, extent=(0, width, height, 0), interpolation="nearest" if width < 64 else "antialiased"
    )
    place.set_axis_off()
    size = min(width, height)
    reach = [np.array([[0.0, 0.0], [width, height]])]
    if scenery is not None:
        if box:
            reach.append(_draw_box(place, scenery))
        if axes:
            for side in range(3):
                reach.append(_draw_axis(place, scenery, side, size))
        if wants_length:
            _draw_scale_bar(place, scenery, scale_bar, width, height)
        if has_bar and scenery.transfers is not None:
            _draw_colours(figure, scenery.transfers)
    low, high = _corners(reach)
    most = np.array([[-1.0, -1.0], [1.0, 1.0]]) * size + np.array([[0.0, 0.0], [width, height]])
    for _ in range(2):  # letters keep their size when there is more to show
        low, high = np.maximum(low, most[0]), np.minimum(high, most[1])
        _lay_out(figure, low, high, size)
        low, high = _with_letters(place, low, high)
    _declutter(place)
    return figure


def _with_letters(place: Any, low: np.ndarray, high: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Corners in pixels of the picture of what all letters fit into, too."""
    ends = [place.transData.inverted().transform(box.get_points()) for box in map(_extent, place.texts)]
    margin = GAP * (high - low) / place.figure.bbox.size
    wider = (np.sort(end, axis=0) + np.array([-margin, margin]) for end in ends)
    return _corners([np.stack([low, high]), *wider])


def _corners(points: list[np.ndarray]) -> tuple[np.ndarray, np.ndarray]:
    """The least and the greatest of points (n, 2), but for those that are not in the picture's plane."""
    every = np.concatenate(points)
    every = every[np.isfinite(every).all(axis=1)]
    return every.min(axis=0), every.max(axis=0)


def _extent(text: Any) -> Any:
    """The box round letters, in dots of the figure."""
    return text.get_window_extent(text.figure.canvas.get_renderer())


def _declutter(place: Any) -> None:
    """Hide letters that are cut or lie over others; names of axes come first, then numbers in their order."""
    kept: list[Any] = []
    frame = place.get_window_extent().padded(1)
    for text in sorted(place.texts, key=lambda text: -text.get_fontsize()):
        box = _extent(text).padded(GAP)
        whole = frame.contains(*box.min) and frame.contains(*box.max)
        if not whole or any(box.overlaps(other) for other in kept):
            text.set_visible(False)
        else:
            kept.append(box)


def _lay_out(figure: Any, low: np.ndarray, high: np.ndarray, size: int) -> None:
    """The picture as large as it is, or larger where letters would be too large for it; the bar beside it.

    low, high : corners of what is shown, in pixels of the picture.
    """
    figure.axes[0].set(xlim=(low[0], high[0]), ylim=(high[1], low[1]))
    extent = high - low
    inches = extent * max(1 / DOTS_PER_INCH, LEAST_INCHES / size)
    bar = BAR_INCHES if len(figure.axes) > 1 else 0.0
    whole = float(inches[0]) + bar
    figure.set_size_inches(whole, float(inches[1]))
    figure.axes[0].set_position((0, 0, float(inches[0]) / whole, 1))
    if bar:
        figure.axes[1].set_position((float(inches[0] + 0.25 * bar) / whole, 0.1, 0.15 * bar / whole, 0.8))


def _stroke(width: float) -> list[Any]:
    from matplotlib import patheffects

    return [patheffects.withStroke(linewidth=width, foreground=EDGE, alpha=0.75)]


def _draw_box(place: Any, scenery: Scenery) -> np.ndarray:
    """The twelve sides; those behind the volume are dashed.

    Returns the pixels (n, 2) that they reach to.
    """
    shares = np.array(list(product((0.0, 1.0), repeat=3)))
    corners = scenery.corner + shares @ scenery.edges
    farthest = int(scenery.place(corners)[2].argmax())
    pixels = scenery.project(corners)
    for one, other in ((a, b) for a in range(8) for b in range(a) if (a ^ b) in (1, 2, 4)):
        style = LINE | (HIDDEN if farthest in (one, other) else {})
        place.plot(
            *pixels[[one, other]].T, **style, path_effects=None if farthest in (one, other) else _stroke(2.2)
        )
    seen: np.ndarray = pixels[np.isfinite(pixels).all(axis=1)]
    return seen if len(seen) else np.zeros((1, 2))


def _draw_axis(place: Any, scenery: Scenery, side: int, size: int) -> np.ndarray:
    """Ticks and numbers along that one of four parallel sides which is outermost in the picture.

    Returns the pixels (n, 2) that they reach to.
    """
    from matplotlib.ticker import MaxNLocator

    starts = []
    for others in product((0.0, 1.0), repeat=2):
        along = list(others)
        along.insert(side, 0.0)
        starts.append((along[0], along[1], along[2]))
    middle = scenery.project(scenery.middle[None])[0]
    ends = [
        scenery.project(np.array([scenery.corner_at(s), scenery.corner_at(s) + scenery.edges[side]]))
        for s in starts
    ]
    outward = []
    for pixels in ends:
        line = pixels[1] - pixels[0]
        normal = np.array([-line[1], line[0]]) / max(float(np.linalg.norm(line)), 1e-9)
        offset = float((pixels.mean(axis=0) - middle) @ normal)
        outward.append(normal * np.sign(offset or 1.0) * abs(offset))
    # far from the middle, and rather below or left of it
    score = [
        np.linalg.norm(o) + 0.6 * o[1] - 0.3 * o[0] if np.isfinite(o).all() else -np.inf for o in outward
    ]
    chosen = int(np.argmax(score))
    if not np.isfinite(score[chosen]):
        return np.zeros((1, 2))
    out = outward[chosen] / max(float(np.linalg.norm(outward[chosen])), 1e-9)
    name, first, last = scenery.extent(side)
    start, tick = scenery.corner_at(starts[chosen]), TICK * size
    length = float(np.linalg.norm(ends[chosen][1] - ends[chosen][0]))
    low, high = min(first, last), max(first, last)
    locator = MaxNLocator(nbins=int(np.clip(length / size * 7, 1, MOST_TICKS)), steps=[1, 2, 5, 10])
    values = np.asarray(locator.tick_values(low, high))
    letters = {
        "color": LETTERS,
        "fontsize": 8,
        "ha": "center",
        "va": "center",
        "path_effects": _stroke(2.0),
    }
    for value in values[(values >= low - 1e-9 * (high - low)) & (values <= high + 1e-9 * (high - low))]:
        at = scenery.project((start + scenery.edges[side] * (value - first) / (last - first))[None])[0]
        place.plot(*np.stack([at, at + tick * out]).T, **LINE, path_effects=_stroke(2.2))
        place.text(*(at + 2.4 * tick * out), f"{value:.6g}", **letters)
    unit = f" ({scenery.unit})" if scenery.unit else ""
    place.text(*(ends[chosen].mean(axis=0) + 6.2 * tick * out), f"{name}{unit}", **letters | {"fontsize": 10})
    border: np.ndarray = ends[chosen] + 4.2 * tick * out
    return np.concatenate([border, border.mean(axis=0, keepdims=True) + 3.0 * tick * out])


def _draw_scale_bar(place: Any, scenery: Scenery, asked: Any, width: int, height: int) -> None:
    """A bar of a known length, as it is at the middle of the volume."""
    steps = scenery.project(np.array([scenery.middle, scenery.middle + scenery.right]))
    per_length = float(np.linalg.norm(steps[1] - steps[0]))
    if not np.isfinite(per_length) or per_length <= 0:
        raise OptionError(
            "the middle of the volume is not in the picture, and a scale bar has no length there"
        )
    length = _round_length(SCALE_BAR * width / per_length)
    if asked is not True:
        if isinstance(asked, bool) or not isinstance(asked, int | float) or not 0 < asked < np.inf:
            raise OptionError(f"scale_bar must be True or a length, not {shown(asked)}")
        length = float(asked)
    pixels, left, low = length * per_length, 0.05 * width, 0.94 * height
    if pixels > 0.9 * width:
        hint = f"the picture is {width / per_length:.3g} wide there"
        raise OptionError(f"a scale bar of {length:g} does not fit into the picture", hint=hint)
    place.plot([left, left + pixels], [low, low], color=LETTERS, linewidth=3, path_effects=_stroke(5))
    text = f"{length:g} {scenery.unit}".strip()
    letters = {
        "color": LETTERS,
        "fontsize": 9,
        "ha": "center",
        "va": "bottom",
        "path_effects": _stroke(2.0),
    }
    place.text(left + pixels / 2, low - 0.015 * height, text, **letters)


def _round_length(most: float) -> float:
    """The greatest of 1, 2 and 5 times a power of ten that is not above."""
    power = 10.0 ** np.floor(np.log10(most))
    return float(max(step * power for step in (1, 2, 5) if step * power <= most * (1 + 1e-9)))


def _draw_colours(figure: Any, transfers: Transfers) -> None:
    """The colours of values from the first of the opacity's points to the last, and how opaque they are."""
    place, opacity = figure.add_axes((0.9, 0.1, 0.03, 0.8)), transfers.sigma_t
    low, high = float(opacity.values[0]), float(opacity.values[-1])
    high = high if high > low else low + 1.0
    values = np.linspace(low, high, 256)
    colours = np.ones((256, 3)) if transfers.albedo is None else transfers.albedo(values)
    if transfers.emission is not None and transfers.albedo is None:
        colours = transfers.emission(values)
        colours = colours / max(colours.max(), 1e-9)
    linear = np.clip(colours, 0, 1)
    encoded = np.where(linear <= 0.0031308, 12.92 * linear, 1.055 * linear ** (1 / 2.4) - 0.055)  # sRGB
    opaque = opacity(values)[:, 0]
    strength = opaque / max(opaque.max(), 1e-30)
    place.imshow(encoded[:, None], origin="lower", extent=(0, 1, low, high), aspect="auto")
    place.plot(strength, values, color="white", linewidth=1.4, path_effects=_stroke(3.0))
    place.set(xlim=(0, 1), ylim=(low, high), xticks=[])
    place.yaxis.tick_right()
    place.tick_params(labelsize=8, colors=LETTERS)
    place.set_title("value", fontsize=9, color=LETTERS)
    place.set_xlabel("opacity", fontsize=8, color=LETTERS, labelpad=8)
    for spine in place.spines.values():
        spine.set_color(LETTERS)
