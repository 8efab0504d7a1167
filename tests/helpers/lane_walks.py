"""Many walks along one ray in lanes: the loop of cl/kernels/lanes.cl round a stage of nothing else."""

import numpy as np
import pyopencl as cl
from walks import record_of

UNIT = """
#include "core/random.h"
#include "stages/medium_ray.h"
#include "tracking/lanes.h"
#include %s

#define OUTCOME 6u

#define LANE_BLOCK %du

INLINE SampleKey lane_key(const Scene *scene, uint slot, uint *segment)
{
    const SampleKey key = {slot, slot + 1u, 0u};
    *segment = 0u;
    return key;
}

INLINE bool lane_begin(const Scene *scene, uint group, uint slot, LaneWalk *walk)
{
    __global const uint *given = scene->state;
    Ray ray;
    ray.o = (float3)(as_float(given[0]), as_float(given[1]), as_float(given[2]));
    ray.d = (float3)(as_float(given[3]), as_float(given[4]), as_float(given[5]));
    walk->in = medium_ray(scene, scene->media, ray, as_float(given[6]), (int)as_float(given[7]));
    walk->from = 0.0f;
    return true;
}

INLINE void lane_end(const Scene *scene, uint group, const LanePath *path, const LaneArrival *arrival)
{
    __global float *out = scene->results + path->slot * OUTCOME;
    out[0] = arrival->happened ? arrival->t : -1.0f;
    out[1] = arrival->estimate;
    out[2] = (float)(arrival->tally.violations + arrival->tally.exhausted + arrival->tally.stopped);
    out[3] = (float)arrival->tally.lookups;
    out[4] = (float)arrival->tally.cells;
    out[5] = path->start.x;
}

#include "kernels/lanes.cl"

__kernel void lanes(CLVOL_ARGUMENTS, __global const uint *slots, __global uint *steps)
{
    const Scene scene = CLVOL_SCENE;
    const uint i = get_global_id(0), n = get_global_size(0);
    const LanesWalked walked = walk_lanes(&scene, 0u, slots, i, n, %du, ~0u);
    steps[2 * i] = walked.lane_steps;
    steps[2 * i + 1] = walked.busy_steps;
}
"""
WORK_ITEMS, PATHS = 64, 512
"""Work-items that share the walks: a group of them, or as many more as walk so many paths each."""


def lane_walks(probe, family, ray, length, walks, lanes=8, seed=1, channel=0):
    """What many walks came to, float32 (walks, 6).

    They are t (-1: no collision), the estimate of transmittance, flaws, look-ups, cells, and where they
    began; and the steps of lanes, and of those that walked, of each work-item.
    """
    outcomes = np.zeros((walks, 6), np.float32)
    queue, memory = probe.device.queue, probe.device.memory
    record = record_of(probe, ray, length, channel)
    probe.buffers["state"] = memory.upload(record, "a ray", "")
    probe.buffers["results"] = memory.upload(outcomes, "outcomes", "")
    text = UNIT % (f"CLVOL_{family.upper()}_HEADER", seed, walks)
    items = WORK_ITEMS * max(1, walks // (WORK_ITEMS * PATHS))
    slots, steps = np.random.default_rng(2).permutation(walks), np.zeros((items, 2), np.uint32)
    macros = {"CLVOL_LANES": lanes, "CLVOL_GROUP_SLOTS": -(-walks // items)}
    probe.run_unit("lanes", text, items, [slots.astype(np.uint32)], [steps], macros=macros)
    cl.enqueue_copy(queue, outcomes, probe.buffers["results"], is_blocking=True)
    return outcomes, steps
