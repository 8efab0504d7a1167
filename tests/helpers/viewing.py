"""A viewer, and pages that talk to it without a browser."""

from __future__ import annotations

import json
import struct
import time
from contextlib import contextmanager
from typing import TYPE_CHECKING, Any

from places import SCENES

import clvol

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator

SLAB = str(SCENES / "slab.xml")
SECONDS = 60


class Page:
    """What a page does: it sends wishes, and takes what comes."""

    def __init__(self, connection: Any) -> None:
        self.connection = connection
        self.scene = self.take("scene")

    def send(self, wish: object) -> None:
        self.connection.send(wish if isinstance(wish, str | bytes) else json.dumps(wish))

    def next(self) -> dict[str, Any]:
        data = self.connection.recv(timeout=SECONDS)
        (length,) = struct.unpack("<I", data[:4])
        return {**json.loads(data[4 : 4 + length]), "data": data[4 + length :]}

    def take(self, kind: str, fits: Callable[[dict[str, Any]], bool] = lambda said: True) -> dict[str, Any]:
        """The next of a kind that fits."""
        end = time.monotonic() + SECONDS
        while time.monotonic() < end:
            said = self.next()
            if said["kind"] == kind and fits(said):
                return said
        raise AssertionError(f"there came no {kind}")

    def last(self) -> dict[str, Any]:
        """The best picture."""
        return self.take("picture", lambda said: said["is_last"])


@contextmanager
def page_of(server: Any, path: str = "live") -> Iterator[Page]:
    from websockets.sync.client import connect

    with connect(server.address.replace("http", "ws", 1) + path, max_size=1 << 26) as connection:
        yield Page(connection)


def serving(spp: int, size: tuple[int, int] = (16, 16)) -> Any:
    """A server of the slab."""
    from clvol.viewer.server import Server
    from clvol.viewer.subject import Subject

    words = ["clvol", "render", SLAB]
    server = Server(Subject(clvol.load_file(SLAB), words, size=size), {}, spp)
    server.start()
    return server
