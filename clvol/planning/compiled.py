"""What is compiled: a plan as macros, and as headers that fill slots."""

from __future__ import annotations

from typing import TYPE_CHECKING

from clvol import layout
from clvol.planning import registry
from clvol.planning.lanes import lanes

if TYPE_CHECKING:
    from clvol.planning.decisions import Decisions


def plan_macros(plan: Decisions) -> dict[str, int]:
    """``CLVOL_*`` macros of a plan; every value is an integer, 0 for what is not there."""
    f = plan.features
    return {
        "CLVOL_LOCAL_SIZE": plan.tuning.local_size,
        "CLVOL_GROUP_SLOTS": plan.tuning.group_slots,
        "CLVOL_LANES": 0,  # of units other than those of stages that have lanes
        "CLVOL_HAS_LANES": max(lanes(plan).values(), default=0),
        "CLVOL_CHANNELS": plan.channels,
        "CLVOL_SPECTRUM": plan.spectrum,
        "CLVOL_EXTINCTION": plan.extinction,
        "CLVOL_WEIGHTED": int(plan.weighted),
        "CLVOL_JOBS_PER_SAMPLE": plan.jobs_per_sample,
        "CLVOL_ONE_CHANNEL_PER_PATH": int(plan.one_channel_per_path),
        "CLVOL_HAS_MEDIA": int(f.media > 0),
        "CLVOL_HAS_MANY_MEDIA": int(f.media > 1),
        "CLVOL_HAS_SEGMENTS": int(f.segments),
        "CLVOL_HAS_OVERLAP": int(f.media_overlap),
        "CLVOL_HAS_HOMOGENEOUS": int(f.homogeneous),
        "CLVOL_HAS_HETEROGENEOUS": int(f.heterogeneous),
        "CLVOL_HAS_CLIPPED": int(f.clipped),
        "CLVOL_HAS_THIN": int(f.thin),
        "CLVOL_HAS_CUBE": int(f.cubes),
        "CLVOL_HAS_SPHERE": int(f.spheres),
        "CLVOL_HAS_VOLUMES": int(f.volumes > 0),
        "CLVOL_HAS_TRILINEAR": int(f.trilinear),
        "CLVOL_HAS_NEAREST": int(f.nearest),
        "CLVOL_HAS_TOP_TREES": int(plan.settled is not None and plan.settled.top_trees),
        "CLVOL_HAS_COLOURED_VOLUME": int(f.coloured_volumes),
        "CLVOL_HAS_ALBEDO_VOLUME": int(f.albedo_volumes),
        "CLVOL_DENSITY_CHANNELS": 3 if f.coloured_extinction else 1,
        "CLVOL_EMISSION_ON_WALKS": int(f.emission and not f.media_overlap),
        "CLVOL_EMISSION_AT_COLLISIONS": int(f.emission and f.media_overlap),
        "CLVOL_EXPECTS_BACKGROUND": int(plan.expects_background),
        "CLVOL_SUN_CONTROL": int(plan.sun_control),
        "CLVOL_FLIGHT_STRATA": plan.flight_strata,
        "CLVOL_HAS_EMISSION_VOLUME": int(f.emission_volumes),
        "CLVOL_HAS_GLOW": int(f.glow),
        "CLVOL_HAS_GLOW_VOLUME": int(f.glow_volumes),
        "CLVOL_HAS_TEMPERATURE": int(f.temperature),
        "CLVOL_HAS_TRANSFER": int(f.transfers),
        **{f"CLVOL_PHASE_{name}": int(name in f.phases) for name in layout.ENUMS["PHASE"]},
        "CLVOL_HAS_BLEND": int(f.blend),
        "CLVOL_HAS_VARIED_PHASE": int(f.varied_phases or f.varied_flakes),
        "CLVOL_HAS_VARIED_FLAKES": int(f.varied_flakes),
        "CLVOL_HAS_VARIED_AREAS": int(f.varied_areas),
        "CLVOL_HAS_SCATTERING": int(f.scattering),
        "CLVOL_HAS_PHASES": int(f.scattering or "SGGX" in f.phases),
        "CLVOL_HAS_EMITTERS": int(f.emitters > 0),
        "CLVOL_HAS_NEAR_LIGHTS": int(f.near_lights),
        "CLVOL_HAS_CONSTANT": int(f.constant),
        "CLVOL_SKY_APART": int(f.sky_apart),
        "CLVOL_HAS_ENVMAP": int(f.envmap),
        "CLVOL_HAS_DIRECTIONAL": int(f.directional),
        "CLVOL_HAS_POINT": int(f.point_lights),
        "CLVOL_HAS_SPOT": int(f.spot),
        "CLVOL_HAS_SPOT_TEXTURE": int(f.spot_textures),
        "CLVOL_HAS_PROJECTOR": int(f.projector),
        "CLVOL_HAS_SUN": int(f.sun),
        "CLVOL_HAS_AREA": int(f.area),
        "CLVOL_HAS_AREA_MESH": int(f.area_meshes),
        "CLVOL_HAS_AREA_SPHERE": int(f.area_spheres),
        "CLVOL_HAS_AREA_DISK": int(f.area_disks),
        "CLVOL_HAS_AREA_TEXTURE": int(f.area_textures),
        "CLVOL_HAS_SURFACES": int(f.surfaces > 0),
        "CLVOL_HAS_TRIANGLES": int(f.triangles),
        "CLVOL_HAS_QUADRICS": int(f.quadrics),
        "CLVOL_HAS_SHADING_NORMALS": int(f.shading_normals),
        "CLVOL_HAS_VERTEX_UVS": int(f.vertex_uvs),
        "CLVOL_HAS_TEXTURES": int(f.textures),
        "CLVOL_HAS_BITMAPS": int(f.bitmaps),
        "CLVOL_HAS_VOLUME_TEXTURES": int(f.volume_textures),
        "CLVOL_HAS_MATERIAL_TABLES": int(f.material_tables),
        "CLVOL_HAS_ROUGHNESS_TEXTURES": int(f.rough_textures),
        "CLVOL_HAS_METAL_TEXTURES": int(f.metal_textures),
        "CLVOL_VARIED_ROUGHNESS": int(f.rough_textures or any("PRINCIPLED" in name for name in f.bsdfs)),
        "CLVOL_HAS_BUMPS": int(f.bumps),
        "CLVOL_HAS_REFLECTION": int(f.reflecting),
        "CLVOL_HAS_PASSABLE": int(f.passable),
        "CLVOL_HAS_TRANSMISSION": int(f.transmissive),
        "CLVOL_BOUNDARY_WORDS": f.boundary_words,
        "CLVOL_CAMERA_INSIDE": int(f.camera_inside),
        "CLVOL_BVH_STACK": layout.BVH_STACK if f.surfaces else 0,
        **{f"CLVOL_BSDF_{name}": int(name in f.bsdfs) for name in layout.BSDFS},
        "CLVOL_HAS_FILTER_TABLE": int(f.filter_table),
        "CLVOL_HAS_SIGNED_FILTER": int(f.signed_filter),
        "CLVOL_HAS_LENS": int(f.lens),
        "CLVOL_HAS_PARALLEL_RAYS": int(f.parallel_rays),
        "CLVOL_HAS_METER": int(f.meter),
        "CLVOL_HAS_TARGET": int(f.meter and f.parallel_rays),
        "CLVOL_HAS_LONG_WALKS": int(f.heterogeneous or f.passable),
        "CLVOL_WALKS_GRID": int(plan.walks_majorants and plan.chosen["majorant"] == "grid"),
        "CLVOL_WALKS_TREE_GRID": int(plan.walks_majorants and plan.has_tree_grid),
        "CLVOL_WALKS_KDTREE": int(plan.walks_majorants and plan.chosen["majorant"] == "kdtree"),
        "CLVOL_HAS_CONTROLS": int(plan.needs_controls),
        "CLVOL_HAS_RESIDUALS": int(plan.needs_residuals),
        "CLVOL_HAS_MAX_DEPTH": int(f.depth_limited),
        "CLVOL_DEPTH_PICTURE": int(f.shows_depth),
        "CLVOL_HIDE_EMITTERS": int(f.hide_emitters),
        "CLVOL_HIDE_ENVIRONMENT": int(f.hide_environment and (f.constant or f.envmap)),
        "CLVOL_HAS_BACKDROP": int(f.backdrop),
        "CLVOL_FIRST_HIT": int(bool(plan.first_hit)),
        "CLVOL_HAS_ALPHA": int(plan.counts_alpha),
        "CLVOL_FIRSTS": int(bool(plan.first_hit) or plan.counts_alpha),
        **{f"CLVOL_SHOWS_{name.upper()}": int(name in plan.shown) for name in registry.AOVS},
        "CLVOL_RANDOMIZATIONS": plan.randomizations,
        "CLVOL_JOINT": int(plan.chosen["sampler"] == "joint"),
        "CLVOL_PIXEL_LIST": int(plan.pixel_list),
        "CLVOL_NEE": int(plan.nee),
        "CLVOL_MIS": int(plan.mis),
        "CLVOL_LIGHT_CACHE": int(plan.light_cache),
        "CLVOL_LIGHT_CHOICE": int(plan.light_choice),
        "CLVOL_DIRECTION_CONTROL": int(plan.direction_control),
        "CLVOL_ABSORPTION": layout.enum("ABSORPTION", plan.chosen["absorption"]),
        "CLVOL_ROULETTE": layout.enum("ROULETTE", plan.chosen["roulette"]),
        "CLVOL_PROBABILITY": layout.enum("PROBABILITY", plan.chosen["probability"]),
    }


def filled_slots(plan: Decisions) -> dict[str, str]:
    """The headers under cl/ that choices fill in, by family; the majorant's once it is settled."""
    majorant = registry.MAJORANTS.get(plan.chosen["majorant"], registry.Choice(""))
    heads = {
        "sampler": registry.SAMPLERS[plan.chosen["sampler"]].header,
        "technique": "tracking/delta_through.h" if plan.expects_background else plan.tracker.header,
        "transmittance": plan.estimator.header,
        "majorant": "majorant/tree_grid.h" if plan.has_tree_grid else majorant.header,
        "lookup": registry.LOOKUPS[plan.chosen["lookup"]].header,
    }
    return {family: header for family, header in heads.items() if header}
