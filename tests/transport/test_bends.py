"""Normal maps and bump maps in pictures: closed forms under a slanting sun, in one scene of a plate a pixel.

The camera looks straight down, so that a plate of diffuse reflectance r shows r times the cosine between the
bent normal and the sun, times what shadowing leaves (Estevez et al. 2019).
"""

import numpy as np
import pytest

from clvol import load_dict, render
from clvol.scene import look_at, rotate, scale, translate

SUN = np.array([0.5, 0.7, 0.3]) / np.linalg.norm([0.5, 0.7, 0.3])
"""Where it stands; y is up."""
LYING = look_at([0, 0, 0], [0, 1, 0], [0, 0, 1])
DIFFUSE = {"type": "diffuse", "reflectance": 0.8}
BOTH = {"type": "twosided", "inner": DIFFUSE}
STEEP, BACKWARDS, LEVEL = (0.6, -0.3, 0.8), (-0.9, 0.1, 0.5), (0.0, 0.0, 1.0)


def normals(n, nested=DIFFUSE, **flags):
    n = np.array(n) / np.linalg.norm(n)
    color = {"type": "rgb", "value": (0.5 + 0.5 * n).tolist()}
    return {"type": "normalmap", "normalmap": color, "nested": nested, **flags}


def ramp(slope_u, slope_v, factor=1.0):
    """Heights of these slopes per unit of (u, v), everywhere on a plate."""
    at = np.array([[0.0, slope_u], [slope_v, slope_u + slope_v]]) / factor
    texels = np.repeat(0.5 + at[..., None] / 4, 3, axis=2).astype(np.float32)
    to_uv = translate([0.25, 0.25, 0]) @ scale([0.5, 0.5, 1])
    heights = {"type": "bitmap", "bitmap": texels, "raw": True, "wrap_mode": "clamp", "to_uv": to_uv}
    return {"type": "bumpmap", "heights": heights, "nested": DIFFUSE, "scale": 4 * factor}


def shine(n, reflectance=0.8, shadowing=True, turned=False):
    """What such a plate shows; `turned`: it lies upside down, and is seen from its back."""
    frame = (rotate([0, 0, 1], 180) @ LYING if turned else LYING)[:3, :3]
    sun = SUN @ frame
    n = np.array(n) / np.linalg.norm(n)
    alpha2 = min((1 - n[2] ** 2) / n[2] ** 2 / 8, 1) if shadowing else 0
    share = 2 / (1 + np.sqrt(1 + alpha2 * (1 - sun[2] ** 2) / sun[2] ** 2))
    return reflectance * share * max(n @ sun * np.sign(sun[2]), 0)


PLATES = {
    "steep": (normals(STEEP), shine(STEEP)),
    "away from the sun": (normals(BACKWARDS), shine(BACKWARDS)),
    "without shadowing": (normals(STEEP, use_shadowing_function=False), shine(STEEP, shadowing=False)),
    "level": (normals(LEVEL), shine(LEVEL)),
    "ramp": (ramp(0.7, -0.4, factor=3), shine(np.cross((2, 0, 0.7), (0, 2, -0.4)))),
    "in a mixture": (
        {"type": "blendbsdf", "weight": 0.25, "a": normals(STEEP), "b": DIFFUSE},
        0.75 * shine(STEEP) + 0.25 * shine(LEVEL),
    ),
    "round a mask": (normals(STEEP, {"type": "mask", "opacity": 0.5, "inner": DIFFUSE}), 0.5 * shine(STEEP)),
    "in a mask": ({"type": "mask", "opacity": 0.5, "inner": normals(STEEP)}, 0.5 * shine(STEEP)),
    "back, outside": (normals(STEEP, BOTH), shine(STEEP, turned=True)),
    # inside, both sides have the same map on them: from the back z points to the other side of it
    "back, inside": (
        {"type": "twosided", "inner": normals(STEEP)},
        shine(np.array(STEEP) * (-1, -1, 1), turned=True),
    ),
}


def scene(plates, **lights):
    size = len(plates)
    camera = {
        "type": "orthographic",
        "to_world": look_at([0, 5, 0], [0, 0, 0], [0, 0, 1]) @ scale([-size, size, 1]),
        "film": {"type": "hdrfilm", "width": size, "height": 1, "rfilter": {"type": "box"}},
    }
    found = {"type": "scene", "sensor": camera, **lights}
    for n, (name, bsdf) in enumerate(plates.items()):
        turn = rotate([0, 0, 1], 180) if "back" in name else np.eye(4)
        at = translate([2 * n - size + 1, 0, 0]) @ turn @ LYING
        found[f"plate_{n}"] = {"type": "rectangle", "to_world": at, "bsdf": bsdf}
    return load_dict(found)


def test_plates_under_a_slanting_sun_show_their_bent_normals():
    sun = {"type": "directional", "direction": -SUN, "irradiance": np.pi}
    result = render(scene({name: bsdf for name, (bsdf, _) in PLATES.items()}, sun=sun), spp=1 << 16)
    for n, (name, (_, expected)) in enumerate(PLATES.items()):
        error = float(np.sqrt(result.variance[0, n, 0]))  # 0 where nothing is left to chance
        assert error < 2.5e-3, name
        assert result.image[0, n, 0] == pytest.approx(expected, rel=2e-5, abs=4 * error), name


@pytest.mark.contract
def test_what_is_sampled_has_the_values_that_lights_are_seen_by():
    """White light all round, found by paths or sampled: pictures differ where pdfs or values disagree."""
    coat = {"type": "roughplastic", "alpha": 0.3}
    glass = {"type": "roughdielectric", "alpha": 0.3}
    plates = {str(n): normals(STEEP, inner) for n, inner in enumerate((coat, glass))}
    lights = {"type": "constant"}, {"type": "envmap", "bitmap": np.ones((4, 8, 3))}
    found, sampled = (render(scene(plates, sky=light), spp=1 << 15, seed=3) for light in lights)
    error = np.sqrt(found.variance + sampled.variance)
    assert (error < 4e-3).all() and (np.abs(found.image - sampled.image) < 4.5 * error).all()
    assert (found.image < 1 + 4.5 * error).all() and (found.image > 0.3).all()
