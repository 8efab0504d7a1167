/* Where a ray meets a unit sphere, the unit disk in z = 0, or an open cylinder of radius 1 from z = 0 to 1, each
   under an affine map; t is the same on both sides of the map.

   The quadratic is solved as in Haines et al. 2019 (Ray Tracing Gems, 7): the discriminant from the closest approach,
   so that a far origin costs no digits, and the root that would cancel from the product of both. */
#ifndef CLVOL_GEOMETRY_QUADRIC_H
#define CLVOL_GEOMETRY_QUADRIC_H
#include "core/shared.h"
#include "core/types.h"

#define NEVER ((float2)(INFINITY, INFINITY))

/* Both t where (o + t d)² = 1, in either order; `o` and `d` in 3D, or in 2D with z = 0. */
INLINE float2 unit_circle_roots(float3 o, float3 d)
{
    const float a = d.x * d.x + (d.y * d.y + d.z * d.z);
    if (!(a > 0.0f))
        return NEVER;
    const float b = -(o.x * d.x + (o.y * d.y + o.z * d.z));
    const float3 closest = o + (b / a) * d;
    const float half_chord2 = 1.0f - (closest.x * closest.x + (closest.y * closest.y + closest.z * closest.z));
    if (!(half_chord2 >= 0.0f))
        return NEVER;
    const float q = b + with_sign(sqrt_of(a * half_chord2), b);
    const float c = (o.x * o.x + (o.y * o.y + o.z * o.z)) - 1.0f;
    return (float2)(q == 0.0f ? 0.0f : c / q, q / a);
}

INLINE bool on_cylinder(Ray local_ray, float t)
{
    const float z = local_ray.o.z + t * local_ray.d.z;
    return z >= 0.0f && z <= 1.0f;
}

INLINE float2 disk_hit(Ray local_ray)
{
    const float t = -local_ray.o.z / local_ray.d.z;
    const float x = local_ray.o.x + t * local_ray.d.x, y = local_ray.o.y + t * local_ray.d.y;
    return local_ray.d.z != 0.0f && x * x + y * y <= 1.0f ? (float2)(t, INFINITY) : NEVER;
}

/* Both crossings of the ray's line, in either order; infinity where there is none. */
INLINE float2 quadric_hits(__global const Quadric *quadric, Ray ray)
{
    const Ray local_ray = transform_ray(quadric->local_from_world, ray);
    if (quadric->kind == QUADRIC_SPHERE)
        return unit_circle_roots(local_ray.o, local_ray.d);
    if (quadric->kind == QUADRIC_DISK)
        return disk_hit(local_ray);
    const float2 t = unit_circle_roots((float3)(local_ray.o.xy, 0.0f), (float3)(local_ray.d.xy, 0.0f));
    return (float2)(on_cylinder(local_ray, t.x) ? t.x : INFINITY, on_cylinder(local_ray, t.y) ? t.y : INFINITY);
}

#endif
