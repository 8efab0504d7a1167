/* Which media a ray is in, and where.

   A medium is bounded by a shape, which cuts a span out of the ray, or by boundaries, of which a path carries one bit
   each.  Its presence is the number of boundaries that hold it minus the number of those that keep it out; its
   coefficients are multiplied by it (METHODS §6). */
#ifndef CLVOL_STAGES_MEDIA_H
#define CLVOL_STAGES_MEDIA_H
#if CLVOL_HAS_MEDIA
#include "core/scene.h"
#include "geometry/span.h"
#include "stages/medium_ray.h"

INLINE int medium_presence(const Scene *scene, uint m, const Inside *inside)
{
    int presence = scene->media[m].presence;
#if CLVOL_BOUNDARY_WORDS > 0
    __global const uint *holds = scene->boundary_masks + 2 * CLVOL_BOUNDARY_WORDS * m;
    for (int w = 0; w < CLVOL_BOUNDARY_WORDS; ++w)
        presence += (int)popcount(inside->word[w] & holds[w]) -
                    (int)popcount(inside->word[w] & holds[CLVOL_BOUNDARY_WORDS + w]);
#endif
    return presence;
}

/* The segment of the ray between `from` and `to` that lies in medium m; false where there is none. */
INLINE bool medium_segment(const Scene *scene, uint m, Ray ray, const Inside *inside, float from, float to, Span *span)
{
    if (CLVOL_BOUNDARY_WORDS > 0 && medium_presence(scene, m, inside) <= 0)
        return false;
    return medium_span(scene->media + m, ray, from, to, span);
}

/* One medium on a segment of a ray. */
typedef struct {
    int medium; /* -1: none yet */
    float start; /* ray parameter */
    Span span;
} MediumSegment;

/* The next one, in the order of entry, ties by number, that begins before `limit`; false at the last. */
INLINE bool next_medium_segment(const Scene *scene, Ray ray, const Inside *inside, float from, float to, float limit,
                                MediumSegment *segment)
{
    MediumSegment next = {-1, limit, {0.0f, limit, limit}};
    for (int m = 0; m < (int)scene->render->media; ++m) {
        Span span;
        if (!medium_segment(scene, (uint)m, ray, inside, from, to, &span))
            continue;
        const float t0 = span_t(&span);
        const bool is_later = segment->medium < 0 || t0 > segment->start ||
                              (t0 == segment->start && m > segment->medium);
        if (is_later && t0 < next.start) {
            next.medium = m;
            next.start = t0;
            next.span = span;
        }
    }
    *segment = next;
    return next.medium >= 0;
}

/* The medium's coefficients where it is present several times. */
INLINE MediumRay segment_ray(const Scene *scene, const Inside *inside, int m, Ray world, float length, int channel)
{
    MediumRay in = medium_ray(scene, scene->media + m, world, min_of(length, 1e30f), channel);
#if CLVOL_BOUNDARY_WORDS > 0
    const float presence = (float)medium_presence(scene, (uint)m, inside);
    in.scale *= presence;
    in.rate *= presence;
#endif
    return in;
}

/* Which of the random numbers of a bounce a walk takes. */
INLINE uint walk_number(const Scene *scene, uint segment, int m) { return segment * scene->render->media + (uint)m; }

#endif
#endif
