/* Interacting multiple models: constant velocity, constant acceleration and coordinated turn, weighed by likelihood.
   InteractingMultipleModel of tracking/filters/imm.py, and tracking/filters/motion_models.py, in C. */
#ifndef GBT_IMM_H
#define GBT_IMM_H

#include "gbt_kalman.h"

GBT_BEGIN_C

#define GBT_MODES 3

typedef struct {
    gbt_real initial_variance; /* of velocity, m^2/s^2, and acceleration, m^2/s^4, on each axis */
    gbt_real process_noise;    /* spectral density of the acceleration where the velocity is constant, m^2/s^3 */
    gbt_real jerk_noise;       /* and of the jerk where the acceleration varies, m^2/s^5 */
    gbt_real stay;             /* probability that a mode lasts from one measurement to the next */
    gbt_real turn_rate_max;    /* rad/s */
    gbt_real log_size;         /* of the median size in m, and the deviation of the logarithm; read where GBT_SIZED is 1 */
    gbt_real log_size_std;
} gbt_imm_settings;

typedef struct {
    gbt_real probability[GBT_MODES];
    gbt_real mean[GBT_MODES][GBT_N], covariance[GBT_MODES][GBT_N][GBT_N];
} gbt_imm;

/* Starts all modes at rest at a position, GBT_DIMENSION, with its covariance. */
void gbt_imm_begin(gbt_imm *imm, const gbt_imm_settings *settings, const gbt_real *position,
                   gbt_real covariance[GBT_DIMENSION][GBT_DIMENSION]);

/* Mixes the modes and predicts each by a step in seconds. */
void gbt_imm_advance(gbt_imm *imm, const gbt_imm_settings *settings, gbt_real step);

/* The modes' probabilities after a measurement, by the logarithms of its densities in each. */
void gbt_imm_weigh(gbt_imm *imm, const gbt_real *log_likelihood);

/* Position some seconds from now: each mode by its own model, the probabilities kept. */
void gbt_imm_forecast(const gbt_imm *imm, const gbt_imm_settings *settings, gbt_real ahead, gbt_real *mean,
                      gbt_real *covariance);

GBT_END_C

#endif
