"""`clvol view`: a scene or a volume in the browser, while it renders."""

from __future__ import annotations

import threading
import webbrowser
from typing import TYPE_CHECKING, Any

import click

from clvol.base.interrupts import ENDING, interruptible
from clvol.cli.messages import logging_to, tell
from clvol.cli.options import (
    ExplainedCommand,
    Size,
    assignments_option,
    definitions_option,
    device_option,
    family_options,
    skip_option,
)
from clvol.cli.pictures import Stops
from clvol.cli.volumes import Asked, Background, spelled, volume_options, write_looks

if TYPE_CHECKING:
    import logging
    from contextlib import AbstractContextManager

EXAMPLES = """
\b
Examples:
  clvol view smoke.vdb
  clvol view scenes/cloud.xml --size 512x512
  clvol view scenes/fire.vdb --light studio --no-browser --port 8080
"""
SPP = 1024
"""Samples at which a picture is good enough to rest."""
LARGEST = 768
"""Pixels of the longer side, where none are asked for."""
_WAIT = 0.2
"""Seconds after which a wait looks whether there is still something to wait for."""


class ViewCommand(ExplainedCommand):
    """As `ExplainedCommand`, and what lights there are."""

    def format_epilog(self, ctx: click.Context, formatter: click.HelpFormatter) -> None:
        """Write a section of them before the rest."""
        write_looks(formatter)
        super().format_epilog(ctx, formatter)


@click.command(cls=ViewCommand, epilog=EXAMPLES)
@click.argument("scene", metavar="SCENE")
@volume_options
@click.option("--background", type=Background(), default="auto", help="As of clvol render.")
@family_options("background")
@click.option(
    "--size", type=Size(), metavar="WxH", help="Pixels, as 640x480; those of the scene's film up to 768."
)
@click.option(
    "--sensor", type=click.IntRange(min=0), metavar="N", help="Which of the scene's sensors, from 0."
)
@click.option(
    "--spp", type=click.IntRange(min=1), default=SPP, help=f"Samples after which it rests; {SPP} by default."
)
@click.option("--exposure", type=Stops(), default=0.0, metavar="STOPS|auto", help="Brighten what is shown.")
@click.option("--denoise", is_flag=True, help="Show the picture without its noise.")
@click.option("--seed", type=click.IntRange(min=0), help="Same seed, same bits; the scene's own by default.")
@device_option
@definitions_option
@skip_option
@assignments_option
@click.option(
    "--host",
    default="127.0.0.1",
    metavar="ADDRESS",
    help="Where to listen: this machine alone by default; 0.0.0.0: others that know the address may look, "
    "too, and what is sent is not encrypted.",
)
@click.option(
    "--port", type=click.IntRange(0, 65535), default=0, metavar="N", help="Any that is free by default."
)
@click.option("--no-browser", is_flag=True, help="Only print the address.")
def view(
    scene: str,
    definitions: tuple[tuple[str, str], ...],
    size: tuple[int, int] | None,
    spp: int,
    host: str,
    port: int,
    no_browser: bool,
    **options: Any,
) -> None:
    """Look at SCENE, a Mitsuba 3 XML file, a .pbrt file or a volume, in the browser.

    Drag turns it, drag with shift or the right button moves it, the wheel zooms. The picture refines while
    nothing changes. The page has knobs for density, light and exposure, and the command that renders what is
    seen. Ctrl-C ends it.
    """
    from clvol.base.progress import error_console
    from clvol.device.device import open_device
    from clvol.viewer.server import Server
    from clvol.viewer.subject import Subject
    from clvol.viewer.wish import Wish

    wished = ("technique", "transmittance", "denoise", "exposure")
    first = Wish.of({name: options.pop(name) for name in wished})
    words = _words(scene, definitions, options)
    asked = Asked.taken(scene, options, definitions)
    sensor = options.pop("sensor")
    with logging_to(error_console(), verbose=False), _said_once(), interruptible(ENDING) as interrupt:
        open_device(options["device"])
        loaded, lines = asked.open(size)
        subject = Subject(loaded, words, sensor or 0, size or _fitting(loaded, sensor))
        server = Server(subject, options, spp, host, port, first)
        try:
            interrupt.heed(patience=1)
            server.start()
            tell([*lines, f"clvol view: {server.address}", "Ctrl-C ends it."])
            if not no_browser:
                threading.Thread(target=webbrowser.open, args=(server.address,), daemon=True).start()
            ended = threading.Event()
            while server.alive() and not interrupt.asked():
                ended.wait(_WAIT)
        finally:
            server.close()


def _said_once() -> AbstractContextManager[None]:
    """Warnings of a scene, which is rendered again and again, are logged once."""
    from clvol.lab.quiet import log_filter

    said: set[str] = set()

    def is_new(record: logging.LogRecord) -> bool:
        known = record.getMessage() in said
        said.add(record.getMessage())
        return not known

    return log_filter(is_new)


def _fitting(scene: Any, sensor: int | None) -> tuple[int, int]:
    """The size of the film, smaller where it is large."""
    from clvol.scene.views import viewed

    width, height = viewed(scene, sensor).film.window[2:]
    if max(width, height) <= LARGEST:
        return width, height
    factor = LARGEST / max(width, height)
    return max(round(width * factor), 1), max(round(height * factor), 1)


def _words(scene: str, definitions: tuple[tuple[str, str], ...], options: dict[str, Any]) -> list[str]:
    """The command that renders the scene as it was asked for."""
    words = ["clvol", "render", scene]
    for name, text in definitions:
        words += ["-D", f"{name}={text}"]
    for name, value in options.items():
        if value is None or value is False or value == "auto":
            continue
        if name == "assignments":
            for parameter, text in value:
                words += ["--set", f"{parameter}={text}"]
        elif value is True:
            words.append(spelled(name))
        else:
            text = ",".join(f"{one:.9g}" for one in value) if isinstance(value, tuple) else _plain(value)
            words += [spelled(name), text]
    return words


def _plain(value: Any) -> str:
    """A value as the command line has it; of transfer functions these are names of presets."""
    from clvol.staging.transfer import Look

    return value.name if isinstance(value, Look) else str(value)
