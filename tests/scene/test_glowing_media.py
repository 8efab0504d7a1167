"""What the reader makes of emission_density, and what else knows of it: plans, parameters, descriptions."""

from pathlib import Path

import numpy as np
import pytest
from pictures import box, picture
from test_scene_media import DENSITY, RGB, error_of, features_of, grid, medium_of

import clvol
from clvol.scene.describe import describe_scene
from clvol.scene.medium_facts import medium_volumes
from clvol.scene.records import GridVolume

COLOURED = np.stack([DENSITY, DENSITY / 2, DENSITY / 4], axis=-1)
XML = """
<scene version="3.0.0">
  <sensor type="perspective"/>
  <shape type="cube">
    <bsdf type="null"/>
    <medium name="interior" type="homogeneous">
      <float name="sigma_t" value="0"/>
      <rgb name="emission_density" value="1, 2, 4"/>
      <float name="emission_density_scale" value="3"/>
    </medium>
  </shape>
</scene>
"""


@pytest.mark.parametrize("kind", ["homogeneous", "heterogeneous"])
def test_it_is_a_number_a_colour_or_a_volume(kind):
    medium = medium_of(type=kind, emission_density=2, emission_density_scale=3)
    assert (medium.emission_density.value, medium.emission_density_scale) == ((2.0,), (3.0,))
    assert medium.glows and not medium.emits
    assert medium_of(type=kind, emission_density=RGB).emission_density.value == (1.0, 2.0, 4.0)
    volume = medium_of(type=kind, emission_density=grid(COLOURED)).emission_density
    assert isinstance(volume, GridVolume) and volume.grid.channels == 3
    assert medium_of().emission_density is None and not medium_of().glows


def test_xml_has_it_too(tmp_path):
    path = Path(tmp_path) / "gas.xml"
    path.write_text(XML)
    [shape] = clvol.load_file(path).shapes
    assert shape.interior.emission_density.value == (1.0, 2.0, 4.0)
    assert shape.interior.emission_density_scale == (3.0,)


def test_a_spectrum_is_seen_as_that_of_a_light():
    density = medium_of(emission_density={"type": "spectrum", "value": 1.0}).emission_density
    assert density.value == pytest.approx((1.204794, 0.948291, 0.908916))


@pytest.mark.parametrize(
    ("parameters", "glows"),
    [
        ({"emission_density": 1.0}, True),
        ({"emission_density": grid(), "sigma_t": 0.0}, True),
        ({"emission_density": 0.0}, False),
        ({"emission_density": grid(), "emission_density_scale": 0.0}, False),
        ({"emission": 1.0}, False),
    ],
)
def test_what_is_dark_needs_no_code_and_no_volumes(parameters, glows):
    medium = medium_of(**parameters)
    assert medium.glows == features_of(**parameters).glow == glows
    given = isinstance(medium.emission_density, GridVolume)
    assert (medium.emission_density in medium_volumes(medium)) == (glows and given)


def test_features_tell_what_it_needs():
    assert features_of(emission_density=grid()).glow_volumes
    assert not features_of(emission_density=1.0).glow_volumes
    assert features_of(emission_density=RGB).chromatic_emission
    assert features_of(emission_density=grid(COLOURED)).chromatic_emission
    assert features_of(emission_density=grid(), emission_density_scale=RGB).chromatic_emission
    assert not features_of(emission_density=grid()).chromatic_emission


@pytest.mark.parametrize(
    ("parameters", "message"),
    [
        ({"emission_density": -1.0}, "'emission_density' of medium 'heterogeneous' must be finite and >= 0"),
        ({"emission_density": float("nan")}, "must be finite and >= 0"),
        ({"emission_density": grid(-DENSITY)}, "emission_density of medium 'heterogeneous' has"),
        ({"emission_density": grid(DENSITY * np.nan)}, "NaN or infinite"),
        ({"emission_density": {"type": "hg"}}, "must be a number, a colour or a volume, got a 'hg'"),
        ({"emission_density": 1.0, "emission_density_scale": -2.0}, "emission_density_scale"),
        ({"emission_density_scale": 2.0}, "has nothing to scale give the medium an emission_density"),
        ({"emission_density": 1e20, "emission_density_scale": 1e20}, "may emit at most"),
        ({"emission_densty": 1.0}, "did you mean 'emission_density'?"),
    ],
)
def test_what_cannot_be_is_an_error(parameters, message):
    assert message in error_of(**parameters).replace("\n", " ").replace("  ", " ").replace("; ", " ")


CUBE = (-1, -1, -1), (1, 1, 1)


def seen(medium):
    """Nearly parallel rays along z."""
    return picture([box(*CUBE, medium)], (), (0.1, 0.2, -90), (0.1, 0.2, 0), 1e-3)


def test_its_values_are_parameters():
    parameters = clvol.traverse(seen(medium_of(type="homogeneous", sigma_t=0.0, emission_density=1.0)))
    [density] = [name for name in parameters if name.endswith("emission_density.value.value")]
    [scale] = [name for name in parameters if name.endswith("emission_density_scale")]
    parameters[density], parameters[scale] = 2.0, 5.0
    parameters.update()
    assert clvol.render(parameters.scene, spp=1).image == pytest.approx(20.0)
    parameters[density], parameters[scale] = 1e10, 1e10
    with pytest.raises(clvol.Error, match="may emit at most"):
        parameters.update()


def test_a_grid_of_it_is_a_parameter_too():
    parameters = clvol.traverse(seen(medium_of(emission_density=grid())))
    assert [name for name in parameters if name.endswith("emission_density.data")]


def test_a_description_says_so():
    medium = medium_of(type="homogeneous", emission_density=RGB, emission_density_scale=2.0)
    said = "\n".join(describe_scene(seen(medium)))
    assert "emits (1, 2, 4) times 2 per length whatever its extinction" in said
