"""Scenes as nested dicts, of every plugin with every kind of value: a scene that renders, or one clear error.

200 here; `CLVOL_FUZZ` is another number.
"""

import copy
import os

import numpy as np
import pytest
from hypothesis import HealthCheck, example, given, settings
from hypothesis import strategies as st
from plugin_parameters import CELLS, PARAMETERS, RGB, TEXTURE, Silent

import clvol
from clvol.planning.choices import Choices
from clvol.planning.plan import Plan
from clvol.scene.loader import PLUGINS
from clvol.tables.prepare import prepare

pytestmark = pytest.mark.contract

KIND_OF = {name: kind for kind, names in PLUGINS.items() for name in names}
TABLE = {name: PARAMETERS[name] for name in sorted(PARAMETERS) if name in KIND_OF}
VALUES = [
    value.value if isinstance(value, Silent) else value
    for name in TABLE
    for value in TABLE[name][1].values()
    if not isinstance(value, str) or "." not in value
]
"""Of all parameters: right for one, and most often wrong for another.  Files are fuzzed elsewhere."""
ODD = [
    *(np.nan, np.inf, -np.inf, -0.0, 0, -1, 1e-320, 1e300, 2**63, -(2**63), 10**400, True, None, b"a", ""),
    *(
        "a" * 5000,
        "\0",
        "é\n",
        "$a",
        [],
        {},
        (),
        [1],
        [1, 2],
        [1, 2, 3],
        [[1, 2], [3, 4]],
        {"type": 3},
        {"a": {}},
    ),
    *(
        np.zeros((0, 3)),
        np.full((2, 2, 2), np.nan),
        np.ones((1, 1, 1)),
        np.eye(4)[:3],
        np.zeros((4, 4)),
        CELLS,
    ),
    *(
        np.full((4, 4), 1e200),
        np.eye(4) * 1e-30,
        np.array(["a"]),
        np.ones((2, 2), complex),
        object(),
        lambda: 0,
    ),
    *(RGB, TEXTURE, {"type": "ref", "id": "wall"}, {"type": "spectrum", "value": [(400, 1)]}),
]
FOR = {"medium": "interior", "bsdf": "bsdf", "emitter": "emitter", "film": "film", "sampler": "sampler"}


_seldom = st.integers(0, 9).map(lambda number: number == 0)


@st.composite
def plugins(draw, depth=2):
    """A plugin with what it needs and some of its parameters, of which some are wrong or more plugins."""
    name = draw(st.sampled_from(sorted(TABLE)))
    needs, parameters = TABLE[name]
    made = {"type": name} | copy.copy(needs)
    keys = draw(st.lists(st.sampled_from(sorted(parameters) or ["to_world"]), max_size=4))
    if draw(_seldom):
        keys.append(draw(st.sampled_from(["id", "type", "inner", "interior", "to_world"])))
    for key in keys:
        usual = parameters.get(key)
        right = st.just(usual.value if isinstance(usual, Silent) else usual)
        wrong = [
            st.sampled_from(ODD),
            st.sampled_from(VALUES),
            st.floats(),
            st.integers(),
            st.text(max_size=8),
        ]
        more = [plugins(depth=depth - 1)] if depth else []
        made[key] = draw(st.one_of(right, right, *wrong, st.lists(st.floats(), max_size=5), *more))
    if draw(_seldom):
        del made[draw(st.sampled_from(sorted(made)))]
    return made


@st.composite
def scenes(draw):
    """A scene of up to three plugins, most often where they belong."""
    scene = {"type": "scene", "sensor": {"type": "perspective", "fov": 40.0}}
    for number in range(draw(st.integers(1, 3))):
        plugin = draw(plugins())
        kind = KIND_OF.get(str(plugin.get("type")), "")
        place = FOR.get(kind, "")
        if place in ("film", "sampler"):
            scene["sensor"][place] = plugin
        elif place and draw(st.booleans()):
            scene[f"shape{number}"] = {"type": "sphere", place: plugin}
        elif kind == "sensor":
            scene["sensor"] = plugin
        else:
            scene[f"part{number}"] = plugin
    return scene


@settings(
    max_examples=int(os.environ.get("CLVOL_FUZZ", "200")),
    derandomize="CLVOL_FUZZ" not in os.environ,
    deadline=10_000,
    database=None,
    suppress_health_check=list(HealthCheck),
)
@given(scenes())
@example({"type": "scene", "sensor": {"type": "batch", "a": {"type": "batch", "b": {"type": "perspective"}}}})
def test_any_dict_is_a_scene_or_an_error(described):
    try:
        scene = clvol.load_dict(described)
        prepare(scene, Plan.of(scene, Choices.for_scene(scene, {})))
    except clvol.Error as error:
        assert len(str(error)) < 30_000
        assert all(map(str.isprintable, str(error).split("\n")))
