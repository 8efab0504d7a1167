"""BSDFs without a renderer: reads them as the loader does, and runs the device's functions over them."""

import numpy as np
import pyopencl as cl

from clvol import layout
from clvol.device import programs
from clvol.device.launch import run_kernel
from clvol.scene import bends, bsdf, texture
from clvol.scene.building import build_whole
from clvol.scene.library import Library
from clvol.scene.nodes import from_dict
from clvol.tables.materials import material_table

PLUGINS = {
    "bsdf": {
        name: getattr(bsdf, name)
        for name in (
            *("null", "diffuse", "dielectric", "thindielectric", "roughdielectric", "conductor"),
            *("roughconductor", "plastic", "roughplastic", "twosided", "mask"),
            *("principled", "principledthin", "blendbsdf"),
        )
    }
    | {"normalmap": bends.normalmap, "bumpmap": bends.bumpmap},
    "texture": {"bitmap": texture.bitmap, "checkerboard": texture.checkerboard},
}

BODY = """
__kernel void sample_probe(SCENE, __global const int *number, __global const float *uv,
                           __global const float *wi, __global const float *random, __global float *out,
                           uint count)
{
    const Scene scene = {.materials = materials_, .textures = textures_, .texels = texels_,
                         .material_tables = material_tables_};
    const uint i = get_global_id(0);
    if (i >= count)
        return;
    BsdfSample s;
    __global const Material *material = scene.materials + number[i];
    const float3 in = vload3(i, wi), r = vload3(i, random);
    __global float *o = out + 10 * i;
    for (int k = 0; k < 10; ++k)
        o[k] = 0.0f;
    if (!bsdf_sample(&scene, material, vload2(i, uv), in, r.x, r.y, r.z, CHANNEL, &s))
        return;
    o[0] = 1.0f;
    vstore3(s.direction, 0, o + 1);
    vstore3((float3)(s.weight), 0, o + 4);
    o[7] = s.pdf, o[8] = s.eta, o[9] = s.passes;
}

__kernel void value_probe(SCENE, __global const int *number, __global const float *uv,
                          __global const float *wi, __global const float *wo, __global float *out, uint count)
{
    const Scene scene = {.materials = materials_, .textures = textures_, .texels = texels_,
                         .material_tables = material_tables_};
    const uint i = get_global_id(0);
    if (i >= count)
        return;
    __global const Material *material = scene.materials + number[i];
    const float3 in = vload3(i, wi);
    __global float *o = out + 8 * i;
    float pdf;
    vstore3((float3)(bsdf_value(&scene, material, vload2(i, uv), in, vload3(i, wo), CHANNEL, &pdf)), 0, o);
    o[3] = pdf;
    vstore3((float3)(null_transmission(&scene, material, vload2(i, uv), in.z, CHANNEL)), 0, o + 4);
    o[7] = material_opacity(&scene, material, vload2(i, uv));
}

#if CLVOL_HAS_TEXTURES
__kernel void texture_probe(SCENE, __global const int *number, __global const float *uv, __global float *out,
                            uint count)
{
    const Scene scene = {.materials = materials_, .textures = textures_, .texels = texels_,
                         .material_tables = material_tables_};
    const uint i = get_global_id(0);
    if (i < count)
        vstore3(texture_value(&scene, number[i], vload2(i, uv)), i, out);
}
#endif
"""


def read(description):
    """The record of a BSDF or texture that is described in Mitsuba's words."""
    root = from_dict({"type": "scene", "it": description})
    return build_whole(root["it"], Library(root, PLUGINS))


def source(kinds, channel=None, textures=True):
    """OpenCL text with these kinds of BSDF, maybe textures; with a `channel`, spectra are that one."""
    defines = {f"CLVOL_BSDF_{kind}": int(kind in kinds) for kind in layout.BSDFS}
    defines |= {"CLVOL_HAS_ROUGHNESS_TEXTURES": +textures, "CLVOL_VARIED_ROUGHNESS": 1}
    defines |= {"CLVOL_HAS_METAL_TEXTURES": +textures}
    defines |= {"CLVOL_HAS_TEXTURES": +textures, "CLVOL_HAS_BITMAPS": +textures, "CLVOL_EXTINCTION": 1}
    defines |= {"CLVOL_SPECTRUM": 3 if channel is None else 1, "CLVOL_ONE_CHANNEL_PER_PATH": 1}
    buffers = ("const Material *materials", "const Texture *textures", "const float *texels")
    buffers = [f"__global {buffer}" for buffer in (*buffers, "const float *material_tables")]
    scene = "#define SCENE " + ", ".join(f"{buffer}_" for buffer in buffers)
    text = f'#include "bsdf/bsdf.h"\n{scene}\n#define CHANNEL {channel or 0}\n{BODY}'
    return programs.expand(text, defines, {})


class Samples:
    """What `bsdf_sample` gave."""

    def __init__(self, out):
        self.found = out[:, 0] == 1
        self.wo, self.weight, self.pdf, self.eta = out[:, 1:4], out[:, 4:7], out[:, 7], out[:, 8]
        self.passes = out[:, 9] == 1


class MaterialProbe:
    """The materials of several BSDFs on a device; `sides` has their numbers."""

    def __init__(self, device, bsdfs, kinds=None, channel=None):
        self.device = device
        self.table = material_table(bsdfs)
        self.sides = self.table.sides
        kinds = set(layout.BSDFS) if kinds is None else set(kinds)
        self.program = programs.build(device, source(kinds, channel), "material probe")
        self.scene = [
            device.memory.upload(array if array.size else np.zeros(64, np.float32), "")
            for array in (self.table.materials, self.table.textures, self.table.texels, self.table.tables)
        ]

    def _run(self, name, width, count, *arrays):
        out = np.zeros((count, width), np.float32)
        kernel = cl.Kernel(self.program, name)
        run_kernel(self.device, kernel, count, self.scene, arrays, [out], [np.uint32(count)])
        return out

    def sample(self, material, wi, random, uv=(0.5, 0.5)):
        """`Samples` of a material for wi (n, 3) and random numbers (n, 3)."""
        count = len(random)
        inputs = _inputs(count, (material, ()), (uv, (2,)), (wi, (3,)), (random, (3,)))
        return Samples(self._run("sample_probe", 10, count, *inputs))

    def value(self, material, wi, wo, uv=(0.5, 0.5)):
        """Value (n, 3) and pdf (n,) for wi and wo (n, 3)."""
        out = self._run("value_probe", 8, len(wo), *self._pairs(material, wi, wo, uv))
        return out[:, :3], out[:, 3]

    def null(self, material, wi, uv=(0.5, 0.5)):
        """Null transmission (n, 3) and opacity (n,)."""
        count = max(len(np.atleast_2d(wi)), len(np.atleast_2d(uv)))
        wi = np.broadcast_to(np.float32(wi), (count, 3))
        out = self._run("value_probe", 8, count, *self._pairs(material, wi, wi, uv))
        return out[:, 4:7], out[:, 7]

    def _pairs(self, material, wi, wo, uv):
        return _inputs(len(wo), (material, ()), (uv, (2,)), (wi, (3,)), (wo, (3,)))

    def texture(self, number, uv):
        """Colours (n, 3) of a texture at uv (n, 2)."""
        inputs = _inputs(len(uv), (number, ()), (uv, (2,)))
        return self._run("texture_probe", 3, len(uv), *inputs)


def _inputs(count, number, *arrays):
    inputs = [np.ascontiguousarray(np.broadcast_to(np.int32(number[0]), (count,)))]
    for array, shape in arrays:
        inputs.append(np.ascontiguousarray(np.broadcast_to(np.asarray(array, np.float32), (count, *shape))))
    return inputs
