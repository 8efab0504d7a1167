"""Scenes as nested dicts, of every plugin with every kind of value; and thousands of them in one process.

`python tests/helpers/fuzz_dicts.py COUNT SEED` prints, as JSON, what became of COUNT of them.  One that takes
over ten seconds or much memory, or ends in anything but a scene with all its tables or one of clvol's errors,
is among the faults, made as small as Hypothesis finds it.
"""

from __future__ import annotations

import argparse
import copy
import faulthandler
import json
import logging
import resource
import time
import traceback
from collections import Counter

import numpy as np
from fuzzing import SECONDS, limit_memory
from hypothesis import HealthCheck, Phase, given, seed, settings
from hypothesis import strategies as st
from plugin_parameters import CELLS, PARAMETERS, RGB, TEXTURE, Silent

import clvol
from clvol.planning.choices import Choices
from clvol.planning.plan import Plan
from clvol.scene.loader import PLUGINS
from clvol.tables.prepare import prepare

LONGEST = 30_000
"""Characters of an error at most: a scene with many faults lists them."""
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


def loads(described: object) -> bool:
    """Whether it is a scene; AssertionError where the error is not as it should be."""
    try:
        scene = clvol.load_dict(described)
        prepare(scene, Plan.of(scene, Choices.for_scene(scene, {})))
    except clvol.Error as error:
        assert len(str(error)) < LONGEST
        assert all(map(str.isprintable, str(error).split("\n")))
        return False
    return True


def fuzzed(count: int, number: int) -> dict[str, object]:
    """What became of `count` scenes: numbers, and the faults.  This process has little memory from now on."""
    limit_memory()
    seen: Counter[bool] = Counter()
    slowest = 0.0

    @seed(number)
    @settings(
        max_examples=count,
        deadline=None,
        database=None,
        phases=(Phase.generate, Phase.shrink),
        suppress_health_check=list(HealthCheck),
    )
    @given(scenes())
    def each(described: object) -> None:
        nonlocal slowest
        faulthandler.dump_traceback_later(SECONDS, exit=True)
        began = time.perf_counter()
        try:
            seen[loads(described)] += 1
        finally:
            faulthandler.cancel_dump_traceback_later()
            slowest = max(slowest, time.perf_counter() - began)

    faults = []
    try:
        each()
    except BaseException as error:
        faults.append("".join(traceback.format_exception(error, limit=-6)))
    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss >> 10
    said = {"scenes": seen.total(), "refused": seen[False], "faults": faults}
    return said | {"slowest": slowest, "peak_mib": peak}


def main() -> None:
    """Load scenes, and print what became of them."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("count", type=int)
    parser.add_argument("seed", type=int)
    given_ = parser.parse_args()
    logging.getLogger("clvol").addHandler(logging.NullHandler())
    started = time.process_time()
    said = fuzzed(given_.count, given_.seed)
    print(json.dumps({"dicts": said | {"seconds": round(time.process_time() - started, 2)}}))


if __name__ == "__main__":
    main()
