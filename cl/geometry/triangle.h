/* Eight triangles against one ray, watertight (Woop, Benthin and Wald 2013): vertices are sheared into a frame
   where the ray is the z axis, and the origin is inside a triangle if it is on one side of all three edges.

   Two triangles that share an edge compute the same two products for it and subtract them; rounded to nearest, the
   difference has the right sign or is 0, and 0 counts as inside.  So no ray passes between them, in float alone.  That
   holds only while nothing is fused: FP_CONTRACT is off in whatever computes with vertices. */
#ifndef CLVOL_GEOMETRY_TRIANGLE_H
#define CLVOL_GEOMETRY_TRIANGLE_H
#include "core/types.h"

/* What a ray brings to every triangle: which axes are sheared x, y, z, and by how much. */
typedef struct {
    uint x, y, z; /* z is the direction's largest component */
    float ox, oy, oz;
    float shear_x, shear_y, scale_z;
} Shear;

INLINE float component(float3 v, uint axis) { return axis == 0u ? v.x : (axis == 1u ? v.y : v.z); }

INLINE Shear shear_of(Ray ray)
{
#pragma OPENCL FP_CONTRACT OFF
    Shear shear;
    const float ax = abs_of(ray.d.x), ay = abs_of(ray.d.y), az = abs_of(ray.d.z);
    shear.z = ax > ay ? (ax > az ? 0u : 2u) : (ay > az ? 1u : 2u);
    shear.x = shear.z == 2u ? 0u : shear.z + 1u;
    shear.y = shear.x == 2u ? 0u : shear.x + 1u;
    shear.ox = component(ray.o, shear.x);
    shear.oy = component(ray.o, shear.y);
    shear.oz = component(ray.o, shear.z);
    const float dz = component(ray.d, shear.z);
    shear.shear_x = component(ray.d, shear.x) / dz;
    shear.shear_y = component(ray.d, shear.y) / dz;
    shear.scale_z = 1.0f / dz;
    return shear;
}

/* Where the ray meets the packet's triangles. */
typedef struct {
    float8 v, w; /* edge functions opposite the second and the third vertex; over det: their weights */
    float8 det;
    float8 depth; /* over det: t */
    int8 inside; /* -1 where the line meets the triangle */
} PacketHits;

INLINE PacketHits packet_hits(__global const float8 *packet, const Shear *shear)
{
#pragma OPENCL FP_CONTRACT OFF
    const float8 az = packet[shear->z] - shear->oz;
    const float8 bz = packet[3u + shear->z] - shear->oz;
    const float8 cz = packet[6u + shear->z] - shear->oz;
    const float8 ax = (packet[shear->x] - shear->ox) - shear->shear_x * az;
    const float8 ay = (packet[shear->y] - shear->oy) - shear->shear_y * az;
    const float8 bx = (packet[3u + shear->x] - shear->ox) - shear->shear_x * bz;
    const float8 by = (packet[3u + shear->y] - shear->oy) - shear->shear_y * bz;
    const float8 cx = (packet[6u + shear->x] - shear->ox) - shear->shear_x * cz;
    const float8 cy = (packet[6u + shear->y] - shear->oy) - shear->shear_y * cz;
    const float8 u = cx * by - cy * bx;
    PacketHits hits;
    hits.v = ax * cy - ay * cx;
    hits.w = bx * ay - by * ax;
    hits.det = (u + hits.v) + hits.w;
    hits.inside = ((u >= 0.0f & hits.v >= 0.0f & hits.w >= 0.0f) | (u <= 0.0f & hits.v <= 0.0f & hits.w <= 0.0f)) &
                  (hits.det != 0.0f);
    hits.depth = (u * az + hits.v * bz + hits.w * cz) * shear->scale_z;
    return hits;
}

/* t of the lanes that are inside, from the triangles' planes: unlike the edge functions' sum, whose error grows with
   length over width, this keeps the digits on needles.  Where a plane is seen edge-on, the sum has to do. */
INLINE float8 packet_t(__global const float8 *packet, const PacketHits *hits, const Ray *ray)
{
#pragma OPENCL FP_CONTRACT OFF
    const float8 x1 = packet[3] - packet[0], y1 = packet[4] - packet[1], z1 = packet[5] - packet[2];
    const float8 x2 = packet[6] - packet[0], y2 = packet[7] - packet[1], z2 = packet[8] - packet[2];
    const float8 nx = y1 * z2 - z1 * y2, ny = z1 * x2 - x1 * z2, nz = x1 * y2 - y1 * x2;
    const float8 along = nx * ray->d.x + ny * ray->d.y + nz * ray->d.z;
    const float8 distance_ = nx * (packet[0] - ray->o.x) + ny * (packet[1] - ray->o.y) + nz * (packet[2] - ray->o.z);
    const int8 usable = along != 0.0f;
    return (usable ? distance_ : hits->depth) / (usable ? along : hits->det);
}

#endif
