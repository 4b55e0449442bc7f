/* Interacting models that are given the means of short bins, and begun again where their track is lost:
   tracking/filters/binned.py in C. */
#ifndef GBT_BINNED_H
#define GBT_BINNED_H

#include "gbt_imm_ekf.h"
#include "gbt_lost.h"
#include "gbt_noise.h"
#include "gbt_waiting.h"

GBT_BEGIN_C

typedef struct {
    gbt_imm_ekf_settings filter;
    gbt_bearing_noise noise;
    gbt_binning binning;
} gbt_binned_settings;

typedef struct {
    int known, restarts;         /* whether a position is known, and how often the track was lost and begun again */
    gbt_real own[GBT_DIMENSION]; /* own position at the latest bearing, or where the track began */
    gbt_gaps gaps;
    gbt_lost lost;
    int begun, foreseen;          /* whether a bin has been taken in, and whether what waits is in a filter of its own */
    gbt_imm_ekf filter, foreseeing;
    gbt_bins bins;
    gbt_waiting waiting;          /* for the newest bin to be full */
    gbt_real zero[GBT_DIMENSION]; /* where the coordinates of the settings begin */
} gbt_binned_filter;

/* Nothing taken yet, with the vehicle at start, GBT_DIMENSION. */
void gbt_binned_begin(gbt_binned_filter *binned, const gbt_binned_settings *settings, const gbt_real *start);

/* Moves the origin of all positions by a way, GBT_DIMENSION. */
void gbt_binned_shift(gbt_binned_filter *binned, const gbt_real *way);

/* Takes a bearing, a unit vector, from a position, both finite; 0 where its time is not after that of the last one, or where
   there is no room for it in its bin. */
int gbt_binned_update(gbt_binned_filter *binned, const gbt_binned_settings *settings, double time, const gbt_real *bearing,
                      const gbt_real *own);

/* Takes a measurement of any kind; 0 where gbt_can_take refuses it, or where there is no room. */
int gbt_binned_take(gbt_binned_filter *binned, const gbt_binned_settings *settings, const gbt_sighting *sighting);

/* Where the target is at a time, and the covariance of that: not a number before the first full bin. */
void gbt_binned_predict(const gbt_binned_filter *binned, const gbt_binned_settings *settings, double time, gbt_real *mean,
                        gbt_real *covariance);

/* Whether the range is known to a quarter. */
int gbt_binned_observable(const gbt_binned_filter *binned, const gbt_binned_settings *settings);

GBT_END_C

#endif
