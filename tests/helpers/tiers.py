"""Which of a test's parameters plain `pytest` tries; the others are for `pytest -m contract`.

Each kernel takes a second or so to build: a few parameters show that something is broken, all of them that
nothing is.
"""

import pytest


def quick_first(names, values, count=1, **more):
    """As `pytest.mark.parametrize`, of which plain `pytest` tries the first `count`."""
    return quick_where(names, values, set(range(count)).__contains__, by_place=True, **more)


def quick_where(names, values, is_quick, by_place=False, **more):
    """As `pytest.mark.parametrize`, of which plain `pytest` tries those that `is_quick` is true of.

    by_place : it is asked of their numbers, from 0, and not of them.
    """
    several = not isinstance(names, str)
    parameters = [
        value if is_quick(place if by_place else value) else _in_contract(value, several)
        for place, value in enumerate(values)
    ]
    return pytest.mark.parametrize(names, parameters, **more)


def _in_contract(value, several):
    if isinstance(value, type(pytest.param())):
        return pytest.param(*value.values, marks=(*value.marks, pytest.mark.contract), id=value.id)
    return pytest.param(*(value if several else [value]), marks=pytest.mark.contract)
