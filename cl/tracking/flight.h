/* The loop that most trackers are: a walk at rate sigma_maj, with the majorant of each cell as its bound. */
#ifndef CLVOL_TRACKING_FLIGHT_H
#define CLVOL_TRACKING_FLIGHT_H
#include "core/random.h"
#include "majorant/majorant.h"
#include "tracking/walk.h"

/* A walk of rate sigma_maj, from tentative collision to tentative collision through all cells. */
typedef struct {
    MajorantWalk walk;
    Segment segment;
    float depth; /* still to go; the tracker draws it anew at each tentative collision */
    uint steps;  /* still allowed */
} Flight;

INLINE Flight flight_begin(const MediumRay *in, uint first)
{
    Flight flight;
    flight.walk = majorant_begin(in);
    flight.segment = segment_of(in, 0.0f, 0.0f, 0.0f); /* empty: the first cell is still to be entered */
    flight.depth = exponential_variate(first);
    flight.steps = WALK_STEPS;
    return flight;
}

/* Moves on to the next tentative collision; false at the end of the ray, or where the walk stops short. */
INLINE bool flight_next(const MediumRay *in, Flight *flight, Tally *tally)
{
    if (flight->steps-- == 0) {
        stop_walk(segment_t(&flight->segment), tally);
        return false;
    }
    while (!next_tentative(&flight->segment, &flight->depth, tally)) {
        if (!majorant_next(in, &flight->walk))
            return false;
        flight->segment = segment_of(in, flight->walk.t, flight->walk.t_end, flight->walk.majorant);
        tally->cells += 1;
    }
    return true;
}

#endif
