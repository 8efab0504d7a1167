/* Weighted delta tracking, and in several channels at once spectral tracking (Kutz et al. 2017;
   Galtier et al. 2013; METHODS §3).

   Real and null events are chosen with probabilities P_e in proportion to event_rate(), and the weight of
   every channel is multiplied by sigma_e / (sigma_maj P_e), with its sign: unbiased whatever the
   probabilities, and whether or not sigma_maj bounds sigma_t.  With the rule `history` the mean weight of
   the channels stays as it is as long as sigma_maj bounds them all. */
#include "tracking/collision.h"
#include "tracking/event_weight.h"
#include "tracking/flight.h"

INLINE bool sample_collision(const MediumRay *in, uint first, Stream *stream, Tally *tally, Collision *collision)
{
    Spectrum beta = collision->beta;
    Flight flight = flight_begin(in, first);
    while (flight_next(in, &flight, tally)) {
        const float majorant = flight.walk.majorant;
        const float t = segment_t(&flight.segment);
        const Extinction sigma_t = segment_extinction(in, &flight.segment, stream, tally);
        const Extinction sigma_n = majorant - sigma_t;
        tally->violations += extinction_max(sigma_t) > majorant ? 1 : 0;
        collect_emission(in, t, beta * (sigma_t / majorant), collision);
        const float real = event_rate(beta, sigma_t), null = event_rate(beta, sigma_n);
        const uint2 k = stream_pair(stream);
        if (!(real + null > 0.0f))
            break; /* no weight is left in any channel */
        if (choose_event(k.x, real, null)) {
            collision->beta = beta * event_weight(sigma_t, real, real + null, majorant);
            return real_collision(t, tally, collision);
        }
        beta *= event_weight(sigma_n, null, real + null, majorant);
        tally->weight = max_of(tally->weight, spectrum_max(beta));
        RECORD_NULL(beta, tally);
        flight.depth = exponential_variate(k.y);
    }
    collision->beta = beta;
    return false;
}
