"""The viewer's server, without a browser: wishes go in, pictures come out, and strangers see nothing."""

from __future__ import annotations

import io
import json
import shlex
import signal
import subprocess
import sys
from http.client import HTTPConnection
from typing import TYPE_CHECKING, Any
from urllib.parse import urlsplit
from urllib.request import urlopen

import numpy as np
import pytest
from click.testing import CliRunner
from viewing import SLAB, page_of, serving

import clvol
from clvol.cli.main import main
from clvol.errors import OptionError
from clvol.scene.assignments import assign
from clvol.viewer.server import Server
from clvol.viewer.subject import Subject
from clvol.viewer.wish import Wish

if TYPE_CHECKING:
    from pathlib import Path

    from viewing import Page


def status(server: Any, path: str) -> int:
    place = urlsplit(server.address)
    connection = HTTPConnection(place.hostname or "", place.port, timeout=30)
    connection.request("GET", path)
    return connection.getresponse().status


def shown(server: Any, page: Page, wish: dict[str, Any]) -> dict[str, Any]:
    """Wish for it, and wait for its last picture."""
    page.send(wish)
    expected = Wish.of(wish)
    return page.take(
        "picture", lambda said: said["is_last"] and said["command"] == server.subject.command(expected, 4)
    )


def test_all_requests_need_the_token(server: Any) -> None:
    token = urlsplit(server.address).path
    assert len(token) >= 24
    for path in ("", "viewer.js", "viewer.css"):
        assert status(server, token + path) == 200
    assert status(server, token.rstrip("/")) == 404
    assert status(server, token + "nothing") == 404
    assert status(server, token + "../server.py") == 404
    wrong = token[:-2] + ("A" if token[-2] != "A" else "B")
    strange = ("//", "/%ff%00/", "/%C3%A9/", f"{wrong}/", f"{wrong}/viewer.js")
    for path in ("/", "/viewer.js", "/picture.exr", *strange):
        assert status(server, path) == 404, path


def test_sockets_need_the_token(server: Any) -> None:
    from websockets.exceptions import InvalidStatus

    token = urlsplit(server.address).path
    with pytest.raises(InvalidStatus), page_of(server, "../" + token[1:5] + "/live"):
        pass


def test_it_listens_on_this_machine_alone(server: Any) -> None:
    assert urlsplit(server.address).hostname == "127.0.0.1"
    assert server._socket.getsockname()[0] == "127.0.0.1"


def test_a_wish_changes_the_picture_and_its_command_renders_the_same_bits(
    server: Any, tmp_path: Path
) -> None:
    with page_of(server) as page:
        assert {"density"} <= set(page.scene["knobs"]) and page.scene["size"] == [16, 16]
        before = page.last()
        eye, target, up = (page.scene["camera"][n : n + 3] for n in (0, 3, 6))
        camera = [*(x + 0.2 for x in eye), *target, *up]
        wish = {"camera": camera, "density": 2.5, "technique": "delta", "exposure": 1}
        after = shown(server, page, wish)
    assert after["data"] != before["data"]
    assert (
        "--technique delta" in after["command"]
        and after["spp"] == 4
        and after["noise"] > 0
        and after["rate"] > 0
    )
    with urlopen(server.address + "picture.exr") as answer:
        (tmp_path / "seen.exr").write_bytes(answer.read())
    with urlopen(server.address + "picture.png") as answer:
        seen = answer.read()
    words = shlex.split(after["command"])
    assert words[:3] == ["clvol", "render", SLAB]
    words[words.index("view.png")] = str(tmp_path / "view.png")
    done = CliRunner().invoke(main, [*words[1:], "-o", str(tmp_path / "again.exr"), "--quiet"])
    assert done.exit_code == 0, done.output
    images = [clvol.load_result(tmp_path / name).image for name in ("seen.exr", "again.exr")]
    assert np.array_equal(*images)
    assert np.array_equal(pixels(seen), pixels((tmp_path / "view.png").read_bytes()))


def pixels(data: bytes) -> np.ndarray:
    from PIL import Image

    return np.asarray(Image.open(io.BytesIO(data)))


def test_nothing_turned_is_the_scene_as_it_is(server: Any) -> None:
    with page_of(server) as page:
        said = shown(server, page, {})
    assert said["command"].endswith("-o view.png --size 16x16 --spp 4")


def test_exposure_shows_the_same_samples_again(server: Any) -> None:
    with page_of(server) as page:
        dark = shown(server, page, {"density": 1.5})
        rendered = server.painter.latest.result
        bright = shown(server, page, {"density": 1.5, "exposure": 3})
        assert server.painter.latest.result is rendered
    assert pixels(bright["data"]).mean() > pixels(dark["data"]).mean()
    assert bright["spp"] == 4 and bright["is_last"]


def test_denoising_shows_another_picture_of_the_same_samples(server: Any, tmp_path: Path) -> None:
    pytest.importorskip("pyoidn", reason="denoising needs pyoidn, of the extra denoise")
    with page_of(server) as page:
        noisy = shown(server, page, {"density": 1.25})
        rendered = server.painter.latest.result
        clean = shown(server, page, {"density": 1.25, "denoise": True})
        assert server.painter.latest.result is rendered and rendered.denoised is not None
        again = shown(server, page, {"density": 1.25})
    assert clean["data"] != noisy["data"] == again["data"] and clean["noise"] == noisy["noise"]


HOSTILE = [
    '{"denoise": 1}',
    '{"opacity": []}',
    '{"opacity": [1, 2]}',
    '{"opacity": [[1, -2]]}',
    '{"opacity": [[1, NaN]]}',
    b"\x00\xff",
    "",
    "{",
    "null",
    "[]",
    "3",
    "[" * 20000,
    '{"density": NaN}',
    '{"density": Infinity}',
    '{"density": -1}',
    '{"density": 1e400}',
    '{"density": true}',
    '{"density": "2"}',
    '{"density": [2]}',
    '{"camera": []}',
    '{"camera": [0, 0, 0, 0, 0, 0, 0, 0, 1]}',
    '{"camera": [1e300, 0, 0, 0, 0, 0, 0, 0, 1]}',
    '{"camera": [0, 0, 4, 0, 0, 0, 0, 0, 1]}',
    '{"camera": ["a", 0, 0, 0, 0, 0, 0, 0, 1]}',
    '{"technique": "none such"}',
    '{"technique": 3}',
    '{"technique": "auto:pilot"}',
    '{"exposure": "dark"}',
    '{"__class__": 1}',
    '{"rendered": 1}',
]


def test_what_is_no_wish_is_an_error_and_no_end(server: Any) -> None:
    with page_of(server) as page:
        for text in HOSTILE:
            page.send(text)
            assert page.take("error")["text"], text
        assert shown(server, page, {"density": 0.5})


def test_an_endless_message_ends_its_own_page_alone(server: Any) -> None:
    from websockets.exceptions import ConnectionClosed

    with page_of(server) as page:
        page.send(json.dumps({"technique": "x" * (1 << 17)}))
        with pytest.raises(ConnectionClosed):
            page.take("nothing")
    with page_of(server) as page:
        assert shown(server, page, {})


def test_a_new_wish_ends_the_render_of_the_old_one() -> None:
    server = serving(spp=1 << 20)
    try:
        with page_of(server) as page:
            page.take("picture", lambda said: not said["coarse"] and said["spp"] > 1)
            for number in range(20):
                page.send({"density": 1 + number / 100})
            page.send({"density": 3})
            said = page.take(
                "picture", lambda said: not said["coarse"] and said["spp"] > 1 and "scale" in said["command"]
            )
            assert server.painter.latest.wish.density == 3 and not said["is_last"]
    finally:
        server.close()
    assert not server.painter._thread.is_alive()


def test_a_picture_that_is_saved_is_no_coarse_one() -> None:
    server = serving(spp=1, size=(64, 48))
    try:
        for density in (1.0, 2.0):
            server.painter.want(Wish(density=density))
            with urlopen(server.address + "picture.png") as answer:
                assert pixels(answer.read()).shape == (48, 64, 3)
    finally:
        server.close()


def test_who_comes_later_sees_the_picture_there_is(server: Any) -> None:
    with page_of(server) as page:
        shown(server, page, {"density": 0.75})
        with page_of(server) as other:
            assert other.last()["data"]


def test_a_port_that_is_taken_is_an_error(server: Any) -> None:
    port = urlsplit(server.address).port
    with pytest.raises(OptionError, match=f"cannot listen on 127.0.0.1, port {port}"):
        Server(Subject(clvol.load_file(SLAB)), {}, 1, port=port or 0)


def test_sun_and_environment_turn_about_the_vertical() -> None:
    picture = np.ones((3, 4, 3), np.float32)
    scene = clvol.load_dict(
        {
            "type": "scene",
            "sensor": {"type": "perspective", "to_world": clvol.look_at([0, -4, 0], [0, 0, 0], [0, 0, 1])},
            "sun": {"type": "directional", "direction": [0, 1, 0]},
            "sky": {"type": "envmap", "bitmap": picture},
        }
    )
    subject = Subject(scene)
    assert subject.described()["sun"] == pytest.approx((0, 0)) and subject.described()["environment"]
    subject.turn(Wish(azimuth=90.0, elevation=0.0, turn=90.0))
    parameters = clvol.traverse(scene)
    assert parameters["sun.direction"] == pytest.approx((-1, 0, 0), abs=1e-7)
    assert parameters["sky.to_world"][:3, :3] @ [1, 0, 0] == pytest.approx([0, 1, 0], abs=1e-7)
    subject.turn(Wish())
    assert parameters_of(scene, "sun.direction") == pytest.approx((0, 1, 0))


def test_a_transfer_function_is_bent_by_its_points(tmp_path: Path) -> None:
    volume = np.linspace(0, 1, 64, dtype=np.float32).reshape(4, 4, 4)
    np.save(tmp_path / "v.npy", volume)
    scene = clvol.volume_scene(
        str(tmp_path / "v.npy"), transfer={"opacity": [(0, 0), (1, 9)], "colour": [(0, 0.5), (1, 0.9)]}
    )
    subject = Subject(scene, ["clvol", "render", "v.npy"])
    about = subject.described()
    assert about["opacity"] == [(0, 0), (1, 9)] and len(about["colours"]) == 33
    wish = Wish.of({"opacity": [[0.25, 0], [0.5, 4]]})
    subject.turn(wish)
    assert parameters_of(scene, "volume.interior_medium.opacity") == [(0.25, 0), (0.5, 4)]
    assert "'volume.interior_medium.opacity=0.25: 0, 0.5: 4'" in subject.command(wish, 1)
    again = clvol.volume_scene(
        str(tmp_path / "v.npy"), transfer={"opacity": [(0, 0), (1, 9)], "colour": [(0, 0.5), (1, 0.9)]}
    )
    assign(again, subject.assignments(wish))
    assert parameters_of(again, "volume.interior_medium.opacity") == [(0.25, 0), (0.5, 4)]
    with pytest.raises(clvol.SceneError, match="must not fall"):
        subject.turn(Wish.of({"opacity": [[0.5, 0], [0.25, 4]]}))


def parameters_of(scene: clvol.Scene, name: str) -> Any:
    return clvol.traverse(scene)[name]


@pytest.mark.usefixtures("ctrl_c")
def test_ctrl_c_ends_the_command() -> None:
    command = [sys.executable, "-m", "clvol", "view", SLAB, "--size", "64x64", "--no-browser"]
    process = subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
    assert process.stdout
    address = next(line for line in process.stdout if "http://127.0.0.1:" in line).split()[-1]
    with urlopen(address) as answer:
        assert "clvol view" in answer.read().decode()
    process.send_signal(signal.SIGINT)
    _, errors = process.communicate(timeout=60)
    assert process.returncode == 0 and errors == ""


MISTAKES = [
    ("nothing.vdb",),
    (SLAB, "--sensor", "3"),
    (SLAB, "--host", "256.1.1.1"),
    (SLAB, "--device", "no such"),
    (SLAB, "--spp", str(1 << 33)),
    (SLAB, "--technique", "no such"),
    (SLAB, "--exposure", "99"),
    (SLAB, "--set", "sensor.film.crop_size=4,4"),
]


@pytest.mark.parametrize("arguments", MISTAKES)
def test_mistakes_are_one_line(arguments: tuple[str, ...]) -> None:
    done = CliRunner().invoke(main, ["view", *arguments, "--no-browser"])
    assert done.exit_code == 2
    assert done.stderr.startswith("clvol: error: ") and done.stderr.count("\n") == 1
