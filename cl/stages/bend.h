/* Normal maps and bump maps: the shading frame of a surface is bent before its BSDF sees it.

   A material of kind BENT has in material_tables the material that it bends, whether by heights or normals, its
   texture, the scale of heights, and whether invalid normals are flipped, light is shadowed near the horizon, and the
   map lies on both sides of the surface as seen from its front (clvol/tables/bends.py). */
#ifndef CLVOL_STAGES_BEND_H
#define CLVOL_STAGES_BEND_H
#if CLVOL_BSDF_BENT
#include "bsdf/bsdf.h"
#include "geometry/surface.h"
#include "stages/side.h"
#include "texture/gradient.h"

/* The bent normal in the surface's frame, of any length. */
INLINE float3 bent_normal(const Scene *scene, __global const float *entry, const Surface *surface)
{
#if CLVOL_HAS_BUMPS
    if (entry[1] != 0.0f) {
        const float2 slope = entry[3] * texture_gradient(scene, (int)entry[2], surface->uv);
        const float3 u = to_local(surface, surface->dp_du), v = to_local(surface, surface->dp_dv);
        const float3 n = cross_of((float3)(u.x, u.y, slope.x), (float3)(v.x, v.y, slope.y));
        return dot_of(to_local(surface, surface->ng), n) < 0.0f ? -n : n;
    }
#endif
    return 2.0f * texture_value(scene, (int)entry[2], surface->uv) - (float3)(1.0f);
}

/* Puts the bent frame into `surface` and `wi`, seen in it, and what is bent into `side`.  Normals that wi sees from
   behind are turned about the surface's own (Schüssler et al. 2017). */
INLINE void bend_surface(const Scene *scene, Surface *surface, Side *side, float3 *wi)
{
    side->real = surface->n;
    side->alpha2 = -1.0f;
    if (!IS_BSDF(side->material, BENT))
        return;
    __global const float *entry = scene->material_tables + side->material->table;
    side->material = scene->materials + (int)entry[0];
    side->side = wi->z < 0.0f && !material_transmits(side->material) ? -1.0f : 1.0f;
    const float3 seen = on_side(side, *wi), world = to_world(surface, *wi);
    float3 n = bent_normal(scene, entry, surface);
    if (entry[6] != 0.0f)
        n.x *= side->side, n.y *= side->side;
    if (entry[4] != 0.0f && seen.z * dot_of(seen, n) <= 0.0f)
        n.x = -n.x, n.y = -n.y;
    const float square = dot_of(n, n);
    n = square > 0.0f && square < INFINITY ? n / sqrt_of(square) : (float3)(0.0f, 0.0f, 1.0f);
    const float rest = 1.0f - n.x * n.x;
    const float3 s = rest > 0.0f ? ((float3)(1.0f, 0.0f, 0.0f) - n.x * n) / sqrt_of(rest) : (float3)(0.0f, 1.0f, 0.0f);
    const float3 t = cross_of(n, s);
    const float cos2 = n.z * n.z;
    side->alpha2 = entry[5] != 0.0f ? min_of(0.125f * (1.0f - cos2) / max_of(cos2, 1e-20f), 1.0f) : 0.0f;
    const float3 world_s = to_world(surface, on_side(side, s)), world_t = to_world(surface, on_side(side, t));
    surface->n = side->side * to_world(surface, on_side(side, n));
    surface->s = world_s;
    surface->t = world_t;
    *wi = to_local(surface, world);
}

/* What is left of light that goes along d: nothing where it would be on one side of the bent surface and on the other
   of the real one, and less near the horizon, as between facets (Estevez et al. 2019). */
INLINE float bend_share(const Side *side, const Surface *surface, float3 d)
{
    if (side->alpha2 < 0.0f)
        return 1.0f;
    const float real = dot_of(d, side->real);
    if (!(real * dot_of(d, surface->n) > 0.0f))
        return 0.0f;
    const float tan2 = max_of(1.0f - real * real, 0.0f) / max_of(real * real, 1e-20f);
    return 2.0f / (1.0f + sqrt_of(1.0f + side->alpha2 * tan2));
}

#endif
#endif
