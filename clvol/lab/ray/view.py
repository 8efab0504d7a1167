"""What `clvol.trace_ray` returns: one camera ray and its walks, as a figure, text and files."""

from __future__ import annotations

import json
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from clvol.base.extras import need_matplotlib
from clvol.base.output_files import check_file, check_spares, output_suffix, write_file
from clvol.lab.digits import up_to_error
from clvol.lab.ray.walks import Watched, format_estimate
from clvol.lab.ray.watched import WatchedRay
from clvol.version import __version__

if TYPE_CHECKING:
    from os import PathLike

    from matplotlib.figure import Figure

SUFFIXES = (".png", ".svg", ".pdf", ".json")


class RayView(WatchedRay):
    """A ray that was watched, to look at; the fields are those of `WatchedRay`."""

    def figure(self) -> Figure:
        """The view as a matplotlib figure; OptionError where matplotlib is not installed."""
        need_matplotlib("the figure of a ray")
        from clvol.lab.ray.plot import draw

        return draw(self)

    def summary(self) -> list[str]:
        """A line on the ray and one on each technique and transmittance."""
        depth, error = self.depth[self.channel, -1], self.depth_error[self.channel]
        lines = [
            f"{self.medium}: {self.place.length:.4g} long, {self.place.distance:.4g} from the camera; "
            f"optical depth {up_to_error(depth, error)}, transmittance {self.exact}"
        ]
        for watched in self.watched:
            mean, error = watched.transmitted(self.channel)
            lines.append(
                f"  {watched.label}: transmittance {format_estimate(mean, error)}, "
                f"{watched.per_walk('lookups')} look-ups and {watched.per_walk('tentative')} tentative "
                "collisions per walk"
            )
        return lines + [f"  {note}" for note in self.notes]

    def to_dict(self) -> dict[str, Any]:
        """Everything that is shown, as numbers, lists and text."""
        return {
            "scene": self.scene,
            "pixel": list(self.pixel),
            "medium": self.medium,
            "seed": self.seed,
            "device": self.device,
            "version": __version__,
            "notes": list(self.notes),
            "distance": self.place.distance,
            "length": self.place.length,
            "channel": self.channel,
            "sigma_t": self.sigma_t.tolist(),
            "transmittance": self.transmittance[:, -1].tolist(),
            "watched": [self._watched_dict(watched) for watched in self.watched],
        }

    def _watched_dict(self, watched: Watched) -> dict[str, Any]:
        cells = watched.cells
        names = ("t", "t_end", "majorant")
        known = {} if cells is None else {name: cells[name].tolist() for name in names}
        for name, values in (("rate", watched.rate()), ("control", watched.control(self.channel))):
            if values is not None:
                known[name] = values.tolist()
        mean, error = watched.transmitted(self.channel)
        return {
            "family": watched.family,
            "name": watched.name,
            "biased": watched.biased,
            "majorant": watched.majorant,
            "cells": known,
            "walks": len(watched.outcomes),
            "transmittance": mean,
            "standard_error": error,
            "lookups": watched.mean("lookups"),
            "tentative": watched.mean("tentative"),
            "shown": [asdict(walk) for walk in watched.walks],
        }

    def save(self, path: str | PathLike[str]) -> None:
        """Write the view as .png, .svg, .pdf (the figure) or .json (the numbers), by the path's suffix.

        Raises OptionError for another suffix, or a file that cannot be written or that the scene is read
        from; an earlier file is replaced only once the new one is complete.
        """
        check_output(path)
        check_spares(path, self.files)
        write_file(path, self._encoded(Path(path).suffix.lower()[1:], 150))

    def _encoded(self, kind: str, dpi: int) -> bytes:
        """The numbers as JSON, or the figure in a format of matplotlib's."""
        import io

        if kind == "json":
            return (json.dumps(_finite(self.to_dict()), indent=1) + "\n").encode()
        buffer = io.BytesIO()
        self.figure().savefig(buffer, format=kind, dpi=dpi)
        return buffer.getvalue()

    def _repr_png_(self) -> bytes:
        """The figure, for notebooks."""
        return self._encoded("png", 100)


def check_output(path: str | PathLike[str]) -> None:
    """Raise OptionError now for a path that `RayView.save` could not write later."""
    if output_suffix(path, SUFFIXES) != ".json":
        need_matplotlib("the figure of a ray (all but .json)")
    check_file(path)


def _finite(value: Any) -> Any:
    """The same with None for numbers that JSON cannot say."""
    if isinstance(value, dict):
        return {name: _finite(entry) for name, entry in value.items()}
    if isinstance(value, list | tuple):
        return [_finite(entry) for entry in value]
    if isinstance(value, float) and not np.isfinite(value):
        return None
    return value
