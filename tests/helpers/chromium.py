"""Chromium without a window, told what to do by its DevTools protocol."""

from __future__ import annotations

import base64
import json
import shutil
import subprocess
import tempfile
import time
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import pytest

SECONDS = 60
"""After which something that is waited for will not come."""


def find() -> str | None:
    """Its executable."""
    return next(filter(None, map(shutil.which, ("chromium", "chromium-browser", "google-chrome"))), None)


class Tab:
    """A page.  `messages`: what it wrote to its console, and what went wrong in it."""

    def __init__(self, connection: Any) -> None:
        self.connection, self.last, self.messages = connection, 0, []
        for domain in ("Page", "Runtime", "Log", "Network"):
            self.ask(f"{domain}.enable")

    def ask(self, method: str, **parameters: Any) -> dict[str, Any]:
        """Send a command; its answer."""
        self.last += 1
        self.connection.send(json.dumps({"id": self.last, "method": method, "params": parameters}))
        while True:
            message = json.loads(self.connection.recv(timeout=SECONDS))
            if message.get("id") == self.last:
                assert "error" not in message, message
                return message["result"]
            if message.get("method") in (
                "Runtime.consoleAPICalled",
                "Runtime.exceptionThrown",
                "Log.entryAdded",
                "Network.loadingFailed",
            ):
                self.messages.append(message)

    def value(self, expression: str) -> Any:
        """What some JavaScript evaluates to, awaited."""
        answer = self.ask(
            "Runtime.evaluate", expression=expression, returnByValue=True, awaitPromise=True, userGesture=True
        )
        assert "exceptionDetails" not in answer, answer
        return answer["result"].get("value")

    def until(self, expression: str) -> Any:
        """Wait until it is true."""
        end = time.monotonic() + SECONDS
        while not (found := self.value(expression)):
            assert time.monotonic() < end, f"{expression} did not come; {self.messages}"
            time.sleep(0.05)
        return found

    def mouse(self, kind: str, x: float, y: float, **more: Any) -> None:
        self.ask("Input.dispatchMouseEvent", type=kind, x=x, y=y, **more)

    def drag(self, start: tuple[float, float], end: tuple[float, float], steps: int = 5) -> None:
        """With the left button."""
        self.mouse("mousePressed", *start, button="left", buttons=1, clickCount=1)
        for step in range(1, steps + 1):
            share = step / steps
            place = (a + share * (b - a) for a, b in zip(start, end, strict=True))
            self.mouse("mouseMoved", *place, button="left", buttons=1)
        self.mouse("mouseReleased", *end, button="left", buttons=0, clickCount=1)

    def screenshot(self) -> bytes:
        return base64.b64decode(self.ask("Page.captureScreenshot", format="png")["data"])


@contextmanager
def opened(address: str, size: tuple[int, int] = (1280, 800)) -> Any:
    """A tab with the page; the test is skipped where there is no browser."""
    executable = find()
    if executable is None:
        pytest.skip("there is no chromium to open the page in")
    from websockets.sync.client import connect

    with tempfile.TemporaryDirectory(prefix="clvol-chromium-", ignore_cleanup_errors=True) as folder:
        options = [
            *("--headless=new", "--no-sandbox", "--disable-gpu", "--disable-dev-shm-usage", "--no-first-run"),
            *("--remote-debugging-port=0", f"--user-data-dir={folder}", "--window-size={},{}".format(*size)),
        ]
        process = subprocess.Popen(
            [executable, *options, "about:blank"], stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL
        )
        try:
            port = _port(Path(folder) / "DevToolsActivePort", process)
            with connect(_target(port), max_size=1 << 26) as connection:
                tab = Tab(connection)
                tab.ask("Page.navigate", url=address)
                tab.until("location.href !== 'about:blank' && document.readyState === 'complete'")
                yield tab
        finally:
            process.terminate()
            process.wait()


def _port(file: Path, process: subprocess.Popen[bytes]) -> int:
    end = time.monotonic() + SECONDS
    while not (file.is_file() and file.read_text().count("\n")):
        assert process.poll() is None and time.monotonic() < end, "chromium did not start"
        time.sleep(0.05)
    return int(file.read_text().split()[0])


def _target(port: int) -> str:
    """The address of the first tab."""
    from urllib.request import urlopen

    end = time.monotonic() + SECONDS
    while time.monotonic() < end:
        with urlopen(f"http://127.0.0.1:{port}/json/list") as answer:
            pages = [one for one in json.load(answer) if one["type"] == "page"]
        if pages:
            return pages[0]["webSocketDebuggerUrl"]
        time.sleep(0.05)
    raise AssertionError("chromium has no tab")
