/* The material of the side that a surface is seen from. */
#ifndef CLVOL_STAGES_SIDE_H
#define CLVOL_STAGES_SIDE_H
#if CLVOL_HAS_SURFACES
#include "bsdf/bsdf.h"
#include "core/scene.h"

/* A surface as the side it is seen from has it.  Materials that do not let light through are always seen
   from their front. */
typedef struct {
    __global const Material *material;
    float side; /* -1 turns local directions round for the back, else 1 */
#if CLVOL_BSDF_BENT
    float3 real;  /* shading normal of the surface as it was before it was bent */
    float alpha2; /* squared roughness that stands for the bend; -1: there is none */
#endif
} Side;

INLINE bool side_of(const Scene *scene, __global const Shape *shape, float3 wi, Side *side)
{
    const int number = wi.z > 0.0f ? shape->front : shape->back;
    side->material = scene->materials + number;
    side->side = 1.0f;
    if (number < 0)
        return false;
    if (wi.z < 0.0f && !material_transmits(side->material))
        side->side = -1.0f;
    return true;
}

#if CLVOL_BSDF_BLEND
/* Of a mixture one part by chance, which leaves `pick` uniform; false where that is black. */
INLINE bool choose_side(const Scene *scene, float2 uv, float3 wi, float *pick, Side *side)
{
    if (!IS_BSDF(side->material, BLEND))
        return true;
    const int number = choose_part(scene, side->material, uv, pick);
    if (number < 0)
        return false;
    side->material = scene->materials + number;
    side->side = wi.z < 0.0f && !material_transmits(side->material) ? -1.0f : 1.0f;
    return true;
}
#endif

INLINE float3 on_side(const Side *side, float3 d) { return (float3)(d.x, d.y, side->side * d.z); }

#endif
#endif
