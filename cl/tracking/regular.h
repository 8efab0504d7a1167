/* Regular tracking: the free flight by inverting the exact optical depth, piece by piece; no tentative
   collisions, no noise but that of the distance itself (Sutton et al. 1999; METHODS §3).

   The majorant only tells where the medium is empty.  Several channels: the flight is drawn from one and
   weighted over the mixture (tracking/channels.h). */
#include "density/segments.h"
#include "tracking/channels.h"
#include "tracking/collision.h"

#define NEWTON_STEPS 16

/* Where in [0, 8] the integral of one channel reaches `target`: Newton's method, kept between bounds that
   bisection narrows (METHODS §3). */
INLINE float invert_cubic(const Cubic *cubic, int channel, float target)
{
    float lower = 0.0f, upper = 8.0f;
    const float whole = channel_of(cubic_integral(cubic, upper), channel);
    float w = whole > target ? upper * (target / whole) : upper;
    for (int step = 0; step < NEWTON_STEPS; ++step) {
        const float excess = channel_of(cubic_integral(cubic, w), channel) - target;
        const float slope = channel_of(cubic_value(cubic, w), channel);
        if (excess > 0.0f)
            upper = w;
        else
            lower = w;
        float next = w - excess / slope;
        if (!(next > lower && next < upper)) /* also where the slope is 0 */
            next = 0.5f * (lower + upper);
        if (abs_of(next - w) <= 1e-6f * next)
            break;
        w = next;
    }
    return w;
}

INLINE bool sample_collision(const MediumRay *in, uint first, Stream *stream, Tally *tally, Collision *collision)
{
    const float target = exponential_variate(first);
    const int channel = pick_channel(collision->beta, stream_pair(stream));
    Extinction depth = (Extinction)(0.0f);
    uint budget = WALK_BUDGET;
    MajorantWalk walk = majorant_begin(in);
    while (majorant_next(in, &walk)) {
        tally->cells += 1;
        if (walk.majorant == 0.0f)
            continue;
        const float3 start = in->ray.o + walk.t * in->ray.d;
        LatticeWalk piece = segments_begin(in, walk.t, walk.t_end);
        while (lattice_next(&piece)) {
            const Extinction part = segment_depth(in, start, &piece, stream, tally);
            if (channel_of(depth + part, channel) >= target) {
                const Cubic cubic = segment_cubic(in, start, &piece, stream, tally);
                const float unit = 0.125f * (piece.t_end - piece.t);
                const float w = invert_cubic(&cubic, channel, (target - channel_of(depth, channel)) / unit);
                const float t = walk.t + piece.t + w * unit;
                depth += unit * cubic_integral(&cubic, w);
                collision->beta = balanced(collision->beta, cubic_value(&cubic, w), depth);
                collect_emission(in, t, collision->beta, collision);
                tally->tentative += 1;
                return real_collision(t, tally, collision);
            }
            depth += part;
            if (--budget == 0) {
                tally->exhausted += 1;
                return false;
            }
        }
    }
    collision->beta = balanced(collision->beta, (Extinction)(1.0f), depth);
    return false;
}
