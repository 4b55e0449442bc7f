/* Gaussians in log-polar coordinates, one for each time at which the turn rate may have been drawn last:
   tracking/held/bank.py in C, which says why. A component is an extended Kalman filter of azimuth, log range, course, turn
   rate, level of the log speed and deviation from it; in space of elevation and vertical speed too; last of the log of the
   size where it is estimated. */
#ifndef GBT_HELD_BANK_H
#define GBT_HELD_BANK_H

#include "gbt_bearing.h"
#include "gbt_linalg.h"
#include "gbt_pilot_settings.h"

GBT_BEGIN_C

enum { GBT_AT_AZIMUTH, GBT_AT_LOG_RANGE, GBT_AT_COURSE, GBT_AT_TURN, GBT_AT_LEVEL, GBT_AT_CHANGE, GBT_AT_ELEVATION, GBT_AT_CLIMB };

#define GBT_AT_SIZE (2 * GBT_DIMENSION + 2)           /* of the log of the size */
#define GBT_BANK_STATE (GBT_AT_SIZE + GBT_SIZED)      /* numbers of a state: 6, or 8 in space, and the size's */
#define GBT_BRANCHES (GBT_TURN_STDS * GBT_SPEED_STDS) /* pairs of deviations */

#define GBT_HELD_AT(i, j) ((i) >= (j) ? GBT_ROW_BEGIN(i) + (j) : GBT_ROW_BEGIN(j) + (i)) /* place in a covariance */
#define GBT_LARGEST_LOG_SPEED ((gbt_real)3.4011973816621555) /* log of 30 m/s, while nothing has told the speed */

extern const int gbt_polar_at[3]; /* azimuth, log range, elevation */

typedef struct {
    gbt_real speed, log_speed_std; /* median in m/s, deviation of its logarithm */
    gbt_real range, log_range_std; /* in m, at the first bearing */
    gbt_real hold;                 /* mean time for which a turn rate is held, s */
    gbt_real speed_time;           /* time scale of the change of log speed, s */
    gbt_real climb_std;            /* of a vertical speed when it is drawn, m/s */
    gbt_real log_size;             /* of the median size in m, and the deviation of the logarithm; read where GBT_SIZED is 1 */
    gbt_real log_size_std;
    gbt_real turn_std[GBT_TURN_STDS], speed_std[GBT_SPEED_STDS]; /* rad/s when it is drawn; of the change of log speed */
} gbt_held_prior;

typedef struct {
    gbt_real log_weight;
    gbt_real mean[GBT_BANK_STATE], covariance[GBT_ROW_BEGIN(GBT_BANK_STATE)]; /* lower triangle */
    int branch; /* the pair of deviations that it belongs to */
} gbt_component;

/* Deviations of the turn rate and of the change of log speed under a branch. */
gbt_real gbt_turn_std(const gbt_held_prior *prior, int branch);
gbt_real gbt_speed_std(const gbt_held_prior *prior, int branch);

/* An angle in [-pi, pi). */
gbt_real gbt_wrapped(gbt_real angle);

/* Number k of the components of a grid of ranges, speeds and courses on a first bearing, under every deviation of the turn
   rate and the first manner of changing the speed. */
void gbt_bank_start(const gbt_held_prior *prior, const gbt_real *angles, gbt_real variance, const int *grid, int k,
                    gbt_component *one);

/* A component some seconds later, the vehicle having moved by `moved`, GBT_DIMENSION, in m. */
void gbt_bank_advance(const gbt_held_prior *prior, gbt_component *one, gbt_real step, const gbt_real *moved);

/* Where it is some seconds later relative to the vehicle, which has moved by `moved`, and slopes of that by the state now. */
void gbt_bank_move(const gbt_component *one, gbt_real step, const gbt_real *moved, gbt_real *place,
                   gbt_real slopes[GBT_DIMENSION][GBT_BANK_STATE]);

/* Position relative to the vehicle at the mode, and its covariance; slopes by azimuth, log range(, elevation). */
void gbt_bank_position(const gbt_component *one, gbt_real *place, gbt_real slopes[GBT_DIMENSION][GBT_DIMENSION]);
void gbt_bank_spread(const gbt_component *one, gbt_real slopes[GBT_DIMENSION][GBT_DIMENSION], gbt_real *covariance);

GBT_END_C

#endif
