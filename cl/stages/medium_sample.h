/* Walks one interval of one medium to a collision or to the interval's end. */
#ifndef CLVOL_STAGES_MEDIUM_SAMPLE_H
#define CLVOL_STAGES_MEDIUM_SAMPLE_H

INLINE void medium_sample(const Scene *scene, uint group, uint slot)
{
    const SampleKey key = path_key(scene, slot);
#if CLVOL_HAS_MANY_MEDIA
    const uint interval = path_interval(scene, slot);
    const float start = path_interval_start(scene, slot);
    __global const Medium *medium = scene->media + path_medium(scene, slot);
#else
    const uint interval = 0;
    const float start = 0.0f;
    __global const Medium *medium = scene->media;
#endif
    Ray ray = path_ray(scene, slot);
    ray.o += start * ray.d;
    const float t_max = path_interval_end(scene, slot) - start;
    const uint4 k = decision_block(render_seed(scene), key, BLOCK_WALK, interval);
    Collision collision;
    collision.channel = (int)path_channel_or_zero(scene, slot);
    bool collided = false;
#if CLVOL_HAS_HOMOGENEOUS
    if (!CLVOL_HAS_HETEROGENEOUS || medium->homogeneous)
        collided = homogeneous_collision(medium->sigma_t[collision.channel], t_max, k.x, &collision);
#endif
#if CLVOL_HAS_HETEROGENEOUS
    if (!CLVOL_HAS_HOMOGENEOUS || !medium->homogeneous) {
        Stream stream = stream_begin(k.z, k.w);
        Tally tally = {0, 0, 0};
        const Ray index_ray = transform_ray(scene->volumes[medium->sigma_t_volume].world_to_index, ray);
        collided = sample_collision(scene, medium, index_ray, t_max, k.x, &stream, &tally, &collision);
        record_tally(scene, slot, tally);
    }
#endif
#if CLVOL_HAS_OVERLAP
    if (collided) {
        set_path_hit_medium(scene, slot, path_medium(scene, slot));
        set_path_hit_distance(scene, slot, start + collision.t);
    }
    queue_push(scene, group, QUEUE_INTERSECT, slot);
#else
    if (collided) {
        set_path_origin(scene, slot, ray.o + collision.t * ray.d);
        set_path_event(scene, slot, EVENT_COLLISION);
    }
#if CLVOL_HAS_MANY_MEDIA
    queue_push(scene, group, collided ? QUEUE_SHADE : QUEUE_INTERSECT, slot);
#else
    if (!collided)
        set_path_event(scene, slot, EVENT_ESCAPE);
    queue_push(scene, group, QUEUE_SHADE, slot);
#endif
#endif
}

#endif
