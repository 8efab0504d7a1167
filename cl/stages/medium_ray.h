/* A path's ray inside one medium, as trackers take it. */
#ifndef CLVOL_STAGES_MEDIUM_RAY_H
#define CLVOL_STAGES_MEDIUM_RAY_H
#if CLVOL_HAS_MEDIA
#if CLVOL_PHASE_SGGX
#include "phase/sggx.h"
#endif
#include "tracking/interface.h"

INLINE bool is_homogeneous(__global const Medium *medium)
{
    return CLVOL_HAS_HOMOGENEOUS && (!CLVOL_HAS_HETEROGENEOUS || medium->homogeneous);
}

/* `world` starts inside the medium and leaves it at t_max; channel: what a path that follows one follows. */
INLINE MediumRay medium_ray(const Scene *scene, __global const Medium *medium, Ray world, float t_max, int channel)
{
    MediumRay in;
    in.scene = scene;
    in.medium = medium;
    in.world_ray = world;
    in.index_ray = world;
    in.t_max = t_max;
    in.channel = channel;
#if CLVOL_EXTINCTION == 3
    in.scale = load_vector(medium->sigma_t);
#else
    in.scale = medium->sigma_t[channel];
#endif
#if CLVOL_PHASE_SGGX
    in.scale *= projected_area(scene, medium, world.d);
#endif
    in.rate = extinction_max(in.scale);
#if CLVOL_HAS_VARIED_AREAS
    in.flakes = area_volume(scene, medium);
    in.most_area = projected_area(scene, medium, world.d);
    in.flake_ray = world;
    if (in.flakes >= 0)
        in.flake_ray = transform_ray(scene->volumes[in.flakes].world_to_index, world);
#endif
#if CLVOL_HAS_HETEROGENEOUS
    if (!is_homogeneous(medium))
        in.index_ray = transform_ray(scene->volumes[medium->sigma_t_volume].world_to_index, world);
#endif
    return in;
}

#endif
#endif
