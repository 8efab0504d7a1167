/* Weighted decomposition tracking, and in several channels at once spectral decomposition tracking
   (Kutz et al. 2017; METHODS §3).

   A constant control of each majorant cell, a little above its least density, is subtracted from it.  An event of
   the control is chosen, without a look-up, with its share P_c of the majorant; the rest of the probability is
   split over real and null events of the residual in proportion to event_rate().  Weights are
   sigma_e / (sigma_maj P_e) with their sign, so that the control may exceed the density. */
#include "tracking/collision.h"
#include "tracking/event_weight.h"
#include "tracking/flight.h"

INLINE bool sample_collision(const MediumRay *in, uint first, Stream *stream, Tally *tally, Collision *collision)
{
    Spectrum beta = collision->beta;
    Flight flight = flight_begin(in, first);
    while (flight_next(in, &flight, tally)) {
        const float majorant = flight.walk.majorant;
        const Extinction control = cell_extinction(in, cell_row(in, in->scene->controls, flight.walk.cell, 0));
        const float t = segment_t(&flight.segment);
        const uint2 k = stream_pair(stream);
        const float part = event_rate(beta, control), rest = event_rate(beta, majorant - control);
        if (!(part + rest > 0.0f))
            break; /* no weight is left in any channel */
        if (choose_event(k.x, part, rest)) {
            collision->beta = beta * event_weight(control, part, part + rest, majorant);
            collect_emission(in, t, collision->beta, collision);
            return real_collision(t, tally, collision);
        }
        const Extinction sigma_t = segment_extinction(in, &flight.segment, stream, tally);
        const Extinction sigma_r = sigma_t - control, sigma_n = majorant - sigma_t;
        tally->violations += extinction_max(sigma_t) > majorant ? 1 : 0;
#if CLVOL_EXTINCTION == 3
        const float of = majorant;
        beta *= (part + rest) / rest;
#else /* the same in two factors, each of which is 1 within the bounds */
        const float of = rest;
        beta *= event_weight(rest, rest, part + rest, majorant);
#endif
        collect_emission(in, t, beta * (sigma_r / of), collision);
        const float real = event_rate(beta, sigma_r), null = event_rate(beta, sigma_n);
        if (!(real + null > 0.0f)) { /* nothing but the control is here: what is left has no weight */
            collision->beta = (Spectrum)(0.0f);
            return false;
        }
        if (choose_event(k.y, real, null)) {
            collision->beta = beta * event_weight(sigma_r, real, real + null, of);
            return real_collision(t, tally, collision);
        }
        beta *= event_weight(sigma_n, null, real + null, of);
        tally->weight = max_of(tally->weight, spectrum_max(beta));
        RECORD_NULL(beta, tally);
        flight.depth = exponential_variate(stream_pair(stream).x);
    }
    collision->beta = beta;
    return false;
}
