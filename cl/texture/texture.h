/* Colours over (u, v): bitmaps and checkerboards.

   A texel (x, y) is centred at ((x + 1/2) / width, (y + 1/2) / height), row 0 at v = 0; bilinear look-ups wrap each
   of their four texels. */
#ifndef CLVOL_TEXTURE_TEXTURE_H
#define CLVOL_TEXTURE_TEXTURE_H
#include "core/scene.h"
#include "texture/volume.h"

INLINE int wrapped(int index, int count, int wrap)
{
    if (wrap == WRAP_CLAMP)
        return clamp_int(index, 0, count - 1);
    const int period = wrap == WRAP_MIRROR ? 2 * count : count;
    int within = index % period;
    within = within < 0 ? within + period : within;
    return within < count ? within : period - 1 - within;
}

INLINE float3 bitmap_value(const Scene *scene, __global const Texture *texture, float2 uv)
{
    const int width = texture->size[0], height = texture->size[1], wrap = texture->wrap;
    const float shift = texture->nearest ? 0.0f : 0.5f;
    const float x = uv.x * (float)width - shift, y = uv.y * (float)height - shift;
    const int x0 = floor_int(x), y0 = floor_int(y);
    const size_t left = (size_t)wrapped(x0, width, wrap);
    const size_t row = texture->first + (size_t)wrapped(y0, height, wrap) * width;
    const float3 corner = vload3(row + left, scene->texels);
    if (texture->nearest)
        return corner;
    const size_t right = (size_t)wrapped(x0 + 1, width, wrap);
    const size_t next = texture->first + (size_t)wrapped(y0 + 1, height, wrap) * width;
    /* beyond what floor_int can tell, any place is as good as another */
    const float fx = clamp_to(x - (float)x0, 0.0f, 1.0f), fy = clamp_to(y - (float)y0, 0.0f, 1.0f);
    const float3 upper = corner + fx * (vload3(row + right, scene->texels) - corner);
    const float3 start = vload3(next + left, scene->texels);
    const float3 lower = start + fx * (vload3(next + right, scene->texels) - start);
    return upper + fy * (lower - upper);
}

INLINE float3 texture_value(const Scene *scene, int number, float2 surface_uv)
{
    __global const Texture *texture = scene->textures + number;
#if CLVOL_HAS_VOLUME_TEXTURES
    if (texture->kind == TEXTURE_VOLUME)
        return volume_texture(scene, texture);
#endif
    __global const float *m = texture->to_uv;
    const float2 uv = (float2)(m[0] * surface_uv.x + m[1] * surface_uv.y + m[2],
                               m[3] * surface_uv.x + m[4] * surface_uv.y + m[5]);
    if (CLVOL_HAS_BITMAPS && texture->kind == TEXTURE_BITMAP)
        return bitmap_value(scene, texture, uv);
    const bool right = uv.x - (float)floor_int(uv.x) > 0.5f, upper = uv.y - (float)floor_int(uv.y) > 0.5f;
    return load_vector(right == upper ? texture->color0 : texture->color1);
}

/* A colour of a material: that of its texture where it has one, as the path carries it. */
INLINE Spectrum material_color(const Scene *scene, __global const float *base, int texture, float2 uv, int channel)
{
    if (CLVOL_HAS_TEXTURES && texture >= 0)
        return to_spectrum(texture_value(scene, texture, uv), channel);
    return to_spectrum(load_vector(base), channel);
}

#endif
