/* Microflakes that differ from place to place: S is interpolated in a volume of six channels, xx, yy, zz, xy, xz, yz.

   Before the table of every sggx is a record with the number of its volume, -1 where S is the same everywhere and the
   table follows; the most area that any flakes of the volume have in any direction, to which majorants are made; and the
   least, as a share of that. */
#ifndef CLVOL_PHASE_FLAKES_AT_H
#define CLVOL_PHASE_FLAKES_AT_H
#if CLVOL_HAS_VARIED_FLAKES
#include "density/volume.h"
#include "phase/flakes.h"

INLINE __global const Phase *flakes_head(__global const Phase *lobe) { return lobe + as_int(lobe->g); }

/* S at a point of the volume's index space: its diagonal, and xy, xz, yz. */
INLINE void flake_matrix(const Scene *scene, __global const Volume *volume, float3 place, float3 *diagonal,
                         float3 *rest)
{
    const VolumeCell cell = volume_cell(scene, volume, place);
    const bool nearest = volume_is_nearest(volume);
    *diagonal = cell_value3(&cell, nearest);
    *rest = (float3)(cell_value(&cell, nearest, 3), cell_value(&cell, nearest, 4), cell_value(&cell, nearest, 5));
}

INLINE float matrix_area(float3 diagonal, float3 rest, float3 w)
{
    const float square = dot_of(diagonal, w * w) + 2.0f * dot_of(rest, (float3)(w.x * w.y, w.x * w.z, w.y * w.z));
    return sqrt_of(max_of(square, 0.0f));
}

/* The table of S divided by its trace, which is of the same phase function.  It does not tell areas. */
INLINE void matrix_table(float3 diagonal, float3 rest, float *table)
{
    const float trace = diagonal.x + diagonal.y + diagonal.z;
    if (!(trace > 0.0f)) { /* nothing is there, and scatters */
        diagonal = (float3)(1.0f);
        rest = (float3)(0.0f);
    }
    const float inverse = trace > 0.0f ? 1.0f / trace : 1.0f, least = 1e-12f;
    diagonal *= inverse;
    rest *= inverse;
    const float xx = sqrt_of(max_of(diagonal.x, least)), xy = rest.x / xx, xz = rest.y / xx;
    const float yy = sqrt_of(max_of(diagonal.y - xy * xy, least)), yz = (rest.z - xy * xz) / yy;
    const float zz = sqrt_of(max_of(diagonal.z - xz * xz - yz * yz, least));
    const float scale = sqrt_of(sqrt_of(3.14159265f * xx * yy * zz));
    table[0] = xx;
    table[1] = xy;
    table[2] = yy;
    table[3] = xz;
    table[4] = yz;
    table[5] = zz;
    table[6] = scale / xx;
    table[7] = -scale * xy / (xx * yy);
    table[8] = scale / yy;
    table[9] = scale * (xy * yz - xz * yy) / (xx * yy * zz);
    table[10] = -scale * yz / (yy * zz);
    table[11] = scale / zz;
}

/* The table of an sggx that is the same everywhere. */
INLINE void given_table(__global const Phase *lobe, float *table)
{
    __global const float *given = (__global const float *)(flakes_head(lobe) + 1);
    for (int n = 0; n < 12; ++n)
        table[n] = given[n];
}

/* The table of an sggx at a world point. */
INLINE void flakes_at(const Scene *scene, __global const Phase *lobe, float3 p, float *table)
{
    __global const Phase *head = flakes_head(lobe);
    if (head->kind < 0) {
        given_table(lobe, table);
        return;
    }
    __global const Volume *volume = scene->volumes + head->kind;
    float3 diagonal, rest;
    flake_matrix(scene, volume, transform_point(volume->world_to_index, p), &diagonal, &rest);
    matrix_table(diagonal, rest, table);
}

INLINE float sggx_pdf_at(const Scene *scene, __global const Phase *lobe, float3 p, float3 wo, float3 wi)
{
    float table[12];
    flakes_at(scene, lobe, p, table);
    return flakes_pdf(table, wo, wi);
}

INLINE float3 sggx_sample_at(const Scene *scene, __global const Phase *lobe, float3 p, float3 wo, float u, float v,
                             float *pdf)
{
    float table[12];
    flakes_at(scene, lobe, p, table);
    return flakes_sample(table, wo, u, v, pdf);
}

/* The number of the volume by whose flakes a medium's extinction goes, -1 for none. */
INLINE int area_volume(const Scene *scene, __global const Medium *medium)
{
    __global const Phase *lobe = scene->phases + medium->phase_first;
    return IS_PHASE(lobe, SGGX) ? flakes_head(lobe)->kind : -1;
}

/* By what a medium's extinction is multiplied for light along w; where that differs from place to place, the most. */
INLINE float projected_area(const Scene *scene, __global const Medium *medium, float3 w)
{
    __global const Phase *lobe = scene->phases + medium->phase_first;
    if (!IS_PHASE(lobe, SGGX))
        return 1.0f;
    if (flakes_head(lobe)->kind >= 0)
        return flakes_head(lobe)->g;
    float table[12];
    given_table(lobe, table);
    return flakes_area(table, w);
}

/* The least that a control of the density is worth along a ray, as a share of the density times the most area. */
INLINE float least_share(const Scene *scene, __global const Medium *medium)
{
    __global const Phase *lobe = scene->phases + medium->phase_first;
    return area_volume(scene, medium) < 0 ? 1.0f : flakes_head(lobe)->weight;
}

INLINE float mean_area(const Scene *scene, __global const Medium *medium, float3 p)
{
    const int number = area_volume(scene, medium);
    if (number < 0)
        return (projected_area(scene, medium, (float3)(1.0f, 0.0f, 0.0f)) +
                projected_area(scene, medium, (float3)(0.0f, 1.0f, 0.0f)) +
                projected_area(scene, medium, (float3)(0.0f, 0.0f, 1.0f))) *
               (1.0f / 3.0f);
    __global const Volume *volume = scene->volumes + number;
    float3 diagonal, rest;
    flake_matrix(scene, volume, transform_point(volume->world_to_index, p), &diagonal, &rest);
    return (sqrt_of(max_of(diagonal.x, 0.0f)) + sqrt_of(max_of(diagonal.y, 0.0f)) + sqrt_of(max_of(diagonal.z, 0.0f))) *
           (1.0f / 3.0f);
}

#endif
#endif
