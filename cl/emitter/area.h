/* Area lights: shapes whose front sends the same radiance into every direction, from every point or by a texture.

   Points are drawn uniformly over the area, but for spheres seen from outside: there, directions are drawn
   uniformly within the cone that the sphere subtends (Shirley, Wang, Zimmerman 1996).  Densities are per solid
   angle at `from`: that of an area is dist² / (area cos).  Whether a point shows its front is decided by the same
   geometric normal as `hit_surface` finds there. */
#ifndef CLVOL_EMITTER_AREA_H
#define CLVOL_EMITTER_AREA_H
#if CLVOL_HAS_AREA
#include "core/sampling.h"
#include "core/scene.h"
#include "emitter/cdf.h"
#include "emitter/choice.h"
#include "emitter/light_sample.h"
#include "geometry/surface.h"
#if CLVOL_HAS_AREA_TEXTURE
#include "texture/texture.h"
#endif

/* A sphere as seen from a point outside. */
typedef struct {
    float3 axis; /* unit, to the centre */
    float distance;
    float radius;
    float one_minus_cos; /* of half the angle it subtends */
} SphereCone;

/* Returns false where a sphere is sampled by area: from inside, and if it emits inwards.  1 - cos is taken from the
   sine, so that it stays right for the smallest and the farthest (METHODS §7). */
INLINE bool sphere_cone(__global const Shape *shape, float3 from, SphereCone *cone)
{
    __global const float *m = shape->world_from_local;
    const float3 to = (float3)(m[3], m[7], m[11]) - from;
    const float radius = sqrt_of(m[0] * m[0] + m[4] * m[4] + m[8] * m[8]), distance = sqrt_of(dot_of(to, to));
    if (shape->flip || !(distance > radius))
        return false;
    const float sine = radius / distance;
    const float cosine = sqrt_of((distance - radius) * (distance + radius)) / distance;
    cone->axis = to / distance;
    cone->distance = distance;
    cone->radius = radius;
    cone->one_minus_cos = sine * sine / (1.0f + cosine);
    return true;
}

INLINE float cone_pdf(const SphereCone *cone) { return 1.0f / (2.0f * PI * cone->one_minus_cos); }

/* A direction uniform within the cone, and how far the sphere is along it. */
INLINE float3 cone_direction(const SphereCone *cone, float u, float v, float *distance)
{
    const float h = u * cone->one_minus_cos; /* 1 - cos of the angle to the axis */
    const float sine = sqrt_of(h * (2.0f - h)), cosine = 1.0f - h;
    const float2 turn = cos_sin_turn(v);
    const float miss = cone->distance * sine; /* how close the line comes to the centre */
    const float half_chord = sqrt_of(max_of((cone->radius - miss) * (cone->radius + miss), 0.0f));
    /* the smaller root of the quadratic, without the difference of near and equal numbers */
    *distance = (cone->distance - cone->radius) * (cone->distance + cone->radius) /
                (cone->distance * cosine + half_chord);
    return to_frame(cone->axis, sine * turn.x, sine * turn.y, cosine);
}

/* Uniform over a mesh: a triangle in proportion to its area, then a point of it. */
INLINE float3 mesh_point(const Scene *scene, __global const Emitter *emitter, float pick, float u, float v, float3 *ng,
                         uint *primitive)
{
    const int entry = cdf_search(scene->light_cdf + emitter->first, emitter->count, pick);
    const float root = sqrt_of(u);
    Hit hit;
    hit.t = 0.0f;
    hit.primitive = scene->light_faces[emitter->first + entry];
    hit.u = root * (1.0f - v);
    hit.v = root * v;
    Surface surface;
    triangle_surface(scene, &hit, scene->shapes + emitter->shape, &surface);
    *ng = surface.ng;
    *primitive = hit.primitive;
    return surface.p;
}

/* A point uniform over the light's area, the unit normal of its front there, and the primitive it lies on. */
INLINE float3 area_point(const Scene *scene, __global const Emitter *emitter, float pick, float u, float v, float3 *ng,
                         uint *primitive)
{
    __global const Shape *shape = scene->shapes + emitter->shape;
    if (CLVOL_HAS_AREA_MESH && shape->kind == SURFACE_MESH)
        return mesh_point(scene, emitter, pick, u, v, ng, primitive);
    *primitive = emitter->primitive;
    __global const float *world = shape->world_from_local, *inverse = shape->local_from_world;
    const float2 turn = cos_sin_turn(v);
    float3 p, n;
    if (CLVOL_HAS_AREA_SPHERE && shape->kind == SURFACE_SPHERE) {
        p = sphere_direction(u, v);
        n = transform_vector(world, p);
    } else if (CLVOL_HAS_AREA_DISK && shape->kind == SURFACE_DISK) {
        const float r = sqrt_of(u);
        p = (float3)(r * turn.x, r * turn.y, 0.0f);
        n = (float3)(inverse[8], inverse[9], inverse[10]);
    } else { /* a cylinder, round in the world too */
        p = (float3)(turn.x, turn.y, u);
        n = transform_vector(world, (float3)(turn.x, turn.y, 0.0f));
    }
    n = direction_of(n);
    *ng = shape->flip ? -n : n;
    return transform_point(world, p);
}

/* Fills in a sample of the light; `pick` is a third uniform number. */
INLINE void sample_area(const Scene *scene, __global const Emitter *emitter, float3 from, float pick, float u, float v,
                        LightSample *light)
{
    __global const Shape *shape = scene->shapes + emitter->shape;
    SphereCone cone;
    if (CLVOL_HAS_AREA_SPHERE && shape->kind == SURFACE_SPHERE && sphere_cone(shape, from, &cone)) {
        light->direction = cone_direction(&cone, u, v, &light->distance);
        light->primitive = emitter->primitive;
        light->pdf = light->chosen * cone_pdf(&cone);
        light->value = emitter_value(emitter) / light->pdf;
        return;
    }
    float3 ng;
    const float3 to = area_point(scene, emitter, pick, u, v, &ng, &light->primitive) - from;
    const float square = dot_of(to, to);
    light->distance = sqrt_of(square);
    light->direction = to / max_of(light->distance, 1e-30f);
    const float facing = -dot_of(ng, light->direction) * emitter->area; /* the area as it is seen from `from` */
    light->value = (float3)(0.0f);
    light->pdf = 0.0f;
    if (facing > 0.0f) {
        light->pdf = light->chosen * square / facing;
        light->value = emitter_value(emitter) * (facing / (light->chosen * square));
    }
}

#if CLVOL_HAS_AREA_TEXTURE
/* Radiance of the light at its point (u, v). */
INLINE float3 textured_radiance(const Scene *scene, __global const Emitter *emitter, float2 uv)
{
    const int number = (int)emitter->beam_width - 1;
    return number >= 0 ? texture_value(scene, number, uv) : emitter_value(emitter);
}

/* Gives a sample of the light the radiance of its own point, where it has that of the mean; u and v: as they were
   sampled with. */
INLINE void show_texture(const Scene *scene, __global const Emitter *emitter, float3 from, float u, float v,
                         LightSample *light)
{
    if (light->pdf == 0.0f || emitter->beam_width == 0.0f)
        return;
    const float root = sqrt_of(u);
    Ray ray;
    ray.o = from;
    ray.d = light->direction;
    Hit hit;
    hit.t = light->distance;
    hit.primitive = light->primitive;
    hit.u = root * (1.0f - v);
    hit.v = root * v;
#if CLVOL_HAS_VOLUME_TEXTURES
    const Surface surface = hit_surface(scene, ray, &hit);
    Scene there = *scene;
    there.texture_point = surface.p;
    light->value = textured_radiance(&there, emitter, surface.uv) / light->pdf;
#else
    light->value = textured_radiance(scene, emitter, hit_surface(scene, ray, &hit).uv) / light->pdf;
#endif
}
#endif

/* The area light that a ray in direction d sees at the surface, or NULL: no light, or its back. */
INLINE __global const Emitter *seen_light(const Scene *scene, const Surface *surface, float3 d)
{
    const int number = scene->shapes[surface->shape].emitter;
    return number >= 0 && dot_of(surface->ng, d) < 0.0f ? scene->emitters + number : 0;
}

/* Radiance that a ray with direction of travel d meets at the surface. */
INLINE float3 area_radiance(const Scene *scene, const Surface *surface, float3 d)
{
    __global const Emitter *emitter = seen_light(scene, surface, d);
#if CLVOL_HAS_AREA_TEXTURE
    return emitter ? textured_radiance(scene, emitter, surface->uv) : (float3)(0.0f);
#endif
    return emitter ? emitter_value(emitter) : (float3)(0.0f);
}

/* Density with which sample_light(from) would have chosen the unit direction d in which the surface is `distance`
   away; `from`: where lights were sampled from, up to the offset of the ray's start (spawn_point). */
INLINE float area_pdf(const Scene *scene, const Surface *surface, float3 from, float3 d, float distance)
{
    __global const Emitter *emitter = seen_light(scene, surface, d);
    if (!emitter)
        return 0.0f;
    __global const Shape *shape = scene->shapes + surface->shape;
    const float chosen = light_probability(scene, (uint)shape->emitter, from);
    SphereCone cone;
    if (CLVOL_HAS_AREA_SPHERE && shape->kind == SURFACE_SPHERE && sphere_cone(shape, from, &cone))
        return chosen * cone_pdf(&cone);
    return chosen * distance * distance / (emitter->area * -dot_of(surface->ng, d));
}

#endif
#endif
