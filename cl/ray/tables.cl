/* What trackers see along one ray: sigma_t at even steps, (channels, points), and, of a majorant that they walk,
   each cell's segment, bound and controls (t, t_end, majorant, control (3), residual control (3), its rate). */
#if CLVOL_HAS_HETEROGENEOUS
#include "density/transfer.h"
#include "density/volume.h"
#endif
#include "ray/given.h"
#if CLVOL_HAS_VARIED_AREAS
#include "tracking/walk.h"
#endif
#if CLVOL_RAY_MAJORANT
#include "majorant/majorant.h"
#include "tracking/walk.h"
#endif

#define CELL_SIZE 10u

__kernel void tables(CLVOL_ARGUMENTS, __global const float *given, __global float *sigma, __global float *cells,
                     __global uint *cell_count, uint points, uint channels, uint capacity)
{
    const Scene scene = CLVOL_SCENE;
    const uint i = get_global_id(0);
    if (i < points)
        for (uint c = 0; c < channels; ++c) {
            MediumRay in = given_ray(&scene, given);
            const float t = ((float)i + 0.5f) * (in.t_max / (float)points);
            float scale = in.medium->sigma_t[c] * given[7];
#if CLVOL_PHASE_SGGX
            scale *= projected_area(&scene, in.medium, in.world_ray.d);
#endif
#if CLVOL_HAS_VARIED_AREAS
            scale *= area_share(&in, in.index_ray.o + t * in.index_ray.d);
#endif
#if CLVOL_HAS_HETEROGENEOUS
            __global const Volume *volume = scene.volumes + in.medium->sigma_t_volume;
            if (!is_homogeneous(in.medium))
                sigma[c * points + i] = scale * density_of(&scene, in.medium,
                                                           volume_value(&scene, volume,
                                                                        in.index_ray.o + t * in.index_ray.d, (int)c));
            else
#endif
                sigma[c * points + i] = scale;
        }
#if CLVOL_RAY_MAJORANT
    if (i > 0)
        return;
    const MediumRay in = given_ray(&scene, given);
    MajorantWalk walk = majorant_begin(&in);
    uint n = 0;
    for (; n < capacity && majorant_next(&in, &walk); ++n) {
        __global float *cell = cells + n * CELL_SIZE;
        cell[0] = walk.t;
        cell[1] = walk.t_end;
        cell[2] = walk.majorant;
#if CLVOL_RAY_CONTROLS
        vstore3((float3)(cell_extinction(&in, cell_row(&in, scene.controls, walk.cell, 0))), 0, cell + 3);
#endif
#if CLVOL_RAY_RESIDUALS
        __global const float *row = cell_row(&in, scene.residuals, walk.cell, 1);
        vstore3((float3)(cell_extinction(&in, row)), 0, cell + 6);
        cell[9] = in.rate * row[CLVOL_DENSITY_CHANNELS];
#endif
    }
    *cell_count = n;
#endif
}
