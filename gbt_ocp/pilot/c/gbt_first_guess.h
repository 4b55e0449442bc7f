/* Where a filter begins at the first measurement: FirstGuess of tracking/filters/ekf.py in C. */
#ifndef GBT_FIRST_GUESS_H
#define GBT_FIRST_GUESS_H

#include "gbt_sighting.h"

GBT_BEGIN_C

typedef struct {
    gbt_real bearing_std; /* of an angle that does not state its deviation, rad */
    gbt_real range;       /* at which the first bearing puts the target, m, */
    gbt_real range_std;   /* and its deviation */
    gbt_real speed_std;   /* of each component of the velocity at the start, m/s */
    int known;            /* 1: the position at the first measurement is known */
    gbt_real mean[GBT_DIMENSION], covariance[GBT_DIMENSION][GBT_DIMENSION];
} gbt_first_guess;

/* The position before the first measurement is taken; 0 if that does not say where the target is and nothing else does.
   `known` says whether the position still is, `zero` where its coordinates begin. */
int gbt_guess(const gbt_first_guess *guess, int known, const gbt_real *zero, const gbt_sighting *sighting, gbt_real *mean,
              gbt_real covariance[GBT_DIMENSION][GBT_DIMENSION]);

GBT_END_C

#endif
