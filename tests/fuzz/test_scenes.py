"""Scenes as nested dicts, of every plugin with every kind of value: a scene that renders, or one clear error.

200 here, always the same; `python tools/fuzz.py dicts` has more.
"""

import pytest
from fuzz_dicts import loads, scenes
from hypothesis import HealthCheck, example, given, settings

pytestmark = pytest.mark.contract


@settings(
    max_examples=200,
    derandomize=True,
    deadline=10_000,
    database=None,
    suppress_health_check=list(HealthCheck),
)
@given(scenes())
@example({"type": "scene", "sensor": {"type": "batch", "a": {"type": "batch", "b": {"type": "perspective"}}}})
def test_any_dict_is_a_scene_or_an_error(described):
    loads(described)
