"""Parameters of pictures that lights show, and of microflakes."""

import numpy as np
import pytest

import clvol
from clvol.scene.digest import scene_digest

RNG = np.random.default_rng(3)
PICTURE, OTHER = (RNG.uniform(0, 3, (4, 5, 3)).astype(np.float32) for _ in range(2))
MATRICES, OTHERS = (
    np.abs(RNG.normal(size=(2, 2, 3, 6))) * (1, 1, 1, 0.1, 0.1, 0.1) + (1, 1, 1, 0, 0, 0) for _ in "ab"
)


def bitmap(pixels):
    return {"type": "bitmap", "bitmap": pixels, "raw": True}


def lamp(radiance):
    return {"type": "rectangle", "light": {"type": "area", "radiance": radiance}}


def fog(s):
    phase = {"type": "sggx", "S": {"type": "gridvolume", "data": s} if np.ndim(s) > 1 else s}
    sigma_t = {"type": "gridvolume", "data": np.ones((2, 2, 2))}
    medium = {"type": "heterogeneous", "sigma_t": sigma_t, "albedo": 0.8, "phase": phase}
    return {"type": "cube", "bsdf": {"type": "null"}, "interior": medium}


def board(first):
    return {"type": "checkerboard", "color0": first}


CASES = {  # made of a value, the name of its parameter, two values
    "lamp": (lambda v: lamp(bitmap(v)), "it.emitter.radiance.data", PICTURE, OTHER),
    "checkered lamp": (lambda v: lamp(board(v)), "it.emitter.radiance.color0.value", 2.0, 5.0),
    "glowing lamp": (
        lambda v: lamp({"type": "volume", "volume": {"type": "gridvolume", "data": v}}),
        "it.emitter.radiance.volume.data",
        PICTURE[None, ..., 0],
        OTHER[None, ..., 0],
    ),
    "spot": (lambda v: {"type": "spot", "texture": bitmap(v)}, "it.texture.data", PICTURE, OTHER),
    "projector": (
        lambda v: {"type": "projector", "fov": 40.0, "irradiance": board(v)},
        "it.irradiance.color0.value",
        0.2,
        7.0,
    ),
    "flakes that differ": (fog, "it.interior_medium.phase_function.S.data", MATRICES, OTHERS[:, :, :2]),
    "flakes": (
        fog,
        "it.interior_medium.phase_function.S",
        (1.0, 2.0, 1.5, 0.1, 0.0, 0.2),
        (0.5, 0.6, 0.7, 0.0, 0.1, 0.0),
    ),
}


def scene_of(part):
    film = {"type": "hdrfilm", "width": 6, "height": 4}
    camera = {
        "type": "perspective",
        "to_world": clvol.look_at((0.3, 1, 4), (0, 0, 0), (0, 1, 0)),
        "film": film,
    }
    return clvol.load_dict({"type": "scene", "camera": camera, "sky": {"type": "constant"}, "it": part})


@pytest.mark.parametrize("case", CASES)
def test_an_updated_scene_is_the_one_loaded_with_the_value(case):
    make, name, one, other = CASES[case]
    scene, wanted = scene_of(make(one)), scene_of(make(other))
    parameters = clvol.traverse(scene)
    np.testing.assert_allclose(parameters[name], one, rtol=1e-7)
    parameters[name] = other
    assert parameters.update() == [name]
    np.testing.assert_allclose(parameters[name], other, rtol=1e-7)
    assert scene_digest(scene) == scene_digest(wanted) != scene_digest(scene_of(make(one)))


@pytest.mark.parametrize("case", ["lamp", "flakes that differ"])
def test_and_so_is_its_picture(case):
    make, name, one, other = CASES[case]
    scene = scene_of(make(one))
    parameters = clvol.traverse(scene)
    options = {"spp": 4, "seed": 2}
    before = clvol.render(scene, **options)
    parameters.update({name: other})
    after, wanted = clvol.render(scene, **options), clvol.render(scene_of(make(other)), **options)
    assert np.array_equal(after.image, wanted.image) and not np.array_equal(after.image, before.image)
    assert after.stats["kernels_built"] == 0


@pytest.mark.parametrize(
    ("case", "value", "message"),
    [
        ("lamp", -PICTURE, "texels must be in"),
        ("checkered lamp", -1, "must be"),
        ("flakes that differ", -MATRICES, r"S of an sggx must be positive definite; .*, at .0, 0, 0."),
        ("flakes that differ", np.ones((2, 2, 2)), "channel"),
        ("flakes", (1, 1, 1), "six numbers"),
        ("flakes", (1, 1, 1, 1, 1, 1), "must be positive definite"),
        ("flakes", "one", "numbers"),
    ],
)
def test_mistakes_are_named(case, value, message):
    make, name, one, _ = CASES[case]
    parameters = clvol.traverse(scene_of(make(one)))
    with pytest.raises(clvol.Error, match=message):
        parameters[name] = value
