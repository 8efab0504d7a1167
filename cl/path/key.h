/* Which random numbers a path reads. */
#ifndef CLVOL_PATH_KEY_H
#define CLVOL_PATH_KEY_H
#include "core/random.h"
#include "core/scene.h"

INLINE SampleKey path_key(const Scene *scene, uint slot)
{
    SampleKey key;
    key.pixel = path_pixel(scene, slot);
    key.sample = path_sample(scene, slot);
    key.bounce = path_bounce(scene, slot);
    return key;
}

#endif
