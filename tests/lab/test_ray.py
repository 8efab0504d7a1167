"""`clvol ray` shows what the renderer does.

Tables, walks and estimates along a camera ray are those of the device functions, and agree with float64.
"""

from __future__ import annotations

import json
from dataclasses import replace

import numpy as np
import pytest
from click.testing import CliRunner
from fields import coloured, tinted, trilinear
from probe import Probe, grid_volume, medium_of, scene_of
from stat_tests import largest_z
from walks import headers_of

import clvol
from clvol.cli.main import main
from clvol.device import programs
from clvol.errors import OptionError
from clvol.lab.digits import with_error
from clvol.lab.ray.plot import draw
from clvol.lab.ray.walks import OUTCOME, read_walk
from clvol.planning import registry
from clvol.scene.records import ConstVolume, Medium

TECHNIQUES = ("delta", "decomposition", "weighted-decomposition", "regular")
TRANSMITTANCES = ("ratio", "residual-ratio", "delta")
MANY = 20_000
SLAB = {
    "type": "scene",
    "sensor": {
        "type": "perspective",
        "fov": 40,
        "to_world": clvol.look_at([0, 0, -4], [0, 0, 0], [0, 1, 0]),
        "film": {"type": "hdrfilm", "width": 9, "height": 9, "rfilter": {"type": "box"}},
    },
    "sky": {"type": "constant"},
    "box": {
        "type": "cube",
        "bsdf": {"type": "null"},
        "interior": {"type": "homogeneous", "sigma_t": 0.5, "albedo": 0.5},
    },
}
DISK = {"type": "disk", "to_world": clvol.translate([0, 0, -2]) @ clvol.scale(0.5)}


def lumpy():
    """A lumpy grey medium, seen through the middle of the picture."""
    return clvol.trace_ray(
        scene_of(medium_of(tinted(), 3.0, 0.5)),
        *(3, 5),
        techniques=TECHNIQUES,
        transmittances=TRANSMITTANCES,
        majorant="grid",
        walks=20,
        many=MANY,
        seed=5,
    )


@pytest.fixture(scope="module")
def view():
    return lumpy()


@pytest.fixture(scope="module")
def chromatic():
    """Channels of different shape, followed together, over a tree."""
    medium = Medium(grid_volume(coloured()), ConstVolume((0.5,)), (40.0,), homogeneous=False)
    return clvol.trace_ray(
        scene_of(medium),
        *(4, 4),
        techniques=("spectral",),
        transmittances=(),
        majorant="kdtree",
        walks=3,
        many=MANY,
        channel=1,
    )


def points_along(view, t):
    """World positions on the ray, in the unit cube: the scene's centre is at (½, ½, ½)."""
    return 0.5 + view.place.origin + np.asarray(t)[:, None] * view.place.direction


def middles(view):
    return (view.edges[1:] + view.edges[:-1]) / 2


def cell_values(watched, name, t):
    """What the majorant's cells have at t."""
    cells = watched.cells
    return cells[name][np.minimum(np.searchsorted(cells["t_end"], t), len(cells) - 1)]


def test_the_density_along_the_ray_is_that_of_the_volume(view, chromatic):
    exact = 3.0 * trilinear(tinted(), points_along(view, middles(view)))
    np.testing.assert_allclose(view.sigma_t[0], exact, rtol=1e-4)
    for channel in range(3):
        exact = 40.0 * trilinear(coloured()[..., channel], points_along(chromatic, middles(chromatic)))
        np.testing.assert_allclose(chromatic.sigma_t[channel], exact, rtol=1e-3, atol=1e-4 * exact.max())
    assert view.place.distance == pytest.approx(1.2 / view.place.direction[2], rel=1e-5)
    assert view.place.length == pytest.approx(1 / view.place.direction[2], rel=1e-5)


def test_majorants_bound_the_density_and_controls_lie_between(view, chromatic):
    for one, channels in [(w, 1) for w in view.watched] + [(w, 3) for w in chromatic.watched]:
        cells, t = one.cells, middles(view if channels == 1 else chromatic)
        sigma_t = (view if channels == 1 else chromatic).sigma_t
        assert cells["t"][0] == 0
        np.testing.assert_array_equal(cells["t"][1:], cells["t_end"][:-1])
        assert cells["t_end"][-1] == pytest.approx(t[-1], rel=1e-3)
        assert (cell_values(one, "majorant", t) >= sigma_t.max(axis=0)).all()
        control = one.control(0)
        if one.name == "decomposition":
            assert (cell_values(one, "control", t)[:, 0] <= sigma_t[0]).all()
        if control is not None:
            assert (control >= 0).all() and (control <= cells["majorant"]).all()
    named = {(w.family, w.name): w for w in view.watched}
    assert {name for (_, name), w in named.items() if w.control(0) is not None} == {
        "decomposition",
        "weighted-decomposition",
        "residual-ratio",
    }
    residual = named["transmittance", "residual-ratio"]
    spread = np.abs(cell_values(residual, "residual_control", middles(view))[:, 0] - view.sigma_t[0])
    assert (spread <= cell_values(residual, "residual_rate", middles(view))).all()


def test_recorded_events_are_all_that_the_walks_counted(view, chromatic):
    """A tracker that goes past the hooks would be seen here: its own counts say more than its log."""
    for one in (*view.watched, *chromatic.watched):
        for walk, outcome in zip(one.walks, one.outcomes, strict=False):
            assert not walk.truncated
            assert len(walk.lookups) == outcome["lookups"]
            if one.name != "regular":
                assert len(walk.collisions) == outcome["tentative"]
            assert sum(c.kind != "null" for c in walk.collisions) == outcome["real"]
            assert outcome["flaws"] == 0


def test_collisions_know_the_density_and_the_rate_where_they_are(view, chromatic):
    for shown in (view, chromatic):
        for one in shown.watched:
            if one.rate() is None:
                continue
            name = "residual_rate" if one.name == "residual-ratio" else "majorant"
            for collision in (c for walk in one.walks for c in walk.collisions):
                near = cell_values(one, name, collision.t + np.array([-1e-5, 0.0, 1e-5]))
                assert (collision.rate == near.astype(np.float32)).any()
                if collision.sigma_t is not None:
                    for channel, values in enumerate(shown.sigma_t):
                        exact = np.interp(collision.t, middles(shown), values)
                        found = collision.sigma_t[channel]
                        assert found == pytest.approx(exact, rel=1e-2, abs=1e-2 * values.max())
                assert (collision.sigma_t is None) == (collision.kind == "control")


def test_weights_end_where_the_walk_does(view, chromatic):
    for one in (*view.watched, *chromatic.watched):
        if one.family == "technique":
            for walk in (w for w in one.walks if w.end is not None):
                assert walk.weights[-1] == (walk.end, walk.value)
                assert walk.collisions[-1].t == walk.end


def free_path_z(view, one, density_scale=1.0):
    """Largest |z| of a technique's free-path density over 20 bins against the quadrature."""
    edges = np.linspace(0, view.place.length, 21)
    density, error = one.free_path_density(edges, view.channel)
    depth = density_scale * np.interp(edges, view.edges, view.depth[view.channel])
    return np.abs((density + np.diff(np.exp(-depth)) / np.diff(edges)) / error).max()


def test_free_paths_and_transmittances_are_exact_in_the_mean(view, chromatic):
    assert_exact_in_the_mean(view, chromatic)


@pytest.mark.contract
def test_walks_of_many_legs_are_exact_in_the_mean(bounds):
    bounds(WALK_STEPS=3)
    cut = lumpy()
    assert_exact_in_the_mean(cut)
    test_running_estimates_begin_at_1_and_end_at_the_walks_own(cut)


def assert_exact_in_the_mean(*views):
    """All z-scores together have the false-alarm rate of `stat_tests`, and a density 20 % off is caught."""
    comparisons = [(shown, one) for shown in views for one in shown.watched]
    bound = largest_z(21 * len(comparisons))
    for shown, one in comparisons:
        if one.family == "technique":
            assert free_path_z(shown, one) < bound, one.name
            assert free_path_z(shown, one, 1.2) > bound, one.name
        mean, error = one.transmitted(shown.channel)
        exact = shown.transmittance[shown.channel, -1]
        assert abs(mean - exact) < bound * error, one.name


def test_free_paths_beyond_a_window_are_not_in_its_last_bin(view):
    """The same density inside, whether the edges end at the medium's or before."""
    all_edges = np.linspace(0, view.place.length, 21)
    for one in view.watched:
        whole, part = (one.free_path_density(edges, 0) for edges in (all_edges, all_edges[3:12]))
        for full, windowed in zip(whole, part, strict=True):
            np.testing.assert_allclose(windowed, full[3:11], rtol=1e-12)


def test_running_estimates_begin_at_1_and_end_at_the_walks_own(view):
    for one in view.watched:
        if one.family == "transmittance":
            for walk in one.walks:
                running = one.running_estimate(walk, view.edges, 0)
                assert running[0] == 1
                assert running[-1] == pytest.approx(walk.value[0], rel=1e-4)


def test_a_walk_is_the_same_unwatched(device):
    """Hooks change nothing: the same numbers give the same bits without them, as in a render."""
    scene = scene_of(medium_of(tinted(), 3.0, 0.5))
    probe = Probe(device, scene, technique="weighted-decomposition")
    watched = clvol.trace_ray(
        scene,
        *(3, 5),
        techniques=["weighted-decomposition"],
        transmittances=[],
        majorant="grid",
        many=500,
        walks=1,
        seed=5,
    )
    given = [*watched.place.origin, *watched.place.direction, watched.place.length]
    body = """
    const uint4 k = philox4x32((uint4)(i, 0, 0, 0), (uint2)(5, 0));
    Stream stream = stream_begin(k.z, k.w);
    Tally tally = {0, 0, 0, 0, 0, 0, 0.0f};
    const Ray ray = {load_vector(in0), load_vector(in0 + 3)};
    const MediumRay in = medium_ray(scene, scene->media, ray, in0[6], 0);
    Collision collision;
    collision.beta = 1.0f;
    collision.emission = 0.0f;
    out0[i] = sample_collision(&in, k.x, &stream, &tally, &collision) ? collision.t : -1.0f;
    out1[i] = collision.beta;
    """
    out = np.empty(500, np.float32), np.empty(500, np.float32)
    t, weights = probe.run(headers_of(probe.plan, "technique"), body, out, [np.array(given, np.float32)])
    np.testing.assert_array_equal(t, watched.watched[0].outcomes["t"])
    np.testing.assert_array_equal(weights, watched.watched[0].outcomes["value"][:, 0])
    for stage in probe.plan.stages:
        assert "Recorder" not in programs.stage_source(probe.plan, stage)


def test_a_log_too_short_for_a_walk_says_so():
    outcome = np.array((0.5, (1, 1, 1), 3, 1, 3, 0, 7), OUTCOME)
    events = np.array([[0, 0.1, 2, 2, 2], [1, 0.1, 1, 1, 1]], np.float32)
    walk = read_walk(outcome, events)
    assert walk.truncated and walk.collisions[0].kind == "null" and walk.collisions[0].sigma_t == (1, 1, 1)


def test_the_figure_shows_every_choice(view):
    titles = [axes.get_title(loc="left") for axes in draw(view).axes]
    for one in view.watched:
        kind = "collisions" if one.family == "technique" else "transmittance"
        assert any(title.startswith(f"{one.name}  ({kind}") for title in titles)


def test_the_exact_depth_has_the_digits_that_are_right(view, chromatic):
    """Its error, told from longer steps, covers what is left to a finer rule in float64."""
    for shown, field, scale in ((view, tinted(), 3.0), (chromatic, coloured()[..., 1], 40.0)):
        finer = (np.arange(1 << 18) + 0.5) / (1 << 18) * shown.place.length
        depth = scale * trilinear(field, points_along(shown, finer)).mean() * shown.place.length
        channel, error = shown.channel, shown.depth_error[shown.channel]
        assert abs(shown.depth[channel, -1] - depth) < 2 * error < 1e-4 * depth
        assert float(shown.exact) == pytest.approx(np.exp(-depth), rel=3 * error)
        assert f"transmittance {shown.exact}" in shown.summary()[0]


def test_means_over_walks_have_the_digits_of_their_errors(view):
    for one, line in zip(view.watched, view.summary()[1:], strict=True):
        mean, error = one.transmitted(view.channel)
        assert f"{one.label}: transmittance {with_error(mean, error)}, " in line or "every walk" in line
        assert f"{one.per_walk('lookups')} look-ups" in line


# -- what a user meets --------------------------------------------------------------------------------


def test_any_name_of_a_scene_is_drawn(view, tmp_path):
    """Not as a formula, and bytes that are no text as escapes."""
    named = replace(view, scene="$x^\udcff$.xml", watched=(*view.watched[:1], *view.watched[-1:]))
    named.save(tmp_path / "ray.svg")
    title = draw(named).get_suptitle()
    assert title.startswith(r"$x^\udcff$.xml, ray through pixel (3, 5)")


def test_homogeneous_media_are_followed_in_closed_form_and_saved(tmp_path):
    view = clvol.trace_ray(clvol.load_dict(SLAB), 4, 4, many=2000, walks=2)
    assert [w.name for w in view.watched] == ["analytic"]
    assert view.transmittance[0, -1] == pytest.approx(np.exp(-1.0), rel=1e-5)
    for name in ("ray.png", "ray.svg", "ray.json"):
        view.save(tmp_path / name)
        assert (tmp_path / name).stat().st_size > 1000
    assert json.loads((tmp_path / "ray.json").read_text())["watched"][0]["name"] == "analytic"
    assert sorted(p.name for p in tmp_path.iterdir()) == ["ray.json", "ray.png", "ray.svg"]


def test_a_ray_that_meets_no_medium_is_told_so_with_a_pixel_that_does():
    with pytest.raises(OptionError, match=r"pixel \(0, 0\) meets no medium; try 4 4,"):
        clvol.trace_ray(clvol.load_dict(SLAB | {"sensor": SLAB["sensor"] | {"fov": 90}}), 0, 0)
    with pytest.raises(OptionError, match="meets no medium before a surface stops it"):
        clvol.trace_ray(clvol.load_dict(SLAB | {"disk": DISK | {"bsdf": {"type": "diffuse"}}}), 4, 4)
    empty = SLAB["box"] | {"interior": {"type": "homogeneous", "sigma_t": 0.0}}
    with pytest.raises(OptionError, match="the scene has no density anywhere"):
        clvol.trace_ray(clvol.load_dict(SLAB | {"box": empty}), 4, 4)


def test_a_surface_that_light_passes_is_passed_straight():
    glass = DISK | {"bsdf": {"type": "thindielectric"}}
    view = clvol.trace_ray(clvol.load_dict(SLAB | {"disk": glass}), 4, 4, many=100, walks=1)
    assert view.place.distance == pytest.approx(3.0, rel=1e-5)
    assert "straight through" in view.notes[0]


@pytest.mark.parametrize(
    ("arguments", "fragments"),
    [
        (["9", "4"], ["pixel (9, 4) is outside the picture", "9 x 9", "x is 0 to 8"]),
        (["4", "4", "--techniques", "delta,spectrl"], ["unknown technique 'spectrl'", "spectral"]),
        (["4", "4", "--techniques", ""], ["no technique is given"]),
        (["4", "4", "--techniques", "auto:pilot"], ["auto:pilot is for clvol render only"]),
        (["4", "4", "--step", "0.1"], ["nothing marches"]),
        (["4", "4", "--transmittances", "none"], ["'none' estimates nothing"]),
        (["4", "4", "-o", "ray.gif"], ["unknown format '.gif'", ".svg"]),
        (["4", "4", "-o", "missing/ray.png"], ["no such folder"]),
    ],
)
def test_mistakes_are_told_in_one_line(tmp_path, monkeypatch, arguments, fragments):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "scene.xml").write_text(
        '<scene version="3.0.0"><sensor type="perspective"><film type="hdrfilm">'
        '<integer name="width" value="9"/><integer name="height" value="9"/></film></sensor>'
        '<emitter type="constant"/><shape type="cube"><bsdf type="null"/>'
        '<medium name="interior" type="homogeneous"/></shape></scene>'
    )
    outcome = CliRunner().invoke(main, ["ray", "scene.xml", *arguments, "--quiet"])
    assert outcome.exit_code == 2
    assert len(outcome.stderr.splitlines()) == 1
    for fragment in fragments:
        assert fragment in outcome.stderr
    assert not list(tmp_path.glob("ray*"))


def test_help_explains_every_choice_and_shows_examples():
    text = CliRunner().invoke(main, ["ray", "--help"]).output
    for family in ("technique", "transmittance", "majorant"):
        for name in registry.FAMILIES[family]:
            assert name in text
    assert "clvol ray scenes/cloud.xml" in text
