/* Mixtures of BSDFs.  One part of a mixture is chosen by chance, and is all that the path meets: light is sampled for
   it alone, and its pdf weighs both.  On the mean that is the mixture.

   A mixture of mixtures is a list of parts.  material_tables has how many they are, and of each its material (-1:
   black), a constant share, and the number of textures that multiply it, and these: -1 - t for what is missing of
   texture t to 1 (clvol/tables/blends.py). */
#ifndef CLVOL_BSDF_BLEND_H
#define CLVOL_BSDF_BLEND_H
#if CLVOL_BSDF_BLEND
#include "core/scene.h"
#include "texture/texture.h"

/* Share of the part at `entry`, and its material; moves on to the next. */
INLINE float blend_part(const Scene *scene, __global const float **entry, float2 uv, int *number)
{
    __global const float *row = *entry;
    *number = (int)row[0];
    float share = row[1];
    const int count = (int)row[2];
#if CLVOL_HAS_TEXTURES
    for (int n = 0; n < count; ++n) {
        const int texture = (int)row[3 + n];
        const float weight = texture_value(scene, texture < 0 ? -1 - texture : texture, uv).x;
        share *= texture < 0 ? 1.0f - weight : weight;
    }
#endif
    *entry = row + 3 + count;
    return share;
}

/* The material of one part, by its share; `pick` is uniform, and so is what is left of it.  Parts of share 0 are never
   chosen. */
INLINE int choose_part(const Scene *scene, __global const Material *blend, float2 uv, float *pick)
{
    __global const float *entry = scene->material_tables + blend->table;
    int chosen = -1;
    float rest = *pick;
    for (int left = (int)*entry++; left > 0; --left) {
        int number;
        const float share = blend_part(scene, &entry, uv, &number);
        if (!(share > 0.0f))
            continue;
        chosen = number;
        *pick = min_of(rest / share, 1.0f);
        if (rest < share)
            break;
        rest -= share;
    }
    return chosen;
}

#endif
#endif
