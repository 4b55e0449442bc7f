/* The extended Kalman filter of constant velocity: tracking/filters/ekf.py in C, for measurements of all kinds. */
#ifndef GBT_EKF_H
#define GBT_EKF_H

#include <stddef.h>

#include "gbt_first_guess.h"
#include "gbt_gaps.h"
#include "gbt_polar_update.h"

GBT_BEGIN_C

typedef struct {
    gbt_real process_noise; /* spectral density of the white acceleration, m^2/s^3 */
    gbt_real log_size;      /* of the median size in m, and the deviation of the logarithm; read where GBT_SIZED is 1 */
    gbt_real log_size_std;
    gbt_first_guess guess;
} gbt_ekf_settings;

typedef struct {
    gbt_gaps gaps;
    int begun;  /* whether there is a track, and the time of its last measurement */
    double time;
    int known;  /* whether its first position was known before the first measurement */
    gbt_real start[GBT_DIMENSION]; /* of the vehicle: stands for the target's before that */
    gbt_real mean[GBT_N], covariance[GBT_N][GBT_N];
    gbt_own_velocities own;
    gbt_real zero[GBT_DIMENSION]; /* where the coordinates of the settings begin */
} gbt_ekf;

/* Size of a gbt_ekf, for callers that do not see the struct. */
size_t gbt_ekf_bytes(void);

/* Nothing taken yet, with the vehicle at start, GBT_DIMENSION. */
void gbt_ekf_begin(gbt_ekf *filter, const gbt_ekf_settings *settings, const gbt_real *start);

/* Moves the origin of all positions by a way, GBT_DIMENSION. */
void gbt_ekf_shift(gbt_ekf *filter, const gbt_real *way);

/* Takes a measurement at or after the time of the last one; 0 where it refuses it. */
int gbt_ekf_take(gbt_ekf *filter, const gbt_ekf_settings *settings, const gbt_sighting *sighting);

/* Where the target is at a time, and the covariance of that: not a number before the first measurement. */
void gbt_ekf_predict(const gbt_ekf *filter, const gbt_ekf_settings *settings, double time, gbt_real *mean,
                     gbt_real *covariance);

GBT_END_C

#endif
