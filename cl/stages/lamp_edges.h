/* Lamps that the camera sees: in pixels that the edge of one passes, many more rays than there are samples find how
   much of it they show.

   Of a sample whose camera ray is x, f(x) + (h(x_1) + … + h(x_n)) / n - h(x) has the expectation of the radiance f(x),
   whatever h is, since every x_i is distributed as x.  Here h is the lamp's own radiance where it is the first surface
   on the ray, times a guess of the transmittance up to it, and 0 elsewhere.  So f - h is what is seen beside the lamp,
   mostly far darker, and the noise of the edge is that of many rays. */
#ifndef CLVOL_STAGES_LAMP_EDGES_H
#define CLVOL_STAGES_LAMP_EDGES_H
#include "core/sampler.h"
#include "emitter/area.h"
#include "geometry/bvh.h"
#include "geometry/surface.h"
#include "path/camera.h"
#include "path/key.h"
#include "path/ray.h"
#if CLVOL_LIGHT_CACHE
#include "emitter/light_cache.h"
#endif
#if CLVOL_HAS_MEDIA
#include "stages/media.h"
#endif

#define LAMP_RAYS 16u /* of a sample in a pixel that an edge passes */
#define LAMP_SEGMENT 1u /* tells their random numbers from those of the path's own ray */

#define NOBODY_KNOWS ((float3)(-1.0f))

#if CLVOL_LIGHT_CACHE
/* Of the transmittance `least` in the channel that a medium attenuates least, those of its channels. */
INLINE float3 coloured_through(float least, float3 sigma_t)
{
    const float thinnest = min_of(sigma_t.x, min_of(sigma_t.y, sigma_t.z));
    if (CLVOL_DENSITY_CHANNELS == 1 && sigma_t.x == sigma_t.y && sigma_t.y == sigma_t.z)
        return (float3)(least);
    if (CLVOL_DENSITY_CHANNELS == 3 || !(thinnest > 0.0f))
        return NOBODY_KNOWS;
    return pow((float3)(least), sigma_t / thinnest);
}
#endif

/* About the transmittance from the camera to the lamp's point at t, or NOBODY_KNOWS. */
INLINE float3 guess_through(const Scene *scene, Ray ray, float t, uint lamp)
{
    float3 through = (float3)(1.0f);
#if CLVOL_HAS_MEDIA
    uint volumes = 0;
    float3 of_volume = (float3)(1.0f); /* sigma_t of the one that is passed */
    Inside inside;
    for (int w = 0; w < CLVOL_BOUNDARY_WORDS; ++w)
        inside.word[w] = 0;
    for (uint m = 0; m < scene->render->media; ++m) {
        __global const Medium *medium = scene->media + m;
        Span span;
        if (!medium_segment(scene, m, ray, &inside, 0.0f, t, &span))
            continue;
        const float3 sigma_t = load_vector(medium->sigma_t);
        if (is_homogeneous(medium)) {
            through *= exp(-(span.end - span.start) * sigma_t);
        } else {
            of_volume = sigma_t;
            ++volumes;
        }
    }
    if (volumes == 0)
        return through;
#if CLVOL_LIGHT_CACHE
    if (volumes == 1 && weighed_row(scene, lamp) >= 0) {
        const float least = cached_transmittance(scene, lamp, ray.o, ray.d, t);
        const float3 coloured = coloured_through(least, of_volume);
        return coloured.x < 0.0f ? NOBODY_KNOWS : through * coloured;
    }
#endif
    through = NOBODY_KNOWS;
#endif
    return through;
}

/* The lamp whose edges are refined that is seen at a surface, or NULL. */
INLINE __global const Emitter *refined_lamp(const Scene *scene, const Surface *surface, float3 d)
{
    __global const Emitter *lamp = seen_light(scene, surface, d);
    return lamp && lamp->cutoff_angle > 0.0f ? lamp : 0;
}

/* h of a camera ray. */
INLINE float3 lamp_ahead(const Scene *scene, Ray ray)
{
    const Hit hit = closest_hit(scene, ray, 0.0f, NO_PRIMITIVE, camera_reach(scene, ray.d));
    if (hit.primitive == NO_PRIMITIVE)
        return (float3)(0.0f);
    const Surface surface = hit_surface(scene, ray, &hit);
    __global const Emitter *lamp = refined_lamp(scene, &surface, ray.d);
    if (!lamp)
        return (float3)(0.0f);
    const float3 through = guess_through(scene, ray, hit.t, (uint)(lamp - scene->emitters));
    if (through.x < 0.0f)
        return (float3)(0.0f);
#if CLVOL_HAS_VOLUME_TEXTURES
    Scene there = *scene;
    there.texture_point = surface.p;
    return through * area_radiance(&there, &surface, ray.d);
#else
    return through * area_radiance(scene, &surface, ray.d);
#endif
}

/* Number k of the rays of a sample: as if the pixel had LAMP_RAYS times as many. */
INLINE Ray finer_ray(const Scene *scene, SampleKey key, uint k)
{
    const int width = scene->render->film_size[0], height = scene->render->film_size[1];
    const int px = (int)(key.pixel % (uint)width), py = (int)(key.pixel / (uint)width);
#if CLVOL_RANDOMIZATIONS
    const uint part = key.sample % CLVOL_RANDOMIZATIONS, index = key.sample / CLVOL_RANDOMIZATIONS;
    key.sample = (index * LAMP_RAYS + k) * CLVOL_RANDOMIZATIONS + part;
#else
    key.sample = key.sample * LAMP_RAYS + k;
#endif
    const uint4 n = decision_block(scene, key, BLOCK_CAMERA, LAMP_SEGMENT);
    float weight = 1.0f; /* stays so: no signed filter comes here */
    const float x = (float)px + filter_offset(scene, n.x, px, width, &weight);
    const float y = (float)py + filter_offset(scene, n.y, py, height, &weight);
    return camera_ray(scene, x, y, uniform_float(n.z), uniform_float(n.w));
}

/* Adds to a camera path what the lamps of its pixel have on the mean of many rays beyond what its own ray sees. */
INLINE void refine_lamp_edge(const Scene *scene, uint slot, Ray ray)
{
    if (path_bounce(scene, slot) > 0 || path_segment(scene, slot) > 0)
        return;
    const SampleKey key = path_key(scene, slot);
    if (!scene->lamp_edges[key.pixel])
        return;
    float3 sum = (float3)(0.0f);
    for (uint k = 0; k < LAMP_RAYS; ++k)
        sum += lamp_ahead(scene, finer_ray(scene, key, k));
    const float3 more = sum / (float)LAMP_RAYS - lamp_ahead(scene, ray);
    set_path_radiance(scene, slot, path_radiance(scene, slot) + to_spectrum(more, (int)path_channel(scene, slot)));
}

#endif
