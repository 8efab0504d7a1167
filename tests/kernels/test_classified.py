"""Transfer functions on the device: classified after interpolation, right with every tracker and bound.

The reference is the function of the trilinear value along the ray, integrated in float64.
"""

import functools
import itertools
from dataclasses import replace

import numpy as np
import pytest
from fields import RAYS, exit_distance, trilinear
from probe import Probe, grid_volume, medium_of, scene_of
from stat_tests import FALSE_ALARM, largest_z, require_precision, sidak, z_score
from tiers import quick_first
from walks import (
    BINS,
    assert_weighted_collisions,
    collision_p_value,
    sample_walks,
    transmittance_walks,
    unbiased,
)

import clvol
from clvol.device.programs import stage_source
from clvol.errors import OptionError, SceneError
from clvol.layout import BRICK_SAMPLES
from clvol.planning import registry
from clvol.planning.choices import Choices
from clvol.planning.plan import Plan
from clvol.rendering.residence import Residence
from clvol.scene.records import ConstVolume, DirectionalEmitter, Medium
from clvol.tables.prepare import prepare
from clvol.volumes.transfer import Transfers, transfer_of_points

WALKS = 1 << 21
STEPS = 40_000
FUNCTIONS = {
    # A peak that no sample need reach, between samples on either side of it.
    "window": [(-150, 0), (0, 9), (150, 0)],
    # Steps, a constant part, and a part that falls with the value.
    "steps": [(-1000, 0), (-400, 0), (-400, 1.5), (100, 1.5), (100, 4), (900, 0.5)],
}
COLOURS = transfer_of_points([(-800, (0.9, 0.2, 0.4)), (-100, (0.1, 0.6, 0.5)), (700, (0.3, 0.3, 1.0))])
GLOW = transfer_of_points([(-500, 0), (-200, 2), (400, 0.5)])


def scan():
    """Values as of a scan: smooth, from about -1000 to 1000, the air exactly -1000."""
    z, y, x = np.meshgrid(*(np.linspace(-1, 1, n) for n in (17, 18, 27)), indexing="ij")
    values = 900 * np.cos(3 * x + y) * np.cos(2 * y - z) + 300 * z
    return np.where(x**2 + y**2 > 1.4, -1000, np.clip(values, -1000, 1000)).astype(np.float32)


def scene_with(function, filter_type="trilinear", **keywords):
    volume = grid_volume(scan(), filter_type)
    transfers = Transfers(transfer_of_points(FUNCTIONS[function]), **keywords)
    shared = {role: volume for role in keywords}
    fields = {"albedo": ConstVolume((0.5,))} | shared
    return scene_of(Medium(volume, homogeneous=False, transfers=transfers, **fields))


@functools.cache
def exact(function, ray, filter_type="trilinear"):
    """Values along the ray at midpoints, and the optical depth to each of the steps' ends, float64."""
    (origin, direction), values = RAYS[ray], scan()
    length = exit_distance(origin, direction)
    points = origin + ((np.arange(STEPS) + 0.5) * (length / STEPS))[:, None] * direction
    if filter_type == "nearest":
        at = np.clip((points * values.shape[::-1]).astype(int), 0, np.array(values.shape[::-1]) - 1)
        along = values[at[:, 2], at[:, 1], at[:, 0]].astype(float)
    else:
        along = trilinear(values, points)
    sigma = transfer_of_points(FUNCTIONS[function])(along)[:, 0]
    return along, np.concatenate([[0.0], np.cumsum(sigma) * (length / STEPS)])


def cases(family):
    """Every tracker that may classify interpolated values, over two majorants, by turns."""
    names = [n for n in unbiased(family) if not registry.FAMILIES[family][n].interpolated]
    majorants, found = list(registry.MAJORANTS), []
    for turn, name in enumerate(names):
        for n in range(2):
            marks = pytest.mark.contract if n else ()
            found.append(pytest.param(name, majorants[(turn + n) % len(majorants)], marks=marks))
    return found


@pytest.fixture(scope="module")
def probes(device):
    @functools.cache
    def get(function, filter_type="trilinear", **choices):
        return Probe(device, scene_with(function, filter_type), **choices)

    return get


def assert_half_a_percent(values, tau, where):
    """The mean is the share that `tau` says, and 0.5 % more or less of it would be noticed."""
    bound, expected, error = largest_z(1), -np.expm1(-tau), values.std() / len(values) ** 0.5
    require_precision(error, 0.005 * expected / bound, where)
    z = z_score(values.mean(), error**2, expected)
    assert abs(z) < bound, f"{where}: {z:.1f} sigma"


@quick_first("function", FUNCTIONS)
@quick_first(("technique", "majorant"), cases("technique"))
def test_collisions_are_those_of_the_classified_density(probes, technique, majorant, function):
    probe = probes(function, technique=technique, majorant=majorant)
    ray = "oblique"
    length, (_, tau) = exit_distance(*RAYS[ray]), exact(function, ray)
    t, weights, _, flaws, _ = sample_walks(probe, RAYS[ray], length, WALKS)
    assert flaws.sum() == 0
    where = f"{technique}, {majorant}"
    if registry.TECHNIQUES[technique].weighted:
        assert_weighted_collisions(t, weights[:, 0], tau, length, largest_z(BINS + 1), where)
    else:
        assert collision_p_value(t, tau, length) > sidak(FALSE_ALARM, 1), where
    assert_half_a_percent(np.where(t >= 0, weights[:, 0], 0.0).astype(float), tau[-1], where)


@quick_first("function", FUNCTIONS)
@quick_first(("transmittance", "majorant"), cases("transmittance"))
def test_transmittance_is_that_of_the_classified_density(probes, transmittance, majorant, function):
    probe = probes(function, technique="delta", transmittance=transmittance, majorant=majorant)
    length, (_, tau) = exit_distance(*RAYS["backwards"]), exact(function, "backwards")
    values, flaws, _ = transmittance_walks(probe, RAYS["backwards"], length, WALKS)
    assert flaws.sum() == 0
    assert_half_a_percent(1.0 - values[:, 0].astype(float), tau[-1], f"{transmittance}, {majorant}")


@pytest.mark.contract
def test_a_bias_of_half_a_percent_is_rejected(device):
    """A function that is 1.2 % too high, of which half a percent and a little is left in what collides."""
    medium = scene_with("window").shapes[0].interior
    high = Transfers(transfer_of_points([(v, 1.012 * c) for v, c in FUNCTIONS["window"]]))
    probe = Probe(device, scene_of(replace(medium, transfers=high)))
    length, (_, tau) = exit_distance(*RAYS["oblique"]), exact("window", "oblique")
    t, weights, *_ = sample_walks(probe, RAYS["oblique"], length, WALKS)
    with pytest.raises(AssertionError):
        assert_half_a_percent(np.where(t >= 0, weights[:, 0], 0.0).astype(float), tau[-1], "biased")


def test_exact_flights_classify_nearest_samples(probes):
    for ray, function in itertools.product(("oblique", "backwards"), FUNCTIONS):
        _, tau = exact(function, ray, "nearest")
        probe = probes(function, "nearest", technique="regular", transmittance="regular")
        length = exit_distance(*RAYS[ray])
        values, flaws, _ = transmittance_walks(probe, RAYS[ray], length, 4)
        assert flaws.sum() == 0 and np.ptp(values) == 0
        missed = 0.5 * np.abs(np.diff(tau, 2)).sum()  # by midpoints, of the steps between samples
        assert abs(-np.log(values[0, 0]) - tau[-1]) < missed + 1e-5 * tau[-1]
        t, _, _, _, _ = sample_walks(probe, RAYS[ray], length, 1 << 15)
        assert collision_p_value(t, tau, length) > sidak(FALSE_ALARM, 4)


@pytest.mark.parametrize(
    "choices",
    [{"technique": "regular"}, {"transmittance": "regular", "technique": "delta"}, {"lookup": "stochastic"}],
    ids=lambda choices: "-".join(choices),
)
def test_what_cannot_classify_interpolated_values_is_refused(choices):
    sun = scene_with("steps", albedo=COLOURS)
    lit = scene_of(sun.shapes[0].interior, (DirectionalEmitter((1.0,), (0.0, -1.0, 0.0)),))
    with pytest.raises(OptionError, match="filter_type nearest"):
        Plan.of(lit, Choices(**choices))
    nearest = scene_with("steps", "nearest", albedo=COLOURS).shapes[0].interior
    Plan.of(scene_of(nearest, lit.emitters), Choices(**choices))


def test_colours_and_emission_are_those_of_the_interpolated_value(device):
    probe = Probe(device, scene_with("steps", albedo=COLOURS, emission=GLOW))
    points = np.random.default_rng(5).random((4096, 3))
    body = """
    const float3 p = (float3)(in0[3 * i], in0[3 * i + 1], in0[3 * i + 2]);
    vstore3(medium_albedo(scene, scene->media, p, 0), i, out0);
    vstore3(medium_radiance(scene, scene->media, p, 0), i, out1);
    """
    out = np.empty((4096, 3), np.float32), np.empty((4096, 3), np.float32)
    given = (points - probe.prepared.centre).astype(np.float32)
    albedo, glow = probe.run(["medium/emission.h"], body, out, [given])
    values = trilinear(scan(), given.astype(float) + probe.prepared.centre)
    np.testing.assert_allclose(albedo, COLOURS(values), atol=2e-5)
    np.testing.assert_allclose(glow, GLOW(values), atol=2e-4)


def test_emission_on_walks_is_its_integral(device):
    probe = Probe(device, scene_with("steps", emission=GLOW), technique="delta")
    along, tau = exact("steps", "oblique")
    length = exit_distance(*RAYS["oblique"])
    middle = np.exp(-0.5 * (tau[:-1] + tau[1:])) * np.diff(tau)
    expected = 0.5 * float((middle * GLOW(along)[:, 0]).sum())  # what is not scattered
    _, _, emission, flaws, _ = sample_walks(probe, RAYS["oblique"], length, WALKS)
    values = emission[:, 0].astype(float)
    assert flaws.sum() == 0
    z = z_score(values.mean(), values.var() / len(values), expected)
    require_precision(values.std() / len(values) ** 0.5, 0.005 * expected / largest_z(1), "emission")
    assert abs(z) < largest_z(1)


def test_other_functions_neither_build_kernels_nor_load_the_volume(device):
    """Only tables are new: not a program more, and no bytes of the samples."""
    scene = scene_with("window", albedo=COLOURS)
    parameters = clvol.traverse(scene)
    choices = {"technique": "delta", "majorant": "grid", "device": str(device.info.index)}
    first = clvol.render(scene, spp=1, **choices)
    there, samples = Residence.of(scene, device), prepare(scene).volumes[0].bricks
    programs, uploaded = len(device.programs), there.uploaded
    assert uploaded > 4 * samples.brick_count * BRICK_SAMPLES
    parameters["shape.interior.opacity"] = FUNCTIONS["steps"]
    parameters["shape.interior.albedo"] = [(0, (0.2, 0.5, 0.9)), (1, 0.8)]
    assert set(parameters.update()) == {"shape.interior_medium.opacity", "shape.interior_medium.albedo"}
    other = clvol.render(scene, spp=1, **choices)
    assert prepare(scene).volumes[0].bricks is samples
    assert there.uploaded - uploaded < 4 * BRICK_SAMPLES
    assert len(device.programs) == programs
    assert not np.allclose(first.image, other.image)
    with pytest.raises(SceneError, match="must not fall"):
        parameters["shape.interior.opacity"] = [(1, 0), (0, 1)]
    assert parameters["shape.interior.opacity"][:2] == [(-1000, 0), (-400, 0)]


def test_other_scenes_compile_nothing_of_it():
    plan = prepare(scene_of(medium_of(scan() + 1000, 0.01, albedo=0.5))).plan
    assert plan.macros["CLVOL_HAS_TRANSFER"] == 0
    assert "classified_colour" not in "".join(stage_source(plan, stage) for stage in plan.stages)
