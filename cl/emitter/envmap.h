/* Lat-long environment (Mitsuba's convention): u = atan2(x, -z)/2pi with column u·W - 1/2, wrapped;
   v = acos(y)/pi with row v·(H-1).

   Sampling is piecewise constant over the cells between texel centres: marginal and conditional
   distributions, inverted by bisection, so that stratified numbers stay stratified. */
#ifndef CLVOL_EMITTER_ENVMAP_H
#define CLVOL_EMITTER_ENVMAP_H
#if CLVOL_HAS_ENVMAP
#include "core/scene.h"
#include "emitter/cdf.h"

/* Fractional column (in cells between texel centres, 0..W) and row (0..H-1) of a world direction. */
INLINE float2 envmap_position(const Scene *scene, float3 direction)
{
    const float3 d = direction_of(transform_vector(scene->envmap->env_from_world, direction));
    const float width = (float)scene->envmap->size[0], height = (float)scene->envmap->size[1];
    float column = atan2(d.x, -d.z) * (0.5f / PI) * width - 0.5f;
    column -= floor(column / width) * width;
    const float polar = atan2(sqrt_of(d.x * d.x + d.z * d.z), d.y); /* acos(d.y) is blind near the poles */
    return (float2)(column, polar * (1.0f / PI) * (height - 1.0f));
}

INLINE float3 envmap_radiance(const Scene *scene, float3 direction)
{
    const int width = scene->envmap->size[0], height = scene->envmap->size[1];
    const float2 p = envmap_position(scene, direction);
    const int x0 = clamp_int((int)p.x, 0, width - 1), y0 = clamp_int((int)p.y, 0, height - 2);
    const int x1 = x0 + 1 < width ? x0 + 1 : 0;
    const float fx = p.x - (float)x0, fy = p.y - (float)y0;
    __global const float *t = scene->env_texels;
    const float3 a0 = vload3((size_t)y0 * width + x0, t), a1 = vload3((size_t)y0 * width + x1, t);
    const float3 b0 = vload3((size_t)(y0 + 1) * width + x0, t), b1 = vload3((size_t)(y0 + 1) * width + x1, t);
    const float3 a = (a1 - a0) * fx + a0, b = (b1 - b0) * fx + b0;
    return (b - a) * fy + a;
}

/* pdf in solid angle of the cell (x, y), at a sine of the polar angle. */
INLINE float envmap_cell_pdf(const Scene *scene, int x, int y, float sine)
{
    const int width = scene->envmap->size[0], rows = scene->envmap->size[1] - 1;
    __global const float *conditional = scene->env_conditional + (size_t)y * (width + 1) + x;
    const float p = (scene->env_marginal[y + 1] - scene->env_marginal[y]) * (conditional[1] - conditional[0]);
    return p * (float)width * (float)rows / (2.0f * PI * PI * max_of(sine, 1e-9f));
}

INLINE float envmap_pdf(const Scene *scene, float3 direction)
{
    const float2 p = envmap_position(scene, direction);
    const int x = clamp_int((int)p.x, 0, scene->envmap->size[0] - 1);
    const int y = clamp_int((int)p.y, 0, scene->envmap->size[1] - 2);
    return envmap_cell_pdf(scene, x, y, sin(p.y * PI / (float)(scene->envmap->size[1] - 1)));
}

INLINE float3 envmap_sample(const Scene *scene, float u, float v, float *pdf)
{
    const int width = scene->envmap->size[0], rows = scene->envmap->size[1] - 1;
    const int y = cdf_search(scene->env_marginal, rows, v);
    __global const float *conditional = scene->env_conditional + (size_t)y * (width + 1);
    const int x = cdf_search(conditional, width, u);
    const float fx = (u - conditional[x]) / (conditional[x + 1] - conditional[x]);
    const float fy = (v - scene->env_marginal[y]) / (scene->env_marginal[y + 1] - scene->env_marginal[y]);
    const float phi = ((float)x + fx + 0.5f) / (float)width * (2.0f * PI);
    const float theta = ((float)y + fy) / (float)rows * PI;
    const float sine = sin(theta);
    *pdf = envmap_cell_pdf(scene, x, y, sine);
    const float3 d = (float3)(sine * sin(phi), cos(theta), -sine * cos(phi));
    return direction_of(transform_vector(scene->envmap->world_from_env, d));
}

#endif
#endif
