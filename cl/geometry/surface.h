/* The point of a surface that a ray has hit, as BSDFs and lights take it. */
#ifndef CLVOL_GEOMETRY_SURFACE_H
#define CLVOL_GEOMETRY_SURFACE_H
#if CLVOL_HAS_SURFACES
#include "core/sampling.h"
#include "core/scene.h"
#include "geometry/bvh.h"

typedef struct {
    float3 p;
    float3 ng;   /* geometric normal, unit; points to the shape's front */
    float3 s, t; /* tangents; with the shading normal n they make an orthonormal, right-handed frame */
    float3 n;
    float2 uv;
#if CLVOL_HAS_BUMPS
    float3 dp_du, dp_dv;
#endif
    float span; /* magnitude, along ng, of what p was computed from */
    uint shape;
} Surface;

INLINE float3 to_local(const Surface *surface, float3 world)
{
    return (float3)(dot_of(world, surface->s), dot_of(world, surface->t), dot_of(world, surface->n));
}

INLINE float3 to_world(const Surface *surface, float3 d)
{
    return d.x * surface->s + d.y * surface->t + d.z * surface->n;
}

/* A third of the magnitudes, along the unit normal, of what a point is the sum of: about its own largest coordinate,
   but for large shapes. */
INLINE float span_of(float3 ng, float3 a, float3 b, float3 c)
{
    return (abs_of(ng.x) * (abs_of(a.x) + abs_of(b.x) + abs_of(c.x)) +
            abs_of(ng.y) * (abs_of(a.y) + abs_of(b.y) + abs_of(c.y)) +
            abs_of(ng.z) * (abs_of(a.z) + abs_of(b.z) + abs_of(c.z))) *
           (1.0f / 3.0f);
}

/* Frame round the normal n whose first tangent follows dp/du, any where that is none. */
INLINE void set_frame(Surface *surface, float3 n, float3 dp_du)
{
    float3 s = dp_du - n * dot_of(n, dp_du);
    const float square = dot_of(s, s);
    surface->n = n;
    surface->s = square > 1e-20f * dot_of(dp_du, dp_du) ? s / sqrt_of(square) : to_frame(n, 1.0f, 0.0f, 0.0f);
    surface->t = cross_of(n, surface->s);
}

/* The shape that a primitive belongs to. */
INLINE uint primitive_shape(const Scene *scene, uint primitive)
{
    if (CLVOL_HAS_QUADRICS && (!CLVOL_HAS_TRIANGLES || primitive >= scene->render->triangles))
        return scene->quadrics[primitive - scene->render->triangles].shape;
    return scene->faces[4 * primitive + 3];
}

INLINE float3 vertex(const Scene *scene, uint number)
{
    __global const float *v = scene->vertices + 3 * (size_t)number;
    return (float3)(v[0], v[1], v[2]);
}

INLINE void triangle_surface(const Scene *scene, const Hit *hit, __global const Shape *shape, Surface *surface)
{
    __global const uint *face = scene->faces + 4 * hit->primitive;
    const float3 a = vertex(scene, face[0]), b = vertex(scene, face[1]), c = vertex(scene, face[2]);
    const float u = hit->u, v = hit->v, w = 1.0f - u - v;
    const float3 e1 = b - a, e2 = c - a;
    surface->p = a + u * e1 + v * e2;
    surface->ng = direction_of(cross_of(e1, e2));
    surface->span = span_of(surface->ng, a, e1, e2);
    surface->uv = (float2)(u, v);
    float3 dp_du = e1;
    if (CLVOL_HAS_VERTEX_UVS && shape->uvs) {
        const float2 ta = vload2(face[0], scene->uvs), tb = vload2(face[1], scene->uvs),
                     tc = vload2(face[2], scene->uvs);
        const float2 d1 = tb - ta, d2 = tc - ta;
        const float determinant = d1.x * d2.y - d1.y * d2.x;
        surface->uv = w * ta + u * tb + v * tc;
        if (determinant != 0.0f)
            dp_du = (d2.y * e1 - d1.y * e2) / determinant;
#if CLVOL_HAS_BUMPS
        surface->dp_dv = determinant != 0.0f ? (d1.x * e2 - d2.x * e1) / determinant : e2;
#endif
    }
#if CLVOL_HAS_BUMPS
    surface->dp_du = dp_du;
    if (!CLVOL_HAS_VERTEX_UVS || !shape->uvs)
        surface->dp_dv = e2;
#endif
    float3 n = surface->ng;
    if (CLVOL_HAS_SHADING_NORMALS && shape->normals) {
        const float3 smooth = w * vload3(face[0], scene->normals) + u * vload3(face[1], scene->normals) +
                              v * vload3(face[2], scene->normals);
        const float square = dot_of(smooth, smooth);
        if (square > 0.0f)
            n = smooth / sqrt_of(square);
    }
    if (shape->flip) {
        surface->ng = -surface->ng;
        n = -n;
    }
    set_frame(surface, n, dp_du);
}

#if CLVOL_HAS_BUMPS
/* Derivatives by (u, v) at a point p of a quadric, in its own space. */
INLINE void quadric_derivatives(__global const Shape *shape, float3 p, Surface *surface)
{
    const float r = sqrt_of(p.x * p.x + p.y * p.y);
    const float2 out = r > 0.0f ? (float2)(p.x, p.y) / r : (float2)(1.0f, 0.0f);
    const float3 round = 2.0f * PI * (float3)(-p.y, p.x, 0.0f);
    float3 dp_du = round, dp_dv = (float3)(0.0f, 0.0f, 1.0f);
    if (shape->kind == SURFACE_DISK)
        dp_du = (float3)(out, 0.0f), dp_dv = round;
    else if (shape->kind == SURFACE_SPHERE)
        dp_dv = PI * (float3)(p.z * out, -r);
    surface->dp_du = transform_vector(shape->world_from_local, dp_du);
    surface->dp_dv = transform_vector(shape->world_from_local, dp_dv);
}
#endif

INLINE void quadric_surface(const Scene *scene, Ray ray, const Hit *hit, __global const Shape *shape, Surface *surface)
{
    float3 p = transform_point(shape->local_from_world, ray.o + hit->t * ray.d);
    float3 normal, dp_du;
    if (shape->kind == SURFACE_DISK) {
        p.z = 0.0f;
        const float r = sqrt_of(p.x * p.x + p.y * p.y);
        normal = (float3)(0.0f, 0.0f, 1.0f);
        dp_du = r > 0.0f ? (float3)(p.x, p.y, 0.0f) : (float3)(1.0f, 0.0f, 0.0f);
        const float turn = atan2(p.y, p.x) * (0.5f / PI);
        surface->uv = (float2)(r, turn < 0.0f ? turn + 1.0f : turn);
    } else {
        const float turn = atan2(p.y, p.x) * (0.5f / PI);
        const float around = turn < 0.0f ? turn + 1.0f : turn;
        if (shape->kind == SURFACE_SPHERE) {
            p = direction_of(p); /* back on the surface: the ray parameter has lost more than the shape has */
            normal = p;
            surface->uv = (float2)(around, acos(clamp_to(p.z, -1.0f, 1.0f)) * (1.0f / PI));
        } else {
            const float r = sqrt_of(p.x * p.x + p.y * p.y);
            p.x /= r, p.y /= r;
            normal = (float3)(p.x, p.y, 0.0f);
            surface->uv = (float2)(around, p.z);
        }
        dp_du = p.x != 0.0f || p.y != 0.0f ? (float3)(-p.y, p.x, 0.0f) : (float3)(1.0f, 0.0f, 0.0f);
    }
    surface->p = transform_point(shape->world_from_local, p);
#if CLVOL_HAS_BUMPS
    quadric_derivatives(shape, p, surface);
#endif
    /* normals go by the inverse transpose */
    __global const float *m = shape->local_from_world;
    float3 n = direction_of((float3)(m[0] * normal.x + m[4] * normal.y + m[8] * normal.z,
                                     m[1] * normal.x + m[5] * normal.y + m[9] * normal.z,
                                     m[2] * normal.x + m[6] * normal.y + m[10] * normal.z));
    n = shape->flip ? -n : n;
    surface->ng = n;
    __global const float *w = shape->world_from_local;
    surface->span = span_of(n, (float3)(w[3], w[7], w[11]), surface->p - (float3)(w[3], w[7], w[11]), (float3)(0.0f));
    set_frame(surface, n, transform_vector(shape->world_from_local, dp_du));
}

INLINE Surface hit_surface(const Scene *scene, Ray ray, const Hit *hit)
{
    Surface surface;
    surface.shape = primitive_shape(scene, hit->primitive);
    __global const Shape *shape = scene->shapes + surface.shape;
    if (CLVOL_HAS_QUADRICS && (!CLVOL_HAS_TRIANGLES || shape->kind != SURFACE_MESH))
        quadric_surface(scene, ray, hit, shape, &surface);
    else
        triangle_surface(scene, hit, shape, &surface);
    return surface;
}

/* A point just off the surface, on the side of `ng` that d points to: moved along the normal by some units in the
   last place of every coordinate (after Wächter and Binder 2019), so that the new ray does not meet it again.  Where a
   large slanted triangle or sphere passes near the origin, its own coordinates are what was rounded. */
INLINE float3 spawn_point(const Surface *surface, float3 d)
{
    const float3 n = dot_of(surface->ng, d) < 0.0f ? -surface->ng : surface->ng;
    const float largest = max_of(largest3(surface->p), surface->span);
    const float distance = (largest + 1e-30f) * 0x1p-20f; /* 8 units in the last place of the largest */
    return surface->p + distance * n;
}

#endif
#endif
