"""Alpha: the share of camera paths that meet something, against 1 - T in closed form.

Rays run along z, so that T follows from the depths along it.  A bias of 0.5 % is seen: what is found may
differ by that from 1 - T, and has a standard error of 0.16 % at most at these numbers of samples.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import OpenImageIO as oiio  # noqa: N813
import pytest
from click.testing import CliRunner
from pictures import box, gridded, homogeneous, picture, volume
from tiers import quick_first

import clvol
from clvol import layout
from clvol.cli.main import main
from clvol.planning import registry
from clvol.planning.in_force import warnings
from clvol.scene.materials import Diffuse, Mask
from clvol.scene.records import ConstantEmitter, ConstVolume, DirectionalEmitter, ReconstructionFilter, Shape
from clvol.scene.views import TRANSPARENT, before

CUBE = (-1.0, -1.0, -1.0), (1.0, 1.0, 1.0)
SKY, SUN = ConstantEmitter((0.3,)), DirectionalEmitter((4.0,), (0.6, -0.8, 0.0))
LAYERS = np.array([0.2, 1.0, 0.1, 0.0, 0.9], np.float32)
DEPTH = 2.0 * float(LAYERS.mean())
UNBIASED = [name for name, choice in registry.TECHNIQUES.items() if not choice.biased]
CHROMATIC = (0.4, 1.0, 2.0)
CASES = [(1.0, name) for name in UNBIASED] + [
    (CHROMATIC, name) for name in ("delta", "weighted-delta", "spectral", "regular")
]


def cut_out(scene):
    return before(scene, TRANSPARENT)


def layered(scale=1.0, albedo=0.5):
    return gridded(volume(np.broadcast_to(LAYERS[:, None, None], (5, 3, 4)), *CUBE), albedo, scale=scale)


def slab(*media, lights=(SKY, SUN), max_depth=1, **integrator):
    """Media in one cube that fills the view, which looks along z from afar."""
    shapes = [box(*CUBE, medium) for medium in media]
    return cut_out(
        picture(shapes, lights, (0, 0, -900), (0, 0, 0), 1e-3, (4, 4), max_depth=max_depth, **integrator)
    )


def wall(z, bsdf, half=10.0):
    to_world = np.diag([half, half, 1.0, 1.0])
    to_world[2, 3] = z
    return Shape("rectangle", to_world, bsdf=bsdf)


def alpha_of(scene, spp=1 << 14, **options):
    alpha = clvol.render(scene, spp=spp, seed=5, **options).alpha
    assert alpha.dtype == np.float32 and alpha.shape == (4, 4)
    return alpha.mean(dtype=float)


def assert_alpha(found, expected):
    assert abs(found - expected) < 0.005 * expected


@pytest.mark.contract
@pytest.mark.parametrize(("scale", "technique"), CASES)
def test_alpha_is_one_less_the_transmittance_in_every_technique(scale, technique):
    expected = 1 - np.exp(-DEPTH * np.atleast_1d(scale)).mean()
    assert_alpha(alpha_of(slab(layered(scale)), technique=technique), expected)


@pytest.mark.contract
@pytest.mark.parametrize(("background", "lanes"), [("sampled", "8"), ("expected", "8"), ("expected", "off")])
def test_alpha_in_lanes_and_where_walks_expect_the_background(background, lanes):
    options = {"technique": "delta", "background": background, "lanes": lanes, "majorant_scale": 2.0}
    result = clvol.render(slab(layered()), spp=1 << 14, seed=7, **options)
    assert result.metadata["background"] == background
    assert_alpha(result.alpha.mean(), 1 - np.exp(-DEPTH))


@pytest.mark.contract
@pytest.mark.parametrize("background", ["sampled", "expected"])
def test_walks_of_several_legs_count_once(bounds, background):
    bounds(WALK_STEPS=1)
    found = alpha_of(slab(layered(3.0)), technique="delta", background=background)
    assert_alpha(found, 1 - np.exp(-3 * DEPTH))


@pytest.mark.contract
def test_alpha_of_media_that_overlap():
    found = alpha_of(slab(layered(), homogeneous(0.2, 0.9), layered(0.5)))
    assert_alpha(found, 1 - np.exp(-1.5 * DEPTH - 0.4))


def test_alpha_of_what_absorbs_and_glows():
    flame = replace(layered(albedo=0.0), emission=ConstVolume((2.0,)))  # L_e, so that it glows as 2 (1 - T)
    scene = slab(flame, lights=())
    result = clvol.render(scene, spp=1 << 14, seed=5)
    assert_alpha(result.alpha.mean(), 1 - np.exp(-DEPTH))
    np.testing.assert_allclose(result.image.mean(), 2 * (1 - np.exp(-DEPTH)), rtol=0.01)


def test_alpha_behind_null_boundaries_masks_and_walls():
    inner = box((-0.5, -0.5, -0.5), (0.5, 0.5, 0.5), homogeneous(0.3, 0.5))
    shapes = [box(*CUBE, homogeneous(0.2, 0.5)), inner, wall(3.0, Mask(Diffuse(), 0.25))]
    scene = picture(shapes, [SKY], (0, 0, -900), (0, 0, 0), 1e-3, (4, 4), max_depth=1)
    through = np.exp(-0.2 * 2 - 0.3) * 0.75
    assert_alpha(alpha_of(cut_out(scene)), 1 - through)
    walled = replace(scene, shapes=(*shapes, wall(4.0, Diffuse())))
    assert (clvol.render(cut_out(walled), spp=16).alpha == 1).all()


def test_over_the_background_it_is_the_picture_with_it():
    """Premultiplied: what is seen and (1 - alpha) of the sky are the very picture under the sky."""
    scene = picture(
        [box(*CUBE, layered(CHROMATIC[1]))], [SKY, SUN], (0.4, 0.5, -4.0), (0, 0, 0), 90.0, (8, 8)
    )
    options = {"spp": 16, "technique": "delta", "seed": 3}
    whole, cut = clvol.render(scene, **options), clvol.render(scene, background="transparent", **options)
    assert whole.alpha is None and cut.alpha is not None
    over = cut.image + 0.3 * (1 - cut.alpha)[..., None]
    np.testing.assert_allclose(over, whole.image, rtol=1e-5, atol=1e-6)
    assert (cut.alpha[0] == 0).all() and (cut.image[0] == 0).all() and cut.alpha.max() > 0.3


@pytest.mark.contract
def test_filters_with_negative_parts_leave_empty_pixels_empty():
    scene = cut_out(picture([box(*CUBE, layered())], [SKY], (0, 0, -8), (0, 0, 0), 40.0, (12, 12)))
    lanczos = replace(scene, film=replace(scene.film, rfilter=ReconstructionFilter("lanczos", 3.0, 0.0)))
    alpha = clvol.render(lanczos, spp=4096).alpha
    assert (alpha[0, :2] == 0).all()
    plain = clvol.render(scene, spp=1024).alpha
    assert abs(alpha.sum(dtype=float) / plain.sum(dtype=float) - 1) < 0.02


def test_an_environment_that_is_seen_is_opaque_as_in_mitsuba():
    scene = slab(layered())
    seen = replace(scene, film=replace(scene.film, backdrop=None))
    assert (clvol.render(seen, spp=1).alpha == 1).all()
    plan = clvol.plan(seen)
    assert not plan.counts_alpha and "alpha is 1 everywhere" in " ".join(warnings(plan, {}))
    hidden = replace(seen, integrator=replace(seen.integrator, hide_emitters=True))
    assert clvol.plan(seen, background="transparent").counts_alpha
    for other in (scene, hidden, replace(seen, emitters=(SUN,))):
        plan = clvol.plan(other)
        assert plan.counts_alpha and not list(warnings(plan, {}))


def test_parts_merge_with_their_alpha():
    scene = slab(layered())
    parts = [clvol.render(scene, samples=span, seed=1) for span in ((0, 64), (64, 192))]
    whole = clvol.render(scene, spp=256, seed=1)
    np.testing.assert_allclose(clvol.merge(parts).alpha, whole.alpha, rtol=1e-6)


@pytest.mark.contract
def test_renders_to_a_target_error_have_alpha():
    found = clvol.render(slab(layered(), max_depth=2), target_error=0.01, seed=1)
    assert found.metadata["spp"] > 100 and abs(found.alpha.mean() / (1 - np.exp(-DEPTH)) - 1) < 0.05


def test_it_costs_nothing_where_it_is_not_asked_for():
    scene = slab(layered())
    film = replace(scene.film, pixel_format="rgb")
    plain, with_it = clvol.render(replace(scene, film=film), spp=16), clvol.render(scene, spp=16)
    assert (plain.image == with_it.image).all() and plain.alpha is None
    assert with_it.stats["bytes_per_slot"] - plain.stats["bytes_per_slot"] == 4
    macros = clvol.plan(replace(scene, film=film)).macros
    assert not macros["CLVOL_HAS_ALPHA"] and not macros["CLVOL_FIRSTS"]
    assert "result_firsts" not in {argument.name for argument in layout.arguments(macros)}


@quick_first("colour", [(0.1, 0.2, 0.4), (0.6,)])
@quick_first("lights", [[SKY, SUN], [SUN]], ids=["sky", "no sky"])
def test_a_backdrop_is_seen_and_lights_nothing(colour, lights):
    scene = picture([box(*CUBE, layered())], lights, (0.4, 0.5, -4.0), (0, 0, 0), 90.0, (8, 8))
    options = {"spp": 16, "technique": "delta", "seed": 3}
    cut = clvol.render(cut_out(scene), **options)
    seen = clvol.render(before(scene, colour), **options)
    assert seen.alpha is None and seen.metadata["background"] == cut.metadata["background"]
    over = cut.image + (1 - cut.alpha)[..., None] * np.float32(colour)
    np.testing.assert_allclose(seen.image, over, rtol=1e-5, atol=1e-6)


XML = """<scene version="3.0.0"><integrator type="volpath"/><sensor type="perspective">
<film type="hdrfilm"><integer name="width" value="6"/><integer name="height" value="4"/>
<rfilter type="box"/>{film}</film></sensor><emitter type="constant"/>
<shape type="sphere"><float name="radius" value="0.7"/><point name="center" x="0" y="0" z="4"/></shape>
</scene>"""


@pytest.mark.parametrize("film", ["", '<string name="pixel_format" value="rgba"/>'], ids=["rgb", "rgba"])
def test_the_command_writes_pictures_with_alpha(tmp_path, film):
    (tmp_path / "scene.xml").write_text(XML.format(film=film))
    outputs = ["-o", str(tmp_path / "a.exr"), "-o", str(tmp_path / "a.png")]
    words = ["render", str(tmp_path / "scene.xml"), "--background", "transparent", "--spp", "4"]
    outcome = CliRunner().invoke(main, [*words, *outputs])
    assert outcome.exit_code == 0, outcome.output
    for name in ("a.exr", "a.png"):
        pixels = oiio.ImageBuf(str(tmp_path / name)).get_pixels(oiio.FLOAT)
        names = oiio.ImageBuf(str(tmp_path / name)).spec().channelnames
        alpha = pixels[..., names.index("A")]
        assert alpha[0, 0] == 0 and alpha[2, 3] == 1 and pixels[0, 0, 0] == 0
    refused = CliRunner().invoke(main, [*words, "-o", str(tmp_path / "a.jpg")])
    assert refused.exit_code == 2 and "cannot hold alpha" in refused.stderr
    assert not (tmp_path / "a.jpg").exists()
