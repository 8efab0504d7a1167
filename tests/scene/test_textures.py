"""Textures: how they are read, and their colours on the device against Mitsuba's."""

import numpy as np
import OpenImageIO as oiio  # noqa: N813
import pytest
from material_probe import MaterialProbe, read

from clvol.errors import SceneError
from clvol.scene.materials import Bitmap, Checkerboard, Diffuse
from clvol.scene.transforms import scale, translate

UV = np.array(
    [
        *((0.125, 0.1), (0.3, 0.45), (0.01, 0.02), (0.99, 0.99), (-0.3, 0.4), (1.7, 2.2)),
        *((-1.2, -0.6), (1.0, 1.0), (0.0, 0.0), (0.5, 0.5), (0.9, 0.3), (2.4, -3.7)),
    ]
)
TWELFTHS = (np.arange(12) * 5 % 12 / 12).reshape(3, 4)
PICTURE = np.stack([TWELFTHS, 1 - TWELFTHS, TWELFTHS**2], axis=-1).astype(np.float32)
MOVED = np.array([[1.5, 0.5, 0.2], [-0.4, 2.0, -0.3], [0.0, 0.0, 1.0]])
RED = {
    ("nearest", "repeat"): "0 .0833333 0 .583333 .5 .833333 .916667 0 0 .5 .25 .416667",
    ("nearest", "mirror"): "0 .0833333 0 .583333 .0833333 .416667 .916667 .583333 0 .5 .25 .416667",
    ("nearest", "clamp"): "0 .0833333 0 .583333 .666667 .583333 0 .583333 0 .5 .25 .25",
    ("bilinear", "repeat"): (
        ".0666667 .263333 .261667 .311667 .635 .655 .681667 .291667 .291667 .291667 .491667 .325"
    ),
    ("bilinear", "mirror"): "0 .263333 0 .583333 .268333 .288333 .691667 .583333 0 .291667 .516667 .325",
    ("bilinear", "clamp"): "0 .263333 0 .583333 .466667 .583333 0 .583333 0 .291667 .516667 .25",
}
"""Red channel of PICTURE at UV; this and the following: `eval` of Mitsuba 3.9.1's textures, scalar_rgb."""
MOVED_GREEN = ".4 .123333 .519467 .751107 .278333 .261 .788333 .728333 .528333 .508333 .591 .478333"
CHECKERS = ".8 .8 .8 .8 .3 .3 .3 .8 .8 .8 .3 .8"
MOVED_CHECKERS = ".3 .3 .3 .8 .8 .3 .3 .8 .3 .8 .8 .3"
OPACITY = ".71516 .673787 .71516 .446599 .481958 .346537 .315187 .71516 .71516 .481958 .594048 .518319"
"""1 - eval_null_transmission of a mask with PICTURE as its opacity, nearest texel."""


def numbers(text):
    return np.array(text.split(), float)


def bitmap(**parameters):
    return {"type": "bitmap", "bitmap": PICTURE} | parameters


def matrix4(matrix):
    return np.insert(np.insert(matrix, 2, 0, axis=0), 2, (0, 0, 1, 0), axis=1)


@pytest.fixture(scope="module")
def probe(device):
    """Textures of many BSDFs; number n is the texture of BSDF n."""
    textures = [bitmap(filter_type=f, wrap_mode=w) for f, w in RED]
    textures.append(bitmap(to_uv=matrix4(MOVED)))
    checkers = {"type": "checkerboard", "color0": 0.8, "color1": 0.3}
    textures += [checkers, checkers | {"to_uv": MOVED}]
    bsdfs = [read({"type": "diffuse", "reflectance": t}) for t in textures]
    mask = {"type": "mask", "opacity": bitmap(filter_type="nearest"), "nested": {"type": "diffuse"}}
    return MaterialProbe(device, [*bsdfs, read(mask)], {"DIFFUSE"})


@pytest.mark.parametrize("number", range(len(RED)))
def test_filters_and_wrapping_are_mitsubas(probe, number):
    color = probe.texture(number, UV)
    red = numbers(list(RED.values())[number])
    assert np.allclose(color[:, 0], red, atol=2e-6)
    assert np.allclose(color[:, 1], 1 - red, atol=2e-6)


def test_uv_transforms_are_mitsubas(probe):
    assert np.allclose(probe.texture(len(RED), UV)[:, 1], numbers(MOVED_GREEN), atol=2e-6)
    assert np.allclose(probe.texture(len(RED) + 2, UV), numbers(MOVED_CHECKERS)[:, None])


def test_checkers_are_mitsubas(probe):
    assert np.allclose(probe.texture(len(RED) + 1, UV), numbers(CHECKERS)[:, None])


def test_far_and_odd_places_are_texels(probe):
    far = np.array([(1e30, -1e30), (3e9, 1.0), (-1e20, 0.0), (1e-30, -1e-30)])
    for number in range(len(RED) + 3):
        color = probe.texture(number, far)
        assert ((color >= 0) & (color <= 1)).all()


def test_materials_take_their_textures(probe):
    wi = np.array([[0.0, 0.0, 1.0]])
    value, _ = probe.value(0, wi, np.repeat(wi, len(UV), axis=0), UV)
    assert np.allclose(value[:, 0] * np.pi, numbers(RED["nearest", "repeat"]), atol=2e-6)


def test_opacity_is_the_luminance_as_in_mitsuba(probe):
    masked = probe.sides[len(RED) + 3]
    for side in masked:  # a mask is as thick from behind, though its diffuse back is black
        straight, opacity = probe.null(side, (0.0, 0.0, 1.0), UV)
        assert np.allclose(opacity, numbers(OPACITY), atol=2e-6)
        assert np.allclose(straight, 1 - opacity[:, None], atol=2e-6)
    up = np.array([[0.0, 0.0, 1.0]])
    assert (probe.value(masked[0], up, up)[0] > 0).all() and (probe.value(masked[1], up, up)[0] == 0).all()


# -- reading -----------------------------------------------------------------------------------------


def texture(**parameters):
    return read({"type": "diffuse", "reflectance": parameters}).reflectance


def test_defaults():
    found = texture(type="bitmap", bitmap=PICTURE)
    assert isinstance(found, Bitmap)
    assert (found.filter_type, found.wrap_mode) == ("bilinear", "repeat")
    assert (found.to_uv == np.eye(3)).all() and np.array_equal(found.pixels, PICTURE)
    found = texture(type="checkerboard")
    assert isinstance(found, Checkerboard) and (found.color0, found.color1) == ((0.4,), (0.2,))


def test_to_uv_is_what_moves_uv():
    found = texture(type="checkerboard", to_uv=scale((2, 3, 1)) @ translate((0.25, 0.5, 9)))
    assert np.allclose(found.to_uv, [[2, 0, 0.5], [0, 3, 1.5], [0, 0, 1]])


def test_integers_are_decoded_unless_raw(tmp_path):
    grey = np.full((2, 3, 3), 128, np.uint8)
    image = oiio.ImageBuf(oiio.ImageSpec(3, 2, 3, oiio.UINT8))
    image.set_pixels(oiio.ROI(), grey)
    image.write(str(tmp_path / "grey.png"))
    for source in ({"bitmap": grey}, {"filename": str(tmp_path / "grey.png")}):
        assert np.allclose(texture(type="bitmap", **source).pixels, 0.215861, atol=1e-6)
        assert np.allclose(texture(type="bitmap", raw=True, **source).pixels, 128 / 255)


def test_raw_grey_file(tmp_path):
    image = oiio.ImageBuf(oiio.ImageSpec(3, 2, 1, oiio.UINT8))
    image.set_pixels(oiio.ROI(), np.arange(6, dtype=np.uint8).reshape(2, 3, 1) * 50)
    image.write(str(tmp_path / "grey.png"))
    found = texture(type="bitmap", raw=True, filename=str(tmp_path / "grey.png"))
    assert np.allclose(found.pixels, np.arange(6).reshape(2, 3, 1) * 50 / 255)


def test_alpha_leaves_colours_alone(tmp_path):
    """As in Mitsuba: 128 of 255 is 0.21586, whatever the alpha."""
    image = oiio.ImageBuf(oiio.ImageSpec(3, 2, 4, oiio.UINT8))
    image.specmod().attribute("oiio:UnassociatedAlpha", 1)
    image.set_pixels(oiio.ROI(), np.tile(np.array([128, 128, 128, 64], np.uint8), (2, 3, 1)))
    image.write(str(tmp_path / "alpha.png"))
    for raw, expected in ((False, 0.215861), (True, 128 / 255)):
        found = texture(type="bitmap", raw=raw, filename=str(tmp_path / "alpha.png"))
        assert np.allclose(found.pixels, expected, atol=1e-6)


def test_a_texture_used_twice_is_one():
    from clvol.tables.materials import material_table

    shared = read({"type": "checkerboard"})
    table = material_table([Diffuse(shared), Diffuse(shared)])
    assert len(table.textures) == 1 and len(table.materials) == 2
    picture = read(bitmap())
    other = Bitmap(picture.pixels, wrap_mode="clamp")
    table = material_table([Diffuse(picture), Diffuse(other)])
    assert len(table.textures) == 2 and len(table.texels) == 12


@pytest.mark.parametrize(
    ("parameters", "message"),
    [
        ({"type": "bitmap"}, "either a filename or a bitmap"),
        ({"type": "bitmap", "bitmap": PICTURE, "filename": "x.png"}, "either a filename or a bitmap"),
        ({"type": "bitmap", "filename": "missing.png"}, "does not exist"),
        ({"type": "bitmap", "filename": __file__}, "cannot read image"),
        ({"type": "bitmap", "bitmap": PICTURE * 2}, r"texels must be in \[0, 1\]; at row 0, column 0"),
        ({"type": "bitmap", "bitmap": -PICTURE}, "texels must be in"),
        ({"type": "bitmap", "bitmap": PICTURE * np.nan}, "texels must be in"),
        ({"type": "bitmap", "bitmap": PICTURE[0, 0]}, "expected an image"),
        ({"type": "bitmap", "bitmap": PICTURE, "filter_type": "trilinear"}, "cannot be 'trilinear'"),
        ({"type": "bitmap", "bitmap": PICTURE, "wrap_mode": "clip"}, "cannot be 'clip'"),
        ({"type": "bitmap", "bitmap": PICTURE, "raw": 1}, "true or false"),
        ({"type": "bitmap", "bitmap": PICTURE, "scale": 2.0}, "unknown parameter 'scale'"),
        ({"type": "bitmap", "bitmap": PICTURE, "to_uv": np.eye(2)}, "4x4"),
        ({"type": "bitmap", "bitmap": PICTURE, "to_uv": MOVED * np.nan}, "to_uv must be finite"),
        ({"type": "checkerboard", "to_uv": MOVED.T}, "last row of 0 0 1"),
        ({"type": "checkerboard", "color0": 1.5}, r"in \[0, 1\]"),
        ({"type": "checkerboard", "color0": {"type": "checkerboard"}}, "no texture in a texture"),
        ({"type": "plastic"}, "a texture"),
    ],
)
def test_errors(parameters, message):
    with pytest.raises(SceneError, match=message) as caught:
        texture(**parameters)
    assert caught.value.where
