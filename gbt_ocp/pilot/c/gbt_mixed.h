/* Moments of mixtures of Gaussians: tracking/protocol.py in C, part after part. */
#ifndef GBT_MIXED_H
#define GBT_MIXED_H

#include "gbt_problem.h"

GBT_BEGIN_C

#define GBT_RANGE_OBSERVABLE ((gbt_real)0.25) /* deviation of the range over the range below which it counts as known */

/* Adds a part to a mixture of n numbers of which a total weight was added before (West 1979). Mean and covariance of the first
   part replace what was there. */
void gbt_mix(gbt_real *mean, gbt_real *covariance, int n, gbt_real before, gbt_real weight, const gbt_real *part,
             const gbt_real *spread);

/* Moments of positions: of the coordinates, or of direction and log range where at_median is 1. */
typedef struct {
    int at_median;
    gbt_real weight;                /* of the parts so far */
    gbt_real mean[GBT_DIMENSION + 1]; /* direction, log range; or coordinates */
    gbt_real covariance[(GBT_DIMENSION + 1) * (GBT_DIMENSION + 1)];
} gbt_mixed;

void gbt_mixed_begin(gbt_mixed *mixed, int at_median);

/* Adds a position relative to the vehicle, GBT_DIMENSION, and its covariance. */
void gbt_mixed_add(gbt_mixed *mixed, gbt_real weight, const gbt_real *position, const gbt_real *covariance);

/* Mean and covariance in metres; those of direction and log range are mapped at their median. */
void gbt_mixed_moments(const gbt_mixed *mixed, gbt_real *mean, gbt_real *covariance);

/* Deviation of the range over the range to a position relative to the own one, by a covariance with rows of so many numbers:
   not a number where that is not known, infinite at the vehicle. */
gbt_real gbt_relative_range_std(const gbt_real *line, const gbt_real *covariance, int row);

GBT_END_C

#endif
