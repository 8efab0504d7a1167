"""Everything that is drawn, against the density it is drawn from, and every density against its integral.

Device functions run through small kernels (`Probe`).  χ² tests use the device's own random numbers at fixed
keys and have a false-alarm rate of 1e-4 each; wrong parameters inside the tests show that they can fail.
Everything else is compared in float64.  Phase functions have test_phases.py.
"""

from dataclasses import replace

import numpy as np
import pytest
from camera_paths import start_paths
from pictures import gauss
from probe import Probe, medium_of, scene_of
from sampling import DRAWS, RANDOM, uniform_p_value, uniforms
from stat_tests import FALSE_ALARM, chi2_p_value

import clvol
from clvol.scene.records import EnvmapEmitter, Film, Perspective, ReconstructionFilter
from clvol.tables.camera import camera_rays


def bare_scene(**film):
    scene = scene_of(medium_of(1.0, albedo=0.5))
    return replace(scene, film=replace(scene.film, **film)) if film else scene


@pytest.fixture(scope="module")
def probe(device):
    return Probe(device, bare_scene())


# -- random numbers ----------------------------------------------------------------------------------


def philox(counter, key, rounds=7):
    """Philox4x32 (Salmon et al. 2011) in NumPy: counter (n, 4), key (n, 2), uint32."""
    a, b, c, d = np.asarray(counter, np.uint64).T
    k0, k1 = np.asarray(key, np.uint64).T
    low = np.uint64(0xFFFFFFFF)
    for _ in range(rounds):
        p, q = a * np.uint64(0xD2511F53), c * np.uint64(0xCD9E8D57)
        a, b, c, d = (q >> np.uint64(32)) ^ b ^ k0, q & low, (p >> np.uint64(32)) ^ d ^ k1, p & low
        k0, k1 = (k0 + np.uint64(0x9E3779B9)) & low, (k1 + np.uint64(0xBB67AE85)) & low
    return np.stack([a, b, c, d], axis=1).astype(np.uint32)


KNOWN_PHILOX = [  # Random123's kat_vectors, philox4x32 with 7 rounds
    ((0, 0, 0, 0), (0, 0), (0x5F6FB709, 0x0D893F64, 0x4F121F81, 0x4F730A48)),
    ((0xFFFFFFFF,) * 4, (0xFFFFFFFF,) * 2, (0x5207DDC2, 0x45165E59, 0x4D8EE751, 0x8C52F662)),
    (
        (0x243F6A88, 0x85A308D3, 0x13198A2E, 0x03707344),
        (0xA4093822, 0x299F31D0),
        (0x4DFCCABA, 0x190A87F0, 0xC47362BA, 0xB6B5242A),
    ),
]


def test_philox_has_the_published_values_and_those_of_a_second_implementation(probe):
    rng = np.random.default_rng(1)
    counters = np.concatenate([[k[0] for k in KNOWN_PHILOX], rng.integers(0, 2**32, (5000, 4))])
    keys = np.concatenate([[k[1] for k in KNOWN_PHILOX], rng.integers(0, 2**32, (5000, 2))])
    counters, keys, out = counters.astype(np.uint32), keys.astype(np.uint32), np.zeros((5003, 4), np.uint32)
    body = "vstore4(philox4x32(vload4(i, in0), vload2(i, in1)), i, out0);"
    probe.run([], body, [out], [counters, keys])
    assert (out[:3] == np.array([k[2] for k in KNOWN_PHILOX], np.uint32)).all()
    assert (out == philox(counters, keys)).all()
    assert (out != philox(counters, keys, rounds=6)).any()


def test_decisions_of_a_path_never_share_a_block(probe):
    """Pixel, sample, bounce, block and segment all tell blocks apart, and so does the seed."""
    grid = np.stack(np.meshgrid([0, 1, 2], [0, 1], [1, 2, 3], range(6), [0, 1]), -1).reshape(-1, 5)
    found = []
    body = """
        __global uint *g = in0 + 5 * i;
        SampleKey key;
        key.pixel = g[0], key.sample = g[1], key.bounce = g[2];
        vstore4(decision_block(scene, key, g[3], g[4]), i, out0);"""
    for seed in (3, 3 + 2**32, 9):
        out = np.zeros((len(grid), 4), np.uint32)
        probe.upload(seed)
        probe.run([], body, [out], [grid.astype(np.uint32)])
        found.append(out)
    assert len(np.unique(np.concatenate(found), axis=0)) == 3 * len(grid)


def test_streams_are_uniform_and_independent(probe):
    """Bytes, serial pairs, neighbouring streams and the two words of a pair: χ² over 256 or 64 x 64 cells."""
    streams, length = 4096, 64
    out = np.zeros((streams, length, 2), np.uint32)
    body = f"""
        Stream stream = stream_begin(i, 77u);
        for (uint n = 0; n < {length}; ++n)
            vstore2(stream_pair(&stream), i * {length} + n, out0);"""
    probe.run([], body, [out])
    top = (out >> 26).astype(int)  # six bits
    pairs = {
        "words": (top[..., 0], top[..., 1]),
        "in a row": (top[:, :-1, 0], top[:, 1:, 0]),
        "neighbours": (top[:-1, :, 0], top[1:, :, 0]),
        "high and low bits": (top[..., 0], (out[..., 0] & 63).astype(int)),
    }
    for name, (a, b) in pairs.items():
        assert uniform_p_value(64 * a.ravel() + b.ravel(), 4096) > FALSE_ALARM, name
    for shift in (0, 8, 16, 24):
        for word in (0, 1):
            assert uniform_p_value((out[..., word] >> shift & 255).ravel(), 256) > FALSE_ALARM
    lagged = 64 * top[:, :-1, 0].ravel() + top[:, :-1, 0].ravel()
    assert uniform_p_value(lagged, 4096) < 1e-9  # dependent numbers are noticed


MAGNITUDES = np.unique(
    np.concatenate(
        [
            [0, 1, 2, 3, 2**31 - 1, 2**31, 2**31 + 1, 2**32 - 2, 2**32 - 1, int(0.29 * 2**32)],
            *(np.clip(2**b + np.arange(-40, 41), 0, 2**32 - 1) for b in range(33)),
            *(2**32 - 1 - np.clip(2**b + np.arange(-40, 41), 0, 2**32 - 1) for b in range(33)),
            np.random.default_rng(2).integers(0, 2**32, 200_000),
            (0.29 * 2**32 + np.arange(-1000, 1000)).astype(np.int64),
        ]
    )
).astype(np.uint32)


def test_exponential_variates_have_seven_digits_at_every_magnitude(probe):
    out = np.zeros(MAGNITUDES.size, np.float32)
    probe.run([], "out0[i] = exponential_variate(in0[i]);", [out], [MAGNITUDES])
    exact = -np.log1p(-(MAGNITUDES.astype(float) + 0.5) * 2.0**-32)
    error = np.abs(out / exact - 1)
    assert out.min() > 0
    assert error.max() <= 3e-7, f"k = {MAGNITUDES[error.argmax()]}: {error.max():.2e}"


def test_uniform_floats_are_the_middles_of_their_cells(probe):
    out = np.zeros((MAGNITUDES.size, 2), np.float32)
    body = "vstore2((float2)(uniform_float(in0[i]), uniform_below_one(in0[i])), i, out0);"
    probe.run([], body, [out], [MAGNITUDES])
    exact = (MAGNITUDES.astype(float) + 0.5) * 2.0**-32
    assert np.abs(out / exact[:, None] - 1).max() <= 2.0**-23
    assert out[:, 0].min() > 0
    assert out[:, 1].max() < 1


RATES = [(1.0, 1.0), (0.3, 0.9), (1e-8, 1.0), (1.0, 1e-8), (3e-5, 20.0), (5.0, 1e-3)]


@pytest.mark.parametrize(("part", "rest"), RATES)
def test_events_are_chosen_at_their_rate_at_full_resolution(probe, part, rest):
    """The number of words k that choose the event, by bisection (the choice is monotonic in k)."""
    body = f"""
        uint lower = 0u, upper = 0xFFFFFFFFu; /* first k that chooses otherwise than k = 0 */
        const bool at_zero = choose_event(0u, {part!r}f, {rest!r}f);
        while (lower < upper) {{
            const uint middle = lower + ((upper - lower) >> 1);
            if (choose_event(middle, {part!r}f, {rest!r}f) == at_zero)
                lower = middle + 1u;
            else
                upper = middle;
        }}
        out0[0] = lower;
        out0[1] = at_zero;"""
    out = np.zeros(2, np.uint32)
    probe.run([], "if (i > 0) return;" + body, [out])
    words = int(out[0]) if out[1] else 2**32 - int(out[0])
    part, rest = float(np.float32(part)), float(np.float32(rest))
    rarer = min(part, rest)
    chosen = words if part < rest else 2**32 - words
    # to a word, and to the rounding of a float product
    assert abs(chosen - 2**32 * rarer / (part + rest)) <= 1 + 2**32 * rarer / (part + rest) * 2.0**-22


def test_an_event_of_rate_zero_never_happens_and_a_certain_one_always(probe):
    out = np.zeros((MAGNITUDES.size, 4), np.int32)
    body = """
        const uint k = in0[i];
        out0[4 * i] = choose_event(k, 0.0f, 1.0f);
        out0[4 * i + 1] = choose_event(k, 1.0f, 0.0f);
        out0[4 * i + 2] = choose_event(k, 0.0f, 1e-30f);
        out0[4 * i + 3] = choose_event(k, 1e30f, 0.0f);"""
    probe.run([], body, [out], [MAGNITUDES])
    assert (out == [0, 1, 0, 1]).all()


def test_cosine_and_sine_of_a_turn_are_exact_to_seven_digits(probe):
    v = np.concatenate([np.linspace(0, 1, 100_001), np.arange(9) / 8]).astype(np.float32)
    out = np.zeros((v.size, 2), np.float32)
    probe.run([], "vstore2(cos_sin_turn(in0[i]), i, out0);", [out], [v])
    angle = 2 * np.pi * v.astype(float)
    assert np.abs(out - np.stack([np.cos(angle), np.sin(angle)], axis=1)).max() < 1.2e-7


def test_frames_turn_z_onto_any_direction_and_keep_lengths(probe):
    rng = np.random.default_rng(3)
    n = rng.normal(size=(20_000, 3))
    n[:6] = np.concatenate([np.eye(3), -np.eye(3)])
    n[6:100, :2] *= 1e-5  # near the poles, where frames are hardest
    n = (n / np.linalg.norm(n, axis=1, keepdims=True)).astype(np.float32)
    v = rng.normal(size=n.shape).astype(np.float32)
    out = np.zeros_like(n)
    body = """
        const float3 v = vload3(i, in1);
        vstore3(to_frame(vload3(i, in0), v.x, v.y, v.z), i, out0);"""
    probe.run(["core/sampling.h"], body, [out], [n, v])
    size = np.linalg.norm(v, axis=1)
    assert np.abs(np.linalg.norm(out, axis=1) / size - 1).max() < 1e-6
    assert (np.abs((out.astype(float) * n).sum(axis=1) - v[:, 2]) / size).max() < 1e-6


# -- environment maps --------------------------------------------------------------------------------


def peaky_map(height=33, width=48, seed=5):
    """Random radiance with a sun beside the seam and one at the pole; float32 (h, w, 3)."""
    rng = np.random.default_rng(seed)
    radiance = rng.uniform(0, 1, (height, width, 3)) ** 4
    radiance[height // 3, 0] = 400, 300, 200
    radiance[0] = 30
    radiance[-6:, : width // 2] = 0
    radiance[-1] = 0.2  # at a pole the column is anyone's guess
    return radiance.astype(np.float32)


TURN = clvol.rotate((1, 2, 3), 50.0)


@pytest.fixture(scope="module", params=[np.eye(4), TURN], ids=["upright", "turned"])
def sky(request, device):
    """A probe with the peaky sky, its map and its to_world."""
    emitter = EnvmapEmitter(peaky_map(), request.param)
    scene = scene_of(medium_of(1.0, albedo=0.5), [emitter])
    return Probe(device, scene), emitter.radiance.astype(float), request.param[:3, :3]


def map_position(local, shape):
    """Fractional column (0 at the centre of column 0, not wrapped) and row of local directions, float64."""
    height, width = shape[:2]
    u = np.arctan2(local[:, 0], -local[:, 2]) / (2 * np.pi)
    v = np.arctan2(np.hypot(local[:, 0], local[:, 2]), local[:, 1]) / np.pi
    return u * width - 0.5, v * (height - 1)


def map_radiance(local, radiance):
    column, row = map_position(local, radiance.shape)
    x, y = np.floor(column).astype(int), np.minimum(np.floor(row).astype(int), len(radiance) - 2)
    fx, fy = (column - x)[:, None], (row - y)[:, None]
    at = [[radiance[y + j, (x + i) % radiance.shape[1]] for i in (0, 1)] for j in (0, 1)]
    upper, lower = ((1 - fx) * a + fx * b for a, b in at)
    return (1 - fy) * upper + fy * lower


def directions(count, seed=6):
    d = np.random.default_rng(seed).normal(size=(count, 3))
    d[:6] = np.concatenate([np.eye(3), -np.eye(3)])
    d[6:40, [0, 2]] *= 1e-3
    d[40:80, 0] *= 1e-6
    return d / np.linalg.norm(d, axis=1, keepdims=True)


def test_environment_maps_are_read_where_mitsuba_reads_them(sky):
    probe, radiance, rotation = sky
    local = directions(50_000)
    world = (local @ rotation.T).astype(np.float32)
    out = np.zeros((len(local), 3), np.float32)
    body = "vstore3(envmap_radiance(scene, vload3(i, in0)), i, out0);"
    probe.run(["emitter/envmap.h"], body, [out], [world])
    expected = map_radiance(world.astype(float) @ rotation, radiance)
    # a float direction moves a look-up by some 1e-5 cells; the sun's slope is 400 per cell
    assert np.abs(out - expected).max() < 0.01
    assert np.median(np.abs(out - expected)) < 1e-5
    shifted = map_radiance(world.astype(float) @ rotation, np.roll(radiance, 1, axis=1))
    assert np.abs(out - shifted).max() > 50


def sampled_sky(probe):
    out = np.zeros((DRAWS, 5), np.float32)
    body = (
        uniforms("u", "v")
        + """
        float pdf;
        const float3 d = envmap_sample(scene, u, v, &pdf);
        vstore3(d, 0, out0 + 5 * i);
        out0[5 * i + 3] = pdf;
        out0[5 * i + 4] = envmap_pdf(scene, d);"""
    )
    probe.run(["emitter/envmap.h"], body, [out])
    return out[:, :3].astype(float), out[:, 3].astype(float), out[:, 4].astype(float)


def expected_cells(radiance):
    """Probability of each cell (rows, columns): mean luminance of its corners times its middle's sine."""
    luminance = radiance @ [0.212671, 0.715160, 0.072169]
    wide = luminance + np.roll(luminance, -1, axis=1)
    rows = len(radiance) - 1
    mass = (wide[:-1] + wide[1:]) * np.sin((np.arange(rows)[:, None] + 0.5) * np.pi / rows)
    return mass / mass.sum()


def test_environment_maps_are_sampled_by_their_pdf(sky):
    probe, radiance, rotation = sky
    world, pdf, looked_up = sampled_sky(probe)
    local = world @ rotation
    column, row = map_position(local, radiance.shape)
    rows, width = len(radiance) - 1, radiance.shape[1]
    # four quarters of every cell: the density within a cell is flat in (column, row)
    x = np.floor(2 * column).astype(int) % (2 * width)
    y = np.minimum(np.floor(2 * row).astype(int), 2 * rows - 1)
    observed = np.bincount(y * 2 * width + x, minlength=4 * rows * width)
    expected = np.repeat(np.repeat(expected_cells(radiance), 2, 0), 2, 1) / 4
    # rounding may move a draw over a border into a cell of no light
    dark = expected.ravel() == 0
    assert observed[dark].sum() < 1e-4 * DRAWS
    assert chi2_p_value(observed[~dark], DRAWS * expected.ravel()[~dark]) > FALSE_ALARM
    assert chi2_p_value(observed[~dark], np.roll(DRAWS * expected, 1, axis=1).ravel()[~dark]) < 1e-9
    # and the density it says is the one that others look up for the direction
    inside = np.abs(column - np.rint(column)) > 1e-3
    inside &= (np.abs(row - np.rint(row)) > 1e-3) & (row > 0.01) & (row < rows - 0.01)
    assert inside.mean() > 0.9
    assert np.abs(looked_up[inside] / pdf[inside] - 1).max() < 1e-3


def test_the_pdf_of_an_environment_map_integrates_to_one(sky):
    probe, radiance, rotation = sky
    rows, width = len(radiance) - 1, radiance.shape[1]
    row, w_row = (a.ravel() for a in gauss(np.arange(rows), np.arange(rows) + 1.0, 4))
    column = np.arange(2 * width) / 2 + 0.25  # two per cell: the pdf does not depend on the column within
    theta, phi = np.meshgrid(row * np.pi / rows, (column + 0.5) / width * 2 * np.pi, indexing="ij")
    local = np.stack([np.sin(theta) * np.sin(phi), np.cos(theta), -np.sin(theta) * np.cos(phi)], -1)
    world = (local.reshape(-1, 3) @ rotation.T).astype(np.float32)
    out = np.zeros(len(world), np.float32)
    probe.run(["emitter/envmap.h"], "out0[i] = envmap_pdf(scene, vload3(i, in0));", [out], [world])
    solid_angle = np.sin(theta) * (w_row * np.pi / rows)[:, None] * np.pi / width
    assert abs((out * solid_angle.ravel()).sum() - 1) < 1e-4


# -- pixel filters -----------------------------------------------------------------------------------

FILTERS = {
    "tent": ReconstructionFilter("tent", radius=1.0),
    "wide tent": ReconstructionFilter("tent", radius=2.5),
    "gaussian": ReconstructionFilter("gaussian", radius=2.0, stddev=0.5),
    "box": ReconstructionFilter("box", radius=0.5),
}


def filter_value(rfilter, x):
    """Mitsuba's filters, up to a factor."""
    if rfilter.kind == "box":
        return (np.abs(x) <= 0.5).astype(float)
    if rfilter.kind == "tent":
        return np.maximum(0, 1 - np.abs(x) / rfilter.radius)
    floor = np.exp(-(rfilter.radius**2) / (2 * rfilter.stddev**2))
    return np.maximum(0, np.exp(-(x**2) / (2 * rfilter.stddev**2)) - floor)


@pytest.fixture(scope="module", params=FILTERS)
def filter_probe(request, device):
    kind = FILTERS[request.param]
    return kind, {b: Probe(device, bare_scene(rfilter=kind, sample_border=b)) for b in (False, True)}


@pytest.mark.parametrize("sample_border", [False, True])
@pytest.mark.parametrize(("pixel", "pixels"), [(4, 9), (0, 9), (8, 9), (1, 3), (0, 1)])
def test_pixel_offsets_follow_the_filter_cut_at_the_films_edge(filter_probe, sample_border, pixel, pixels):
    rfilter, probes = filter_probe
    out = np.zeros(DRAWS, np.float32)
    body = RANDOM + "float weight = 1.0f; out0[i] = filter_offset(scene, k.x, in0[0], in0[1], &weight);"
    place = np.array([pixel, pixels], np.uint32)
    probes[sample_border].run(["stages/generate.h"], body, [out], [place], stage="generate")
    offset = out.astype(float) - 0.5  # from the pixel's centre
    edges = np.linspace(-rfilter.radius, rfilter.radius, 65)
    if not sample_border:
        film = -pixel - 0.5, pixels - pixel - 0.5
        assert offset.min() >= film[0] - 1e-5 and offset.max() <= film[1] + 1e-5
        edges = np.unique(np.clip(edges, *film))
    x, w = gauss(edges[:-1], edges[1:], 16)
    mass = (w * filter_value(rfilter, x)).sum(axis=1)
    observed = np.histogram(np.clip(offset, edges[0], edges[-1]), edges)[0]
    assert observed.sum() == DRAWS
    # the table is linear within 1/1024 of the width: too fine a difference for this many draws
    assert chi2_p_value(observed, DRAWS * mass / mass.sum()) > FALSE_ALARM
    if rfilter.kind != "box":
        assert chi2_p_value(observed, DRAWS * np.diff(edges) / np.ptp(edges)) < 1e-9


# -- the camera --------------------------------------------------------------------------------------

VIEW = clvol.look_at((1, 2, 3), (0, 0.5, -1), (0, 1, 0))
FILM_POINTS = np.array([(0.0, 0.0), (0.75, 0.25), (1.0, 1.0)])
MITSUBA_RAYS = {  # sensor.sample_ray of Mitsuba 3.9.1 (scalar_rgb) at FILM_POINTS: width, height, directions
    "x": (
        {"fov": 50.0, "fov_axis": "x"},
        (6, 4),
        [
            (-0.6159481406, -0.0433923863, -0.7865906954),
            (-0.0140752010, -0.1885492951, -0.9819628596),
            (0.2182962000, -0.5530854464, -0.8040169477),
        ],
    ),
    "y": (
        {"fov": 50.0, "fov_axis": "y"},
        (6, 4),
        [
            (-0.7234856486, 0.0737349316, -0.6863902807),
            (0.0848444253, -0.1131851599, -0.9899446964),
            (0.3745563626, -0.5971288681, -0.7093269229),
        ],
    ),
    "diagonal": (
        {"fov": 50.0, "fov_axis": "diagonal"},
        (6, 4),
        [
            (-0.5671455264, -0.0895495191, -0.8187349439),
            (-0.0491241217, -0.2145889103, -0.9754682183),
            (0.1540120095, -0.5301506520, -0.8337989450),
        ],
    ),
    "smaller of a tall film": (
        {"fov": 50.0, "fov_axis": "smaller"},
        (4, 6),
        [
            (-0.5651426911, 0.2414508611, -0.7888695002),
            (-0.0283273775, -0.0121915722, -0.9995243549),
            (0.2162133902, -0.7648448348, -0.6068477035),
        ],
    ),
    "larger of a tall film": (
        {"fov": 50.0, "fov_axis": "larger"},
        (4, 6),
        [
            (-0.4956461787, 0.0840309039, -0.8644499183),
            (-0.0928813443, -0.1182232797, -0.9886335731),
            (0.0979942381, -0.6805087328, -0.7261577249),
        ],
    ),
    "smaller of a wide film": (
        {"fov": 50.0, "fov_axis": "smaller"},
        (6, 4),
        [
            (-0.7234856486, 0.0737349316, -0.6863902807),
            (0.0848444253, -0.1131851599, -0.9899446964),
            (0.3745563626, -0.5971288681, -0.7093269229),
        ],
    ),
    "principal point": (
        {"fov": 50.0, "principal_point_offset": (0.1, -0.2)},
        (6, 4),
        [
            (-0.5430286527, 0.0582259670, -0.8376930356),
            (0.0602195485, -0.0725368187, -0.9955460429),
            (0.2845894098, -0.4454503357, -0.8488715291),
        ],
    ),
}


def film_and_sensor(name):
    """Without `fov` a Mitsuba camera has a 50 mm lens: tested with the loader."""
    keywords, (width, height), expected = MITSUBA_RAYS[name]
    film = Film(width, height, ReconstructionFilter("box", 0.5))
    return film, Perspective(VIEW, **keywords), np.array(expected)


@pytest.mark.parametrize("name", MITSUBA_RAYS)
def test_camera_rays_are_mitsubas(name):
    film, sensor, expected = film_and_sensor(name)
    centre = np.array([0.3, 0.2, 0.1])
    rays = camera_rays(sensor, film, centre, radius=1.5)
    for (u, v), direction in zip(FILM_POINTS, expected, strict=True):
        x, y = u * film.width, v * film.height
        found = rays.base + x * rays.base_dx + y * rays.base_dy
        np.testing.assert_allclose(found / np.linalg.norm(found), direction, atol=2e-6)
        from_eye = rays.position + x * rays.dx + y * rays.dy + centre - VIEW[:3, 3]
        assert from_eye @ direction > 0
        np.testing.assert_allclose(np.cross(from_eye, direction), 0, atol=1e-5)


@pytest.mark.parametrize("name", ["x", "smaller of a tall film", "principal point"])
def test_paths_start_on_mitsubas_rays_at_the_offsets_drawn(device, name):
    """Every path that `start_job` starts lies in its own pixel of Mitsuba's image plane."""
    film, sensor, expected = film_and_sensor(name)
    samples, pixels = 500, film.width * film.height
    started = start_paths(device, replace(bare_scene(), film=film, sensor=sensor), samples)
    d, o, jobs = started.direction, started.origin, started.pixel
    # where the ray meets the image plane, from the corners of Mitsuba's film
    a, _, c = expected / (expected @ VIEW[:3, 2])[:, None]
    local, corners = d @ VIEW[:3, :3], np.array([a, c]) @ VIEW[:3, :3]
    place = (local[:, :2] / local[:, 2:] - corners[0, :2]) / (corners[1, :2] - corners[0, :2])
    found = np.floor(place * [film.width, film.height] + 1e-6).astype(int)
    assert (jobs == np.repeat(np.arange(pixels), samples)).all()
    inside = (found[:, 1] * film.width + found[:, 0] == jobs).mean()
    assert inside > 0.9999  # rounding moves a few over a border
    np.testing.assert_allclose(np.cross(o - VIEW[:3, 3], d), 0, atol=1e-5)
    cells = np.floor(place * [4 * film.width, 4 * film.height]).astype(int)
    cells = np.clip(cells, 0, [4 * film.width - 1, 4 * film.height - 1])
    assert uniform_p_value(cells[:, 1] * 4 * film.width + cells[:, 0], 16 * pixels) > FALSE_ALARM
