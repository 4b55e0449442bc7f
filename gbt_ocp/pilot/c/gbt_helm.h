/* The helm of a vehicle that is not flat: from a velocity to the inputs that steer towards it. guidance/helm.py in C. */
#ifndef GBT_HELM_H
#define GBT_HELM_H

#include "gbt_pilot_settings.h"
#include "gbt_solver.h"

GBT_BEGIN_C

#if GBT_SHOOTING

typedef struct {
    int steered; /* whether inputs were given before */
    gbt_real last[GBT_INPUTS];
} gbt_helm;

/* The velocity to steer for first, m/s, GBT_DIMENSION, in place of the one to be reached: away from the target where the
   course is more than a right angle off the heading, until the vehicle has turned to that side.

   z      measured pose, GBT_FLAT
   mean   posterior mean of the target's position now, GBT_DIMENSION, m */
void gbt_helm_turning_away(const gbt_real *z, const gbt_real *mean, gbt_real *velocity);

/* Inputs that steer towards a velocity in m/s, GBT_DIMENSION, at a pose and its rate, GBT_FLAT each. */
void gbt_helm_reach(gbt_helm *helm, const gbt_real *z, const gbt_real *dz, const gbt_real *velocity, gbt_real *inputs);

/* Generated: inputs, within their limits, of a share of the push ahead and one of the turn to port. */
void gbt_steering(const gbt_real *push_and_turn, const gbt_real *second, const gbt_real *third, gbt_real *inputs);

#endif

GBT_END_C

#endif
