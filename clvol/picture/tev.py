"""Pictures that are shown in tev, an image viewer, while they render: over its network protocol.

Its own package makes the packets; the connection is ours, so that a viewer that hangs, or goes away, costs
seconds and no picture.
"""

from __future__ import annotations

import logging
import re
import socket
import time
from typing import TYPE_CHECKING, Self

import numpy as np

from clvol.base.extras import need
from clvol.errors import OptionError, shown

if TYPE_CHECKING:
    from clvol.base.progress import Progress
    from clvol.picture.result import Result

log = logging.getLogger("clvol")
PORT = 14158
"""Where tev listens, unless it is told otherwise."""
PATIENCE = 5.0
"""Seconds that tev may take to accept anything."""
PACE, SHARE = 0.5, 0.1
"""Seconds between pictures at least, and the share of the time that sending them may take."""
TILE = 256
"""Pixels of the sides of what one packet holds."""


class Tev:
    """Sends a picture to tev whenever there is more of it; a callback for the progress of a render.

    Use it as a context manager.

    Parameters
    ----------
    address : HOST:PORT.

    Raises
    ------
    OptionError : the extra `view` is missing, the address is none, or nobody listens there.
    """

    self_paced = True

    def __init__(self, address: str) -> None:
        self.packet = need("tevclient.packet", "--tev", "view")
        self.address = address
        self.begin("clvol")
        host, port = parse_address(address)
        try:
            self._socket: socket.socket | None = socket.create_connection((host, port), PATIENCE)
        except (OSError, UnicodeError) as error:
            hint = "start tev first, or name its machine: --tev HOST:PORT"
            raise OptionError(f"nobody listens at {address} ({error})", "--tev", hint) from None

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_exception: object) -> None:
        if self._socket is not None:
            self._socket.close()
            self._socket = None

    def begin(self, name: str) -> None:
        """From now on it is another picture, which tev calls so."""
        self.name = name
        self._shape: tuple[int, ...] = ()
        self._due = 0.0

    def __call__(self, record: Progress) -> None:
        """Show the picture so far, unless one was shown just before."""
        started = time.perf_counter()
        if self._socket is None or started < self._due or record.what != "rendering":
            return
        if (image := record.image) is not None:
            self.show(image)
            now = time.perf_counter()
            self._due = now + max(PACE, (now - started) / SHARE)

    def finish(self, result: Result) -> None:
        """Show what came of the render, with its alpha."""
        layers = [result.image] if result.alpha is None else [result.image, result.alpha]
        self.show(np.dstack(layers))

    def show(self, image: np.ndarray) -> None:
        """Show linear radiance (height, width, 3), or 4 with alpha; warn once of a viewer that is gone."""
        if self._socket is None:
            return
        try:
            self._send(self._socket, np.asarray(image, np.float32))
        except OSError as error:
            log.warning("tev at %s is gone (%s): the render goes on without it", self.address, error)
            self.__exit__()

    def _send(self, connection: socket.socket, image: np.ndarray) -> None:
        height, width, channels = image.shape
        names = list("RGBA"[:channels])
        if image.shape != self._shape:
            connection.sendall(self.packet.create_image(self.name, width, height, names, not self._shape))
            self._shape = image.shape
        for y in range(0, height, TILE):
            for x in range(0, width, TILE):
                tile = image[y : y + TILE, x : x + TILE]
                connection.sendall(self.packet.update_image(self.name, tile, names, x, y, False))


def parse_address(text: str) -> tuple[str, int]:
    """Host and port of HOST:PORT, or of a host alone; OptionError for what is neither."""
    found = re.fullmatch(r"(\[[^\]]+\]|[^:\[\]/\s]+)(?::(\d{1,5}))?", text)
    port = int(found[2] or PORT) if found else 0
    if not found or not 0 < port < 1 << 16:
        raise OptionError(f"--tev takes HOST:PORT, not {shown(text)}", hint=f"as localhost:{PORT}")
    return found[1].strip("[]"), port
