/* Analog decomposition tracking: a constant control under the density, found without a look-up.

   The medium is the sum of a control, the minimum of each majorant cell, and a residual; the nearer of
   their collisions is the medium's (Kutz et al. 2017; METHODS §3).  The two races together are one walk
   of rate sigma_maj whose tentative collisions belong to the control with probability sigma_c / sigma_maj:
   these are real, and only the others look the density up. */
#include "tracking/collision.h"
#include "tracking/flight.h"

INLINE bool sample_collision(const MediumRay *in, uint first, Stream *stream, Tally *tally, Collision *collision)
{
    Flight flight = flight_begin(in, first);
    while (flight_next(in, &flight, tally)) {
        const float majorant = flight.walk.majorant;
        const float control = cell_extinction(in, cell_row(in, in->scene->controls, flight.walk.cell, 0));
        const float residual = majorant - control;
        const float t = segment_t(&flight.segment);
        const uint2 k = stream_pair(stream);
        if (choose_event(k.x, control, residual)) {
            collect_emission(in, t, collision->beta, collision); /* sigma_c / (sigma_maj P_c) = 1 */
            return real_collision(t, tally, collision);
        }
        const float sigma_t = segment_extinction(in, &flight.segment, stream, tally);
        tally->violations += sigma_t > majorant || sigma_t < control ? 1 : 0;
        const float sigma_r = sigma_t - control;
        collect_emission(in, t, collision->beta * (sigma_r / residual), collision);
        if (choose_event(k.y, sigma_r, majorant - sigma_t))
            return real_collision(t, tally, collision);
        flight.depth = exponential_variate(stream_pair(stream).x);
    }
    return false;
}
