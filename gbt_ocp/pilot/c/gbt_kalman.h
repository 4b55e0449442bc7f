/* The measurement update of a Kalman filter: tracking/filters/kalman.py in C. */
#ifndef GBT_KALMAN_H
#define GBT_KALMAN_H

#include "gbt_linalg.h"
#include "gbt_pilot_settings.h"
#include "gbt_problem.h"

GBT_BEGIN_C

#define GBT_KINEMATIC (GBT_BLOCKS_OF_STATE * GBT_DIMENSION) /* position, velocity, and the acceleration where there is one */
#define GBT_N (GBT_KINEMATIC + GBT_SIZED) /* and the log of the size where it is estimated */
#if GBT_N > GBT_LARGEST
#error "a state has more numbers than a matrix can have rows"
#endif
#define GBT_MOST_ROWS GBT_DIMENSION           /* of a measurement */

/* Conditions a state on value = observation x + noise of independent rows, by Joseph's form of a square root of the
   covariance, which keeps it positive semidefinite. 0, and the state as it was, where the innovation has no inverse. The
   logarithm of the density of the observation may be 0. */
int gbt_kalman_update(gbt_real mean[GBT_N], gbt_real covariance[GBT_N][GBT_N], int rows,
                      gbt_real observation[GBT_MOST_ROWS][GBT_N], const gbt_real *std, const gbt_real *innovation,
                      gbt_real *log_likelihood);

GBT_END_C

#endif
