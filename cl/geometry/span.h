/* Where on a ray a medium is: analytic cube and sphere, and the box of a volume. */
#ifndef CLVOL_GEOMETRY_SPAN_H
#define CLVOL_GEOMETRY_SPAN_H
#if CLVOL_HAS_MEDIA
#include "core/shared.h"
#include "core/types.h"

/* Cuts [t0, t1] to one slab.  A ray along it, which over the box's length moves by no more than rounding, is all in or
   all out: of the slab's two faces the lower counts, the upper does not, to rounding, so that of boxes side by side
   one holds it.  All walks go by this one decision: density, majorants and cells reach on beyond the box as they are
   at its border. */
INLINE void clip_slab(float lower, float upper, float o, float d, float along, float *t0, float *t1)
{
    if (abs_of(d) <= along) {
        const float slack = max_of(abs_of(lower), abs_of(upper)) * 0x1p-21f;
        if (!(o >= lower - slack && o < upper - slack))
            *t1 = -INFINITY;
        return;
    }
    const float inverse = 1.0f / d;
    const float a = (lower - o) * inverse, b = (upper - o) * inverse;
    *t0 = max_of(*t0, min_of(a, b));
    *t1 = min_of(*t1, max_of(a, b));
}

INLINE void clip_box(Ray ray, float3 lower, float3 upper, float *t0, float *t1)
{
    const float along = largest3(ray.d) * 0x1p-22f;
    clip_slab(lower.x, upper.x, ray.o.x, ray.d.x, along, t0, t1);
    clip_slab(lower.y, upper.y, ray.o.y, ray.d.y, along, t0, t1);
    clip_slab(lower.z, upper.z, ray.o.z, ray.d.z, along, t0, t1);
}

/* Cuts [t0, t1] to the unit sphere.  The discriminant is taken from the point of closest approach,
   which keeps its precision for far origins (Haines et al. 2019). */
INLINE void clip_sphere(Ray ray, float *t0, float *t1)
{
    const float a = dot_of(ray.d, ray.d);
    const float middle = -dot_of(ray.o, ray.d) / a;
    const float3 closest = ray.o + middle * ray.d;
    const float discriminant = (1.0f - dot_of(closest, closest)) / a;
    if (!(discriminant > 0.0f)) {
        *t1 = -INFINITY;
        return;
    }
    const float half_chord = sqrt_of(discriminant);
    *t0 = max_of(*t0, middle - half_chord);
    *t1 = min_of(*t1, middle + half_chord);
}

/* Cuts [t0, t1] to the medium; empty when the result has t0 >= t1. */
INLINE void clip_medium(__global const Medium *medium, Ray ray, float *t0, float *t1)
{
    if (CLVOL_HAS_CUBE && medium->shape_kind == SHAPE_CUBE)
        clip_box(transform_ray(medium->shape_from_world, ray), (float3)(-1.0f), (float3)(1.0f), t0, t1);
    if (CLVOL_HAS_SPHERE && medium->shape_kind == SHAPE_SPHERE)
        clip_sphere(transform_ray(medium->shape_from_world, ray), t0, t1);
    if (CLVOL_HAS_CLIPPED && medium->clipped) {
        const float3 lower = (float3)(medium->box_lower[0], medium->box_lower[1], medium->box_lower[2]);
        const float3 upper = (float3)(medium->box_upper[0], medium->box_upper[1], medium->box_upper[2]);
        clip_box(transform_ray(medium->box_from_world, ray), lower, upper, t0, t1);
    }
}

/* How far along the ray it comes closest to the middle of the medium's shape or box, as they measure. */
INLINE float nearest_approach(__global const Medium *medium, Ray ray)
{
    Ray local_ray;
    if (medium->shape_kind == SHAPE_NONE) {
        local_ray = transform_ray(medium->box_from_world, ray);
        local_ray.o -= 0.5f * (load_vector(medium->box_lower) + load_vector(medium->box_upper));
    } else {
        local_ray = transform_ray(medium->shape_from_world, ray);
    }
    return max_of(-dot_of(local_ray.o, local_ray.d) / dot_of(local_ray.d, local_ray.d), 0.0f);
}

/* The segment of a ray inside a medium, as two numbers.  Of one that is thin beside the scene, entry and exit are
   measured from a point of the ray close by: from afar they differ by less than rounding. */
typedef struct {
    float base; /* ray parameter of that point, 0 for all but thin media */
    float start, end; /* from there */
} Span;

/* The point of the ray that the span is measured from. */
INLINE float3 span_origin(const Span *span, Ray ray)
{
    /* rounded once, however far the ray has come */
    return CLVOL_HAS_THIN ? fma((float3)(span->base), ray.d, ray.o) : ray.o;
}

INLINE float span_t(const Span *span) { return CLVOL_HAS_THIN ? span->base + span->start : span->start; }
INLINE float3 span_point(const Span *span, Ray ray) { return span_origin(span, ray) + span->start * ray.d; }

/* The segment of the ray between `from` and `to` inside `medium`; false where there is none. */
INLINE bool medium_span(__global const Medium *medium, Ray ray, float from, float to, Span *span)
{
    span->base = 0.0f;
    if (CLVOL_HAS_THIN && medium->thin)
        span->base = nearest_approach(medium, ray);
    ray.o = span_origin(span, ray);
    span->start = CLVOL_HAS_THIN ? from - span->base : from;
    span->end = CLVOL_HAS_THIN ? to - span->base : to;
    clip_medium(medium, ray, &span->start, &span->end);
    return span->start < span->end;
}

#endif
#endif
