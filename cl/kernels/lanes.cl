/* A work-item's walks side by side: CLVOL_LANES at once, and as soon as some have ended others begin in their lanes.

   Walks wait for memory, and for branches that nobody can foretell; side by side, one fills the gaps of the others.
   The lanes take two steps in turn: into the next majorant cells, and look-ups where tentative collisions are, the
   latter when enough lanes wait for one.  What a lane computes depends on its walk alone, so that bits are the same
   at every width. */
#include "core/sampler.h"
#include "density/lookup.h"
#include "majorant/lanes.h"
#include "path/tally.h"
#include "tracking/lanes.h"

#define LANES_IDLE (CLVOL_LANES > 4 ? 2u : 1u)     /* so many, and they begin anew */
#define LANES_WAITING ((CLVOL_LANES + 1u) / 2u)    /* so many, and they look up */

/* What stays as it is during the walks, in memory: where one begins, one lane is written. */
typedef struct {
    Real o_x, o_y, o_z, d_x, d_y, d_z, inverse_x, inverse_y, inverse_z, t_max, per_depth;
    Int channel;
#if LANE_FLIES_ON && CLVOL_SUN_CONTROL
    Real cell_x, cell_y, cell_z, cells_x, cells_y, cells_z; /* the ray in cells of the cache of lights */
#endif
} LaneRays;

INLINE void set_lane_axis(Real *o, Real *d, Real *inverse, uint lane, float origin, float direction)
{
    const float way = abs_of(direction) > LEAST_DIRECTION ? direction : LEAST_DIRECTION;
    set_lane(*o, lane, origin);
    set_lane(*d, lane, way);
    set_lane(*inverse, lane, 1.0f / way);
}

/* Puts a walk that begins into a lane. */
INLINE void lane_put(LaneRays *rays, LaneState *state, uint lane, const LaneWalk *walk)
{
    const Ray ray = walk->in.index_ray;
    const float per_depth = 1.0f / (LANE_FLIES_ON ? walk->in.rate : walk->in.scale); /* infinite for vacuum */
    set_lane_axis(&rays->o_x, &rays->d_x, &rays->inverse_x, lane, ray.o.x, ray.d.x);
    set_lane_axis(&rays->o_y, &rays->d_y, &rays->inverse_y, lane, ray.o.y, ray.d.y);
    set_lane_axis(&rays->o_z, &rays->d_z, &rays->inverse_z, lane, ray.o.z, ray.d.z);
    set_lane(rays->t_max, lane, min_of(walk->in.t_max, 1e30f));
    set_lane(rays->per_depth, lane, per_depth);
    set_lane_int(rays->channel, lane, walk->in.channel);
    set_lane(state->t, lane, 0.0f);
    set_lane(state->t_end, lane, 0.0f); /* the first cell is still to be entered */
    set_lane(state->bound, lane, 0.0f);
    set_lane(state->depth, lane, walk->depth * per_depth);
    set_lane(state->estimate, lane, 1.0f);
    set_lane_int(state->stream.counter, lane, (int)walk->k.z);
    set_lane_int(state->stream.key, lane, (int)walk->k.w);
    set_lane_int(state->lookups, lane, 0);
    set_lane_int(state->cells, lane, 0);
    set_lane_int(state->violations, lane, 0);
    set_lane_int(state->happened, lane, 0);
    set_lane_int(state->alive, lane, -1);
#if LANE_FLIES_ON
    set_lane(state->share, lane, walk->in.scale * per_depth);
    set_lane(state->here, lane, 0.0f);
    set_lane(state->caught, lane, 0.0f);
    set_lane(state->lit, lane, 0.0f);
    set_lane(state->met_lit, lane, 0.0f);
#if CLVOL_SUN_CONTROL
    const Ray cells = sunlit_ray(walk->in.scene, walk->in.world_ray);
    set_lane(rays->cell_x, lane, cells.o.x);
    set_lane(rays->cell_y, lane, cells.o.y);
    set_lane(rays->cell_z, lane, cells.o.z);
    set_lane(rays->cells_x, lane, cells.d.x);
    set_lane(rays->cells_y, lane, cells.d.y);
    set_lane(rays->cells_z, lane, cells.d.z);
#endif
#endif
}

INLINE LaneArrival lane_arrival(const LaneRays *rays, const LaneState *state, uint lane)
{
    LaneArrival arrival;
    const uint lookups = (uint)lane_int(state->lookups, lane);
    arrival.happened = lane_int(state->happened, lane) != 0;
    arrival.t = lane_of(state->t, lane);
    arrival.estimate = lane_of(state->estimate, lane);
    Tally tally = {lookups,
                   lookups,
                   LANE_COLLIDES && arrival.happened,
                   (uint)lane_int(state->cells, lane),
                   (uint)lane_int(state->violations, lane),
                   0,
                   0.0f,
                   0,
                   0.0f};
#if LANE_FLIES_ON
    const Expected expected = {arrival.estimate, lane_of(state->caught, lane), lane_of(state->lit, lane),
                               lane_of(state->met_lit, lane)};
    arrival.expected = expected;
    if (arrival.estimate != 0.0f && arrival.t < lane_of(rays->t_max, lane))
        stop_walk(arrival.t, &tally);
    if (arrival.happened)
        arrival.t = lane_of(state->met, lane);
#else
    if (!arrival.happened && arrival.t < lane_of(rays->t_max, lane))
        stop_walk(arrival.t, &tally);
#endif
    arrival.tally = tally;
    return arrival;
}

/* Into the next cells, in the lanes of `advance`. */
INLINE void lane_enter(const LaneCells *cells, const LaneRays *rays, LaneState *state, Int advance)
{
#if CLVOL_WALKS_GRID
    const Real t = state->t;
    const int *size = cells->cells;
    const Int x = lane_axis_cell_of(cells, size[0], rays->o_x, rays->d_x, t);
    const Int y = lane_axis_cell_of(cells, size[1], rays->o_y, rays->d_y, t);
    const Int z = lane_axis_cell_of(cells, size[2], rays->o_z, rays->d_z, t);
    const Real found = gather_real(cells->majorants, (z * size[1] + y) * size[0] + x);
    const Int empty = MASK(found < 0.0f);
    const Int edge = either_int(empty, to_int(-found), (Int)(1));
    const Real bound = either(empty, (Real)(0.0f), found);
    const Real t_x = lane_axis_exit(cells, size[0], rays->o_x, rays->d_x, rays->inverse_x, x, edge);
    const Real t_y = lane_axis_exit(cells, size[1], rays->o_y, rays->d_y, rays->inverse_y, y, edge);
    const Real t_z = lane_axis_exit(cells, size[2], rays->o_z, rays->d_z, rays->inverse_z, z, edge);
    /* on by a unit in the last place at least, whatever rounding says */
    const Real next = bits_real(real_bits(t) + 1u);
    const Real t_end = least_of(greatest_of(least_of(t_x, least_of(t_y, t_z)), next), rays->t_max);
#else
    const Real bound = (Real)(cells->bound), t_end = rays->t_max;
#endif
    state->t_end = either(advance, t_end, state->t_end);
    state->bound = either(advance, bound, state->bound);
    state->cells -= advance;
}

/* What became of a queue. */
typedef struct {
    uint next;       /* the first that was not begun */
    uint lane_steps; /* taken, idle lanes and all */
    uint busy_steps; /* of lanes that walked */
} LanesWalked;

/* Paths of a group that one of its work-items walks, at most, and their blocks of random numbers. */
#define OWN_PATHS ((CLVOL_GROUP_SLOTS + CLVOL_LOCAL_SIZE - 1) / CLVOL_LOCAL_SIZE)

typedef struct {
    uint x[OWN_PATHS + CLVOL_LANES], y[OWN_PATHS + CLVOL_LANES], z[OWN_PATHS + CLVOL_LANES], w[OWN_PATHS + CLVOL_LANES];
    uint depth[OWN_PATHS + CLVOL_LANES]; /* exponential variate of x, a float's bits */
} LaneBlocks;

INLINE void store_bits(uint *to, Bits values)
{
    for (uint lane = 0; lane < CLVOL_LANES; ++lane)
        to[lane] = lane_uint(values, lane);
}

/* The random numbers of all walks at hand, which by the way of vectors cost a fraction. */
INLINE void lane_blocks(const Scene *scene, __global const uint *slots, uint first, uint stride, uint count,
                        LaneBlocks *blocks)
{
    for (uint n = 0, i = first; i < count; n += CLVOL_LANES) {
        const Bits none = (Bits)(0u);
        LaneKeys keys = {none, none, none};
        Bits segments = none;
        for (uint lane = 0; lane < CLVOL_LANES && i < count; ++lane, i += stride) {
            uint segment;
            const SampleKey key = lane_key(scene, slots[i], &segment);
            set_lane_uint(keys.pixel, lane, key.pixel);
            set_lane_uint(keys.sample, lane, key.sample);
            set_lane_uint(keys.bounce, lane, key.bounce);
            set_lane_uint(segments, lane, segment);
        }
        const BitsBlock block = lane_decisions(scene, &keys, (Bits)(LANE_BLOCK), segments);
        store_bits(blocks->depth + n, real_bits(lane_exponential(block.x)));
        store_bits(blocks->x + n, block.x);
        store_bits(blocks->y + n, block.y);
        store_bits(blocks->z + n, block.z);
        store_bits(blocks->w + n, block.w);
    }
}

/* Walks every `stride`th of `count` paths from the `first` on, but begins no more after `budget` steps. */
INLINE LanesWalked walk_lanes(const Scene *scene, uint group, __global const uint *slots, uint first, uint stride,
                              uint count, uint budget)
{
    const LaneVolume volume = lane_volume(scene, scene->volumes + scene->media->sigma_t_volume);
    const LaneCells cells = lane_cells(scene, scene->media);
    const Real zero = (Real)(0.0f);
    const Int none = (Int)(0);
    LaneRays rays = {zero, zero, zero, zero, zero, zero, zero, zero, zero, zero, zero, none};
    LaneState state = {zero, zero, zero, zero, zero};
#if LANE_FLIES_ON && CLVOL_SUN_CONTROL
    const Sunlit sunlit = sunlit_begin(scene);
#endif
    LanePath paths[CLVOL_LANES];
    for (uint lane = 0; lane < CLVOL_LANES; ++lane)
        paths[lane].slot = NO_SLOT;
    LaneBlocks blocks;
    lane_blocks(scene, slots, first, stride, count, &blocks);
    LanesWalked walked = {first, 0, 0};
    uint own = 0;
    uint steps = 0;
    for (;;) {
        uint idle = lanes_of(~state.alive);
        if (idle == ALL_LANES || (lane_count(idle) >= LANES_IDLE && walked.next < count && steps < budget)) {
            LaneState kept = state;
            for (; idle != 0; idle &= idle - 1u) {
                const uint lane = first_lane(idle);
                if (paths[lane].slot != NO_SLOT) {
                    const LaneArrival arrival = lane_arrival(&rays, &kept, lane);
                    steps += steps_of(&arrival.tally);
                    lane_end(scene, group, &paths[lane], &arrival);
                    paths[lane].slot = NO_SLOT;
                }
                while (walked.next < count && steps < budget && paths[lane].slot == NO_SLOT) {
                    LaneWalk walk;
                    const uint slot = slots[walked.next];
                    walked.next += stride;
                    walk.k = (uint4)(blocks.x[own], blocks.y[own], blocks.z[own], blocks.w[own]);
                    walk.depth = as_float(blocks.depth[own]);
                    ++own;
                    if (!lane_begin(scene, group, slot, &walk))
                        continue;
                    lane_put(&rays, &kept, lane, &walk);
                    paths[lane].slot = slot;
                    paths[lane].from = walk.from;
                    paths[lane].start = walk.in.world_ray.o;
#if CLVOL_EXPECTS_BACKGROUND
                    paths[lane].k = walk.k;
#endif
#if CLVOL_HAS_GLOW
                    paths[lane].length = min_of(walk.in.t_max, 1e30f);
#endif
                }
            }
            state = kept;
            if (lanes_of(state.alive) == 0)
                return walked;
        }
        Int ready;
        uint waiting;
        for (;;) {
            const Real left = (state.t_end - state.t) * state.bound;
            ready = state.alive & MASK(state.depth < left);
            const Int advance = state.alive & ~ready;
            const uint both = lanes_of_two(ready, advance);
            waiting = lane_count(both & ALL_LANES);
            const uint advancing = lane_count(both >> 16);
            if (waiting >= LANES_WAITING || advancing == 0)
                break;
            walked.lane_steps += CLVOL_LANES;
            walked.busy_steps += advancing;
            state.depth -= either(advance, left, (Real)(0.0f));
            state.t = either(advance, state.t_end, state.t);
            state.alive &= ~(advance & MASK(state.t >= rays.t_max));
            lane_enter(&cells, &rays, &state, advance & state.alive);
        }
        if (waiting == 0)
            continue;
        walked.lane_steps += CLVOL_LANES;
        walked.busy_steps += waiting;
        state.t += either(ready, state.depth / state.bound, (Real)(0.0f));
        state.lookups -= ready;
        const Real x = rays.o_x + state.t * rays.d_x, y = rays.o_y + state.t * rays.d_y;
        const Real z = rays.o_z + state.t * rays.d_z;
        const Real found = lane_density(&volume, x, y, z, rays.channel, ready, &state.stream);
        state.violations -= ready & MASK(found > state.bound);
        const BitsPair k = lane_pair(&state.stream, ready);
#if LANE_FLIES_ON && CLVOL_SUN_CONTROL
        state.here = lane_sunlit(&sunlit, rays.cell_x + state.t * rays.cells_x, rays.cell_y + state.t * rays.cells_y,
                                 rays.cell_z + state.t * rays.cells_z);
#endif
        const Int ended = lane_event(&state, found, k.x, ready);
        state.depth = either(ready, lane_exponential(k.y) * rays.per_depth, state.depth);
        state.happened |= LANE_FLIES_ON ? none : ended;
        state.alive &= ~ended & ~(ready & MASK(state.lookups >= (int)WALK_STEPS));
    }
}
