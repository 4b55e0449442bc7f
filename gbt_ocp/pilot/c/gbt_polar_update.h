/* The update of a filter in the direction, the log range, and velocities over the range: the same as
   tracking/filters/polar_update.py, which says why. */
#ifndef GBT_POLAR_UPDATE_H
#define GBT_POLAR_UPDATE_H

#include "gbt_kalman.h"
#include "gbt_polar.h"

GBT_BEGIN_C

#define GBT_OF_BINS GBT_SENSORS /* number, among sensors, of the means of bins */

/* Velocities of sensors, from where they were at their measurements. */
typedef struct {
    int seen[GBT_SENSORS + 1];
    double time[GBT_SENSORS + 1];
    gbt_real position[GBT_SENSORS + 1][GBT_DIMENSION];
    gbt_real velocity[GBT_DIMENSION]; /* of the sensor that measured last, 0 before one has measured twice */
} gbt_own_velocities;

/* Takes note of where a sensor was; `velocity` is then the one to update with. */
void gbt_own_velocity(gbt_own_velocities *own, const gbt_sighting *sighting);

/* Conditions a state on the rows of a measurement, made at its position. own and own_velocity are the sensor's; the
   velocity chooses the coordinates and is no measurement. 0, and the state as it was, where that has no inverse. The
   logarithm of the density of the measurement may be 0. */
int gbt_polar_update(gbt_real mean[GBT_N], gbt_real covariance[GBT_N][GBT_N], const gbt_polar_rows *rows,
                     const gbt_real *own, const gbt_real *own_velocity, gbt_real *log_likelihood);

GBT_END_C

#endif
