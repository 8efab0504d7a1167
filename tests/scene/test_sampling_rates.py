"""Sampling rates of principled BSDFs: told where a rate of 0 leaves light out, and not where it does not."""

import pytest

import clvol

BOARD = {"type": "checkerboard", "color0": 0.0, "color1": 1.0}


def said(caplog, bsdf):
    caplog.clear()
    ball = {"type": "sphere", "bsdf": bsdf}
    clvol.load_dict({"type": "scene", "camera": {"type": "perspective"}, "ball": ball})
    return "light that no other lobe's samples find is left out" in caplog.text


def rates(**given):
    return {f"{lobe}_sampling_rate": rate for lobe, rate in given.items()}


@pytest.mark.parametrize(
    ("given", "left_out"),
    [
        (rates(main_specular=0), False),
        (rates(main_specular=0, diffuse_reflectance=0), True),
        (rates(main_specular=0, diffuse_reflectance=0) | {"clearcoat": 0.5}, False),
        (rates(main_specular=0) | {"metallic": 1.0}, True),
        (rates(main_specular=0) | {"metallic": 0.9}, False),
        (rates(main_specular=0) | {"metallic": BOARD}, True),
        (rates(main_specular=0) | {"spec_trans": 0.1}, True),
        (rates(diffuse_reflectance=0, clearcoat=0) | {"clearcoat": 1.0}, False),
    ],
    ids=range(8),
)
def test_of_a_solid(caplog, given, left_out):
    assert said(caplog, {"type": "principled"} | given) == left_out


@pytest.mark.parametrize(
    ("given", "left_out"),
    [
        (rates(diffuse_transmittance=0), False),
        (rates(diffuse_transmittance=0) | {"diff_trans": 1.0}, True),
        (rates(diffuse_transmittance=0) | {"diff_trans": 1.0, "spec_trans": 0.5}, False),
        (rates(specular_transmittance=0) | {"spec_trans": 0.5}, True),
        (rates(specular_transmittance=0) | {"spec_trans": 0.5, "diff_trans": 1.0}, False),
        (rates(diffuse_reflectance=0), True),
        (rates(diffuse_reflectance=0) | {"diff_trans": 2.0}, False),
        (rates(specular_reflectance=0) | {"spec_trans": BOARD}, True),
    ],
    ids=range(8),
)
def test_of_a_sheet(caplog, given, left_out):
    assert said(caplog, {"type": "principledthin"} | given) == left_out


@pytest.mark.parametrize(
    ("bsdf", "lit"),
    [
        ({"type": "principled", **rates(main_specular=0)}, True),
        ({"type": "principled", "metallic": 1.0, **rates(main_specular=0)}, False),
    ],
)
def test_what_is_said_is_so(caplog, bsdf, lit):
    """A ball that scatters by no lobe that is sampled is black under an even sky."""
    scene = {
        "type": "scene",
        "integrator": {"type": "path"},
        "camera": {"type": "perspective", "fov": 10.0, "film": {"type": "hdrfilm", "width": 2, "height": 2}},
        "ball": {"type": "sphere", "center": [0.0, 0.0, 4.0], "bsdf": bsdf},
        "sky": {"type": "constant"},
    }
    result = clvol.render(clvol.load_dict(scene), spp=64, transmittance="none")
    assert (result.image.min() > 0.1) == lit
