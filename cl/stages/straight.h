/* What a ray that goes straight on keeps of its light, whatever the surface's material wraps. */
#ifndef CLVOL_STAGES_STRAIGHT_H
#define CLVOL_STAGES_STRAIGHT_H
#if CLVOL_HAS_SURFACES
#include "bsdf/bsdf.h"
#include "stages/bend.h"
#include "stages/side.h"

#if CLVOL_BSDF_BLEND || CLVOL_BSDF_BENT
INLINE Spectrum part_transmission(const Scene *scene, const Surface *surface, Side side, float3 wi, int channel)
{
#if CLVOL_BSDF_BENT
    Surface bent = *surface;
    bend_surface(scene, &bent, &side, &wi);
#endif
    return null_transmission(scene, side.material, surface->uv, wi.z, channel);
}

/* On the mean over the parts of a mixture. */
INLINE Spectrum straight_transmission(const Scene *scene, const Surface *surface, Side side, float3 wi, int channel)
{
#if CLVOL_BSDF_BLEND
    if (IS_BSDF(side.material, BLEND)) {
        Spectrum sum = (Spectrum)(0.0f);
        __global const float *entry = scene->material_tables + side.material->table;
        for (int left = (int)*entry++; left > 0; --left) {
            int number;
            const float share = blend_part(scene, &entry, surface->uv, &number);
            side.material = scene->materials + number;
            if (number >= 0)
                sum += share * part_transmission(scene, surface, side, wi, channel);
        }
        return sum;
    }
#endif
    return part_transmission(scene, surface, side, wi, channel);
}
#define STRAIGHT_TRANSMISSION straight_transmission(scene, &surface, side, wi, channel)
#else
#define STRAIGHT_TRANSMISSION null_transmission(scene, side.material, surface.uv, wi.z, channel)
#endif

#endif
#endif
