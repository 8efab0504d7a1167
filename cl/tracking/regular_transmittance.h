/* Regular transmittance: the exact optical depth, piece by piece, no variance (METHODS §4).  The majorant only
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
        const float3 start = in->ray.o + walk.t * in->ray.d;
        LatticeWalk piece = segments_begin(in, walk.t, walk.t_end);
        while (lattice_next(&piece)) {
            depth += segment_depth(in, start, &piece, stream, tally);
            if (--steps == 0) {
                stop_walk(walk.t + piece.t_end, tally);
                return exp_of_minus(depth);
            }
        }
    }
    return exp_of_minus(depth);
}
