"""`clvol.live`: a widget that shows a render as it refines."""

from __future__ import annotations

import io

import numpy as np
import pytest
from PIL import Image
from viewing import SLAB

import clvol

pytest.importorskip("ipywidgets", reason="clvol.live needs ipywidgets, of the extra notebook")


@pytest.fixture(scope="module")
def scene() -> clvol.Scene:
    return clvol.load_file(SLAB, res=16)


def brightness(live: clvol.Live) -> float:
    return float(np.asarray(Image.open(io.BytesIO(live._picture.value))).mean())


def test_it_shows_what_a_render_returns(scene: clvol.Scene) -> None:
    live = clvol.live(scene, spp=4, interval=0)
    result = live.wait()
    assert np.array_equal(result.image, clvol.render(scene, spp=4).image) and result.is_last
    assert live._words.value.startswith("4 spp, noise") and live._words.value.endswith("done")
    assert live._button.disabled
    before = brightness(live)
    live._exposure.value = 3.0
    assert brightness(live) > before
    assert repr(live).startswith("<Live done: <Frame 16 x 16, 4 spp")
    assert "application/vnd.jupyter.widget-view+json" in live._repr_mimebundle_()


def test_its_button_stops_it_and_keeps_the_picture(scene: clvol.Scene) -> None:
    live = clvol.live(scene, spp=1 << 24)
    assert live.result.samples[1] >= 1
    live._button.click()
    result = live.wait()
    assert 1 <= result.samples[1] < 1 << 24


def test_mistakes_are_said_at_once(scene: clvol.Scene) -> None:
    with pytest.raises(clvol.OptionError, match="unknown technique"):
        clvol.live(scene, technique="none such")
    with pytest.raises(TypeError):
        clvol.live(scene, sp=3)
