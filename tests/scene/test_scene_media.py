"""What scenes say about media beyond extinction and albedo: coloured scales, emission, phase functions."""

from dataclasses import fields, replace

import numpy as np
import pytest

import clvol
from clvol.errors import Error, SceneError
from clvol.planning.plan import Plan
from clvol.scene import load_dict, load_file, scale
from clvol.scene.describe import describe_scene
from clvol.scene.digest import scene_digest
from clvol.scene.medium_facts import medium_volumes
from clvol.scene.phase import MAX_LOBES
from clvol.scene.records import BlendPhase, ConstVolume, Film, GridVolume, Medium, Phase, PhaseTable
from clvol.volumes.transfer import Transfer, Transfers

DENSITY = np.random.default_rng(3).uniform(0, 2, (4, 3, 2))
COLOURED = DENSITY[..., None] * np.array([0.5, 1.0, 0.25])
RGB = {"type": "rgb", "value": [1.0, 2.0, 4.0]}


def grid(values=DENSITY, **parameters):
    return {"type": "gridvolume", "data": values} | parameters


def scene_of(**parameters):
    medium = {"type": "heterogeneous"} | parameters
    cube = {"type": "cube", "bsdf": {"type": "null"}, "interior": medium}
    return load_dict({"type": "scene", "camera": {"type": "perspective", "fov": 40}, "cube": cube})


def medium_of(**parameters):
    return scene_of(**parameters).shapes[0].interior


def features_of(**parameters):
    return Plan.of(scene_of(**parameters)).features


def error_of(**parameters):
    with pytest.raises(Error) as caught:
        medium_of(**parameters)
    return str(caught.value)


# -- scale -------------------------------------------------------------------------------------------


def test_scale_is_a_number_or_a_colour():
    assert medium_of(scale=3).scale == (3.0,)
    assert medium_of(scale=RGB).scale == (1.0, 2.0, 4.0)
    assert medium_of(scale={"type": "rgb", "value": [2, 2, 2]}).scale == (2.0,)
    assert Medium(ConstVolume((1.0,)), ConstVolume((0.5,)), 5).scale == (5.0,)
    assert Medium(ConstVolume((1.0,)), ConstVolume((0.5,)), np.array([1, 2, 3])).scale == (1.0, 2.0, 3.0)
    with pytest.raises(ValueError, match="one or three"):
        Medium(ConstVolume((1.0,)), ConstVolume((0.5,)), (1.0, 2.0))


def test_a_coloured_scale_makes_extinction_chromatic():
    assert not features_of(sigma_t=grid()).chromatic_extinction
    coloured = features_of(sigma_t=grid(), scale=RGB)
    assert coloured.chromatic_extinction and not coloured.coloured_volumes
    assert features_of(type="homogeneous", scale=RGB).chromatic_extinction


def test_media_without_extinction_do_not_scatter():
    assert features_of(scale=2.0).scattering
    assert not features_of(scale=0.0).scattering
    apart = {"albedo": {"type": "rgb", "value": [0.5, 0, 0]}, "scale": {"type": "rgb", "value": [0, 1, 1]}}
    assert not features_of(**apart).scattering


def test_a_coloured_scale_of_a_coloured_grid_is_an_error():
    for values in (COLOURED, COLOURED**2):
        message = error_of(sigma_t=grid(values), scale=RGB)
        assert "scene.cube.interior.scale: a coloured scale needs a sigma_t of one channel" in message
        assert "give a number as scale" in message


# -- grids whose channels are proportional --------------------------------------------------------------


def test_a_coloured_grid_of_proportional_channels_becomes_grey_times_a_colour():
    medium = medium_of(sigma_t=grid(COLOURED), scale=2.0)
    assert medium.sigma_t.grid.values.shape[-1] == 1
    assert medium.scale == pytest.approx((1.0, 2.0, 0.5), rel=1e-6)
    np.testing.assert_allclose(medium.sigma_t.grid.values * np.array(medium.scale), 2 * COLOURED, rtol=1e-6)
    found = features_of(sigma_t=grid(COLOURED))
    assert found.chromatic_extinction and not found.coloured_volumes


def test_a_coloured_grid_of_equal_channels_is_grey():
    medium = medium_of(sigma_t=grid(np.repeat(DENSITY[..., None], 3, axis=3)), scale=2.0)
    assert medium.scale == (2.0,)
    assert not features_of(sigma_t=grid(np.repeat(DENSITY[..., None], 3, axis=3))).chromatic_extinction


def test_a_coloured_grid_of_other_channels_and_every_albedo_keep_three():
    assert medium_of(sigma_t=grid(COLOURED ** [1, 2, 1])).sigma_t.grid.values.shape[-1] == 3
    assert medium_of(albedo=grid(COLOURED / 4)).albedo.grid.values.shape[-1] == 3


def test_a_reduced_grid_that_media_share_stays_shared():
    shared = {"type": "ref", "id": "fog"}
    scene = load_dict(
        {
            "type": "scene",
            "camera": {"type": "perspective", "fov": 40},
            "fog": grid(COLOURED / 4),
        }
        | {
            name: {
                "type": "cube",
                "bsdf": {"type": "null"},
                "interior": {"type": "heterogeneous", "sigma_t": shared, "albedo": shared},
            }
            for name in ("a", "b")
        }
    )
    first, second = (shape.interior for shape in scene.shapes)
    assert first.sigma_t is second.sigma_t
    assert first.albedo is second.albedo
    assert (first.sigma_t.grid.values.shape[-1], first.albedo.grid.values.shape[-1]) == (1, 3)


# -- emission ------------------------------------------------------------------------------------------


def test_media_do_not_emit_unless_told_to():
    medium = medium_of()
    assert (medium.emission, medium.temperature) == (None, None)
    assert (medium.emission_scale, medium.temperature_scale, medium.temperature_offset) == ((1.0,), 1.0, 0.0)
    assert not medium.emits
    found = features_of()
    assert not (found.emission or found.emission_volumes or found.temperature or found.chromatic_emission)


@pytest.mark.parametrize("kind", ["homogeneous", "heterogeneous"])
def test_emission_is_a_number_a_colour_or_a_volume(kind):
    assert medium_of(type=kind, emission=2, emission_scale=3).emission.value == (2.0,)
    assert medium_of(type=kind, emission=2, emission_scale=3).emission_scale == (3.0,)
    assert medium_of(type=kind, emission=RGB).emission.value == (1.0, 2.0, 4.0)
    assert medium_of(type=kind, emission={"type": "constvolume", "value": 5.0}).emission.value == (5.0,)
    glow = medium_of(type=kind, emission=grid(COLOURED)).emission
    assert glow.grid.values.shape == (4, 3, 2, 3)


@pytest.mark.parametrize("emission", [2.0, grid()], ids=["number", "grid"])
def test_emission_scale_may_be_a_colour(emission):
    assert medium_of(emission=emission, emission_scale=RGB).emission_scale == (1.0, 2.0, 4.0)
    assert features_of(emission=emission, emission_scale=RGB).chromatic_emission
    assert not features_of(emission=emission, emission_scale=3.0).chromatic_emission
    scale_of_one = {"type": "spectrum", "value": 1.0}  # a factor, and so 1 in each channel
    assert medium_of(emission=emission, emission_scale=scale_of_one).emission_scale == (1.0,)


def test_the_colour_of_emission_scale_is_seen():
    scene = scene_of(emission=grid(), emission_scale=RGB, albedo=0.0)
    image = clvol.render(replace(scene, film=Film(4, 4)), spp=16, seed=1).image.mean(axis=(0, 1))
    assert image[0] > 0
    np.testing.assert_allclose(image / image[0], [1.0, 2.0, 4.0], rtol=1e-5)


def test_a_spectrum_of_emission_is_seen_as_that_of_a_light():
    constant = medium_of(emission={"type": "spectrum", "value": 1.0}).emission.value
    assert constant == pytest.approx((1.204794, 0.948291, 0.908916))


@pytest.mark.parametrize("kind", ["homogeneous", "heterogeneous"])
def test_temperature_is_a_number_or_a_volume_of_one_channel(kind):
    medium = medium_of(type=kind, temperature=500, temperature_offset=-273.15, temperature_scale=2)
    assert medium.temperature.value == (500.0,)
    assert (medium.temperature_offset, medium.temperature_scale) == (-273.15, 2.0)
    assert medium_of(type=kind, temperature={"type": "constvolume", "value": 900.0}).emits
    celsius = medium_of(type=kind, temperature=grid(DENSITY - 1.0))  # below 0 is fine
    assert isinstance(celsius.temperature, GridVolume)


def test_a_volume_of_emission_can_shape_the_glow_of_a_temperature():
    medium = medium_of(emission=grid(), temperature=1500.0, emission_scale=4.0)
    assert isinstance(medium.emission, GridVolume)
    assert medium.temperature.value == (1500.0,)
    assert medium.emission_scale == (4.0,)


@pytest.mark.parametrize(
    ("parameters", "emits"),
    [
        ({"emission": 1.0}, True),
        ({"emission": grid()}, True),
        ({"temperature": 1000.0}, True),
        ({"temperature": 10.0, "temperature_offset": 20.0, "temperature_scale": -1.0}, True),
        ({"emission": 0.0}, False),
        ({"emission": grid(), "emission_scale": 0.0}, False),
        ({"temperature": 1000.0, "emission_scale": 0.0}, False),
        ({"temperature": 0.0}, False),
        ({"temperature": 200.0, "temperature_offset": 273.15}, False),
        ({"temperature": grid(), "emission": 0.0}, False),
        ({"temperature": 0.0, "emission": grid()}, False),
    ],
)
def test_what_is_dark_needs_no_code_and_no_volumes(parameters, emits):
    medium = medium_of(**parameters)
    assert medium.emits == features_of(**parameters).emission == emits
    given = [v for v in (medium.emission, medium.temperature) if isinstance(v, GridVolume)]
    assert medium_volumes(medium) == (given if emits else [])


def test_features_tell_what_emission_needs():
    grey = features_of(emission=grid())
    assert grey.emission_volumes and not grey.temperature and not grey.chromatic_emission
    assert features_of(emission=RGB).chromatic_emission
    assert features_of(emission=grid(COLOURED)).chromatic_emission
    constant = features_of(temperature=1000.0)
    assert constant.chromatic_emission and not constant.temperature  # one colour, known beforehand
    looked_up = features_of(temperature=grid())
    assert looked_up.temperature and looked_up.chromatic_emission and not looked_up.emission_volumes
    assert looked_up.volumes == 1


@pytest.mark.parametrize(
    ("parameters", "message"),
    [
        (
            {"emission": -1.0},
            "scene.cube.interior.emission: 'emission' of medium 'heterogeneous' must be finite and >= 0",
        ),
        ({"emission": {"type": "rgb", "value": [1, -1, 1]}}, "finite and >= 0"),
        ({"emission": grid(-DENSITY)}, "emission of medium 'heterogeneous' has"),
        ({"emission": grid(DENSITY * np.nan)}, "NaN or infinite"),
        ({"emission": {"type": "hg"}}, "must be a number, a colour or a volume, got a 'hg'"),
        ({"emission": 1.0, "emission_scale": -2.0}, "scene.cube.interior.emission_scale"),
        ({"emission": 1.0, "emission_scale": float("nan")}, "finite and >= 0"),
        ({"emission_scale": 2.0}, "scene.cube.interior.emission_scale: 'emission_scale' of medium"),
        ({"emission_scale": 2.0}, "has nothing to scale give the medium an emission or a temperature"),
        ({"temperature_scale": 2.0}, "give the medium a temperature"),
        ({"emission": 1.0, "temperature_offset": 2.0}, "give the medium a temperature"),
        ({"temperature": RGB}, "scene.cube.interior.temperature: 'temperature' of medium"),
        ({"temperature": float("inf")}, "must be finite"),
        ({"temperature": grid(COLOURED)}, "must be a number or a volume of one channel, this one has three"),
        ({"temperature": {"type": "constvolume", "value": RGB}}, "this one has three"),
        ({"temperature": {"type": "hg"}}, "must be a number or a volume of one channel, got a 'hg'"),
        ({"temperature": grid(DENSITY * np.inf)}, "temperature of medium 'heterogeneous' has"),
        ({"temperature": 1.0, "temperature_scale": float("inf")}, "must be finite"),
        ({"temperatur": 1.0}, "did you mean 'temperature'?"),
    ],
)
def test_impossible_emission_is_an_error(parameters, message):
    assert message in error_of(**parameters).replace("\n", " ").replace("  ", " ").replace("; ", " ")


# -- phase functions -----------------------------------------------------------------------------------

BLEND = {
    "type": "blendphase",
    "weight": 0.25,
    "z": {"type": "hg", "g": 0.5},  # in the order of the scene, as Mitsuba 3.9.1 takes them
    "a": {"type": "rayleigh"},
}


TABLE = {"type": "tabphase", "values": "1, 2.5 4"}


def test_a_tabulated_phase_function_is_a_string_or_an_array():
    assert medium_of(phase=TABLE).phase.table == PhaseTable((1.0, 2.5, 4.0))
    given = TABLE | {"values": np.float32([1, 2.5, 4]), "angles": [0, 90, 180]}
    assert medium_of(phase=given).phase.table == PhaseTable((1.0, 2.5, 4.0), (0.0, 90.0, 180.0))
    assert features_of(phase=TABLE).phases == ("TABPHASE",)


def test_rayleigh_and_blended_phase_functions():
    assert medium_of(phase={"type": "rayleigh"}).phase == Phase("rayleigh")
    blend = BlendPhase(0.25, Phase("hg", 0.5), Phase("rayleigh"))
    assert medium_of(phase=BLEND).phase == blend
    nested = {"type": "blendphase", "weight": 1, "first": BLEND, "second": {"type": "isotropic"}}
    assert medium_of(phase=nested).phase == BlendPhase(1.0, blend, Phase())


def test_features_tell_which_phase_functions_there_are():
    found = features_of(phase=BLEND)
    assert (found.phases, found.blend) == (("HG", "RAYLEIGH"), True)
    found = features_of(phase=BLEND | {"weight": 1.0})  # only the second
    assert (found.phases, found.blend) == (("RAYLEIGH",), False)
    found = features_of(phase=BLEND | {"a": {"type": "hg", "g": 0.5}})  # twice the same
    assert (found.phases, found.blend) == (("HG",), False)


def many_phases(levels):
    """A mixture of mixtures, each holding the one below twice."""
    phases = {"mix0": {"type": "isotropic"}}
    for n in range(levels):
        below = {"type": "ref", "id": f"mix{n}"}
        phases[f"mix{n + 1}"] = {"type": "blendphase", "weight": 0.5, "a": below, "b": below}
    return phases


def load_phases(phases):
    return load_dict({"type": "scene", "camera": {"type": "perspective", "fov": 40}} | phases)


def test_mixtures_cannot_grow_without_end():
    load_phases(many_phases(6))
    assert MAX_LOBES == 2**6
    with pytest.raises(SceneError, match="at most 64 phase functions, got 128"):
        load_phases(many_phases(60))
    itself = BLEND | {"a": {"type": "ref", "id": "p"}}
    with pytest.raises(SceneError, match=r"'blendphase' is nested without end"):
        load_phases({"p": itself})
    chain = {f"p{n}": BLEND | {"a": {"type": "ref", "id": f"p{n + 1}"}, "id": f"p{n}"} for n in range(2000)}
    with pytest.raises(SceneError, match="nested without end"):
        load_phases(chain | {"p2000": {"type": "isotropic"}})


@pytest.mark.parametrize(
    ("phase", "message"),
    [
        ({"type": "hg", "g": 1.0}, "must be in (-1, 1)"),
        ({"type": "rayleigh", "g": 0.5}, "unknown parameter 'g' of phase 'rayleigh'"),
        ({"type": "sggx"}, "an sggx needs S"),
        ({"type": "tabphase"}, "a tabphase needs values"),
        (TABLE | {"values": "1"}, "phase.values: there must be 2 to 65536 values, not 1, of a tabphase"),
        (TABLE | {"values": "1, x2"}, "'values' of a tabphase has 'x2', which is no number"),
        (TABLE | {"values": "0, 0"}, "values must be finite and >= 0, and not all 0"),
        (TABLE | {"values": "1 nan"}, "values must be finite and >= 0"),
        (TABLE | {"values": [[1, 2]]}, "must be numbers in a row"),
        (TABLE | {"values": 3}, "must be numbers in a row"),
        (TABLE | {"values": {"type": "rgb", "value": [1, 2, 3]}}, "must be an array of numbers"),
        (TABLE | {"angles": "0, 180"}, "phase.angles: there must be as many angles as values, 3, not 2, of"),
        (TABLE | {"angles": "0, 90, 90"}, "angles must increase from 0 to 180"),
        (TABLE | {"values": "1, 0, 0", "angles": "0, 1e-6, 180"}, "a peak that is too narrow"),
        (
            BLEND | {"weight": np.nan},
            "scene.cube.interior.phase.weight: 'weight' of phase 'blendphase' must be",
        ),
        (BLEND | {"weight": grid(np.full((2, 2, 2), np.nan))}, "NaN"),
        (BLEND | {"weight": grid(np.ones((2, 2, 2, 3)))}, "a volume of one channel"),
        (BLEND | {"weight": {"type": "checkerboard"}}, "a number or a volume of one channel, got a 'checker"),
        (BLEND | {"weight": grid(), "a": BLEND | {"weight": grid()}}, "one weight that is a volume"),
        (BLEND | {"weight": {"type": "rgb", "value": [0, 1, 0]}}, "must be a number"),
        ({k: v for k, v in BLEND.items() if k != "weight"}, "needs a weight"),
        ({k: v for k, v in BLEND.items() if k != "a"}, "takes two phase functions, got 1"),
        (
            BLEND | {"c": {"type": "isotropic"}},
            "scene.cube.interior.phase.c: a blendphase takes two phase functions, got 3",
        ),
        (BLEND | {"a": {"type": "sggy"}}, "scene.cube.interior.phase.a: unknown plugin 'sggy'"),
        (BLEND | {"a": {"type": "sphere"}}, "takes two phase functions, got 1"),
    ],
)
def test_impossible_phase_functions_are_errors(phase, message):
    assert message in error_of(phase=phase)


# -- what is made of them ------------------------------------------------------------------------------


def test_the_digest_depends_on_every_field_of_a_medium():
    base = scene_of(emission=grid(), temperature=grid(), phase=BLEND)
    medium = base.shapes[0].interior
    other = {
        "sigma_t": ConstVolume((7.0,)),
        "albedo": ConstVolume((0.1,)),
        "scale": (1.0, 2.0, 3.0),
        "phase": replace(medium.phase, second=Phase()),
        "homogeneous": True,
        "sample_emitters": False,
        "emission": None,
        "temperature": ConstVolume((1.0,)),
        "emission_scale": 2.0,
        "temperature_scale": 2.0,
        "temperature_offset": 2.0,
        "emission_density": ConstVolume((1.0,)),
        "emission_density_scale": 2.0,
        "transfers": Transfers(sigma_t=Transfer(np.arange(2, dtype=np.float32), np.ones((2, 3), np.float32))),
    }
    assert {f.name for f in fields(Medium)} == {"name", *other}
    digests = {scene_digest(base)}
    for name, value in other.items():
        shape = replace(base.shapes[0], interior=replace(medium, **{name: value}))
        digests.add(scene_digest(replace(base, shapes=(shape,))))
    assert len(digests) == 1 + len(other)


def test_descriptions_say_what_a_medium_emits_and_how_it_scatters():
    [line] = [line for line in describe_scene(scene_of(scale=RGB, phase=BLEND)) if "medium" in line]
    assert "sigma_t 1 times (1, 2, 4), albedo 0.75" in line
    assert line.endswith("phase blend (hg (g 0.5), and 0.25 of it rayleigh)")
    glowing = scene_of(emission=2.0, temperature=grid(to_world=scale(2)), emission_scale=3.0)
    [line] = [line for line in describe_scene(glowing) if "medium" in line]
    assert "emits emission 2 times a blackbody of (" in line
    assert line.endswith("(2x3x4) - 0) times 1 kelvin times 3")


def test_xml_says_the_same(tmp_path):
    path = tmp_path / "glow.xml"
    path.write_text(
        """<scene version="3.0.0"><sensor type="perspective"><float name="fov" value="40"/></sensor>
        <shape type="cube"><bsdf type="null"/><medium type="homogeneous" name="interior">
            <rgb name="scale" value="1 2 4"/> <rgb name="emission" value="1 2 4"/>
            <volume name="temperature" type="constvolume"><float name="value" value="1500"/></volume>
            <float name="emission_scale" value="3"/> <float name="temperature_offset" value="-273.15"/>
            <phase type="blendphase"><float name="weight" value="0.25"/>
                <phase type="hg"><float name="g" value="0.5"/></phase> <phase type="rayleigh"/></phase>
        </medium></shape></scene>"""
    )
    given = {"emission": RGB, "emission_scale": 3.0, "temperature_offset": -273.15}
    temperature = {"type": "constvolume", "value": 1500.0}
    same = scene_of(type="homogeneous", scale=RGB, phase=BLEND, temperature=temperature, **given)
    assert scene_digest(load_file(path)) == scene_digest(same)
