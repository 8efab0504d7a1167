"""The page in Chromium: it loads, turns, changes the density, and its picture changes with them."""

from __future__ import annotations

import shlex
from typing import Any

from chromium import opened

FINE = "document.body.dataset.coarse === 'false'"
COMMAND = "document.getElementById('command').textContent"
PIXELS = "document.getElementById('picture').toDataURL()"
PLACE = """(() => {
  const r = document.getElementById('picture').getBoundingClientRect();
  return [r.x + r.width / 2, r.y + r.height / 2];
})()"""


def slide(knob: str, value: float) -> str:
    """What a hand at a slider does."""
    return (
        f"(() => {{ const s = document.querySelector('[data-knob={knob}]'); s.value = {value};"
        "s.dispatchEvent(new Event('input', {bubbles: true})); })()"
    )


def test_the_page_turns_and_changes_without_an_error(server: Any) -> None:
    with opened(server.address) as tab:
        tab.until(FINE)
        assert tab.value("document.querySelector('h1').textContent") == "slab.xml"
        tab.value("document.getElementById('reset').click()")
        tab.until(f"!{COMMAND}.includes('--set')")
        first = tab.value(PIXELS)
        x, y = tab.value(PLACE)
        tab.drag((x, y), (x + 60, y + 25))
        tab.until(f"{COMMAND}.includes('sensor.to_world')")
        tab.until(FINE)
        turned = tab.value(PIXELS)
        tab.mouse("mouseWheel", x, y, deltaX=0, deltaY=-120)
        tab.value(slide("density", 2))
        tab.until(f"{COMMAND}.includes('medium.scale')")
        tab.until(FINE)
        dense = tab.value(PIXELS)
        assert len({first, turned, dense}) == 3
        words = shlex.split(tab.value(COMMAND))
        assert sum(word.startswith("sensor.to_world=") for word in words) == 1
        assert tab.value("document.getElementById('error').hidden")
        assert tab.value("document.querySelectorAll('#methods tr').length") >= 1
        tab.value("document.getElementById('compare').click()")
        tab.until("document.getElementById('compare').textContent === 'Compare techniques'")
        assert tab.value("document.querySelectorAll('#methods tr').length") >= 1
        tab.value("document.getElementById('technique').value = 'auto'")
        assert tab.messages == []
