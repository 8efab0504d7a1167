"""The frames of a sequence or a turntable, one after the other, whatever becomes of single ones."""

from __future__ import annotations

import os
import sys
from contextlib import ExitStack
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, Any

import click

from clvol.base.frames import MOST, Pattern, parse_frames
from clvol.cli.messages import exit_by, mention
from clvol.errors import DeviceError, Error

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

    import numpy as np
    from rich.console import Console

    from clvol.api.sequence import Pictures
    from clvol.cli.painter import Painter
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


class Reel:
    """Films of pictures that may come in another order: each is added once all before it were, or failed."""

    def __init__(self, films: Sequence[Film]) -> None:
        self._films = films
        self._waiting: dict[int, np.ndarray | None] = {}
        self._next = 0

    def put(self, place: int, pixels: np.ndarray | None) -> None:
        """The picture at a place, uint8 (height, width, 3); None where there is none."""
        self._waiting[place] = pixels
        while self._next in self._waiting:
            following = self._waiting.pop(self._next)
            self._next += 1
            if following is not None:
                for film in self._films:
                    film.add(following)


@dataclass
class Series:
    """The work: renders each frame, and keeps count of what became of it.

    Parameters
    ----------
    painter : renders and saves them.
    """

    asked: Asked
    frames: Frames
    painter: Painter
    shown: Shown
    size: tuple[int, int] | None
    overwrite: bool
    quiet: bool
    console: Console
    fps: float
    _turned: Source | None = None  # the volume on the turntable is read once
    _told: bool = False  # what was chosen for all frames
    _failures: dict[Frame, str] = field(default_factory=dict)
    _skipped: int = 0

    def run(self) -> None:
        """Render all frames; exits with 1 where some failed, and as the signal says that ended it."""
        from clvol.picture.video import Film

        with ExitStack() as stack:
            films = [stack.enter_context(Film(name, self.fps)) for name in self.frames.films]
            fixed, reel = self._fixed(), Reel(films)
            frames = self.frames.frames
            pictures = self.painter.pictures(lambda place: self._scene(frames[place], fixed))
            left = self._left(reel, films)
            if pictures is not None and len(frames) > 1:
                interrupted = self._spread(pictures, left, reel)
            else:
                interrupted = self._one_by_one(left, fixed, reel)
        self._tell(interrupted)
        if self._failures and not interrupted:
            sys.exit(FAILED)
        exit_by(interrupted)

    def _left(self, reel: Reel, films: Sequence[Film]) -> Iterator[int]:
        """Places of the frames that are to be rendered; of others films get the pictures that there are."""
        for place, frame in enumerate(self.frames.frames):
            made = self._made(frame) if films and self._is_there(frame) else None
            if self._is_there(frame) and (not films or made is not None):
                self._skipped += 1
                reel.put(place, made)
            else:
                yield place

    def _one_by_one(self, left: Iterator[int], fixed: Fixed | None, reel: Reel) -> bool:
        """Render frames here; whether an end was asked for."""
        for place in left:
            frame, pixels = self.frames.frames[place], None
            try:
                result = self.painter.frame(self._scene(frame, fixed), frame.outputs)
                if result.stats["interrupted"]:
                    return True
                self._mention(place, result)
                pixels = self._pixels(result) if self.frames.films else None
            except DeviceError:
                raise
            except (Error, OSError, MemoryError) as error:
                self._fail(frame, error)
            reel.put(place, pixels)
        return False

    def _spread(self, pictures: Pictures, left: Iterator[int], reel: Reel) -> bool:
        """Have workers render whole frames; whether an end was asked for."""
        from clvol.base.interrupts import interruptible
        from clvol.base.progress import bar_of

        with interruptible() as interrupt, bar_of(self.console) as bar:
            interrupt.heed(patience=2)
            task = bar.add_task("frames", total=len(self.frames.frames))
            for place, found in pictures.results(left, interrupt.urgency):
                frame, pixels = self.frames.frames[place], None
                try:
                    if isinstance(found, Exception):
                        raise found
                    self.painter.save(found, frame.outputs)
                    self._mention(place, found)
                    pixels = self._pixels(found) if self.frames.films else None
                except (Error, OSError, MemoryError) as error:
                    self._fail(frame, error)
                reel.put(place, pixels)
                bar.update(task, completed=place + 1)
            return interrupt.asked()

    def _fail(self, frame: Frame, error: Error | OSError | MemoryError) -> None:
        """Note, and say, why there is no picture of a frame."""
        said = error.told(command=True) if isinstance(error, Error) else str(error)
        self._failures[frame] = said or "out of memory"
        mention([f"clvol: frame {frame.number} failed: {self._failures[frame]}"], err=True)

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

    def _scene(self, frame: Frame, fixed: Fixed | None) -> Scene:
        """The scene of a frame, which fits its outputs; what was chosen for all is told once."""
        from clvol.staging.source import Source

        if frame.turn is None or self._turned is None:
            self._turned = Source.of(frame.name)
        asked = replace(self.asked, name=frame.name)
        scene, lines = asked.open(self.size, self._turned, fixed, frame.turn)
        if not self._told and not self.quiet:
            mention(lines)
        self._told = True
        self.painter.check(scene, frame.outputs)
        return scene

    def _mention(self, place: int, result: Result) -> None:
        """Say that a frame is done."""
        if self.quiet:
            return
        from clvol.base.progress import format_noise

        frame = self.frames.frames[place]
        names = ", ".join(frame.outputs) or f"frame {frame.number}"
        noise, seconds = format_noise(result.noise), result.metadata["seconds"]
        count = f"{place + 1} of {len(self.frames.frames)}"
        mention([f"{names}: {result.samples[1]} spp, {seconds:.2f} s, noise {noise} ({count})"])

    def _pixels(self, result: Result) -> np.ndarray:
        """What a display shows, uint8 (height, width, 3)."""
        import numpy as np

        height, width = result.image.shape[:2]
        data = replace(self.shown, component_format=None).encoder(result)(".ppm")
        return np.frombuffer(data[-3 * width * height :], np.uint8).reshape(height, width, 3)

    def _is_there(self, frame: Frame) -> bool:
        """Whether it was rendered before, and is not to be again."""
        return not self.overwrite and bool(frame.outputs) and all(map(os.path.exists, frame.outputs))

    def _made(self, frame: Frame) -> np.ndarray | None:
        """A frame's earlier picture as films take it, if it was saved as such."""
        import numpy as np

        from clvol.base.image_reading import UnreadableError, read_stored

        for output in frame.outputs:
            try:
                stored = read_stored(output, channels=3)
            except UnreadableError:
                continue
            if stored.type_name == "uint8" and stored.pixels.shape[2] == 3:
                return np.asarray(stored.pixels, np.uint8)
        return None

    def _tell(self, interrupted: bool) -> None:
        """What became of them."""
        failures = self._failures
        if interrupted:
            mention(["clvol: interrupted; frames under way are not saved"], err=True)
        if not self.quiet:
            mention(self._summary())
        if failures:
            lines = [f"  frame {frame.number}, {frame.name}: {what}" for frame, what in failures.items()]
            mention(
                [f"clvol: error: {len(failures)} of {len(self.frames.frames)} frames failed", *lines],
                err=True,
            )

    def _summary(self) -> Iterator[str]:
        if self._skipped:
            yield f"{self._skipped} frames were there already: --overwrite renders them again"
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
