"""Who may look: those on this machine who know the address, in which there is a secret."""

from __future__ import annotations

import secrets
import socket
from typing import TYPE_CHECKING

from clvol.errors import OptionError

if TYPE_CHECKING:
    from starlette.types import ASGIApp, Receive, Scope, Send

LOOPBACK = "127.0.0.1"
HEADERS = {
    "Cache-Control": "no-store",
    "Content-Security-Policy": "default-src 'self'; img-src 'self' blob: data:; frame-ancestors 'none'",
    "Referrer-Policy": "no-referrer",  # the address is a secret
    "X-Content-Type-Options": "nosniff",
}
"""Of every answer."""


def listening(host: str, port: int) -> socket.socket:
    """A socket that listens; OptionError where that cannot be."""
    try:
        family = socket.getaddrinfo(host, port, type=socket.SOCK_STREAM)[0][0]
        return socket.create_server((host, port), family=family)
    except (OSError, OverflowError, UnicodeError) as error:
        raise OptionError(
            f"cannot listen on {host}, port {port}: {error}", hint="choose another --host or --port"
        ) from None


def guarded(application: ASGIApp, token: str) -> ASGIApp:
    """The application under the token, as a folder; everything else is not there."""

    async def inner(scope: Scope, receive: Receive, send: Send) -> None:
        first, slash, rest = scope["path"].lstrip("/").partition("/")
        if not (slash and secrets.compare_digest(first.encode(), token.encode())):
            await _refused(scope, receive, send)
            return
        await application({**scope, "path": f"/{rest}", "root_path": ""}, receive, send)

    return inner


async def _refused(scope: Scope, receive: Receive, send: Send) -> None:
    from starlette.responses import PlainTextResponse
    from starlette.websockets import WebSocketClose

    if scope["type"] == "websocket":
        await WebSocketClose(code=1008)(scope, receive, send)
    else:
        await PlainTextResponse("not found", 404)(scope, receive, send)
