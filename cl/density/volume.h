/* The one way to read a sampled field: brick map look-up at a point of index space.

   Bricks hold 8³ cells and therefore 9³ samples each, so that the eight corners of a cell always
   stand in one brick; the top grid maps a brick's place to its number.  Points beyond the lattice
   take the value at its border. */
#ifndef CLVOL_DENSITY_VOLUME_H
#define CLVOL_DENSITY_VOLUME_H

#define BRICK_SAMPLES 729

/* First sample of the brick that holds cell (x, y, z). */
INLINE __global const float *volume_brick(const Scene *scene, __global const Volume *volume,
                                                 int x, int y, int z)
{
    const int top = ((z >> 3) * volume->bricks[1] + (y >> 3)) * volume->bricks[0] + (x >> 3);
    const uint brick = (uint)scene->tops[volume->top_offset + top];
    return scene->bricks + (size_t)(volume->brick_offset + brick) * BRICK_SAMPLES;
}

/* Value of one channel of `volume` at index position p. */
INLINE float volume_value(const Scene *scene, __global const Volume *volume, float3 p, int channel)
{
    const int stride = CLVOL_HAS_COLOURED_VOLUME ? volume->channels : 1;
    channel = stride > 1 ? channel : 0; /* a grey volume serves every channel */
    const float x = clamp_to(p.x, 0.0f, (float)(volume->size[0] - 1));
    const float y = clamp_to(p.y, 0.0f, (float)(volume->size[1] - 1));
    const float z = clamp_to(p.z, 0.0f, (float)(volume->size[2] - 1));
    const int ix = min_int((int)x, volume->size[0] - 2);
    const int iy = min_int((int)y, volume->size[1] - 2);
    const int iz = min_int((int)z, volume->size[2] - 2);
    __global const float *brick = volume_brick(scene, volume, ix, iy, iz);
    const float fx = x - (float)ix, fy = y - (float)iy, fz = z - (float)iz;
    const int corner = ((iz & 7) * 81 + (iy & 7) * 9 + (ix & 7));
    if (CLVOL_HAS_NEAREST && (!CLVOL_HAS_TRILINEAR || volume->nearest)) {
        const int nearest = corner + (fx >= 0.5f ? 1 : 0) + (fy >= 0.5f ? 9 : 0) + (fz >= 0.5f ? 81 : 0);
        return brick[nearest * stride + channel];
    }
    __global const float *c = brick + corner * stride + channel;
    const float c00 = lerp(c[0], c[stride], fx);
    const float c10 = lerp(c[9 * stride], c[10 * stride], fx);
    const float c01 = lerp(c[81 * stride], c[82 * stride], fx);
    const float c11 = lerp(c[90 * stride], c[91 * stride], fx);
    return lerp(lerp(c00, c10, fy), lerp(c01, c11, fy), fz);
}

#endif
