"""`clvol render --tev` sends the picture as it refines; here to a viewer that is made up."""

from __future__ import annotations

import socket
import struct
import threading
from typing import TYPE_CHECKING

import numpy as np
import pytest
from click.testing import CliRunner
from places import SCENES

import clvol
from clvol.cli.main import main
from clvol.errors import OptionError
from clvol.picture.tev import PORT, parse_address

if TYPE_CHECKING:
    from pathlib import Path

pytest.importorskip("tevclient", reason="--tev needs tevclient, of the extra view")
CREATE, UPDATE = 4, 6
SLAB = str(SCENES / "slab.xml")


class Viewer:
    """Takes packets, as tev does: `images` by name, and how often their first pixel was sent.

    deaf : it goes away after so many packets.
    """

    def __init__(self, deaf: int | None = None) -> None:
        self.server = socket.create_server(("127.0.0.1", 0))
        self.address = f"127.0.0.1:{self.server.getsockname()[1]}"
        self.images: dict[str, np.ndarray] = {}
        self.sent: list[str] = []
        self.deaf = deaf
        self.thread = threading.Thread(target=self.serve, daemon=True)
        self.thread.start()

    def serve(self) -> None:
        connection, _ = self.server.accept()
        with connection, connection.makefile("rb") as stream:
            count = 0
            while (head := stream.read(4)) and count != self.deaf:
                (length,) = struct.unpack("<I", head)
                self.take(stream.read(length - 4))
                count += 1
            connection.setsockopt(socket.SOL_SOCKET, socket.SO_LINGER, struct.pack("ii", 1, 0))

    def take(self, packet: bytes) -> None:
        kind, rest = packet[0], packet[2:]
        name, _, rest = rest.partition(b"\0")
        if kind == CREATE:
            width, height, channels = struct.unpack("<3i", rest[:12])
            assert rest[12:].split(b"\0")[:channels] == [b"R", b"G", b"B", b"A"][:channels]
            self.images[name.decode()] = np.full((height, width, channels), np.nan, np.float32)
            return
        assert kind == UPDATE
        (channels,) = struct.unpack("<i", rest[:4])
        rest = rest[4:].split(b"\0", channels)[channels]
        x, y, width, height = struct.unpack("<4i", rest[:16])
        tile = np.frombuffer(rest[16 + 16 * channels :], "<f4").reshape(height, width, channels)
        self.images[name.decode()][y : y + height, x : x + width] = tile
        if (x, y) == (0, 0):
            self.sent.append(name.decode())


def test_the_picture_is_shown_as_it_refines_and_at_last_as_it_is_saved(tmp_path: Path) -> None:
    viewer, output = Viewer(), str(tmp_path / "a.exr")
    options = ["-D", "res=16", "--spp", "8", "--tev", viewer.address]
    done = CliRunner().invoke(main, ["render", SLAB, "-o", output, *options])
    assert done.exit_code == 0, done.output
    viewer.thread.join()
    assert list(viewer.images) == [output]
    assert len(viewer.sent) >= 2
    assert np.array_equal(viewer.images[output], clvol.load_result(output).image)


def test_large_pictures_go_in_tiles_with_their_alpha(tmp_path: Path) -> None:
    viewer, output = Viewer(), str(tmp_path / "a.exr")
    options = ["--size", "300x270", "--spp", "1", "--background", "transparent", "--tev", viewer.address]
    done = CliRunner().invoke(main, ["render", SLAB, "-o", output, "--quiet", *options])
    assert done.exit_code == 0, done.output
    viewer.thread.join()
    result = clvol.load_result(output)
    assert result.alpha is not None
    assert np.array_equal(viewer.images[output], np.dstack([result.image, result.alpha]))


def test_a_viewer_that_goes_away_costs_no_picture(tmp_path: Path) -> None:
    viewer, output = Viewer(deaf=1), tmp_path / "a.exr"
    options = ["--size", "600x600", "--spp", "1", "--tev", viewer.address]
    done = CliRunner().invoke(main, ["render", SLAB, "-o", str(output), *options])
    assert done.exit_code == 0 and output.is_file()
    assert done.stderr.count("the render goes on without it") == 1


def test_nobody_there_is_one_line_before_anything_is_rendered(tmp_path: Path) -> None:
    with socket.create_server(("127.0.0.1", 0)) as server:
        address = f"127.0.0.1:{server.getsockname()[1]}"
    done = CliRunner().invoke(main, ["render", SLAB, "-o", str(tmp_path / "a.exr"), "--tev", address])
    assert done.exit_code == 2 and done.stderr.count("\n") == 1
    assert f"nobody listens at {address}" in done.stderr
    assert not list(tmp_path.iterdir())


def test_addresses() -> None:
    assert parse_address("127.0.0.1:99") == ("127.0.0.1", 99)
    assert parse_address("localhost") == ("localhost", PORT)
    assert parse_address("[::1]:99") == ("::1", 99)
    for wrong in ("", ":1", "a:b", "a:0", "a:70000", "a:1:2", "scenes/x.xml", "a b:3"):
        with pytest.raises(OptionError, match="--tev takes HOST:PORT"):
            parse_address(wrong)
