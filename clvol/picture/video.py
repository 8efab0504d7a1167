"""Films: pictures one after the other into an .mp4, by the ffmpeg that imageio-ffmpeg brings."""

from __future__ import annotations

import subprocess
import tempfile
from pathlib import Path
from typing import TYPE_CHECKING, Self

from clvol.base.extras import need
from clvol.base.output_files import check_file, replacing
from clvol.errors import OptionError

if TYPE_CHECKING:
    import numpy as np

    from clvol.base.output_files import StrPath

SUFFIX = ".mp4"
FPS = 24.0
_CODING = (
    *("-an", "-c:v", "libx264", "-crf", "15", "-pix_fmt", "yuv420p", "-movflags", "+faststart"),
    *("-colorspace", "bt709", "-color_primaries", "bt709", "-color_trc", "iec61966-2-1", "-f", "mp4"),
)
# Sides must be even, and colours are those of high definition, not of old television.
_FILTER = "scale=out_color_matrix=bt709,pad=ceil(iw/2)*2:ceil(ih/2)*2"


def is_film(path: StrPath) -> bool:
    """Whether a name is a film's."""
    return Path(path).suffix.lower() == SUFFIX


class Film:
    """A film in the making.  Used as a context manager it is there, whole, once the block is through.

    It has the size of its first picture.  A film without any is not written, nor one whose block fails: an
    earlier one then stays.

    Raises OptionError where the extra is missing or the file cannot be written.
    """

    def __init__(self, path: StrPath, fps: float = FPS) -> None:
        check_file(path)
        self.path, self.fps = path, fps
        self.frames = 0
        self._size = (0, 0)
        self._ffmpeg = str(need("imageio_ffmpeg", f"{path}: a film", "video").get_ffmpeg_exe())
        self._process: subprocess.Popen[bytes] | None = None

    def __enter__(self) -> Self:
        self._folder = tempfile.TemporaryDirectory(prefix="clvol-film-")
        self._errors = tempfile.TemporaryFile()
        return self

    @property
    def _made(self) -> Path:
        return Path(self._folder.name) / f"film{SUFFIX}"

    def add(self, pixels: np.ndarray) -> None:
        """Add a picture, uint8 (height, width, 3).

        Raises OptionError for one of another size, and where ffmpeg fails.
        """
        size = pixels.shape[1], pixels.shape[0]
        if self._process is None:
            self._size = size
            self._process = self._start()
        if size != self._size:
            (width, height), (w, h) = size, self._size
            what = f"a picture of {width} x {height} pixels does not fit a film of {w} x {h}"
            raise OptionError(what, str(self.path))
        assert self._process.stdin is not None
        try:
            self._process.stdin.write(pixels.tobytes())
        except OSError:
            raise self._failure() from None
        self.frames += 1

    def _start(self) -> subprocess.Popen[bytes]:
        width, height = self._size
        raw = ["-f", "rawvideo", "-pix_fmt", "rgb24", "-s", f"{width}x{height}", "-r", f"{self.fps:g}"]
        command = [self._ffmpeg, "-v", "error", *raw, "-i", "-", "-vf", _FILTER, *_CODING, str(self._made)]
        # A session of its own: Ctrl-C ends the render, and ffmpeg still ends the film.
        return subprocess.Popen(
            command,
            stdin=subprocess.PIPE,
            stdout=subprocess.DEVNULL,
            stderr=self._errors,
            start_new_session=True,
        )

    def __exit__(self, *exception: object) -> None:
        try:
            failed = isinstance(exception[1], Exception)  # Ctrl-C leaves a shorter film
            if self._process is not None and not failed:
                self._end()
        finally:
            if self._process is not None and self._process.poll() is None:
                self._process.kill()
                self._process.wait()
            self._folder.cleanup()
            self._errors.close()

    def _end(self) -> None:
        assert self._process is not None
        assert self._process.stdin is not None
        try:
            self._process.stdin.close()
        except OSError:
            raise self._failure() from None
        if self._process.wait() != 0:
            raise self._failure()
        with replacing(self.path) as file, open(self._made, "rb") as made:
            while part := made.read(1 << 20):
                file.write(part)

    def _failure(self) -> OptionError:
        """What ffmpeg says."""
        self._errors.seek(0)
        said = self._errors.read().decode(errors="replace").strip().splitlines()
        return OptionError(f"ffmpeg failed: {said[-1] if said else 'it says nothing'}", str(self.path))
