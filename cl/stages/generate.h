/* Writes a finished path's result at its job's own index and starts the next job in its slot. */
#ifndef CLVOL_STAGES_GENERATE_H
#define CLVOL_STAGES_GENERATE_H
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

/* Offset of the sample from the pixel's corner along one axis, drawn from the pixel filter's magnitude; a filter
   that reaches over the window's edge is cut there and renormalised.  A filter f with negative parts multiplies
   `weight` by sign(f) times the integral of |f| over that of f. */
INLINE float filter_offset(const Scene *scene, uint k, int pixel, int pixels, float *weight)
{
#if CLVOL_HAS_FILTER_TABLE
    __global const float *cdf = scene->filter_cdf;
    const int bins = scene->render->filter_bins;
    const float radius = scene->render->filter_radius;
    const float per_unit = (float)bins / (2.0f * radius);
    float lower = 0.0f, upper = 1.0f;
    float net = CLVOL_HAS_SIGNED_FILTER ? cdf[2 * bins + 1] : 1.0f; /* integral of the filter itself */
    if (!scene->render->sample_border) {
        const float from = clamp_to((radius - 0.5f - (float)pixel) * per_unit, 0.0f, (float)bins);
        const float to = clamp_to((radius - 0.5f + (float)(pixels - pixel)) * per_unit, 0.0f, (float)bins);
        const int a = min_int((int)from, bins - 1), b = min_int((int)to, bins - 1);
        lower = lerp(cdf[a], cdf[a + 1], from - (float)a);
        upper = lerp(cdf[b], cdf[b + 1], to - (float)b);
        if (CLVOL_HAS_SIGNED_FILTER) {
            __global const float *sums = cdf + bins + 1;
            net = lerp(sums[b], sums[b + 1], to - (float)b) - lerp(sums[a], sums[a + 1], from - (float)a);
        }
    }
    const float u = min_of(lerp(lower, upper, uniform_below_one(k)), 0x1.fffffep-1f); /* below the last bin's end */
    int first = 0, last = bins - 1;
    while (first < last) {
        const int middle = (first + last) >> 1;
        if (cdf[middle + 1] > u)
            last = middle;
        else
            first = middle + 1;
    }
    if (CLVOL_HAS_SIGNED_FILTER)
        *weight *= with_sign((upper - lower) / net, cdf[bins + 2 + first] - cdf[bins + 1 + first]);
    const float in_bin = (u - cdf[first]) / (cdf[first + 1] - cdf[first]);
    return 0.5f - radius + ((float)first + in_bin) / per_unit;
#else
    return uniform_float(k);
#endif
}

#if !CLVOL_HAS_METER
/* Starts the camera ray of film position (x, y); u and v place it on the lens, uniformly over its disk. */
INLINE void set_camera_ray(const Scene *scene, uint slot, float x, float y, float u, float v)
{
    __global const Render *render = scene->render;
    float3 origin = load_vector(render->camera_position) + x * load_vector(render->camera_dx) +
                    y * load_vector(render->camera_dy);
    float3 towards = load_vector(render->camera_base) + x * load_vector(render->camera_base_dx) +
                     y * load_vector(render->camera_base_dy);
    if (CLVOL_HAS_LENS) {
        const float2 place = sqrt_of(u) * cos_sin_turn(v);
        const float3 lens = place.x * load_vector(render->lens_x) + place.y * load_vector(render->lens_y);
        origin += render->lens_start * lens;
        towards -= render->lens_bend * lens;
    }
    set_path_origin(scene, slot, origin);
    set_path_direction(scene, slot, unit_of(towards));
}
#endif

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
    set_camera_ray(scene, slot, x, y, uniform_float(k.z), uniform_float(k.w));
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
