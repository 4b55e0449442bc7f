/* What a follower says of what it was asked, and what an autopilot is given in place of thrust. */
#ifndef GBT_SETPOINT_H
#define GBT_SETPOINT_H

#include "gbt_problem.h"

GBT_BEGIN_C

typedef enum {
    GBT_FOLLOWED = 0,
    GBT_FOLLOW_CLIPPED = 1,   /* more thrust was asked for than there is */
    GBT_FOLLOW_NO_PLAN = 2,   /* there is no plan at this time; no thrust */
    GBT_FOLLOW_NOT_FINITE = 3 /* an input is not finite; no thrust */
} gbt_follow_status;

typedef struct {
    gbt_follow_status status;
    gbt_real z[GBT_FLAT], dz[GBT_FLAT]; /* flat output and its rate, over ground */
    gbt_real course;                    /* over ground, counter-clockwise from +x, rad */
    gbt_real speed;                     /* through the water, in the horizontal plane, m/s */
    gbt_real heading;                   /* the first flat output after the position, rad; 0 without one */
    gbt_real depth;                     /* positive down, m; 0 in the plane */
} gbt_setpoint;

GBT_END_C

#endif
