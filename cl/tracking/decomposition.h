/* Analog decomposition tracking: a constant control under the density, found without a look-up.

   The medium is the sum of a control, the minimum of each majorant cell, and a residual; the nearer of
   their collisions is the medium's (Kutz et al. 2017; METHODS §3).  The two races together are one walk
   of rate sigma_maj whose tentative collisions belong to the control with probability sigma_c / sigma_maj:
   these are real, and only the others look the density up. */
#include "tracking/collision.h"
#include "tracking/walk.h"

INLINE bool sample_collision(const MediumRay *in, uint first, Stream *stream, Tally *tally, Collision *collision)
{
    float depth = exponential_variate(first);
    uint budget = WALK_BUDGET;
    MajorantWalk walk = majorant_begin(in);
    while (majorant_next(in, &walk)) {
        const float majorant = walk.majorant;
        const float control = cell_extinction(in, cell_row(in, in->scene->controls, walk.cell, 0));
        const float residual = majorant - control;
        Stretch stretch = stretch_of(in, walk.t, walk.t_end, majorant);
        tally->cells += 1;
        while (next_tentative(&stretch, &depth, tally)) {
            const float t = stretch.begin + stretch.t;
            const uint2 choice = stream_pair(stream);
            if (choose_event(choice.x, control, residual)) {
                collect_emission(in, t, collision->beta, collision); /* sigma_c / (sigma_maj P_c) = 1 */
                return real_collision(t, tally, collision);
            }
            const float sigma_t = extinction_at(in, stretch_point(in, &stretch), stream, tally);
            tally->violations += sigma_t > majorant || sigma_t < control ? 1 : 0;
            const float sigma_r = sigma_t - control;
            collect_emission(in, t, collision->beta * (sigma_r / residual), collision);
            if (choose_event(choice.y, sigma_r, majorant - sigma_t))
                return real_collision(t, tally, collision);
            if (--budget == 0) {
                tally->exhausted += 1;
                return false;
            }
            depth = exponential_variate(stream_pair(stream).x);
        }
    }
    return false;
}
