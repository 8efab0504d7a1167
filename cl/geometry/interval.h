/* Media as intervals along a ray: analytic cube and sphere, and the box of a volume. */
#ifndef CLVOL_GEOMETRY_INTERVAL_H
#define CLVOL_GEOMETRY_INTERVAL_H

/* Cuts [t0, t1] to one slab lower <= o + t d <= upper; a ray along the slab is all in or all out. */
INLINE void clip_slab(float lower, float upper, float o, float d, float *t0, float *t1)
{
    if (d == 0.0f) {
        if (o < lower || o > upper)
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
    clip_slab(lower.x, upper.x, ray.o.x, ray.d.x, t0, t1);
    clip_slab(lower.y, upper.y, ray.o.y, ray.d.y, t0, t1);
    clip_slab(lower.z, upper.z, ray.o.z, ray.d.z, t0, t1);
}

/* Cuts [t0, t1] to the unit sphere.  The discriminant is taken from the point of closest approach,
   which keeps its precision for far origins (Haines et al. 2019). */
INLINE void clip_sphere(Ray ray, float *t0, float *t1)
{
    const float a = dot(ray.d, ray.d);
    const float middle = -dot(ray.o, ray.d) / a;
    const float3 closest = ray.o + middle * ray.d;
    const float discriminant = (1.0f - dot(closest, closest)) / a;
    if (!(discriminant > 0.0f)) {
        *t1 = -INFINITY;
        return;
    }
    const float half_chord = sqrt(discriminant);
    *t0 = max_of(*t0, middle - half_chord);
    *t1 = min_of(*t1, middle + half_chord);
}

/* The part of the ray inside `medium`, cut to [t0, t1]; empty when the result has t0 >= t1. */
INLINE void medium_interval(__global const Medium *medium, Ray ray, float *t0, float *t1)
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

#endif
