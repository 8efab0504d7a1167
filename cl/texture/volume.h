/* Textures of volumes: what a volume holds at a point of a surface, in the world, whatever the surface's (u, v).

   The point goes with the Scene, of which those who look at a surface make a copy: `texture_point` is a member where a
   scene has such textures.  Beyond its box a grid takes the border's values, or is repeated or mirrored. */
#ifndef CLVOL_TEXTURE_VOLUME_H
#define CLVOL_TEXTURE_VOLUME_H
#if CLVOL_HAS_VOLUME_TEXTURES
#include "core/scene.h"
#include "density/volume.h"

/* The place in one period, of `count` cells round the samples, that looks like x, where sample i is at i. */
INLINE float place_in_period(float x, float count, int wrap)
{
    const float period = wrap == WRAP_MIRROR ? 2.0f * count : count;
    const float within = x + 0.5f - period * floor((x + 0.5f) / period);
    return (within <= count ? within : period - within) - 0.5f;
}

INLINE float3 volume_texture(const Scene *scene, __global const Texture *texture)
{
    __global const Volume *volume = scene->volumes + texture->first;
    float3 place = transform_point(volume->world_to_index, scene->texture_point);
    if (texture->wrap != WRAP_CLAMP) {
        const float3 first = load_vector(texture->to_uv), count = load_vector(texture->to_uv + 3);
        place -= first;
        place = first + (float3)(place_in_period(place.x, count.x, texture->wrap),
                                 place_in_period(place.y, count.y, texture->wrap),
                                 place_in_period(place.z, count.z, texture->wrap));
    }
    const float3 value = volume_value3(scene, volume, place), weights = load_vector(texture->color0);
    return weights.y > 0.0f ? (float3)(dot_of(value, weights)) : value;
}

#endif
#endif
