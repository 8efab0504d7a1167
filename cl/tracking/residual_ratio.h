/* Residual ratio tracking: exp of a control's optical depth, known without look-ups, times ratio tracking of
   what is left (Novák, Selle, Jarosz 2014; METHODS §4).

   Each majorant cell has a control per channel and one rate sigma_r of tentative collisions.  Unbiased for any
   rate; its relative variance is exp(integral of (sigma_t - sigma_c)² / sigma_r) - 1. */
#include "core/random.h"
#include "majorant/majorant.h"
#include "tracking/transmittance.h"

/* Optical depth of the control beyond which it is paid into the estimate: roulette has to see it, and over
   long segments the product alone would run over. */
#define CONTROL_DEPTH 2.0f

INLINE void pay_control(Extinction *transmittance, Extinction *control_depth)
{
    if (extinction_max(*control_depth) > CONTROL_DEPTH) {
        *transmittance *= exp_of_minus(*control_depth);
        *control_depth = (Extinction)(0.0f);
    }
}

INLINE Extinction estimate_transmittance(const MediumRay *in, uint first, Stream *stream, Tally *tally)
{
    Extinction transmittance = (Extinction)(1.0f), control_depth = (Extinction)(0.0f);
    float depth = exponential_variate(first);
    uint steps = WALK_STEPS;
    MajorantWalk walk = majorant_begin(in);
    while (majorant_next(in, &walk)) {
        __global const float *row = cell_row(in, in->scene->residuals, walk.cell, 1);
        const Extinction control = cell_extinction(in, row);
        Segment segment = segment_of(in, walk.t, walk.t_end, in->rate * row[CLVOL_DENSITY_CHANNELS]);
        float paid = 0.0f; /* part of the segment whose control is in control_depth */
        tally->cells += 1;
        while (next_tentative(&segment, &depth, tally)) {
            const Extinction sigma_t = segment_extinction(in, &segment, stream, tally);
            transmittance *= 1.0f - (sigma_t - control) / segment.rate;
            control_depth += control * (segment.t - paid);
            paid = segment.t;
            pay_control(&transmittance, &control_depth);
            const uint2 k = stream_pair(stream);
            if (!transmittance_survives(&transmittance, k.x))
                return (Extinction)(0.0f);
            RECORD_ESTIMATE(segment_t(&segment), transmittance * exp_of_minus(control_depth), tally);
            if (--steps == 0) {
                stop_walk(segment_t(&segment), tally);
                return transmittance * exp_of_minus(control_depth);
            }
            depth = exponential_variate(k.y);
        }
        control_depth += control * (segment.length - paid);
        pay_control(&transmittance, &control_depth);
        if (!transmittance_survives(&transmittance, stream_pair(stream).x))
            return (Extinction)(0.0f);
        RECORD_ESTIMATE(walk.t_end, transmittance * exp_of_minus(control_depth), tally);
    }
    return transmittance * exp_of_minus(control_depth);
}
