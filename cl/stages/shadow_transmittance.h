/* Attenuates one next-event ray by every medium on its way and adds what arrives. */
#ifndef CLVOL_STAGES_SHADOW_TRANSMITTANCE_H
#define CLVOL_STAGES_SHADOW_TRANSMITTANCE_H
#include "stages/medium_ray.h"

INLINE Extinction medium_transmittance(const MediumRay *in, uint4 k, Tally *tally)
{
#if CLVOL_HAS_HOMOGENEOUS
    if (is_homogeneous(in->medium))
        return homogeneous_transmittance(in);
#endif
#if CLVOL_HAS_HETEROGENEOUS
    Stream stream = stream_begin(k.z, k.w);
    return estimate_transmittance(in, k.x, &stream, tally);
#endif
}

INLINE void shadow_transmittance(const Scene *scene, uint group, uint slot)
{
    SampleKey key = path_key(scene, slot);
    Ray ray;
    ray.o = (float3)(path_origin_x(scene, slot), path_origin_y(scene, slot), path_origin_z(scene, slot));
    ray.d = (float3)(path_shadow_x(scene, slot), path_shadow_y(scene, slot), path_shadow_z(scene, slot));
#if CLVOL_HAS_POINT
    const float limit = path_shadow_distance(scene, slot);
#else
    const float limit = INFINITY;
#endif
    const int channel = (int)path_channel_or_zero(scene, slot);
    Extinction transmittance = (Extinction)(1.0f);
    Tally tally = {0, 0, 0, 0, 0, 0, 0.0f};
    for (uint m = 0; m < (CLVOL_HAS_MANY_MEDIA ? scene->render->media : 1u); ++m) {
        __global const Medium *medium = scene->media + m;
        float t0 = 0.0f, t1 = limit;
        medium_interval(medium, ray, &t0, &t1);
        if (!(t0 < t1))
            continue;
        const uint4 k = decision_block(render_seed(scene), key, BLOCK_SHADOW, m);
        Ray inside = ray;
        inside.o += t0 * ray.d;
        const MediumRay in = medium_ray(scene, medium, inside, t1 - t0, channel);
        transmittance *= medium_transmittance(&in, k, &tally);
        if (extinction_max(transmittance) == 0.0f)
            break;
    }
    record_tally(scene, slot, tally);
    set_radiance(scene, slot, get_radiance(scene, slot) + get_shadow(scene, slot) * transmittance);
}

#endif
