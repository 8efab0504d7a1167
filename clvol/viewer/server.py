"""The page's server: hands out the page, takes wishes and sends pictures, to those who know its address."""

from __future__ import annotations

import asyncio
import json
import secrets
import socket
import struct
import threading
from importlib.resources import files
from typing import TYPE_CHECKING, Any

from clvol.base.extras import need
from clvol.errors import Error, OptionError
from clvol.lab.combinations import unbiased
from clvol.picture.denoising import need_denoiser
from clvol.planning import registry
from clvol.viewer.access import HEADERS, LOOPBACK, guarded, listening
from clvol.viewer.painter import Painter
from clvol.viewer.wish import Wish

if TYPE_CHECKING:
    from collections.abc import Mapping

    from starlette.requests import Request
    from starlette.responses import Response
    from starlette.types import ASGIApp
    from starlette.websockets import WebSocket

    from clvol.viewer.painter import Painted
    from clvol.viewer.subject import Subject

_PAGE = {"": "text/html", "viewer.js": "text/javascript", "viewer.css": "text/css"}
"""Files of the page, and what they are."""
_PICTURES = {"exr": "image/x-exr", "png": "image/png"}
"""What a picture can be saved as."""
_LONGEST = 1 << 16
"""Bytes of a wish at most."""
_GRACE = 2
"""Seconds that connections have to end."""
_PATIENCE, _GLANCE = 60.0, 0.05
"""Seconds that who saves a picture waits for one that is not coarse, and after which it looks again."""


class Server:
    """Serves a subject until it is closed.

    Parameters
    ----------
    options : of `clvol.render`.
    spp : samples per pixel at which a picture is good enough.
    host, port : where to listen; port 0 is any that is free.
    first : what is seen at first.

    Raises
    ------
    OptionError : the extra `view` is missing, or there is no listening there.
    """

    def __init__(
        self,
        subject: Subject,
        options: Mapping[str, Any],
        spp: int,
        host: str = LOOPBACK,
        port: int = 0,
        first: Wish | None = None,
    ) -> None:
        for module in ("starlette", "uvicorn", "websockets"):
            need(module, "the viewer", "view")
        import uvicorn

        if first is not None and first.denoise:
            need_denoiser()
        self.subject, self.first = subject, first or Wish()
        self.token = secrets.token_urlsafe(24)
        self._host = host
        self._audience: set[asyncio.Queue[bytes]] = set()
        self._loop: asyncio.AbstractEventLoop | None = None
        self.painter = Painter(subject, options, spp, self._show, self._fail, self.first)
        self._socket = listening(host, port)
        config = uvicorn.Config(
            guarded(self._application(), self.token),
            log_level="critical",
            access_log=False,
            lifespan="off",
            ws_max_size=_LONGEST,
            timeout_graceful_shutdown=_GRACE,
        )
        self._server = uvicorn.Server(config)
        self._thread = threading.Thread(target=self._serve, name="clvol server", daemon=True)

    @property
    def address(self) -> str:
        """Of the page."""
        host = {"0.0.0.0": socket.gethostname(), "::": socket.gethostname()}.get(self._host, self._host)
        bracketed = f"[{host}]" if ":" in host else host
        return f"http://{bracketed}:{self._socket.getsockname()[1]}/{self.token}/"

    def start(self) -> None:
        """Serve, in a thread."""
        self._thread.start()
        self.painter.start()
        self.painter.want(self.first)

    def alive(self) -> bool:
        """Whether it serves."""
        return self._thread.is_alive()

    def close(self) -> None:
        """End everything."""
        self._server.should_exit = True
        self.painter.close()
        if self._thread.ident is not None:
            self._thread.join()
        self._socket.close()

    def _serve(self) -> None:
        self._server.run(sockets=[self._socket])

    def _application(self) -> ASGIApp:
        from starlette.applications import Starlette
        from starlette.routing import Route, WebSocketRoute

        return Starlette(
            routes=[
                *(Route(f"/{name}", self._file) for name in _PAGE),
                Route("/picture.{kind}", self._picture),
                WebSocketRoute("/live", self._live),
            ]
        )

    async def _file(self, request: Request) -> Response:
        from starlette.responses import Response

        name = request.url.path.rpartition("/")[2]
        data = (files("clvol.viewer") / "page" / (name or "index.html")).read_bytes()
        return Response(data, media_type=_PAGE[name], headers=HEADERS)

    async def _picture(self, request: Request) -> Response:
        """The picture as it is now, as a file."""
        from starlette.responses import PlainTextResponse, Response

        kind = request.path_params["kind"]
        if kind not in _PICTURES:
            return PlainTextResponse("no such picture", 404, headers=HEADERS)
        end = asyncio.get_running_loop().time() + _PATIENCE
        while (painted := self.painter.latest) is None or painted.coarse:
            if self._server.should_exit or asyncio.get_running_loop().time() > end:
                return PlainTextResponse("there is no picture yet", 503, headers=HEADERS)
            await asyncio.sleep(_GLANCE)
        data = await asyncio.to_thread(self._file_of, painted, f".{kind}")
        headers = {**HEADERS, "Content-Disposition": f'attachment; filename="view.{kind}"'}
        return Response(data, media_type=_PICTURES[kind], headers=headers)

    @staticmethod
    def _file_of(painted: Painted, suffix: str) -> bytes:
        """As the picture is shown; those between the pictures of a page may not be denoised yet."""
        if painted.wish.denoise and painted.result.denoised is None:
            painted.result.denoise()
        return painted.result.encode(suffix, painted.wish.exposure)

    async def _live(self, connection: WebSocket) -> None:
        """One page: its wishes come in, pictures go out."""
        from starlette.websockets import WebSocketDisconnect

        await connection.accept()
        self._loop = asyncio.get_running_loop()
        queue: asyncio.Queue[bytes] = asyncio.Queue(maxsize=1)
        self._audience.add(queue)
        sending = asyncio.create_task(self._send(connection, queue))
        try:
            await connection.send_bytes(_message(self._greeting()))
            if (painted := self.painter.latest) is not None:
                self._put(queue, await asyncio.to_thread(self._encoded, painted))
            while True:
                await self._take(connection)
        except (WebSocketDisconnect, RuntimeError):  # RuntimeError: it was closed while we sent
            pass
        finally:
            self._audience.discard(queue)
            sending.cancel()

    async def _take(self, connection: WebSocket) -> None:
        """One wish."""
        try:
            wish = Wish.of(json.loads(await connection.receive_text()))
        except (Error, ValueError, RecursionError, KeyError) as error:
            await connection.send_bytes(_message({"kind": "error", "text": _said(error)}))
        else:
            await asyncio.to_thread(self.painter.want, wish)

    @staticmethod
    async def _send(connection: WebSocket, queue: asyncio.Queue[bytes]) -> None:
        from starlette.websockets import WebSocketDisconnect

        try:
            while True:
                await connection.send_bytes(await queue.get())
        except (WebSocketDisconnect, RuntimeError):
            return

    def _greeting(self) -> dict[str, Any]:
        families = {
            family: {name: entry.summary for name, entry in registry.FAMILIES[family].items()}
            for family in ("technique", "transmittance")
        }
        name = self.subject.scene.source or "scene"
        first = {name: getattr(self.first, name) for name in (*families, "denoise", "exposure")}
        return {
            "kind": "scene",
            "denoiser": _has_denoiser(),
            "name": name,
            "families": families,
            "compared": list(unbiased("technique")),
            "first": first,
            **self.subject.described(),
        }

    def _encoded(self, painted: Painted) -> bytes:
        result, about = painted.result, painted.result.metadata
        opaque = result.alpha is None
        spp = result.samples[1]
        height, width = result.image.shape[:2]
        said = {
            "kind": "picture",
            "type": "image/jpeg" if opaque else "image/png",
            "width": width,
            "height": height,
            "coarse": painted.coarse,
            "is_last": painted.is_last,
            "spp": spp,
            "most": self.painter.spp,
            "noise": _finite(result.noise),
            "rate": _finite(painted.rate),
            "seconds": _finite(about["seconds"]),
            "wished": painted.wish.technique,
            "technique": about["technique"],
            "transmittance": about["transmittance"],
            "seen": repr(painted.wish.seen),
            "command": self.subject.command(painted.wish, spp),
        }
        return _message(said, result.encode(".jpg" if opaque else ".png", painted.wish.exposure))

    def _show(self, painted: Painted) -> None:
        if self._audience:
            self._publish(self._encoded(painted))

    def _fail(self, error: Exception) -> None:
        self._publish(_message({"kind": "error", "text": _said(error) or "out of memory"}))

    def _publish(self, message: bytes) -> None:
        """To all pages, from the thread that renders."""
        if self._loop is not None and not self._loop.is_closed():
            self._loop.call_soon_threadsafe(self._put_all, message)

    def _put_all(self, message: bytes) -> None:
        for queue in self._audience:
            self._put(queue, message)

    @staticmethod
    def _put(queue: asyncio.Queue[bytes], message: bytes) -> None:
        """A page that is slow gets the latest only."""
        if queue.full():
            queue.get_nowait()
        queue.put_nowait(message)


def _finite(number: float) -> float | None:
    number = float(number)
    return number if abs(number) < float("inf") else None


def _has_denoiser() -> bool:
    try:
        need_denoiser()
    except OptionError:
        return False
    return True


def _message(said: dict[str, Any], picture: bytes = b"") -> bytes:
    """Length of what is said, that, and the picture."""
    words = json.dumps(said).encode()
    return struct.pack("<I", len(words)) + words + picture


def _said(error: Exception) -> str:
    """What is wrong, in the words of the command line, where whoever looks at the page came from."""
    return error.told(command=True) if isinstance(error, Error) else str(error)
