/* Writes a finished path's result at its job's own index and starts the next job in its slot. */
#ifndef CLVOL_STAGES_GENERATE_H
#define CLVOL_STAGES_GENERATE_H

/* A job is one sample of one pixel, or, where a path follows one channel, a third of it; consecutive jobs are
   channels of a sample and samples of a pixel, so that rays that run together stay together. */
INLINE void write_result(const Scene *scene, uint slot, uint job)
{
    const uint ring_jobs = scene->render->pass_jobs * scene->render->ring_passes;
    const uint place = job % ring_jobs;
    const Spectrum radiance = get_radiance(scene, slot);
#if CLVOL_SPECTRUM == 1
    scene->results[place] = radiance;
#else
    vstore3(radiance, place, scene->results);
#endif
    write_counts(scene, slot, place);
    atomic_inc(scene->control + CONTROL_DONE + place / scene->render->pass_jobs);
}

/* Offset of the sample from the pixel's corner along one axis, drawn from the pixel filter; a filter
   that reaches over the film's edge is cut there and renormalised. */
INLINE float filter_offset(const Scene *scene, uint k, int pixel, int pixels)
{
#if CLVOL_HAS_FILTER_TABLE
    const int bins = scene->render->filter_bins;
    const float radius = scene->render->filter_radius;
    const float per_unit = (float)bins / (2.0f * radius);
    float lower = 0.0f, upper = 1.0f;
    if (!scene->render->sample_border) {
        const float from = clamp_to((radius - 0.5f - (float)pixel) * per_unit, 0.0f, (float)bins);
        const float to = clamp_to((radius - 0.5f + (float)(pixels - pixel)) * per_unit, 0.0f, (float)bins);
        const int a = min_int((int)from, bins - 1), b = min_int((int)to, bins - 1);
        lower = lerp(scene->filter_cdf[a], scene->filter_cdf[a + 1], from - (float)a);
        upper = lerp(scene->filter_cdf[b], scene->filter_cdf[b + 1], to - (float)b);
    }
    const float u = min_of(lerp(lower, upper, uniform_below_one(k)), 0x1.fffffep-1f); /* below the last bin's end */
    int first = 0, last = bins - 1;
    while (first < last) {
        const int middle = (first + last) >> 1;
        if (scene->filter_cdf[middle + 1] > u)
            last = middle;
        else
            first = middle + 1;
    }
    const float in_bin = (u - scene->filter_cdf[first]) / (scene->filter_cdf[first + 1] - scene->filter_cdf[first]);
    return 0.5f - radius + ((float)first + in_bin) / per_unit;
#else
    return uniform_float(k);
#endif
}

INLINE void start_job(const Scene *scene, uint slot, uint job)
{
    __global const Render *render = scene->render;
    const uint pass = job / render->pass_jobs;
    const uint in_pass = job % render->pass_jobs / CLVOL_JOBS_PER_SAMPLE; /* its sample within the pass */
    const uint samples = pass == render->last_pass ? render->last_samples : render->pass_samples;
    const uint pixel = in_pass / samples;
    SampleKey key;
    key.pixel = pixel;
    key.sample = render->first_sample + pass * render->pass_samples + in_pass % samples;
    key.bounce = 0;
    const uint4 k = decision_block(render_seed(scene), key, BLOCK_CAMERA, 0);
    const int width = render->film_size[0];
    const int px = (int)(pixel % (uint)width), py = (int)(pixel / (uint)width);
    const float x = (float)px + filter_offset(scene, k.x, px, width);
    const float y = (float)py + filter_offset(scene, k.y, py, render->film_size[1]);
    set_path_origin(scene, slot, load_vector(render->camera_position) + x * load_vector(render->camera_dx) +
                                     y * load_vector(render->camera_dy));
    set_path_direction(scene, slot, normalize(load_vector(render->camera_base) + x * load_vector(render->camera_base_dx) +
                                              y * load_vector(render->camera_base_dy)));
#if CLVOL_ONE_CHANNEL_PER_PATH
    set_path_channel(scene, slot, job % CLVOL_JOBS_PER_SAMPLE);
#endif
    set_beta(scene, slot, (Spectrum)(1.0f));
    set_radiance(scene, slot, (Spectrum)(0.0f));
    set_path_pixel(scene, slot, key.pixel);
    set_path_sample(scene, slot, key.sample);
    set_path_job(scene, slot, job);
    set_path_bounce(scene, slot, 0);
    reset_counts(scene, slot);
#if CLVOL_MIS
    set_path_pdf(scene, slot, 0.0f);
#endif
#if CLVOL_HAS_MANY_MEDIA
    set_path_interval(scene, slot, 0);
#endif
#if CLVOL_HAS_OVERLAP
    set_path_hit_medium(scene, slot, -1);
#endif
}

/* Takes the next job for `slot` if there is one.  The counter is looked at before it is touched, so that
   idle slots do not fight over it at the end of a render. */
INLINE bool take_job(const Scene *scene, uint group, uint slot)
{
    const uint limit = scene->control[CONTROL_JOB_LIMIT];
    if (scene->control[CONTROL_NEXT_JOB] >= limit)
        return false;
    const uint job = atomic_inc(scene->control + CONTROL_NEXT_JOB);
    if (job >= limit) {
        atomic_dec(scene->control + CONTROL_NEXT_JOB);
        return false;
    }
    start_job(scene, slot, job);
    queue_push(scene, group, QUEUE_INTERSECT, slot);
    return true;
}

/* A finished path: writes its result and starts the next one, or leaves the slot idle. */
INLINE void generate(const Scene *scene, uint group, uint slot)
{
    write_result(scene, slot, path_job(scene, slot));
    set_path_job(scene, slot, NO_JOB);
    if (!take_job(scene, group, slot))
        atomic_inc(idle_counter(scene, group));
}

/* Slots left idle earlier, now that the limit may have risen. */
INLINE void wake_idle(const Scene *scene, uint group)
{
    if (*idle_counter(scene, group) == 0 || scene->control[CONTROL_NEXT_JOB] >= scene->control[CONTROL_JOB_LIMIT])
        return;
    for (uint i = get_local_id(0); i < CLVOL_GROUP_SLOTS; i += CLVOL_LOCAL_SIZE) {
        const uint slot = group * CLVOL_GROUP_SLOTS + i;
        if (path_job(scene, slot) == NO_JOB && take_job(scene, group, slot))
            atomic_dec(idle_counter(scene, group));
    }
}

#endif
