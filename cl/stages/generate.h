/* Writes a finished path's result at its job's own index and starts the next job in its slot. */
#ifndef CLVOL_STAGES_GENERATE_H
#define CLVOL_STAGES_GENERATE_H
#include "path/camera.h"
#include "path/draws.h"
#include "path/reset.h"
#if CLVOL_HAS_METER
#include "stages/meter.h"
#endif
#include "path/transitions.h"

#define DRAWS_DIRECTION 0
#define DRAWS_LIGHT 0

/* A job is one sample of one pixel, or, where a path follows one channel, a third of it; consecutive jobs are
   channels of a sample and samples of a pixel, so that rays that run together stay together. */
INLINE void write_result(const Scene *scene, uint slot, uint job)
{
    const uint ring_jobs = scene->render->pass_jobs * scene->render->ring_passes;
    const uint place = job % ring_jobs;
#if CLVOL_HAS_METER && !CLVOL_HAS_TARGET
    const Spectrum radiance = PI * path_sample_weight(scene, slot) * path_radiance(scene, slot); /* an irradiance */
#else
    const Spectrum radiance = path_sample_weight(scene, slot) * path_radiance(scene, slot);
#endif
#if CLVOL_SPECTRUM == 1
    scene->results[place] = radiance;
#else
    vstore3(radiance, place, scene->results);
#endif
    write_counts(scene, slot, place);
    write_first_hit(scene, slot, place);
    atomic_inc(scene->counters + COUNTER_DONE + place / scene->render->pass_jobs);
}

/* Which numbers the path of a job reads. */
INLINE SampleKey job_key(const Scene *scene, uint job)
{
    __global const Render *render = scene->render;
    const uint pass = job / render->pass_jobs;
    const uint in_pass = job % render->pass_jobs / CLVOL_JOBS_PER_SAMPLE; /* its sample within the pass */
    const uint samples = pass == render->last_pass ? render->last_samples : render->pass_samples;
    SampleKey key;
    key.pixel = in_pass / samples;
    key.sample = render->first_sample + pass * render->pass_samples + in_pass % samples;
#if CLVOL_PIXEL_LIST
    const uint2 entry = vload2(key.pixel, scene->pixel_list); /* a pixel, and how many samples it has */
    key.pixel = entry.x;
    key.sample += entry.y;
#endif
    key.pixel += render->first_pixel; /* from its number in the band on the device to that in the picture */
    key.bounce = 0;
    return key;
}

/* The path of a job begins: its ray, and nothing gathered yet. */
INLINE void start_job(const Scene *scene, uint slot, uint job, const Draws *draws)
{
    const SampleKey key = draws->key;
    const uint4 k = drawn_block(scene, draws, BLOCK_CAMERA);
    const int width = scene->render->film_size[0];
    const int px = (int)(key.pixel % (uint)width), py = (int)(key.pixel / (uint)width);
    float weight = 1.0f;
#if CLVOL_HAS_METER /* the place in the pixel alone, at full resolution: that in a large film has few digits */
    set_meter_ray(scene, slot, uniform_float(k.x), uniform_float(k.y), uniform_below_one(k.z), uniform_float(k.w));
#else
    const float x = (float)px + filter_offset(scene, k.x, px, width, &weight);
    const float y = (float)py + filter_offset(scene, k.y, py, scene->render->film_size[1], &weight);
    const Ray ray = camera_ray(scene, x, y, uniform_float(k.z), uniform_float(k.w));
    set_path_origin(scene, slot, ray.o);
    set_path_direction(scene, slot, ray.d);
#endif
    set_path_sample_weight(scene, slot, weight);
    set_path_channel(scene, slot, job % CLVOL_JOBS_PER_SAMPLE);
    set_path_beta(scene, slot, (Spectrum)(1.0f));
    set_path_radiance(scene, slot, (Spectrum)(0.0f));
    set_path_pixel(scene, slot, key.pixel);
    set_path_sample(scene, slot, key.sample);
    set_path_bounce(scene, slot, 0);
    reset_counts(scene, slot);
    set_path_pdf(scene, slot, 0.0f);
    set_path_depth(scene, slot, 0.0f);
    set_path_normal(scene, slot, (float3)(0.0f));
    set_path_albedo(scene, slot, (float3)(0.0f));
    set_path_position(scene, slot, (float3)(0.0f));
    set_path_met(scene, slot, 0.0f);
    set_path_alpha(scene, slot, weight);
    reset_path(scene, slot);
}

/* The next job, or NO_JOB.  The counter is looked at before it is touched, so that idle slots do not fight over it at
   the end of a render. */
INLINE uint take_job(const Scene *scene)
{
    const uint limit = scene->counters[COUNTER_JOB_LIMIT];
    if (scene->counters[COUNTER_NEXT_JOB] >= limit)
        return NO_JOB;
    const uint job = atomic_inc(scene->counters + COUNTER_NEXT_JOB);
    if (job < limit)
        return job;
    atomic_dec(scene->counters + COUNTER_NEXT_JOB);
    return NO_JOB;
}

/* A finished path writes its result; the slot takes the next job, whose camera ray will be drawn, or is left idle. */
INLINE bool generate_begins(const Scene *scene, uint group, uint slot, Draws *draws)
{
    const uint finished = path_job(scene, slot);
    if (finished != NO_JOB)
        write_result(scene, slot, finished);
    const uint job = take_job(scene);
    set_path_job(scene, slot, job);
    if (job == NO_JOB) {
        to_idle(scene, group, slot);
        return false;
    }
    draws->key = job_key(scene, job);
    draws->block = BLOCK_CAMERA;
    draws->segment = 0;
    return true;
}

INLINE void generate(const Scene *scene, uint group, uint slot, const Draws *draws)
{
    start_job(scene, slot, path_job(scene, slot), draws);
    to_intersect(scene, group, slot);
}

/* Slots left idle earlier, now that the limit may have risen. */
INLINE void wake_idle(const Scene *scene, uint group)
{
    if (*idle_slots(scene, group) == 0 || scene->counters[COUNTER_NEXT_JOB] >= scene->counters[COUNTER_JOB_LIMIT])
        return;
    for (uint i = get_local_id(0); i < CLVOL_GROUP_SLOTS; i += CLVOL_LOCAL_SIZE) {
        const uint slot = group * CLVOL_GROUP_SLOTS + i;
        if (path_job(scene, slot) == NO_JOB) {
            group_atomic_add(idle_slots(scene, group), -1u);
            from_idle(scene, group, slot);
        }
    }
}

#endif
