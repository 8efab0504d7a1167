"""Arguments of the stages' kernels: every buffer that there may be, and the feature that needs it."""

from __future__ import annotations

from dataclasses import dataclass

from clvol.layout.path_state import Macros, counts_per_path


@dataclass(frozen=True)
class Argument:
    """One kernel argument, a buffer or scalar.

    needs : a macro that must be other than 0.
    rare : few scenes need it, and in what others compile the Scene has no room for it.
    """

    name: str
    c_type: str
    needs: str = ""
    rare: bool = False


ARGUMENTS = (
    Argument("render", "__global const Render *"),
    Argument("state", "__global uint *"),
    Argument("slot_stride", "uint"),
    Argument("queues", "__global uint *"),
    Argument("queue_lengths", "__global uint *"),
    Argument("counters", "__global uint *"),
    Argument("results", "__global float *"),
    Argument("result_counts", "__global uint *", "CLVOL_RESULT_COUNTS"),
    Argument("result_firsts", "__global float *", "CLVOL_FIRSTS"),
    Argument("pixel_list", "__global const uint *", "CLVOL_PIXEL_LIST"),  # pixel, its samples so far
    Argument("sobol", "__global const uint *", "CLVOL_RANDOMIZATIONS"),
    Argument("media", "__global const Medium *", "CLVOL_HAS_MEDIA"),
    Argument("glows", "__global const Glow *", "CLVOL_HAS_GLOW", rare=True),  # one for each medium
    Argument("boundary_masks", "__global const uint *", "CLVOL_BOUNDARY_WORDS"),
    Argument("volumes", "__global const Volume *", "CLVOL_HAS_VOLUMES"),
    Argument("tops", "__global const int *", "CLVOL_HAS_VOLUMES"),
    Argument("bricks", "__global const float *", "CLVOL_HAS_VOLUMES"),
    Argument("majorants", "__global const float *", "CLVOL_WALKS_GRID"),
    Argument("majorant_links", "__global const int *", "CLVOL_WALKS_TREE_GRID"),
    Argument("kd_nodes", "__global const uint2 *", "CLVOL_WALKS_KDTREE"),
    Argument("controls", "__global const float *", "CLVOL_HAS_CONTROLS"),
    Argument("residuals", "__global const float *", "CLVOL_HAS_RESIDUALS"),
    Argument("transfers", "__global const Transfer *", "CLVOL_HAS_TRANSFER"),
    Argument("transfer_points", "__global const float4 *", "CLVOL_HAS_TRANSFER"),  # value and colour
    Argument("blackbody", "__global const float *", "CLVOL_HAS_TEMPERATURE"),
    Argument("phases", "__global const Phase *", "CLVOL_HAS_PHASES"),
    Argument("emitters", "__global const Emitter *", "CLVOL_HAS_EMITTERS"),
    Argument("light_cache", "__global const LightCache *", "CLVOL_LIGHT_CACHE"),
    Argument("light_transmittance", "__global const float *", "CLVOL_LIGHT_CACHE"),
    Argument("bvh_nodes", "__global const float8 *", "CLVOL_HAS_SURFACES"),
    Argument("bvh_triangles", "__global const float8 *", "CLVOL_HAS_SURFACES"),
    Argument("quadrics", "__global const Quadric *", "CLVOL_HAS_QUADRICS"),
    Argument("shapes", "__global const Shape *", "CLVOL_HAS_SURFACES"),
    Argument("faces", "__global const uint *", "CLVOL_HAS_TRIANGLES"),  # 3 vertices and the shape
    Argument("vertices", "__global const float *", "CLVOL_HAS_TRIANGLES"),
    Argument("normals", "__global const float *", "CLVOL_HAS_SHADING_NORMALS"),
    Argument("uvs", "__global const float *", "CLVOL_HAS_VERTEX_UVS"),
    Argument("materials", "__global const Material *", "CLVOL_HAS_SURFACES"),
    Argument("textures", "__global const Texture *", "CLVOL_HAS_TEXTURES"),
    Argument("texels", "__global const float *", "CLVOL_HAS_BITMAPS"),
    Argument("material_tables", "__global const float *", "CLVOL_HAS_MATERIAL_TABLES"),
    Argument("lamp_edges", "__global const uchar *", "CLVOL_LAMP_EDGES", rare=True),  # of each pixel
    Argument("light_faces", "__global const uint *", "CLVOL_HAS_AREA_MESH"),
    Argument("light_cdf", "__global const float *", "CLVOL_HAS_AREA_MESH"),
    Argument("envmap", "__global const Envmap *", "CLVOL_HAS_ENVMAP"),
    Argument("env_texels", "__global const float *", "CLVOL_HAS_ENVMAP"),
    Argument("env_marginal", "__global const float *", "CLVOL_HAS_ENVMAP"),
    Argument("env_conditional", "__global const float *", "CLVOL_HAS_ENVMAP"),
    Argument("meter", "__global const MeterFace *", "CLVOL_HAS_METER", rare=True),
    Argument("filter_cdf", "__global const float *", "CLVOL_HAS_FILTER_TABLE"),
)
"""State and queues first, then what the scene holds."""
ALWAYS = "render"
"""The argument that kernels have even where they use nothing of a scene."""


def arguments(macros: Macros) -> list[Argument]:
    """What a scene's kernels may have as arguments, in order."""
    known = {**macros, "CLVOL_RESULT_COUNTS": counts_per_path(macros)}
    return [argument for argument in ARGUMENTS if not argument.needs or known[argument.needs]]
