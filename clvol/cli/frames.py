"""The frames of a sequence or a turntable, one after the other, whatever becomes of single ones."""

from __future__ import annotations

import os
import sys
from contextlib import ExitStack
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import click

from clvol.base.frames import MOST, Pattern, parse_frames
from clvol.cli.messages import exit_by, mention
from clvol.errors import DeviceError, Error

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator, Sequence

    import numpy as np
    from rich.console import Console

    from clvol.cli.pictures import Shown
    from clvol.cli.volumes import Asked
    from clvol.picture.result import Result
    from clvol.picture.video import Film
    from clvol.scene.records import Scene
    from clvol.staging.fixed import Fixed
    from clvol.staging.source import Source

FAILED = 1
"""Exit status where some frames could not be rendered."""


@dataclass(frozen=True)
class Frame:
    """One of them: its number, the scene or volume, its pictures, and how far the turntable is turned."""

    number: int
    name: str
    outputs: tuple[str, ...]
    turn: float | None = None


@dataclass(frozen=True)
class Frames:
    """What is to be rendered.

    Parameters
    ----------
    frames : in their order.
    films : names of films of all of them.
    whole : volumes of the whole sequence, from which framing and scales are chosen; none for scenes.
    """

    frames: tuple[Frame, ...]
    films: tuple[str, ...]
    whole: tuple[str, ...] = ()

    @classmethod
    def of(
        cls, asked: Asked, outputs: Sequence[str], frames: str | None, turntable: int | None
    ) -> Frames | None:
        """None where one picture is asked for; click.UsageError for what does not go together."""
        from clvol.picture.video import is_film

        films = tuple(output for output in outputs if is_film(output))
        pictures = [output for output in outputs if output not in films]
        source = Pattern.of(asked.name)
        if source is None and turntable is None:
            if frames is not None:
                raise click.UsageError("--frames is for sequences as smoke.####.vdb and for --turntable")
            if films:
                raise click.UsageError(
                    f"{films[0]}: a film takes a sequence as smoke.####.vdb, or --turntable"
                )
            return None
        patterns = [cls._pattern(output) for output in pictures]
        if turntable is not None:
            if source is not None or not asked.is_volume:
                raise click.UsageError("--turntable turns one volume")
            found = list(range(1, turntable + 1))
        else:
            assert source is not None
            found = source.found()
            if not found and frames is None:
                raise click.UsageError(f"{asked.name}: there are no such files")
        numbers = found if frames is None else parse_frames(frames)
        if turntable is not None and (beyond := [n for n in numbers if not 1 <= n <= turntable]):
            raise click.UsageError(f"--frames {beyond[0]}: the turntable has frames 1 to {turntable}")
        made = tuple(
            Frame(
                number,
                asked.name if source is None else source.at(number),
                tuple(pattern.at(number) for pattern in patterns),
                None if turntable is None else 360.0 * (number - 1) / turntable,
            )
            for number in numbers
        )
        _check_distinct(made)
        whole = (asked.name,) if source is None else tuple(map(source.at, found)) if asked.is_volume else ()
        return cls(made, films, whole)

    @staticmethod
    def _pattern(output: str) -> Pattern:
        pattern = Pattern.of(output)
        if pattern is None:
            hint = "name it as out.####.png, or out.mp4"
            raise click.UsageError(f"{output}: has no place for a frame's number; {hint}")
        return pattern

    @property
    def first_outputs(self) -> tuple[str, ...]:
        """What the first frame writes, to be checked before anything is rendered."""
        return self.frames[0].outputs if self.frames else ()


@dataclass
class Series:
    """The work: renders each frame, and keeps count of what became of it.

    Parameters
    ----------
    render : a scene and names of pictures to a result that is saved under them.
    """

    asked: Asked
    frames: Frames
    render: Callable[[Scene, Sequence[str]], Result]
    shown: Shown
    size: tuple[int, int] | None
    overwrite: bool
    quiet: bool
    console: Console
    fps: float
    _turned: Source | None = None  # the volume on the turntable is read once
    _told: bool = False  # what was chosen for all frames

    def run(self) -> None:
        """Render all frames; exits with 1 where some failed, and as the signal says that ended it."""
        from clvol.picture.video import Film

        failures: dict[Frame, str] = {}
        skipped = 0
        interrupted = False
        with ExitStack() as stack:
            films = [stack.enter_context(Film(name, self.fps)) for name in self.frames.films]
            fixed = self._fixed()
            for place, frame in enumerate(self.frames.frames):
                if self._is_there(frame) and (not films or self._add_made(films, frame)):
                    skipped += 1
                    continue
                try:
                    result = self._one(frame, fixed, place)
                    if result.stats["interrupted"]:
                        interrupted = True
                        break
                    for film in films:
                        film.add(self._pixels(result))
                except DeviceError:
                    raise
                except (Error, OSError, MemoryError) as error:
                    said = error.told(command=True) if isinstance(error, Error) else str(error)
                    failures[frame] = said or "out of memory"
                    mention([f"clvol: frame {frame.number} failed: {failures[frame]}"], err=True)
        self._tell(failures, skipped, interrupted)
        if failures and not interrupted:
            sys.exit(FAILED)
        exit_by(interrupted)

    def _fixed(self) -> Fixed | None:
        """What all frames share; None for scenes, and of one volume what its first frame has."""
        if not self.frames.whole:
            return None
        from clvol.base.progress import bar_of
        from clvol.cli.volumes import size_of
        from clvol.staging.sequence import survey

        with bar_of(self.console) as bar:
            task = bar.add_task("looking at frames", total=None)
            return survey(self.frames.whole, self.asked.given, size_of(self.size), lambda: bar.advance(task))

    def _one(self, frame: Frame, fixed: Fixed | None, place: int) -> Result:
        from clvol.staging.source import Source

        if frame.turn is None or self._turned is None:
            self._turned = Source.of(frame.name)
        asked = replace(self.asked, name=frame.name)
        scene, lines = asked.open(self.size, self._turned, fixed, frame.turn)
        if not self._told and not self.quiet:
            mention(lines)
        self._told = True
        result = self.render(scene, frame.outputs)
        if not self.quiet:
            from clvol.base.progress import format_noise

            names = ", ".join(frame.outputs) or f"frame {frame.number}"
            noise, seconds = format_noise(result.noise), result.metadata["seconds"]
            count = f"{place + 1} of {len(self.frames.frames)}"
            mention([f"{names}: {result.samples[1]} spp, {seconds:.2f} s, noise {noise} ({count})"])
        return result

    def _pixels(self, result: Result) -> np.ndarray:
        """What a display shows, uint8 (height, width, 3)."""
        import numpy as np

        height, width = result.image.shape[:2]
        data = replace(self.shown, component_format=None).encoder(result)(".ppm")
        return np.frombuffer(data[-3 * width * height :], np.uint8).reshape(height, width, 3)

    def _is_there(self, frame: Frame) -> bool:
        """Whether it was rendered before, and is not to be again."""
        return not self.overwrite and bool(frame.outputs) and all(map(os.path.exists, frame.outputs))

    def _add_made(self, films: Sequence[Film], frame: Frame) -> bool:
        """Whether a frame's earlier picture could be added to the films."""
        import numpy as np

        from clvol.base.image_reading import UnreadableError, read_stored

        for output in frame.outputs:
            try:
                stored = read_stored(output, channels=3)
            except UnreadableError:
                continue
            if stored.type_name == "uint8" and stored.pixels.shape[2] == 3:
                for film in films:
                    film.add(np.asarray(stored.pixels, np.uint8))
                return True
        return False

    def _tell(self, failures: dict[Frame, str], skipped: int, interrupted: bool) -> None:
        """What became of them."""
        if interrupted:
            mention(["clvol: interrupted; the frame under way is not saved"], err=True)
        if not self.quiet:
            mention(self._summary(failures, skipped))
        if failures:
            lines = [f"  frame {frame.number}, {frame.name}: {what}" for frame, what in failures.items()]
            mention(
                [f"clvol: error: {len(failures)} of {len(self.frames.frames)} frames failed", *lines],
                err=True,
            )

    def _summary(self, failures: dict[Frame, str], skipped: int) -> Iterator[str]:
        if skipped:
            yield f"{skipped} frames were there already: --overwrite renders them again"
        for film in self.frames.films:
            if os.path.exists(film):
                yield f"{film}: the film"


def _check_distinct(frames: Sequence[Frame]) -> None:
    """Refuse pictures that would replace what is to be rendered, whatever the links to them."""
    rendered = {os.path.realpath(frame.name) for frame in frames}
    for output in (output for frame in frames for output in frame.outputs):
        if os.path.realpath(output) in rendered:
            raise click.UsageError(f"{output}: would replace a frame of the sequence")


def check_series(options: dict[str, Any], shown: Shown, trace: str | None, frames: Frames) -> None:
    """click.UsageError for what makes sense of one picture alone."""
    if shown.exposure == "auto":
        raise click.UsageError("--exposure auto differs from frame to frame: give a number of stops")
    if trace is not None or options["profile"]:
        raise click.UsageError("--profile and --trace are for one picture, not for many")
    if not frames.frames:
        raise click.UsageError("there are no frames")


def frame_options(command: Any) -> Any:
    """Options of sequences and turntables."""
    from clvol.cli.options import positive_option

    for option in (
        positive_option("--fps", default=24.0, metavar="N", help="Frames of a film a second; 24 by default."),
        click.option("--overwrite", is_flag=True, help="Render frames again that are there already."),
        click.option(
            "--turntable",
            type=click.IntRange(1, MOST),
            metavar="N",
            help="Turn the volume once, in N frames.",
        ),
        click.option(
            "--frames",
            metavar="LIST",
            help="Frames of a sequence, as 1-100:2; all that there are by default.",
        ),
    ):
        command = option(command)
    return command
