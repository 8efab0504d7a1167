/* Transmittance by a power series: T = exp(-c) sum of (c - tau)^k / k!, every factor an independent, unbiased
   estimate of c - tau, the order chosen by roulette (Georgiev et al. 2019; METHODS §4).

   tau is estimated by a comb: look-ups at even steps of the majorant's optical depth, with one random offset,
   each worth step * sigma_t / sigma_maj (Kettunen et al. 2021).  The pivot c is such an estimate itself,
   drawn apart, so that the factors are small. */
#include "core/random.h"
#include "majorant/majorant.h"
#include "tracking/transmittance.h"

/* Look-ups of a comb per unit of the majorant's optical depth, and at most: beyond that its even steps round
   alike, and cost more than they tell. */
#define COMB_DENSITY 1.0f
#define COMB_MOST 1e4f
/* A series whose order reaches this, or that has taken so many look-ups, is given up and counted: terms have long been
   nothing by then, or have grown beyond what cancels in floats. */
#define SERIES_BUDGET 4096
#define SERIES_LOOKUPS (1u << 18)

/* Combs longer than LONG_COMB are worth a short one first: where that finds the medium thick, roulette
   spares most of the long ones.  Survivors weigh at most 1 / LEAST_SURVIVAL more. */
#define LONG_COMB 64.0f
#define SHORT_COMB 16.0f
#define LEAST_SURVIVAL 1e-3f

INLINE float majorant_depth(const MediumRay *in, Tally *tally)
{
    float depth = 0.0f;
    MajorantWalk walk = majorant_begin(in);
    while (majorant_next(in, &walk)) {
        tally->cells += 1;
        depth += walk.majorant * (walk.t_end - walk.t);
    }
    return depth;
}

INLINE Extinction comb_estimate(const MediumRay *in, float offset, float step, Stream *stream, Tally *tally)
{
    Extinction tau = (Extinction)(0.0f);
    float depth = offset; /* to the next tooth */
    MajorantWalk walk = majorant_begin(in);
    while (majorant_next(in, &walk)) {
        const float length = walk.t_end - walk.t, whole = walk.majorant * length;
        Extinction sum = (Extinction)(0.0f);
        float at = depth; /* of tooth n, from the cell's entry: depth + n step, so that roundings do not add up */
        tally->cells += 1;
        for (uint n = 1; at < whole; ++n) {
            const float t = walk.t + min_of(at / walk.majorant, length);
            const Extinction sigma_t = extinction_at(in, in->index_ray.o + t * in->index_ray.d, stream, tally);
            tally->violations += extinction_max(sigma_t) > walk.majorant ? 1 : 0;
            tally->tentative += 1;
            sum += sigma_t;
            at = depth + (float)n * step;
        }
        depth = at - whole;
        if (walk.majorant > 0.0f)
            tau += sum * (step / walk.majorant);
    }
    return tau;
}

INLINE Extinction estimate_transmittance(const MediumRay *in, uint first, Stream *stream, Tally *tally)
{
    const float whole = majorant_depth(in, tally);
    if (!(whole > 0.0f))
        return (Extinction)(1.0f);
    if (!(whole < INFINITY))
        return (Extinction)(0.0f);
    const float teeth = min_of(1.0f + COMB_DENSITY * whole, COMB_MOST); /* a fraction of one is fine */
    const bool is_long = teeth > LONG_COMB;
    Extinction pivot = (Extinction)(0.0f), sum = (Extinction)(0.0f), term = (Extinction)(0.0f);
    const uint before = tally->lookups;
    float weight = 1.0f;
    uint k = first;
    /* order -1 (of long combs): roulette; 0: the pivot; 1 and more: terms */
    for (int order = is_long ? -1 : 0; order < SERIES_BUDGET && tally->lookups - before < SERIES_LOOKUPS; ++order) {
        const float step = whole / (order < 0 ? SHORT_COMB : teeth);
        const Extinction tau = comb_estimate(in, uniform_float(k) * step, step, stream, tally);
        const uint2 next = stream_pair(stream);
        k = next.y;
        if (order < 0) {
            const float survival = clamp_to(exp(2.0f - 0.5f * extinction_least(tau)), LEAST_SURVIVAL, 1.0f);
            if (survival < 1.0f && !(uniform_float(next.x) < survival))
                return (Extinction)(0.0f);
            weight = 1.0f / survival;
            continue;
        }
        float goes_on = 1.0f; /* probability of the next order */
        if (order == 0) {
            pivot = tau;
            sum = term = exp_of_minus(pivot) * weight;
        } else {
            const Extinction x = pivot - tau;
            term *= x * (1.0f / (float)order);
            sum += term;
            goes_on = clamp_to(2.0f * extinction_max(x) / (float)(order + 1), 0.1f, 1.0f);
        }
        if (goes_on < 1.0f) {
            if (!(uniform_float(next.x) < goes_on))
                return sum;
            term *= 1.0f / goes_on;
        }
    }
    tally->exhausted += 1;
    return (Extinction)(0.0f);
}
