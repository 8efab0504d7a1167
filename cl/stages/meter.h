/* Rays of meters that measure all over a shape, from points that lie evenly on it.  Of an irradiancemeter they go along
   directions in proportion to their cosine with the normal there, so that pi times the mean of what they bring is the
   irradiance.  A distant sensor's come to these points from afar. */
#ifndef CLVOL_STAGES_METER_H
#define CLVOL_STAGES_METER_H
#if CLVOL_HAS_METER
#include "core/sampling.h"
#include "core/scene.h"

/* The face of a mesh whose share of the area holds x, and in x what is left of it, uniform again. */
INLINE __global const MeterFace *meter_face(const Scene *scene, float *x)
{
    __global const MeterFace *faces = scene->meter;
    uint lower = 0, upper = faces->count - 1;
    while (lower < upper) {
        const uint middle = (lower + upper) >> 1;
        if (faces[middle].cdf > *x)
            upper = middle;
        else
            lower = middle + 1;
    }
    const float before = lower > 0 ? faces[lower - 1].cdf : 0.0f;
    *x = clamp_to((*x - before) / (faces[lower].cdf - before), 0.0f, 0x1.fffffep-1f);
    return faces + lower;
}

/* A point that lies evenly on the shape, by two uniform numbers, just off it; and the unit normal there. */
INLINE float3 meter_point(const Scene *scene, float x, float y, float3 *n)
{
    __global const MeterFace *face = meter_face(scene, &x);
    const float2 turn = cos_sin_turn(y);
    const float root = sqrt_of(x);
    float3 at = (float3)(root * (1.0f - y), root * y, 0.0f); /* of a triangle */
    if (face->kind == METER_DISK)
        at = (float3)(root * turn, 0.0f);
    if (face->kind == METER_CYLINDER)
        at = (float3)(turn, x);
    if (face->kind == METER_SPHERE)
        at = sphere_direction(x, y);
    const float3 a = load_vector(face->x), b = load_vector(face->y), c = load_vector(face->z);
    const bool round = face->kind == METER_SPHERE || face->kind == METER_CYLINDER;
    const float3 out = at.x * a + at.y * b;
    *n = face->kind == METER_SPHERE ? direction_of(out + at.z * c) : (round ? direction_of(out) : c);
    *n *= round ? face->side : 1.0f;
    const float3 p = load_vector(face->place) + out + at.z * (round ? c : (float3)(0.0f));
    const float size = largest3(load_vector(face->place)) + largest3(a) + largest3(b) + (round ? largest3(c) : 0.0f);
    return p + *n * ((size + 1e-30f) * 0x1p-20f);
}

/* A path starts on the shape, or on its way there; x, y and u, v are uniform. */
INLINE void set_meter_ray(const Scene *scene, uint slot, float x, float y, float u, float v)
{
    float3 n;
    const float3 p = meter_point(scene, min_of(x, 0x1.fffffep-1f), y, &n);
#if CLVOL_HAS_TARGET
    set_path_origin(scene, slot, p + load_vector(scene->render->lens_x));
    set_path_direction(scene, slot, load_vector(scene->render->camera_base));
#else
    set_path_origin(scene, slot, p);
    const float2 across = sqrt_of(u) * cos_sin_turn(v);
    set_path_direction(scene, slot, to_frame(n, across.x, across.y, sqrt_of(1.0f - u)));
#endif
}
#endif

#endif
