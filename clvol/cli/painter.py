"""Renders scenes and saves their pictures, as the command line of `clvol render` says."""

from __future__ import annotations

import math
from contextlib import nullcontext
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, NoReturn

from clvol.cli.messages import exit_by, mention
from clvol.errors import Error

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator, Sequence

    from rich.console import Console

    from clvol.api.sequence import Pictures
    from clvol.base.output_files import StrPath
    from clvol.cli.pictures import Shown
    from clvol.cli.volumes import Asked
    from clvol.picture.profile import Profile
    from clvol.picture.result import Result
    from clvol.picture.tev import Tev
    from clvol.scene.records import Scene


@dataclass
class Painter:
    """Renders scenes and saves the pictures, as the command line says."""

    asked: Asked
    options: dict[str, Any]
    shown: Shown
    trace: str | None
    quiet: bool
    console: Console
    tev: Tev | None = None

    def result(self, scene: Scene, outputs: Sequence[str]) -> Result:
        """Render a scene that fits the outputs."""
        import clvol
        from clvol.base.progress import RichProgress, Several

        self.check(scene, outputs)
        piloted = self.options["technique"] == "auto:pilot"
        if piloted and not self.quiet and not self.console.is_terminal:
            from clvol.lab.repeat import announcement

            mention([announcement(scene, self.options)], err=True)
        if self.tev:
            self.tev.begin(outputs[0] if outputs else "clvol")
        with nullcontext() if self.quiet else RichProgress(self.console) as bar:
            watching = Several(*(one for one in (bar, self.tev) if one is not None))
            result: Result = clvol.render(scene, progress=watching, **self.options)
        if self.tev:
            self.tev.finish(result)
        if piloted:
            from clvol.lab.repeat import with_definitions

            result.metadata["repeat"] = with_definitions(
                result.metadata["repeat"], self.asked.definitions, self.asked.assignments
            )
        return result

    def check(self, scene: Scene, outputs: Sequence[str]) -> None:
        """Refuse outputs that would replace what is rendered, or could not hold the picture."""
        from clvol.base.output_files import check_spares

        for output in outputs if self.trace is None else (*outputs, self.trace):
            check_spares(output, scene.files)
        _check_room(scene, outputs, self.options)

    def frame(self, scene: Scene, outputs: Sequence[str]) -> Result:
        """Render and save one of many; one that was ended early is not saved."""
        result = self.result(scene, outputs)
        if not result.stats["interrupted"]:
            self.save(result, outputs)
        return result

    def save(self, result: Result, outputs: Sequence[str]) -> None:
        """Save one of many."""
        from clvol.picture.saving import save_all

        self.shown = self.shown.fixed(result)  # or the film would flicker
        for failure in save_all(self.shown.encoder(result), outputs).values():
            raise failure

    def pictures(self, scene_of: Callable[[int], Scene]) -> Pictures | None:
        """Many pictures on the workers of a cluster; None where there is no cluster."""
        from clvol.api.sequence import Pictures

        client = self.options["client"]
        return None if client is None else Pictures(client, self.options, scene_of)

    def picture(self, outputs: Sequence[str], profiled: bool) -> NoReturn:
        """Render and save the only one, tell of it, and exit."""
        from clvol.cli.profile import profile_lines
        from clvol.picture.saving import save_all

        loaded, lines = self.asked.open(self.options["size"])
        if lines and not self.quiet:
            mention(lines)
        result = self.result(loaded, outputs)
        failures = save_all(self.shown.encoder(result), outputs)
        if self.trace is not None and result.profile:
            failures |= _save_trace(result.profile, self.trace)
        written = [output for output in outputs if output not in failures]
        if result.stats["interrupted"]:
            saved = ", saved what there is" if written else ""
            mention([f"clvol: interrupted after {result.samples[1]} spp{saved}"], err=True)
        if not self.quiet:
            mention([*_summary(result, written), *self.shown.said(result)])
        if profiled and result.profile:
            mention(profile_lines(result.profile))
        for failure in failures.values():
            raise failure
        exit_by(result.stats["interrupted"])


def _check_room(loaded: Scene, outputs: Sequence[str], options: dict[str, Any]) -> None:
    """Refuse files that could not hold the picture."""
    from clvol.picture.formats import check_holds
    from clvol.picture.saving import check_disk
    from clvol.scene.views import viewed

    film = viewed(loaded, options["sensor"], options["size"]).film
    for output in outputs:
        check_holds(output, alpha=film.has_alpha, size=film.window[2:])
        check_disk(output, math.prod(film.window[2:]), len(options["aov"]))


def _save_trace(profile: Profile, path: str) -> dict[StrPath, Error]:
    """Write the trace; what went wrong with it, if anything."""
    try:
        profile.save_trace(path)
    except Error as error:
        return {path: error}
    return {}


def _summary(result: Result, written: Sequence[str]) -> Iterator[str]:
    """What was written, what it cost and how sure it is."""
    from clvol.base.progress import format_noise

    height, width = result.image.shape[:2]
    about, count = result.metadata, result.samples[1]
    seconds = about["seconds"]
    rate = width * height * count / max(seconds, 1e-9)
    mean = " on the mean" if "target_error" in about else ""
    yield f"{', '.join(written) or 'not saved'}: {width} x {height} pixels, {count} spp{mean}"
    yield f"  {seconds:.2f} s, {rate:,.0f} samples/s, noise {format_noise(result.noise)}"
    choices = ("technique", "transmittance", "majorant", "lookup")
    used = [f"{key} {about[key]}" for key in choices if about[key] != "none" or key == "transmittance"]
    lookups = result.stats["lookups"] / max(width * height * count, 1)
    if used == ["transmittance none"]:
        yield "  no media"
    else:
        yield f"  {', '.join(used)}; {lookups:.4g} look-ups per sample"
    if "pilot" in about:
        yield f"  pilot: {about['pilot_reason']}; repeat with"
        yield f"  {about['repeat']}"
