"""The page of hard cases is made of docs/hard-cases.jsonl, which has figures of every case, none wrong."""

from __future__ import annotations

import importlib
from typing import TYPE_CHECKING

import numpy as np
import pytest
from places import ROOT, TOOLS

if TYPE_CHECKING:
    from types import ModuleType


@pytest.fixture
def hard_cases(monkeypatch: pytest.MonkeyPatch) -> ModuleType:
    monkeypatch.syspath_prepend(TOOLS)
    return importlib.import_module("hard_cases")


def test_the_page_is_that_of_the_figures(hard_cases: ModuleType) -> None:
    page = hard_cases.page(hard_cases.read(hard_cases.FIGURES))
    assert page == (ROOT / "docs" / "hard-cases.md").read_text(encoding="utf-8"), "tools/docs.py hard"


def test_every_case_has_figures_of_what_it_expects_now_and_none_is_wrong(hard_cases: ModuleType) -> None:
    found = hard_cases.read(hard_cases.FIGURES)
    assert set(found) == {case.name for case in hard_cases.CASES}
    for case in hard_cases.CASES:
        expected = np.broadcast_to(np.atleast_1d(case.expected()), len(found[case.name].expected))
        np.testing.assert_allclose(found[case.name].expected, expected, rtol=1e-5, err_msg=case.name)
        assert found[case.name].wrong == found[case.name].noisy == 0, "every way is decided"
        assert found[case.name].right > 0
        assert found[case.name].of_one < hard_cases.NOISY
