"""`clvol.live`: a render in a notebook that is seen as it refines."""

from __future__ import annotations

import threading
from typing import TYPE_CHECKING, Any

from clvol.api.frames import progressive
from clvol.base.extras import need
from clvol.base.progress import format_noise
from clvol.errors import Error, RenderError

if TYPE_CHECKING:
    from clvol.api.frames import Frame
    from clvol.scene.records import Scene

_STOPS = 6.0
"""By which exposure brightens or darkens, at most."""


class Live:
    """A render under way, made by `live`; a notebook shows its picture, noise, exposure and a button to stop.

    It renders in a thread of its own, so that other cells can run.

    Parameters
    ----------
    scene, options : as `clvol.progressive` takes them.
    """

    def __init__(self, scene: Scene, **options: Any) -> None:
        widgets = need("ipywidgets", "clvol.live", "notebook")
        self._frames = progressive(scene, **options)
        self._frame: Frame | None = None
        self._error: BaseException | None = None
        self._shows = threading.Lock()
        self._picture = widgets.Image(format="jpeg", layout=widgets.Layout(max_width="100%"))
        self._words = widgets.Label("rendering")
        layout = widgets.Layout(width="22em")
        self._exposure = widgets.FloatSlider(
            min=-_STOPS, max=_STOPS, step=0.1, description="exposure", layout=layout
        )
        self._button = widgets.Button(description="stop", layout=widgets.Layout(width="5em"))
        self._button.on_click(lambda _button: self.stop())
        self._exposure.observe(lambda _change: self._show(), names="value")
        self._box = widgets.VBox([self._picture, widgets.HBox([self._button, self._exposure, self._words])])
        self._thread = threading.Thread(target=self._render, name="clvol live", daemon=True)
        self._thread.start()

    @property
    def result(self) -> Frame:
        """The picture so far, a `Result`; it waits for the first.  Raises what went wrong."""
        while self._frame is None and self._thread.is_alive():
            self._thread.join(0.05)
        if self._error is not None:
            raise self._error
        if self._frame is None:
            raise RenderError("the render was stopped before it had a picture")
        return self._frame

    def stop(self) -> None:
        """End the render soon, and keep the picture."""
        self._frames.cancel()

    def wait(self) -> Frame:
        """Wait for the last picture; returns it.  Ctrl-C, or a notebook's interrupt, stops the render."""
        try:
            while self._thread.is_alive():
                self._thread.join(0.1)
        except KeyboardInterrupt:
            self.stop()
            self._thread.join()
        return self.result

    def __repr__(self) -> str:
        state = "rendering" if self._thread.is_alive() else "done"
        return f"<Live {state}: {'no picture yet' if self._frame is None else self._frame!r}>"

    def _repr_mimebundle_(self, **given: Any) -> Any:
        """How a notebook shows it."""
        return self._box._repr_mimebundle_(**given)

    def _render(self) -> None:
        try:
            for frame in self._frames:
                self._frame = frame
                self._show()
        except (Error, MemoryError, KeyboardInterrupt) as error:
            self._error = error
            self._words.value = str(error) or type(error).__name__
        finally:
            self._button.disabled = True

    def _show(self) -> None:
        """The latest picture as the slider says, for who renders and for who moved it."""
        with self._shows:
            if (frame := self._frame) is None:
                return
            kind = ".jpg" if frame.alpha is None else ".png"
            self._picture.format = {".jpg": "jpeg", ".png": "png"}[kind]
            self._picture.value = frame.encode(kind, self._exposure.value)
            done = ", done" if frame.is_last else ""
            noise = "" if frame.samples[1] < 2 else f", noise {format_noise(frame.noise)}"
            self._words.value = f"{frame.samples[1]} spp{noise}, {frame.metadata['seconds']:.1f} s{done}"


def live(scene: Scene, **options: Any) -> Live:
    """Render a scene in a notebook, and see it as it refines: ``clvol.live(scene, spp=256)`` ends a cell.

    Other cells can run meanwhile.  It needs the extra `notebook`.

    Parameters
    ----------
    scene, options
        As `progressive` takes them.

    Returns
    -------
    Live
        Shown by the notebook with a slider for the exposure and a button that stops the render.
        `Live.result` is the picture so far, `Live.wait` waits for the last, `Live.stop` ends the render.

    Raises
    ------
    OptionError, SceneError, TypeError
        As `progressive`; OptionError, with the command that installs it, where ipywidgets is missing.
    """
    return Live(scene, **options)
