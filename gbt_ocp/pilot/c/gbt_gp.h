/* The Gaussian process on a window of exact bearings, tuned by likelihood (algorithm 1 of the paper): tracking/gp in C.

   The posterior is computed where it is asked for; between measurements only the window and what was tuned are kept. */
#ifndef GBT_GP_H
#define GBT_GP_H

#include <stddef.h>

#include "gbt_breaks.h"
#include "gbt_gaps.h"
#include "gbt_gp_likelihood.h"
#include "gbt_gp_root.h"

GBT_BEGIN_C

typedef struct {
    int on_vehicle; /* whether the prior mean is the vehicle's latest position, and not the origin */
    gbt_tuning tuning;
    int known; /* 1: the position at the first bearing is known, with axes of its covariance and deviations along them */
    gbt_real known_mean[GBT_DIMENSION], known_axis[GBT_DIMENSION][GBT_DIMENSION], known_variance[GBT_DIMENSION];
} gbt_gp_settings;

typedef struct {
    double time;
    gbt_real bearing[GBT_DIMENSION], own[GBT_DIMENSION]; /* unit vector, and where it was seen from, m */
} gbt_sample;

typedef struct {
    gbt_gaps gaps;
    int count; /* samples in the window, the oldest first */
    gbt_sample window[GBT_WINDOW];
#if GBT_BREAKS
    gbt_break_watch breaks;
    gbt_sample suspect; /* the latest bearing, while the watch suspects it */
#endif
    int known, begun;  /* whether a known position still counts; whether there was a bearing */
    double known_time; /* of the bearing to which that position belongs: the first, of the track or after a break */
    gbt_real zero[GBT_DIMENSION]; /* where the coordinates of the settings begin */
    gbt_real known_mean[GBT_DIMENSION], known_axis[GBT_DIMENSION][GBT_DIMENSION], known_variance[GBT_DIMENSION];
    gbt_real start[GBT_DIMENSION], centre[GBT_DIMENSION]; /* of the vehicle at first; the prior mean */
    gbt_real log_theta[GBT_TUNABLE];
} gbt_gp;

/* A posterior: the rows and the prior variance, and the factor of their covariance as gbt_factor leaves it with L^-1 times
   their values, or the root of the process. */
typedef struct {
    gbt_gp_rows rows;
    int sound, raised; /* whether there is one; how often the nugget was multiplied by ten for it */
    int rooted;
    gbt_real nugget, variance;
    union {
        struct {
            gbt_wide lower[GBT_PACKED], values[GBT_ROWS_OF_WINDOW];
        } factor;
#if GBT_ROOTED
        gbt_gp_root root;
#endif
    } by;
} gbt_gp_posterior;

/* What predicting and tuning work on. It keeps nothing from one call to the next. */
typedef union {
    gbt_gp_posterior posterior;
    gbt_gp_tuning_work tuning;
} gbt_gp_work;

/* What became of a bearing. */
typedef enum {
    GBT_GP_REFUSED = 0, /* not finite, or not after the last one */
    GBT_GP_TAKEN = 1,
    GBT_GP_WAITS = 2,   /* it is a stray or the first after a break, which the next one says; the old motion goes on */
    GBT_GP_BROKEN = 3   /* taken, after a break: the window begins with the bearing before it */
} gbt_gp_taken;

/* Sizes of both, for callers that do not see the structs. */
size_t gbt_gp_bytes(void);
size_t gbt_gp_work_bytes(void);

/* Nothing taken yet, with the vehicle at start, GBT_DIMENSION. */
void gbt_gp_begin(gbt_gp *process, const gbt_gp_settings *settings, const gbt_real *start);

/* Moves the origin of all positions by a way, GBT_DIMENSION. */
void gbt_gp_shift(gbt_gp *process, const gbt_real *way);

/* Takes a bearing, a unit vector, from an own position, GBT_DIMENSION each, after the time of the last one. */
gbt_gp_taken gbt_gp_add(gbt_gp *process, const gbt_gp_settings *settings, gbt_gp_work *work, double time,
                        const gbt_real *bearing, const gbt_real *own);

/* Where the target is at so many times: means and covariances one after the other. Returns how often the nugget had to be
   multiplied by ten for that. */
int gbt_gp_predict(const gbt_gp *process, const gbt_gp_settings *settings, gbt_gp_work *work, const double *times, int count,
                   gbt_real *mean, gbt_real *covariance);

GBT_END_C

#endif
