/* One decision of a pilot: predict, and decide how the vehicle moves. OnlineLoop of pilot/online_loop.py in C, with what
   pilot/piloting.py says of the state from which is planned. */
#ifndef GBT_DECIDE_H
#define GBT_DECIDE_H

#include "gbt_pilot.h"

GBT_BEGIN_C

/* Whether so many numbers are finite. */
int gbt_finite(const gbt_real *x, int count);

/* The last navigation in time, or 0. */
const gbt_own_state *gbt_latest(const gbt_pilot *pilot);

/* Flat output and its rate now, GBT_FLAT each: since the last navigation as planned, where a plan is followed. */
void gbt_carry_on(const gbt_pilot *pilot, const gbt_own_state *own, double time, gbt_real *z, gbt_real *dz);

/* Predicts and decides; 0 where numbers are so large that nothing can be decided. */
int gbt_decide(gbt_pilot *pilot, double time, const gbt_real *z, const gbt_real *dz);

/* Number j of the velocity of the water for which the plan that is followed was made; 0 of an angle, and in still water. */
gbt_real gbt_water(const gbt_pilot *pilot, int j);

GBT_END_C

#endif
