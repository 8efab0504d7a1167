/* Regular transmittance: the exact optical depth, segment by segment, no variance (METHODS §4).  The majorant only
   tells where the medium is empty. */
#include "density/segments.h"
#include "majorant/majorant.h"
#include "tracking/transmittance.h"

INLINE Extinction estimate_transmittance(const MediumRay *in, uint first, Stream *stream, Tally *tally)
{
    Extinction depth = (Extinction)(0.0f);
    uint steps = WALK_STEPS;
    MajorantWalk walk = majorant_begin(in);
    while (majorant_next(in, &walk)) {
        tally->cells += 1;
        if (walk.majorant == 0.0f)
            continue;
        const float3 start = in->index_ray.o + walk.t * in->index_ray.d;
        SegmentWalk segment = segments_begin(in, walk.t, walk.t_end);
        while (segments_next(&segment)) {
            const SegmentCell cell = segment_cell(in, start, segment.t, segment.t_end, tally);
            depth += segment_depth(in, &cell);
            if (--steps == 0) {
                stop_walk(walk.t + segment.t_end, tally);
                return exp_of_minus(depth);
            }
        }
    }
    return exp_of_minus(depth);
}
