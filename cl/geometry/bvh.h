/* Traversal of clvol.accel.bvh's hierarchy: eight boxes, or a packet of eight triangles, at a time.

   All hits of a ray are ordered by (t, primitive), and a caller walks through them by handing in the last one; so no
   box may be left out because it begins as far away as the best hit, and none because of rounding.  Box tests
   multiply the end of an interval by REACH (Ize 2013): that covers the boxes' and the triangles' rounding as far as it
   grows with the distance from the origin.  The boxes themselves are padded for the rest.

   CLVOL_BVH_STACK is how many nodes may have to wait in the deepest tree that is built.
   scene->bvh_nodes and scene->bvh_triangles are rows of eight floats, as clvol/accel/bvh.py says. */
#ifndef CLVOL_GEOMETRY_BVH_H
#define CLVOL_GEOMETRY_BVH_H
#if CLVOL_HAS_SURFACES
#include "core/scene.h"
#include "geometry/quadric.h"
#include "geometry/triangle.h"

typedef struct {
    float t;
    float u, v;     /* barycentric weights of the second and third vertex; 0 on quadrics */
    uint primitive; /* number of the triangle, or of triangles + number of the quadric; NO_PRIMITIVE: none */
} Hit;

/* What a ray runs to, and no obstacle to it: a point of a light. */
typedef struct {
    uint primitive;    /* that the point lies on; NO_PRIMITIVE: none, or one that a ray may meet before the point */
    uint first, count; /* the light's primitives */
    float near_;       /* from here on they are, to rounding, where the point is */
} Target;

INLINE bool is_target(const Hit *hit, const Target *target)
{
    return hit->primitive == target->primitive ||
           (hit->primitive - target->first < target->count && hit->t >= target->near_);
}

#define BVH_NUMBER (BVH_HAS_QUADRICS - 1u) /* of a packet, in its reference */
#define REACH 1.0000020f
#define STEEPEST 1.0e38f

/* Bit i: whether lane i of a comparison is true.  Number of the lowest bit that is set, if there is one.
   PoCL's own builtins are library calls: a tenth of a ray's time. */
#if defined(__AVX__) && defined(__clang__)
INLINE uint lane_bits(int8 lanes) { return (uint)__builtin_ia32_movmskps256(as_float8(lanes)); }
INLINE uint lowest_bit(uint bits) { return (uint)__builtin_ctz(bits); }
#else
INLINE uint lane_bits(int8 lanes)
{
    const int8 bits = lanes & (int8)(1, 2, 4, 8, 16, 32, 64, 128);
    const int4 half_ = bits.lo | bits.hi;
    const int2 quarter = half_.lo | half_.hi;
    return (uint)(quarter.x | quarter.y);
}
INLINE uint lowest_bit(uint bits) { return 31u - clz(bits & (0u - bits)); }
#endif

/* What a ray brings to every box: reciprocals, and which row of each axis' two is met first. */
typedef struct {
    float3 o;
    float3 inverse_d;
    uint near_x, near_y, near_z;
} Slabs;

/* A component of 0 counts as a tiny one: 0 times infinity never occurs, and since boxes are padded, an origin between a
   pair of planes is between them by more than nothing. */
INLINE float inverse_of(float d) { return abs_of(d) * STEEPEST > 1.0f ? 1.0f / d : with_sign(STEEPEST, d); }

INLINE Slabs slabs_of(Ray ray)
{
    Slabs slabs;
    slabs.o = ray.o;
    slabs.inverse_d = (float3)(inverse_of(ray.d.x), inverse_of(ray.d.y), inverse_of(ray.d.z));
    slabs.near_x = slabs.inverse_d.x < 0.0f ? 1u : 0u;
    slabs.near_y = slabs.inverse_d.y < 0.0f ? 3u : 2u;
    slabs.near_z = slabs.inverse_d.z < 0.0f ? 5u : 4u;
    return slabs;
}

/* Which children a ray's segment from `least` to `most` meets; `entry`: where, at the earliest. */
INLINE uint children_met(__global const float8 *node, const Slabs *slabs, float least, float most, float8 *entry)
{
    const float8 x0 = (node[slabs->near_x] - slabs->o.x) * slabs->inverse_d.x;
    const float8 y0 = (node[slabs->near_y] - slabs->o.y) * slabs->inverse_d.y;
    const float8 z0 = (node[slabs->near_z] - slabs->o.z) * slabs->inverse_d.z;
    const float8 x1 = (node[slabs->near_x ^ 1u] - slabs->o.x) * slabs->inverse_d.x;
    const float8 y1 = (node[slabs->near_y ^ 1u] - slabs->o.y) * slabs->inverse_d.y;
    const float8 z1 = (node[slabs->near_z ^ 1u] - slabs->o.z) * slabs->inverse_d.z;
    const float8 xy0 = x0 > y0 ? x0 : y0, z_least = z0 > least ? z0 : (float8)least;
    const float8 xy1 = x1 < y1 ? x1 : y1, z_most = z1 < most ? z1 : (float8)most;
    *entry = xy0 > z_least ? xy0 : z_least;
    return lane_bits(*entry <= (xy1 < z_most ? xy1 : z_most) * REACH);
}

/* Whether (t, primitive) comes after `after` and before `best`. */
INLINE bool is_next(float t, uint primitive, float after_t, uint after_primitive, const Hit *best)
{
    return (t > after_t || (t == after_t && primitive > after_primitive)) &&
           (t < best->t || (t == best->t && primitive < best->primitive));
}

/* A query: the hits that come after (after_t, after_primitive), and the best of them so far. */
typedef struct {
    Ray ray;
    Slabs slabs;
    Shear shear; /* for triangles */
    float after_t;
    uint after_primitive;
    Hit best; /* before anything is found, a bound: (t_max, 0), which no hit shares */
    bool found;
} Query;

INLINE Query query_begin(Ray ray, float after_t, uint after_primitive, float t_max)
{
    Query query;
    query.ray = ray;
    query.slabs = slabs_of(ray);
    if (CLVOL_HAS_TRIANGLES)
        query.shear = shear_of(ray);
    query.after_t = after_t;
    query.after_primitive = after_primitive;
    query.best.t = t_max;
    query.best.u = query.best.v = 0.0f;
    query.best.primitive = 0u;
    query.found = false;
    return query;
}

INLINE void query_offer(Query *query, float t, uint primitive, float u, float v)
{
    if (is_next(t, primitive, query->after_t, query->after_primitive, &query->best)) {
        query->best.t = t;
        query->best.u = u;
        query->best.v = v;
        query->best.primitive = primitive;
        query->found = true;
    }
}

INLINE void test_triangles(__global const float8 *packet, Query *query)
{
    const PacketHits hits = packet_hits(packet, &query->shear);
    uint lanes = lane_bits(hits.inside);
    if (lanes == 0u)
        return;
    float t[BVH_PACKET], v[BVH_PACKET], w[BVH_PACKET], det[BVH_PACKET];
    const float8 t8 = packet_t(packet, &hits, &query->ray);
    lanes &= lane_bits(t8 >= query->after_t & t8 <= query->best.t);
    if (lanes == 0u)
        return;
    vstore8(t8, 0, t);
    vstore8(hits.v, 0, v);
    vstore8(hits.w, 0, w);
    vstore8(hits.det, 0, det);
    __global const uint *primitives = (__global const uint *)(packet + 9);
    for (; lanes != 0u; lanes &= lanes - 1u) {
        const uint lane = lowest_bit(lanes);
        query_offer(query, t[lane], primitives[lane], v[lane] / det[lane], w[lane] / det[lane]);
    }
}

INLINE void test_leaf(const Scene *scene, uint reference, Query *query)
{
    __global const float8 *packet = scene->bvh_triangles + (size_t)(reference & BVH_NUMBER) * BVH_PACKET_ROWS;
    if (CLVOL_HAS_TRIANGLES)
        test_triangles(packet, query);
    if (CLVOL_HAS_QUADRICS && (reference & BVH_HAS_QUADRICS)) {
        const uint triangles = ((__global const uint *)(scene->bvh_nodes + 7))[0];
        __global const uint *primitives = (__global const uint *)(packet + 9);
        for (uint lane = 0u; lane < BVH_PACKET; ++lane) {
            const uint primitive = primitives[lane];
            if (primitive < triangles || primitive == NO_PRIMITIVE)
                continue;
            const float2 t = quadric_hits(scene->quadrics + (primitive - triangles), query->ray);
            query_offer(query, t.x, primitive, 0.0f, 0.0f);
            query_offer(query, t.y, primitive, 0.0f, 0.0f);
        }
    }
}

/* A node that waits: its entry's bits above its reference, so that they compare as the entries do. */
INLINE ulong waiting(float entry, uint reference) { return ((ulong)as_uint(entry) << 32) | reference; }

INLINE float waiting_entry(ulong node) { return as_float((uint)(node >> 32)); }

/* The nearest of the children met, at least one; the others go on the stack, the nearer the later. */
INLINE uint nearest_child(ulong *stack, uint *height, uint lanes, float8 entry8, __global const uint *references)
{
    const uint first = lowest_bit(lanes);
    const uint others = lanes & (lanes - 1u);
    if (others == 0u)
        return references[first];
    float entry[BVH_PACKET];
    vstore8(entry8, 0, entry);
    ulong nearest = waiting(entry[first], references[first]);
    const uint base = *height;
    for (uint left = others; left != 0u; left &= left - 1u) {
        const uint lane = lowest_bit(left);
        const ulong child = waiting(entry[lane], references[lane]);
        const ulong farther = child < nearest ? nearest : child;
        nearest = child < nearest ? child : nearest;
        uint place = *height;
        for (; place > base && stack[place - 1u] < farther; --place)
            stack[place] = stack[place - 1u];
        stack[place] = farther;
        *height += 1u;
    }
    return (uint)nearest;
}

/* Takes from the stack the next node that begins before the best hit; false if there is none. */
INLINE bool next_waiting(const ulong *stack, uint *height, float most, uint *reference)
{
    while (*height != 0u) {
        *height -= 1u;
        *reference = (uint)stack[*height];
        if (waiting_entry(stack[*height]) <= most)
            return true;
    }
    return false;
}

/* The first hit after (after_t, after_primitive) in the order of (t, primitive), below t_max.  A fresh ray
   passes (0, NO_PRIMITIVE): then t > 0. */
INLINE Hit closest_hit(const Scene *scene, Ray ray, float after_t, uint after_primitive, float t_max)
{
    Query query = query_begin(ray, after_t, after_primitive, t_max);
    ulong stack[CLVOL_BVH_STACK];
    uint height = 0u, reference = 0u;
    do {
        while (!(reference & BVH_LEAF)) {
            __global const float8 *node = scene->bvh_nodes + (size_t)reference * BVH_NODE_ROWS;
            float8 entry;
            const uint lanes = children_met(node, &query.slabs, after_t, query.best.t, &entry);
            if (lanes == 0u)
                break;
            reference = nearest_child(stack, &height, lanes, entry, (__global const uint *)(node + 6));
        }
        if (reference & BVH_LEAF)
            test_leaf(scene, reference, &query);
    } while (next_waiting(stack, &height, query.best.t * REACH, &reference));
    if (!query.found)
        query.best.primitive = NO_PRIMITIVE;
    return query.best;
}

/* Whether anything but the target is hit below t_max. */
INLINE bool any_hit(const Scene *scene, Ray ray, float t_max, const Target *target)
{
    Query query = query_begin(ray, 0.0f, NO_PRIMITIVE, t_max);
    uint stack[CLVOL_BVH_STACK];
    uint height = 1u;
    stack[0] = 0u;
    while (height != 0u && !query.found) {
        height -= 1u;
        const uint reference = stack[height];
        if (reference & BVH_LEAF) {
            test_leaf(scene, reference, &query);
            if (query.found && is_target(&query.best, target))
                query.found = false; /* and only what comes before it counts from now on */
            continue;
        }
        __global const float8 *node = scene->bvh_nodes + (size_t)reference * BVH_NODE_ROWS;
        __global const uint *references = (__global const uint *)(node + 6);
        float8 entry;
        for (uint lanes = children_met(node, &query.slabs, 0.0f, t_max, &entry); lanes != 0u; lanes &= lanes - 1u) {
            stack[height] = references[lowest_bit(lanes)];
            height += 1u;
        }
    }
    return query.found;
}

#endif
#endif
