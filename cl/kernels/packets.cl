/* A work-item's paths of a stage that says what it will draw for each: in lanes the random numbers of a packet of
   CLVOL_LANES paths are drawn side by side, before the stage handles one after the other.  Which blocks a stage reads
   its DRAWS_* say. */
#include "path/draws.h"

#if CLVOL_LANES
/* The blocks of a packet: the paths' own, then of the next bounce that of the direction and that of the light. */
#define PACKET_BLOCKS (DRAWS_LIGHT ? 3u : (DRAWS_DIRECTION ? 2u : 1u))
typedef struct {
    BitsBlock block[PACKET_BLOCKS];
} PacketBlocks;

INLINE void draw_packet(const Scene *scene, const Draws *draws, uint count, PacketBlocks *drawn)
{
    const Bits none = (Bits)(0u);
    LaneKeys keys = {none, none, none};
    Bits blocks = none, segments = none;
    for (uint lane = 0; lane < count; ++lane) {
        set_lane_uint(keys.pixel, lane, draws[lane].key.pixel);
        set_lane_uint(keys.sample, lane, draws[lane].key.sample);
        set_lane_uint(keys.bounce, lane, draws[lane].key.bounce);
        set_lane_uint(blocks, lane, draws[lane].block);
        set_lane_uint(segments, lane, draws[lane].segment);
    }
#pragma unroll 1 /* what draws a block is long, and stands once */
    for (uint n = 0; n < PACKET_BLOCKS; ++n) {
        drawn->block[n] = lane_decisions(scene, &keys, blocks, segments);
        keys.bounce += n == 0 ? 1u : 0u;
        blocks = (Bits)(n == 0 ? BLOCK_DIRECTION : BLOCK_LIGHT);
        segments = none;
    }
}

INLINE void handle_paths(const Scene *scene, uint group, __global const uint *slots, uint count)
{
    uint packet[CLVOL_LANES];
    Draws draws[CLVOL_LANES];
    PacketBlocks drawn;
    for (uint i = get_local_id(0); i < count;) {
        uint paths = 0;
        for (; i < count && paths < CLVOL_LANES; i += CLVOL_LOCAL_SIZE) {
            packet[paths] = slots[i];
            if (STAGE_BEGINS(scene, group, slots[i], &draws[paths]))
                ++paths;
        }
        if (paths > 0)
            draw_packet(scene, draws, paths, &drawn);
        for (uint lane = 0; lane < paths; ++lane) {
            draws[lane].drawn = drawn.block;
            draws[lane].lane = lane;
            STAGE(scene, group, packet[lane], &draws[lane]);
        }
    }
}
#else
INLINE void handle_paths(const Scene *scene, uint group, __global const uint *slots, uint count)
{
    for (uint i = get_local_id(0); i < count; i += CLVOL_LOCAL_SIZE) {
        Draws draws;
        if (STAGE_BEGINS(scene, group, slots[i], &draws))
            STAGE(scene, group, slots[i], &draws);
    }
}
#endif
