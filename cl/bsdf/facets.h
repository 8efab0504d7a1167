/* Roughness that varies over a surface. */
#ifndef CLVOL_BSDF_FACETS_H
#define CLVOL_BSDF_FACETS_H
#include "core/scene.h"
#include "texture/texture.h"

#define MIN_ALPHA 1e-4f /* as in clvol.tables.coat */

typedef struct {
    int distribution;
    float alpha_u, alpha_v;
} Facets;

/* A negative roughness is that of texture -1 - alpha. */
INLINE float roughness_at(const Scene *scene, float alpha, float2 uv)
{
    return CLVOL_HAS_ROUGHNESS_TEXTURES && alpha < 0.0f
               ? max_of(texture_value(scene, (int)(-1.0f - alpha), uv).x, MIN_ALPHA)
               : alpha;
}

INLINE Facets material_facets(const Scene *scene, __global const Material *material, float2 uv)
{
    Facets facets;
    facets.distribution = material->distribution;
    facets.alpha_u = roughness_at(scene, material->alpha_u, uv);
    facets.alpha_v = roughness_at(scene, material->alpha_v, uv);
    return facets;
}

#endif
