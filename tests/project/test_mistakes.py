"""Whatever is given to a public function, a mistake is one of clvol's errors, in a sentence."""

from __future__ import annotations

import inspect
from itertools import product

import numpy as np
import pytest
from every_bit import scene as small_scene

import clvol
from clvol.planning.registry import FAMILIES


class Unspeakable:
    """A value whose repr fails."""

    def __repr__(self) -> str:
        raise RuntimeError("no repr")


WRONG = {
    "None": None,
    "negative": -1,
    "nan": float("nan"),
    "huge": 10**400,
    "text": "x",
    "bytes": b"x",
    "list": [],
    "set": {1},
    "dict": {"a": 1},
    "array": np.zeros((2, 2)),
    "empty": np.zeros(0),
    "scalar array": np.array("x"),
    "masked": np.ma.masked_all(3),
    "object": Unspeakable(),
    "complex": 1j,
}
COUNTS = ("spp", "seed", "samples", "size", "sensor", "pool")
TAKING_ONE = ["load_file", "load_dict", "load_string", "load_result", "merge", "traverse", "plan", "info"]
VECTORS = {
    "look_at": [(0, 0, 1), (0, 0, 0), (0, 1, 0)],
    "rotate": [(0, 1, 0), 3.0],
    "scale": [1.0],
    "translate": [1.0],
}
OPTIONS = sorted(set(inspect.signature(clvol.render).parameters) - {"scene", *FAMILIES} | {"technique"})


@pytest.fixture(scope="module")
def scene() -> clvol.Scene:
    return small_scene()


@pytest.fixture(scope="module")
def result(scene: clvol.Scene) -> clvol.Result:
    return clvol.render(scene, spp=2)


def call(function, *arguments: object, **options: object) -> None:
    """It may work; where it does not, the error is one of ours, and says something."""
    try:
        function(*arguments, **options)
    except clvol.Error as error:
        assert str(error)


@pytest.mark.parametrize(("name", "value"), product(TAKING_ONE, WRONG))
def test_a_wrong_argument(name: str, value: str) -> None:
    call(getattr(clvol, name), WRONG[value])


@pytest.mark.parametrize(("name", "value"), product(VECTORS, WRONG))
def test_a_wrong_vector(name: str, value: str) -> None:
    for place in range(len(VECTORS[name])):
        arguments = list(VECTORS[name])
        arguments[place] = WRONG[value]
        call(getattr(clvol, name), *arguments)


@pytest.mark.parametrize(("name", "value"), product(OPTIONS, WRONG))
def test_a_wrong_option_of_a_render(scene: clvol.Scene, name: str, value: str, tmp_path, monkeypatch) -> None:
    monkeypatch.chdir(tmp_path)  # some values are names that a checkpoint may have
    call(clvol.render, scene, **{"spp": 1, "pool": 256, name: WRONG[value]})


@pytest.mark.parametrize("value", [True, np.True_])
def test_true_is_no_number(scene: clvol.Scene, result: clvol.Result, value: bool) -> None:
    """Python counts it as 1: that it is given is a mistake."""
    for name in (*COUNTS, "majorant_scale", "step", "time_limit", "target_error"):
        pair = {"samples": (0, value), "size": (value, 4)}
        with pytest.raises(clvol.Error, match="True"):
            clvol.render(scene, **{name: pair.get(name, value)})
    for function, options in (
        (clvol.selftest, {"seed": value}),
        (clvol.selftest, {"spp": value}),
        (clvol.compare, {"rounds": value}),
        (clvol.progressive, {"interval": value}),
        (clvol.trace_ray, {"x": value, "y": 0}),
        (clvol.trace_ray, {"x": 0, "y": 0, "channel": value}),
    ):
        with pytest.raises(clvol.Error, match="True"):
            function(scene, **options)
    for move in (clvol.scale, clvol.translate, lambda angle: clvol.rotate((0, 0, 1), angle)):
        with pytest.raises(clvol.SceneError, match="True"):
            move(value)
    with pytest.raises(clvol.OptionError, match="True"):
        result.encode(".png", exposure=value)


@pytest.mark.parametrize("value", WRONG)
def test_a_wrong_way_to_save(result: clvol.Result, value: str, tmp_path) -> None:
    wrong = WRONG[value]
    for name in ("exposure", "display", "view_transform", "component_format"):
        call(result.save, tmp_path / "a.png", **{name: wrong})
        call(result.encode, ".png", **{name: wrong})
    call(result.encode, wrong)
    if not isinstance(wrong, str):
        call(result.save, wrong)


@pytest.mark.parametrize("value", WRONG)
def test_a_wrong_interval_and_a_wrong_scene(scene: clvol.Scene, value: str) -> None:
    call(clvol.progressive, scene, interval=WRONG[value])
    for function in (clvol.render, clvol.progressive, clvol.compare, clvol.selftest):
        with pytest.raises(clvol.Error):
            function(WRONG[value])


def test_unknown_keywords_are_errors_of_both_kinds(scene: clvol.Scene) -> None:
    for function in (clvol.plan, clvol.progressive):
        for kind in (clvol.OptionError, TypeError):
            with pytest.raises(kind, match="not 'techniqe'"):
                function(scene, techniqe="delta")


def test_choices_are_listed_alike_everywhere(scene: clvol.Scene) -> None:
    """In Python, for one name and several, and for AOVs."""
    listed = "choose one of auto, delta, weighted-delta, decomposition"
    for function, options in (
        (clvol.plan, {"technique": "x"}),
        (clvol.trace_ray, {"x": 1, "y": 1, "techniques": "x"}),
        (clvol.compare, {"techniques": ["x"]}),
    ):
        with pytest.raises(clvol.OptionError, match=listed):
            function(scene, **options)
    with pytest.raises(clvol.OptionError, match="choose one of lookups, "):
        clvol.plan(scene, aov="deph")


def test_arrays_over_time_have_a_hint_of_their_own() -> None:
    hints = {(5, 4, 4, 4): r"\(t, z, y, x\), give one time", (5, 4, 4, 4, 3): "one time is array"}
    for shape, hint in hints.items():
        volume = {"type": "gridvolume", "grid": np.ones(shape)}
        medium = {"type": "heterogeneous", "sigma_t": volume}
        cube = {"type": "cube", "bsdf": {"type": "null"}, "interior": medium}
        with pytest.raises(clvol.VolumeError, match=hint):
            clvol.load_dict({"type": "scene", "sensor": {"type": "perspective"}, "smoke": cube})
