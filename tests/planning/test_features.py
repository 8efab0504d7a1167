"""Model only what a scene needs: a stage, buffer, field or branch that a scene does not use is not there.

Pins, from the scene alone, which stages are launched, which headers and arguments a unit holds, and what a
path slot costs.
"""

import re
from dataclasses import replace

import numpy as np
import pytest
from pictures import ball, box, gridded, hg, homogeneous, picture, volume
from probe import medium_of, scene_of

import clvol
from clvol import layout
from clvol.device import programs
from clvol.planning.choices import Choices
from clvol.planning.plan import Plan
from clvol.rendering.session import on_device
from clvol.scene.materials import Conductor, Dielectric, Diffuse, Mask
from clvol.scene.records import (
    ConstantEmitter,
    ConstVolume,
    DirectionalEmitter,
    EnvmapEmitter,
    PointEmitter,
    ReconstructionFilter,
)
from clvol.tables.prepare import prepare

CUBE = (0, 0, 0), (1, 1, 1)
SKY, SUN, LAMP = ConstantEmitter(), DirectionalEmitter((1.0,), (0, -1, 0)), PointEmitter((1.0,), (0, 3, 0))
LUMPS = np.random.default_rng(4).uniform(0, 1, (5, 5, 5))
ENVMAP = EnvmapEmitter(np.ones((8, 16, 3), np.float32), np.eye(4))


def scene(shapes=(), lights=(SKY,), **keywords):
    return picture(shapes, lights, (0.5, 0.5, -2), (0.5, 0.5, 0), **keywords)


def fog(sigma_t=1.0, albedo=0.5, **keywords):
    return box(*CUBE, homogeneous(sigma_t, albedo, **keywords))


def grid(albedo=0.5, filter_type="trilinear", **keywords):
    return box(*CUBE, gridded(volume(LUMPS, *CUBE, filter_type), albedo, **keywords))


SCENES = {
    "nothing": scene(lights=()),
    "a sky": scene(),
    "absorbing fog": scene([fog(albedo=0.0)]),
    "fog under a sky": scene([fog()]),
    "fog under a sun": scene([fog()], [SUN]),
    "coloured fog": scene([fog((0.5, 1.0, 1.5))], [SKY, LAMP]),
    "a coloured albedo": scene([fog(albedo=(0.5, 0.9, 0.1))], [SUN]),
    "a grid": scene([grid()], [SKY, SUN, LAMP]),
    "everything": scene(
        [
            fog(phase=hg(0.3)),
            ball((0.5, 0.5, 0.5), 0.4, gridded(volume(LUMPS[..., None] * [1, 0.5, 0.2], *CUBE, "nearest"))),
            grid(volume(LUMPS, *CUBE)),
        ],
        [ENVMAP, SUN, LAMP],
        max_depth=9,
        hide_emitters=True,
    ),
}


def plan_of(device, described, majorant="grid", **choices):
    plan = Plan.of(described, Choices(majorant=majorant, **choices))
    return on_device(prepare(described, plan), device).plan


def units(plan):
    """Composed text of every stage, without comments."""
    return {
        stage: re.sub(r"/\*.*?\*/", "", programs.stage_source(plan, stage), flags=re.DOTALL)
        for stage in (*plan.stages, "accumulate")
    }


def headers(plan):
    """Files under cl/ that any unit holds."""
    return {name for text in units(plan).values() for name in re.findall(r'^#line \d+ "(.+)"$', text, re.M)}


def argument_names(plan):
    return {a.name for a in layout.arguments(plan.macros)}


def field_names(plan):
    return {f.name for f in layout.path_fields(plan.macros)}


# -- stages ------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("name", "stages"),
    {
        "nothing": "generate intersect shade",
        "a sky": "generate intersect shade",
        "absorbing fog": "generate intersect medium_sample shade",
        "fog under a sky": "generate intersect medium_sample shade",
        "fog under a sun": "generate intersect medium_sample shade shadow_transmittance",
        "everything": "generate intersect medium_sample shade shadow_transmittance",
    }.items(),
)
def test_only_the_stages_a_scene_needs_are_composed(device, name, stages):
    assert plan_of(device, SCENES[name]).stages == tuple(stages.split())


def test_a_scene_without_media_launches_no_medium_stage():
    result = clvol.render(SCENES["a sky"], spp=16)
    assert (result.image == 1).all()
    assert set(result.stats["seconds"]) == {
        "setup",
        "kernels",
        "render",
        "generate",
        "intersect",
        "shade",
        "accumulate",
    }
    assert result.stats["lookups"] == 0


def test_a_scene_without_light_is_black():
    assert (clvol.render(SCENES["nothing"], spp=16).image == 0).all()


def test_absorbing_media_need_no_shadow_rays_whatever_is_asked_for(device):
    plan = plan_of(device, scene([fog(albedo=0.0)], [SUN]), transmittance="ratio")
    assert not plan.nee
    assert "phase/phase.h" not in headers(plan)


def test_media_that_do_not_sample_emitters_need_no_shadow_rays(device):
    medium = medium_of(1.0, albedo=0.5, sample_emitters=False)
    plan = plan_of(device, scene([box(*CUBE, medium)], [SUN]), transmittance="ratio")
    assert "shadow_transmittance" not in plan.stages


# -- homogeneous and heterogeneous ---------------------------------------------------------------------


GRID_WORDS = ("majorant", "volume", "brick", "lookups", "tops", "kd_nodes", "world_to_index", "Stream stream")


@pytest.mark.parametrize("name", ["nothing", "a sky", "absorbing fog", "fog under a sun", "coloured fog"])
def test_homogeneous_scenes_hold_no_grid_code_and_no_grid_buffers(device, name):
    plan = plan_of(device, SCENES[name])
    assert plan.chosen["majorant"] == "none"
    files = headers(plan)
    assert not [
        f for f in files if f.startswith(("density/", "majorant/", "tracking/delta", "tracking/ratio"))
    ]
    assert not argument_names(plan) & {"volumes", "tops", "bricks", "majorants", "kd_nodes"}
    assert not field_names(plan) & {"lookups", "violations", "exhausted"}
    for stage, text in units(plan).items():
        for word in (
            "majorant_next",
            "volume_value",
            "volume_brick",
            "sample_collision",
            "estimate_transmittance",
        ):
            assert f"INLINE bool {word}" not in text and f"INLINE float {word}" not in text, (stage, word)


def test_grids_hold_no_analytic_tracking(device):
    assert "tracking/homogeneous.h" not in headers(plan_of(device, SCENES["a grid"]))
    assert "tracking/homogeneous.h" in headers(plan_of(device, SCENES["everything"]))


@pytest.mark.parametrize(
    ("majorant", "buffer"), {"global": "", "grid": "majorants", "kdtree": "kd_nodes"}.items()
)
def test_one_majorant_is_compiled_and_only_its_buffer_is_bound(device, majorant, buffer):
    plan = plan_of(device, SCENES["a grid"], majorant)
    walks = {f for f in headers(plan) if f.startswith("majorant/")} - {"majorant/majorant.h"}
    beside = {"kdtree": "majorant/box_walk.h"}.get(majorant, "majorant/lanes.h")
    assert walks == {f"majorant/{majorant}.h", beside}
    assert not {"geometry/lattice_tree.h", "majorant/tree_grid.h"} & set(headers(plan)), "for sparse grids"
    assert argument_names(plan) & {"majorants", "kd_nodes"} == ({buffer} if buffer else set())


# -- light -------------------------------------------------------------------------------------------


def test_environment_map_code_comes_with_an_environment_map(device):
    with_map = plan_of(device, scene([fog()], [ENVMAP]))
    without = plan_of(device, scene([fog()], [SKY, SUN]))
    assert "emitter/envmap.h" in headers(with_map) and "env_texels" in argument_names(with_map)
    assert "emitter/envmap.h" not in headers(without)
    assert not argument_names(without) & {"envmap", "env_texels", "env_marginal", "env_conditional"}


def test_the_pdf_of_a_direction_is_kept_only_for_multiple_importance_sampling(device):
    assert "pdf" in field_names(plan_of(device, scene([fog()], [ENVMAP])))
    assert "pdf" not in field_names(plan_of(device, SCENES["fog under a sun"]))
    assert "pdf" not in field_names(plan_of(device, SCENES["fog under a sky"]))


def test_the_distance_to_a_light_is_kept_only_for_point_lights(device):
    assert "shadow_distance" in field_names(plan_of(device, scene([fog()], [LAMP])))
    assert "shadow_distance" not in field_names(plan_of(device, SCENES["fog under a sun"]))


# -- channels, media, film -----------------------------------------------------------------------------


def bytes_per_slot(plan):
    return 4 * len(layout.path_fields(plan.macros))


def test_grey_scenes_carry_one_channel_and_smaller_paths(device):
    grey = plan_of(device, scene([fog()], [SUN]))
    coloured_light = plan_of(device, scene([fog()], [DirectionalEmitter((1, 0.5, 0.2), (0, -1, 0))]))
    assert (grey.channels, coloured_light.channels) == (1, 3)
    assert "#define CLVOL_CHANNELS 1\n" in programs.stage_source(grey, "accumulate")
    assert "#define CLVOL_CHANNELS 3\n" in programs.stage_source(coloured_light, "accumulate")
    # beta, radiance and the shadow ray's light: three numbers each instead of one
    assert bytes_per_slot(coloured_light) - bytes_per_slot(grey) == 4 * 3 * 2


COLOURED_GRID = box(*CUBE, gridded(volume(LUMPS[..., None] * [1, 0.5, 0.2], *CUBE), 0.5))


def test_one_channel_per_path_costs_one_field(device):
    grey = plan_of(device, scene([grid()], [SUN]), technique="delta")
    chromatic = plan_of(device, scene([COLOURED_GRID], [SUN]), technique="delta")
    assert (chromatic.channels, chromatic.spectrum, chromatic.extinction) == (3, 1, 1)
    assert field_names(chromatic) - field_names(grey) == {"channel"}


@pytest.mark.parametrize("technique", ["spectral", "spectral-decomposition", "regular"])
def test_techniques_that_follow_all_channels_carry_them(device, technique):
    plan = plan_of(device, scene([COLOURED_GRID], [SUN]), technique=technique)
    assert (plan.channels, plan.spectrum, plan.extinction) == (3, 3, 3)
    assert plan.weighted


def test_homogeneous_media_of_several_colours_follow_all_channels(device):
    plan = plan_of(device, scene([fog((0.5, 1.0, 1.5))], [SUN]))
    assert (plan.channels, plan.spectrum, plan.extinction) == (3, 3, 3)


def test_overlapping_media_of_several_colours_follow_all_channels(device):
    plan = plan_of(device, scene([fog((0.5, 1.0, 1.5)), fog()], [SUN]))
    assert (plan.channels, plan.spectrum, plan.extinction) == (3, 3, 3)


def test_a_grey_medium_of_coloured_albedo_follows_all_channels_unless_absorption_is_sampled(device):
    described = scene([grid(albedo=(0.5, 0.9, 0.1))], [SUN])
    for absorption, spectrum in {"weight": 3, "mixed": 3, "sample": 1}.items():
        plan = plan_of(device, described, absorption=absorption)
        assert (plan.spectrum, plan.extinction) == (spectrum, 1)
    assert plan_of(device, described, absorption="sample", technique="spectral").spectrum == 3


def test_tables_of_cells_come_with_the_techniques_that_read_them(device):
    described = scene([grid()], [SUN])
    plain = argument_names(plan_of(device, described, technique="delta", transmittance="ratio"))
    assert not plain & {"controls", "residuals", "blackbody"}
    decomposed = plan_of(device, described, technique="decomposition", transmittance="residual-ratio")
    assert argument_names(decomposed) - plain == {"controls", "residuals"}
    marched = plan_of(device, described, technique="marching", transmittance="marching")
    assert plain - argument_names(marched) == {"majorants"}
    assert not any(name.startswith("majorant/") for name in headers(marched))


def test_emission_code_comes_with_emission(device):
    described = scene([grid()], [SUN])
    glowing = replace(described.shapes[0].interior, emission=ConstVolume((1.0,)))
    plan = plan_of(device, scene([box(*CUBE, glowing)], ()))
    assert "medium/emission.h" in headers(plan)
    assert "medium/emission.h" not in headers(plan_of(device, described))


def test_fields_for_several_media_come_with_several_media(device):
    one, apart = [fog()], [fog(), box((2, 0, 0), (3, 1, 1), homogeneous(1.0, 0.5))]
    fields = [field_names(plan_of(device, scene(shapes, [SUN]))) for shapes in (one, apart)]
    assert fields[1] ^ fields[0] == {"medium", "medium_end"}


def test_the_filter_table_comes_with_a_filter_and_the_depth_count_with_a_limit(device):
    plain = scene([fog()])
    plan = plan_of(device, plain)
    assert "filter_cdf" not in argument_names(plan)
    assert not field_names(plan) & {"cut", "cut_energy"}
    tent = scene_of(medium_of(1.0, albedo=0.5))
    object.__setattr__(tent.film, "rfilter", ReconstructionFilter("tent", 1.0))
    assert "filter_cdf" in argument_names(plan_of(device, tent))
    assert {"cut", "cut_energy"} <= field_names(plan_of(device, scene([fog()], max_depth=3)))


def test_what_render_reports_is_what_the_plan_says(device):
    result = clvol.render(SCENES["fog under a sky"], spp=16)
    assert result.stats["bytes_per_slot"] == bytes_per_slot(plan_of(device, SCENES["fog under a sky"]))


# -- surfaces ----------------------------------------------------------------------------------------


SURFACE_CODE = (
    "geometry/bvh",
    "geometry/surface",
    "geometry/triangle",
    "geometry/quadric",
    "bsdf/",
    "texture/",
    "stages/surface_scatter",
    "stages/side",
)
MEDIUM_CODE = (
    "tracking/",
    "medium/",
    "density/",
    "majorant/",
    "phase/",
    "stages/medium",
    "stages/segment",
    "stages/collision_scatter",
)
PLAIN = replace(ball((0.5, 0.5, 0.5), 0.4), bsdf=Diffuse())


def held(plan, words):
    return {f for f in headers(plan) if f.startswith(words)}


@pytest.mark.parametrize("name", SCENES)
def test_scenes_without_surfaces_hold_no_geometry_code(device, name):
    plan = plan_of(device, SCENES[name])
    assert not held(plan, (*SURFACE_CODE, "emitter/area", "stages/boundary"))
    assert not [a for a in argument_names(plan) if a.startswith(("bvh_", "shapes", "materials", "faces"))]
    assert not [
        f for f in field_names(plan) if f.startswith(("hit_primitive", "hit_t", "inside", "shadow_inside"))
    ]


@pytest.mark.parametrize("lights", [[SKY], [LAMP], [SKY, LAMP], []], ids=["sky", "lamp", "both", "dark"])
def test_scenes_without_media_hold_no_tracking_code(device, lights):
    plan = plan_of(device, scene([PLAIN], lights))
    assert held(plan, MEDIUM_CODE) <= {"tracking/tally.h"}  # counters, all of them without a field
    assert "medium_sample" not in plan.stages
    assert not argument_names(plan) & {"media", "phases", "volumes", "bricks", "majorants"}
    assert not field_names(plan) & {
        "medium",
        "medium_end",
        "lookups",
        "tentative",
        "real",
        "largest_weight",
    }
    assert not argument_names(plan) & {"result_counts"}


def test_what_shade_handles_comes_with_what_paths_can_meet(device):
    for name, events in {
        "nothing": set(),
        "a sky": {"escape"},
        "absorbing fog": {"escape", "collision_scatter"},
        "fog under a sun": {"bounce", "collision_scatter"},
    }.items():
        found = held(plan_of(device, SCENES[name]), ("stages/escape", "stages/bounce", "stages/collision"))
        assert found == {f"stages/{event}.h" for event in events}, name


@pytest.mark.parametrize(
    ("bsdf", "files"),
    [
        (Diffuse(), {"diffuse"}),
        (Dielectric(), {"dielectric", "fresnel"}),
        (Conductor(), {"conductor", "fresnel"}),
    ],
)
def test_only_the_bsdfs_of_a_scene_are_composed(device, bsdf, files):
    plan = plan_of(device, scene([replace(PLAIN, bsdf=bsdf)], [SKY]))
    assert held(plan, "bsdf/") == {f"bsdf/{name}.h" for name in files | {"bsdf", "kinds", "sample"}}


def test_what_only_passable_or_transmissive_surfaces_need_comes_with_them(device):
    opaque, glass, veil = (
        plan_of(device, scene([replace(PLAIN, bsdf=b)], [SKY]))
        for b in (Diffuse(), Dielectric(), Mask(Diffuse()))
    )
    assert "eta_squared" in field_names(glass) and "eta_squared" not in field_names(opaque) | field_names(
        veil
    )
    assert "after_t" in field_names(veil) and "after_t" not in field_names(opaque) | field_names(glass)


def test_a_camera_looks_for_what_it_is_inside_of_only_where_it_may_be(device):
    for centre, inside in ((0.5, 0.5, 0.0), 0), ((0.5, 0.5, -2.0), 1):
        shape = replace(ball(centre, 0.4, homogeneous(1.0, 0.5)), bsdf=Dielectric())
        assert plan_of(device, scene([shape])).macros["CLVOL_CAMERA_INSIDE"] == inside


# -- the device --------------------------------------------------------------------------------------


@pytest.mark.parametrize("name", ["nothing", "everything"])
def test_composed_sources_of_every_stage_build(device, name):
    plan = plan_of(device, SCENES[name])
    composed = programs.stage_units(plan, groups=1, pixels=1)
    kernels = programs.build_stages(device, composed)
    assert tuple(kernels) == (*plan.stages, "accumulate")
    for stage, kernel in kernels.items():
        if stage != "accumulate":
            taken = programs.arguments_of(composed[stage].source)
            assert kernel.num_args == len(taken) and set(taken) <= argument_names(plan)


def test_units_are_the_same_for_scenes_that_differ_in_what_a_stage_does_not_use(device):
    """Each is then built once for all of them."""
    sky, sun = (plan_of(device, SCENES[f"fog under a {light}"]) for light in ("sky", "sun"))
    assert sky.macros != sun.macros
    for stage in ("intersect", "accumulate"):
        assert programs.stage_source(sky, stage) == programs.stage_source(sun, stage)
    assert "emitters" not in programs.arguments_of(programs.stage_source(sun, "intersect"))
    assert "emitters" in programs.arguments_of(programs.stage_source(sun, "shade"))


def test_a_unit_is_self_contained_and_names_files_and_lines(device):
    for text in units(plan_of(device, SCENES["everything"])).values():
        assert not re.search(r"^\s*#\s*include", text, re.M)
        assert '#line 1 "core/types.h"' in text


# -- a uniform sky beside other lights ----------------------------------------------------------------


@pytest.mark.parametrize(
    ("lights", "chosen", "mis"),
    [((SKY, SUN), 1, False), ((SKY, SUN, LAMP), 2, False), ((ENVMAP, SUN), 2, True), ((SKY,), 1, True)],
    ids=["a sun", "two lights", "a map", "alone"],
)
def test_a_uniform_sky_among_others_takes_no_shadow_ray(lights, chosen, mis):
    described = scene([box(*CUBE, gridded(volume(LUMPS, *CUBE), 0.9))], lights)
    plan = Plan.of(described, Choices(transmittance="ratio"))
    assert (plan.features.sampled_emitters, plan.mis) == (chosen, mis)
    result = clvol.render(described, spp=4, seed=1, transmittance="ratio")
    assert result.stats["shadow_rays"] > 0
