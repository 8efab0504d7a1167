"""Side by side with Mitsuba 3.9.

Both load the same files, and their pictures agree in every tile and on the mean.

Runs when asked for: ``pytest --mitsuba tests/transport/test_mitsuba.py``, which installs Mitsuba in
an environment of its own, unless CLVOL_MITSUBA names a Python that has it.
"""

import importlib
import os
import re

import mitsuba_scenes
import numpy as np
import pytest
from places import SCENES, TOOLS
from scipy import stats
from stat_tests import FALSE_ALARM, image_mean, sidak, tile_means

import clvol
from clvol.scene import integrator, sensor
from clvol.scene.loader import PLUGINS
from clvol.staging.converting import convert_scene

RUNS = 32
"""Independent renders of Mitsuba, whose scatter is the variance of their mean; few would cost power, as
Student's t has long tails where degrees of freedom are few."""
TILE = 8
BIAS = 0.01
"""Of the image mean: what every comparison must see at least."""
GALLERY = dict.fromkeys(("smoke in a room", "shafts of light", "jade"), 0.02)
"""The same for the scenes of `scenes/`, where Mitsuba's noise would take a quarter of an hour each."""
ROUNDING = 2e-6
"""Of the picture's mean: what is equal but for rounding of floats has no variance to excuse it."""

# Scene (of tests/mitsuba/, if no path), its defaults, samples per pixel of a render of Mitsuba's and of ours.
PICTURES = {
    "room": ("room", {}, 96, 2048),
    "glass": ("glass", {}, 32, 1024),
    "meshes": ("meshes", {}, 32, 4096),
    "coats": ("coats", {}, 64, 2048),
    "shapes": ("shapes", {}, 64, 4096),
    "flakes": ("flakes", {}, 96, 4096),
    "flakes of balls": ("flakes", {"depth": -1, "sky": 0.5, "first": "even", "second": "even"}, 96, 2048),
    "woven": ("woven", {}, 96, 4096),
    "solids": ("solids", {}, 64, 2048),
    "wrapped": ("wrapped", {}, 64, 2048),
    "curves": ("curves", {}, 64, 1024),
    "attributes": ("attributes", {}, 64, 1024),
    "lamps": ("lamps", {}, 64, 2048),
    "fog": ("fog", {}, 96, 4096),
    "cloud": ("cloud", {}, 24, 1024),
    "batch": ("batch", {}, 32, 1024),
    "depths": ("depths", {}, 16, 256),
    "bodies": ("bodies", {}, 48, 768),
    "passages": ("passages", {}, 16, 512),
    "passages, depth 1": ("passages", {"depth": 1, "rfilter": "lanczos"}, 32, 4096),
    "passages, depth 2": ("passages", {"depth": 2, "rfilter": "catmullrom"}, 32, 2048),
    "passages, depth 3": ("passages", {"depth": 3}, 16, 512),
    "fog, depth 3": ("fog", {"depth": 3}, 96, 4096),
    "passages, hidden": ("passages", {"hide": "true", "depth": 5}, 32, 1024),
    "sky, low sun": ("sky", {}, 48, 2048),
    "sky, small sun": ("sky", {"aperture": 0.5358, "height": 0.8}, 48, 2048),
    "smoke in a room": (SCENES / "room", {"res": 24}, 224, 4096),
    "shafts of light": (SCENES / "shaft", {"width": 32, "height": 24}, 192, 4096),
    "jade": (SCENES / "jade", {"width": 32, "height": 24}, 64, 2048),
    "lamps, hidden": ("lamps", {"hide": "true", "integrator": "volpath"}, 160, 8192),
}


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """Where the scenes and what they read lie."""
    folder = tmp_path_factory.mktemp("mitsuba")
    mitsuba_scenes.write_files(folder)
    return folder


@pytest.fixture(scope="module")
def mitsuba(folder):
    """Images (RUNS, height, width, 3) of independent renders of a scene by Mitsuba."""
    with pytest.MonkeyPatch.context() as patch:
        patch.syspath_prepend(TOOLS)
        side = importlib.import_module("benchmarks.mitsuba_side")
    python = side.mitsuba_python(os.environ.get("CLVOL_MITSUBA"))

    def render(scene, defaults, spp):
        with side.MitsubaSide(python, str(folder / f"{scene}.xml"), defaults, os.cpu_count()) as worker:
            assert worker.version.startswith("3.9.")
            # a moment integrator adds channels after the picture's
            return np.array([worker.render(spp, seed)[0][..., :3] for seed in range(RUNS)], float)

    return render


def both(folder, mitsuba, scene, defaults, spp, our_spp, our_defaults=None):
    """Mitsuba's images of a scene, and our result."""
    theirs = mitsuba(scene, {name: str(value) for name, value in defaults.items()}, spp)
    ours = {name: str(value) for name, value in (our_defaults or defaults).items()}
    result = clvol.render(clvol.load_file(str(folder / f"{scene}.xml"), **ours), spp=our_spp, seed=1)
    assert result.image.shape == theirs.shape[1:]
    return theirs, result


def welch(theirs, mean, variance, rounding):
    """Student's t and degrees of freedom of RUNS values against a mean of known variance (Welch 1947)."""
    scatter = theirs.var(axis=0, ddof=1) / RUNS
    total = scatter + variance + rounding**2
    freedom = (RUNS - 1) * (total / np.maximum(scatter, 1e-6 * total)) ** 2
    return (mean - theirs.mean(axis=0)) / np.sqrt(total), freedom, np.sqrt(total)


def deviating(t, freedom, alpha):
    """How many of several comparisons deviate, with a joint false-alarm rate alpha (Šidák)."""
    p = 2 * stats.t.sf(np.abs(t), freedom)
    return int((p < sidak(alpha, t.size)).sum())


def compare(theirs, result, alpha):
    """Messages on what deviates, and the smallest relative bias of the image mean that would be seen."""
    rounding = ROUNDING * theirs.mean()
    nothing = np.zeros_like(theirs)
    tiles = np.array([tile_means(image, none, TILE)[0] for image, none in zip(theirs, nothing, strict=True)])
    found = []
    for what, runs, (mean, variance) in (
        ("tiles", tiles, tile_means(result.image, result.variance, TILE)),
        ("channels of the mean", theirs.mean(axis=(1, 2)), image_mean(result)),
    ):
        t, freedom, error = welch(runs, mean, variance, rounding)
        count = deviating(t, freedom, alpha / 2)
        if count:
            found.append(f"{count} of {t.size} {what} deviate, by {np.abs(t).max():.1f} sigma at most")
    bound = stats.t.isf(sidak(alpha / 2, t.size) / 2, freedom)
    return found, float((bound * error / mean).max())


@pytest.mark.mitsuba
@pytest.mark.parametrize("name", PICTURES)
def test_both_render_the_same_picture(folder, mitsuba, record_property, name):
    """A false alarm in any of the pictures: FALSE_ALARM."""
    scene, defaults, spp, our_spp = PICTURES[name]
    theirs, result = both(folder, mitsuba, scene, defaults, spp, our_spp)
    for count in ("non_finite", "majorant_violations", "walks_exhausted"):
        assert result.stats[count] == 0
    found, seen = compare(theirs, result, sidak(FALSE_ALARM, len(PICTURES)))
    record_property("smallest bias seen", seen)
    assert not found, "; ".join(found)
    least = GALLERY.get(name, BIAS)
    assert seen < least, f"too noisy to see a bias of {least}: {seen}"


@pytest.mark.mitsuba
@pytest.mark.parametrize("meter", ["distant", "radiancemeter"])
def test_sensors_of_one_pixel_measure_the_same(folder, mitsuba, meter):
    theirs, result = both(folder, mitsuba, "meter", {"meter": meter}, 16384, 1 << 17)
    rounding = ROUNDING * theirs.mean()
    t, freedom, error = welch(theirs[:, 0, 0], result.image[0, 0], result.variance[0, 0], rounding)
    assert not deviating(t, freedom, FALSE_ALARM)
    assert (stats.t.isf(FALSE_ALARM / 6, freedom) * error < BIAS * theirs.mean()).all()


@pytest.mark.mitsuba
@pytest.mark.parametrize(("shape", "angle"), [("sphere", 0), ("disk", -60), ("cube", -60)])
def test_irradiance_is_the_same(folder, mitsuba, shape, angle):
    given = {"shape": shape, "angle": angle}
    theirs, result = both(folder, mitsuba, "irradiance", given, 1 << 17, 1 << 20)
    rounding = ROUNDING * theirs.mean()
    t, freedom, error = welch(theirs[:, 0, 0], result.image[0, 0], result.variance[0, 0], rounding)
    assert not deviating(t, freedom, FALSE_ALARM / 3)
    assert (stats.t.isf(FALSE_ALARM / 18, freedom) * error < BIAS * theirs.mean()).all()


@pytest.mark.mitsuba
def test_meters_in_a_batch_measure_the_same(folder, mitsuba):
    """On the mean over each part of the film: in Mitsuba its pixels are places on the shape."""
    theirs, result = both(folder, mitsuba, "gauges", {}, 512, 4096)
    parts = [slice(8 * n, 8 * n + 8) for n in range(3)]
    means = np.stack([theirs[:, :, part].mean(axis=(1, 2)) for part in parts], axis=1)
    ours = np.stack([result.image[:, part].mean(axis=(0, 1), dtype=float) for part in parts])
    variance = np.stack([result.variance[:, part].sum(axis=(0, 1), dtype=float) / 64**2 for part in parts])
    t, freedom, error = welch(means, ours, variance, ROUNDING * means.mean())
    assert not deviating(t, freedom, FALSE_ALARM)
    assert (stats.t.isf(FALSE_ALARM / 18, freedom) * error < BIAS * means.mean(axis=0)).all()
    assert abs(ours[1] / ours[2] - 1).max() > 0.05


PBRT = """
LookAt 1 1.5 -5  0 0 0  0 1 0
Camera "perspective" "float fov" 40
Film "rgb" "integer xresolution" 24 "integer yresolution" 16
PixelFilter "box"
Integrator "volpath" "integer maxdepth" 9
WorldBegin
LightSource "infinite" "string filename" "square.exr"
LightSource "point" "point3 from" [3 4 -1] "rgb I" [20 18 9]
MakeNamedMedium "fog" "string type" "uniformgrid" "integer nx" 2 "integer ny" 2 "integer nz" 3 "float g" .3
  "float density" [1 2 3 4 5 6 1 2 .5 .1 1 2] "rgb sigma_a" [.1 .1 .1] "rgb sigma_s" [.7 .7 .7]
  "point3 p0" [-1 -1 -1] "point3 p1" [1 1 1]
Texture "paint" "spectrum" "imagemap" "string filename" "picture.png" "float scale" .7 "float uscale" 2
AttributeBegin
 Material "diffuse" "texture reflectance" "paint"
 Translate 0 -1.3 0 Scale 3 1 -3
 Shape "bilinearmesh" "point3 P" [-1 0 -1  1 0 -1  -1 0 1  1 0 1] "point2 uv" [0 0  1 0  0 1  1 1]
AttributeEnd
AttributeBegin
 Material "diffuse" "rgb reflectance" [.8 .3 .2]
 Translate 1.2 0.5 0.3 Rotate 30 1 2 3 Scale 2 2 2
 Shape "trianglemesh" "point3 P" [0 0 0  .5 0 0  0 .5 0  0 0 .5]
   "integer indices" [0 2 1  0 1 3  0 3 2  1 2 3]
   "normal3 N" [-1 -1 -1  1 0 .1  0 1 .3  .1 0 1]
AttributeEnd
AttributeBegin
 MediumInterface "fog" ""
 Material "interface"
 Shape "sphere" "float radius" 1
AttributeEnd
"""


@pytest.mark.mitsuba
def test_a_scene_of_pbrt_is_converted_to_one_that_mitsuba_renders_alike(folder, mitsuba):
    square = np.random.default_rng(5).uniform(0.2, 0.8, (6, 6, 3)).astype(np.float32)
    mitsuba_scenes.write_image(folder / "square.exr", square)
    (folder / "told.pbrt").write_text(PBRT)
    convert_scene(folder / "told.pbrt", folder / "converted.xml", {})
    found, seen = compare(*both(folder, mitsuba, "converted", {}, 96, 4096), FALSE_ALARM)
    assert not found, "; ".join(found)
    assert seen < BIAS


OLD = """<scene version="0.6.0">
<integrator type="volpath_simple"> <integer name="maxDepth" value="9"/> </integrator>
<sensor type="perspective"> <float name="fov" value="40"/>
  <transform name="toWorld"> <lookAt origin="1, 1.5, -5" target="0, 0, 0" up="0, 1, 0"/> </transform>
  <film type="ldrfilm"> <integer name="width" value="24"/> <integer name="height" value="16"/>
    <rfilter type="box"/> </film> </sensor>
<emitter type="constant"> <spectrum name="radiance" value="0.4, 0.5, 0.7"/> </emitter>
<emitter type="point"> <point name="position" x="3" y="4" z="-1"/>
  <spectrum name="intensity" value="20"/> </emitter>
<medium id="milk" type="homogeneous"> <spectrum name="sigmaS" value="2, 4, 6"/>
  <spectrum name="sigmaA" value="0.5"/> <float name="scale" value="0.4"/>
  <phase type="hg"> <float name="g" value="0.3"/> </phase> </medium>
<shape type="sphere"> <ref name="interior" id="milk"/> </shape>
<shape type="rectangle"> <transform name="toWorld"> <scale value="3"/> <rotate x="1" angle="-90"/>
  <translate y="-1.3"/> </transform> <bsdf type="diffuse"/> </shape>
</scene>"""


@pytest.mark.mitsuba
def test_an_old_scene_is_converted_to_one_that_mitsuba_renders_alike(folder, mitsuba):
    (folder / "old.xml").write_text(OLD)
    convert_scene(folder / "old.xml", folder / "renewed.xml", {})
    found, seen = compare(*both(folder, mitsuba, "renewed", {}, 48, 2048), FALSE_ALARM)
    assert not found, "; ".join(found)
    assert seen < BIAS


@pytest.mark.mitsuba
def test_a_picture_that_lacks_its_last_two_bounces_is_noticed(folder, mitsuba):
    theirs, result = both(folder, mitsuba, "passages", {"depth": 5}, 16, 512, {"depth": 3})
    found, _ = compare(theirs, result, sidak(FALSE_ALARM, len(PICTURES)))
    assert found


def test_the_scenes_have_every_plugin_that_both_programs_know():
    text = "".join(scene.read_text() for scene in mitsuba_scenes.SCENES)
    used = set(re.findall(r'(?:type|name="integrator" value)="(\w+)"', text))
    used |= {"distant", "radiancemeter"}  # $meter
    used |= {value for _, defaults, *_ in PICTURES.values() for value in defaults.values()}
    taken_as_others = {*integrator.OTHERS, *integrator.WRAPPERS, *sensor.OTHER_SAMPLERS, "aov"}
    known = {name for plugins in PLUGINS.values() for name in plugins}
    not_in_rgb = {"regular", "irregular", "blackbody"}  # Mitsuba's rgb variants do not take them
    at_another_time = {"timed_sunsky"}  # Mitsuba's rays that leave the scene see its first moment
    own = {"classified", "vdbvolume", "stl", "glb", "gltf", "mesh"}
    assert known - used - taken_as_others - not_in_rgb - at_another_time == own
