"""In a notebook progress is one line of output that is written anew, and stays."""

from __future__ import annotations

import io
import sys
from types import ModuleType, SimpleNamespace

import pytest
from rich.console import Console

from clvol.base.notebook import NotebookProgress, in_notebook, progress_bar
from clvol.base.progress import Glance, Progress, RichProgress


@pytest.fixture
def output(monkeypatch):
    """What a notebook's kernel would show: (display's number, line), in order; IPython is made up."""
    shown = []

    class Handle:
        def __init__(self, number):
            self.number = number

        def update(self, line):
            shown.append((self.number, line))

    def display(line, display_id):
        assert display_id
        shown.append((len(shown), line))
        return Handle(len(shown) - 1)

    ipython = ModuleType("IPython")
    ipython.get_ipython = lambda: SimpleNamespace(kernel=object())
    ipython.display = ModuleType("IPython.display")
    ipython.display.display = display
    monkeypatch.setitem(sys.modules, "IPython", ipython)
    monkeypatch.setitem(sys.modules, "IPython.display", ipython.display)
    return shown


def record(done):
    seen = SimpleNamespace(image=None, noise=0.16 / done**0.5)
    return Progress(done, 64, done / 8, glance=Glance(lambda: seen, print))


def test_a_notebook_shows_one_line_that_ends_with_what_came_of_it(output):
    with progress_bar() as bar:
        assert isinstance(bar, NotebookProgress)
        for done in (16, 17, 64):
            bar(record(done))
    assert {number for number, _ in output} == {0}
    assert [repr(line) for _, line in output] == [
        "rendering",
        "rendering, 16/64 spp, 2.0 s, 6 s left, noise 4 %",
        "rendering, 64/64 spp, 8.0 s, noise 2 %",  # 17 came too soon after 16
    ]
    assert output[-1][1]._repr_html_().startswith('<progress value="1.0000" max="1">')


@pytest.mark.parametrize("shell", [None, SimpleNamespace()])
def test_elsewhere_there_is_a_bar_for_terminals(output, monkeypatch, shell):
    """A program that has IPython imported, and IPython in a terminal."""
    monkeypatch.setattr(sys.modules["IPython"], "get_ipython", lambda: shell)
    assert not in_notebook() and isinstance(progress_bar(), RichProgress)


def test_a_bar_that_nobody_sees_reads_no_picture():
    with RichProgress(Console(file=io.StringIO(), force_terminal=False)) as bar:
        bar(Progress(16, 64, 8.0, glance=Glance(lambda: pytest.fail("read"), bar)))
