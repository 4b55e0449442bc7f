/* The desired bearing, a point that runs around a circle, and the pace at which it does: the same as DesiredBearing of
   models/bearings.py, PacedBearing of guidance/pacing.py and SweptBearing of guidance/swept.py. Times are in seconds, and double in both precisions. */
#ifndef GBT_DESIRED_H
#define GBT_DESIRED_H

#include "gbt_problem.h"

GBT_BEGIN_C

typedef struct {
    double rate;      /* of the turn, rad/s */
    double phase;     /* angle on the circle at time 0, rad */
    double reverse;   /* seconds after which the turn changes its sense; 0 for never */
    double leg_start; /* time at which it begins to go in the sense of the rate */
    gbt_real axis[3]; /* of the circle in space, a unit vector; not read in the plane */
    double speed;     /* that going round the target may ask for, m/s, over the radius of the circle; 0: not paced */
    double across;    /* speed of the vehicle that it asks for, m/s; 0: a turn by the clock */
    double changed;   /* time of the last change of pace, */
    double turned;    /* seconds of turning until then, */
    double pace;      /* and share of the rate since then */
} gbt_desired;

/* From a time on, turn as fast as a target at a distance in metres allows. */
void gbt_desired_pace(gbt_desired *desired, double time, double distance);

/* Shifts the turn so that at a time it is as near as it gets to a bearing. */
void gbt_desired_begin_at(gbt_desired *desired, double time, const gbt_real *bearing);

/* The same, with a leg that begins then, in the sense in which the line of sight turns already: from the line to the
   target and the velocity of its end relative to its beginning. Without reversals nothing is done. */
void gbt_desired_reverse_from(gbt_desired *desired, double time, const gbt_real *line, const gbt_real *velocity);

/* The desired bearings at the ends of a plan that begins at a time with a line to the target, (pieces, dimension), for
   `across` and what of the target is expected at the beginning and at those ends, (pieces + 1, dimension). */
void gbt_desired_sweep(const gbt_desired *desired, double time, const gbt_real *line,
                       gbt_real target[GBT_PIECES + 1][GBT_DIMENSION], gbt_real bearings[GBT_PIECES][GBT_DIMENSION]);

/* The desired bearing at a time, GBT_DIMENSION. */
void gbt_desired_at(const gbt_desired *desired, double time, gbt_real *bearing);

GBT_END_C

#endif
