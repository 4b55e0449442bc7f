/* Interacting models with extended updates: ImmExtendedTracker of tracking/filters/ekf.py in C, for measurements with a
   deviation of their own. */
#ifndef GBT_IMM_EKF_H
#define GBT_IMM_EKF_H

#include "gbt_first_guess.h"
#include "gbt_gaps.h"
#include "gbt_imm.h"
#include "gbt_polar_update.h"

GBT_BEGIN_C

typedef struct {
    gbt_imm_settings models;
    gbt_first_guess guess;
} gbt_imm_ekf_settings;

typedef struct {
    gbt_gaps gaps;
    int begun, known;              /* whether there is a track, and whether its first position was known before that */
    double time;                   /* of the last measurement, s */
    gbt_real start[GBT_DIMENSION]; /* of the vehicle: stands for the target's before a track begins */
    gbt_real zero[GBT_DIMENSION];  /* where the coordinates of the settings begin */
    gbt_imm models;
    gbt_own_velocities own;
} gbt_imm_ekf;

/* Nothing taken yet, with the vehicle at start, GBT_DIMENSION; whether the position of the settings is known, in coordinates
   that begin at `zero`. */
void gbt_imm_ekf_begin(gbt_imm_ekf *filter, int known, const gbt_real *start, const gbt_real *zero);

/* Moves the origin of all positions by a way, GBT_DIMENSION. */
void gbt_imm_ekf_shift(gbt_imm_ekf *filter, const gbt_real *way);

/* Takes a measurement of any kind with a stated deviation, at or after the time of the last one; without effect where that
   leaves no track. */
void gbt_imm_ekf_take(gbt_imm_ekf *filter, const gbt_imm_ekf_settings *settings, const gbt_sighting *sighting);

/* Where the target is at a time, and the covariance of that: not a number before the first measurement. */
void gbt_imm_ekf_predict(const gbt_imm_ekf *filter, const gbt_imm_ekf_settings *settings, double time, gbt_real *mean,
                         gbt_real *covariance);

GBT_END_C

#endif
