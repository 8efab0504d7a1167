/* How fast the number that a texture stands for changes over the surface's (u, v). */
#ifndef CLVOL_TEXTURE_GRADIENT_H
#define CLVOL_TEXTURE_GRADIENT_H
#if CLVOL_HAS_BUMPS
#include "texture/texture.h"

/* Of a bilinear bitmap, the slope within its four texels; 0 of one that shows the nearest. */
INLINE float2 texture_gradient(const Scene *scene, int number, float2 surface_uv)
{
    __global const Texture *texture = scene->textures + number;
    if (texture->nearest)
        return (float2)(0.0f);
    __global const float *m = texture->to_uv;
    const int width = texture->size[0], height = texture->size[1], wrap = texture->wrap;
    const float x = (m[0] * surface_uv.x + m[1] * surface_uv.y + m[2]) * (float)width - 0.5f;
    const float y = (m[3] * surface_uv.x + m[4] * surface_uv.y + m[5]) * (float)height - 0.5f;
    const int x0 = floor_int(x), y0 = floor_int(y);
    const float fx = clamp_to(x - (float)x0, 0.0f, 1.0f), fy = clamp_to(y - (float)y0, 0.0f, 1.0f);
    const size_t left = (size_t)wrapped(x0, width, wrap), right = (size_t)wrapped(x0 + 1, width, wrap);
    const size_t upper = texture->first + (size_t)wrapped(y0, height, wrap) * width;
    const size_t lower = texture->first + (size_t)wrapped(y0 + 1, height, wrap) * width;
    const float f00 = scene->texels[3 * (upper + left)], f10 = scene->texels[3 * (upper + right)];
    const float f01 = scene->texels[3 * (lower + left)], f11 = scene->texels[3 * (lower + right)];
    const float dx = lerp(f10 - f00, f11 - f01, fy) * (float)width;
    const float dy = lerp(f01 - f00, f11 - f10, fx) * (float)height;
    return (float2)(m[0] * dx + m[3] * dy, m[1] * dx + m[4] * dy);
}

#endif
#endif
