/* The tracker with a Gaussian process on the shape of the motion, for noisy bearings and ranges that may not be observable:
   tracking/shape/tracker.py, hypotheses.py and moments.py in C.

   Between two estimates only the motions are kept, and moments of the position at nodes ahead and at the last two behind.
   What an estimate needs beside these is a workspace that keeps nothing from one to the next. */
#ifndef GBT_MOTION_GP_H
#define GBT_MOTION_GP_H

#include <stddef.h>

#include "gbt_gaps.h"
#include "gbt_shape_fit.h"

GBT_BEGIN_C

#define GBT_MOTIONS (GBT_HYPOTHESES * GBT_POINTS) /* of the hypotheses that are kept, under all points of the grid */

typedef struct {
    gbt_shape_prior prior;
    gbt_shape_noise noise;
    gbt_binning binning;
    double update;      /* least time between two estimates, s */
    gbt_real gate;      /* standardised residual from which a bearing is suspected; may be infinite */
    gbt_real memory;    /* factor on deviations that are remembered from before the window; infinite: nothing is */
    gbt_real starts[GBT_STARTS]; /* ranges at which a track is begun, m */
    int estimated;      /* whether the white noise is estimated from the scatter in the bins */
    int iterations;     /* most steps of an estimate that starts from the last one */
    int known;          /* 1: the position at the first bearing is known */
    int unused;         /* so that numbers follow an even number of these */
    gbt_real known_mean[GBT_DIMENSION], known_covariance[GBT_DIMENSION][GBT_DIMENSION];
} gbt_motion_gp_settings;

/* One of the distinct motions that fit. */
typedef struct {
    gbt_real weight;               /* its probability; over those that count, and over all */
    gbt_real share;
    gbt_real log_range, log_range_std; /* the median range now, m */
    gbt_real mean[GBT_NODES_AHEAD][GBT_DIMENSION];
    gbt_real covariance[GBT_NODES_AHEAD][GBT_DIMENSION][GBT_DIMENSION];
} gbt_hypothesis;

typedef struct {
    double now;                    /* time of the latest estimate, s */
    double first;                  /* and of the first bearing of the track, */
    double bearing_at;             /* and of the latest bearing of all */
    gbt_real log_evidence;         /* of the mean bearings in the window */
    gbt_real relative_range_std;   /* deviation of the range now over the range; infinite before an estimate */
    gbt_real own[GBT_DIMENSION];   /* own position then, or where the track began */
    gbt_real position[2][GBT_DIMENSION], covariance[GBT_BOTH][GBT_BOTH]; /* now and a node before, relative to it */
    int known, seen;               /* whether a position was known, and whether there was a bearing */
    int found;                     /* whether there is an estimate */
    int open;                      /* whether it is open where the target is */
    int estimates, unfit, restarts;
    int hypotheses;                /* of which there are GBT_POINTS motions each, */
    int likely;                    /* and those that count */
    gbt_gaps gaps;
    gbt_hypothesis hypothesis[GBT_HYPOTHESES]; /* those that count first */
    gbt_motion motion[GBT_MOTIONS];
    gbt_bins bins;
    gbt_singles others;
    gbt_track_memory memory;
    gbt_real zero[GBT_DIMENSION]; /* where the coordinates of the settings begin */
} gbt_motion_gp;

/* What an estimate works on. */
typedef struct {
    gbt_seen seen;
    gbt_walk walk;
    gbt_normal normal;
    gbt_fitted cold[GBT_STARTS];
    gbt_fitted fitted[2 * GBT_MOTIONS];
} gbt_motion_gp_work;

/* Sizes of both, for callers that do not see the structs. */
size_t gbt_motion_gp_bytes(void);
size_t gbt_motion_gp_work_bytes(void);

/* Nothing taken yet, with the vehicle at start, GBT_DIMENSION. */
void gbt_motion_gp_begin(gbt_motion_gp *process, const gbt_motion_gp_settings *settings, const gbt_real *start);

/* Moves the origin of all positions by a way, GBT_DIMENSION. */
void gbt_motion_gp_shift(gbt_motion_gp *process, const gbt_real *way);

/* Takes a measurement; 0 where it refuses it. */
int gbt_motion_gp_take(gbt_motion_gp *process, const gbt_motion_gp_settings *settings, gbt_motion_gp_work *work,
                       const gbt_sighting *sighting);

/* Where the target is at a time, and the covariance of that: not further back than one node before the latest estimate. */
void gbt_motion_gp_predict(const gbt_motion_gp *process, const gbt_motion_gp_settings *settings, double time,
                           gbt_real *mean, gbt_real *covariance);

/* What one hypothesis that counts says of a time that is not past. */
void gbt_motion_gp_believe(const gbt_motion_gp *process, const gbt_motion_gp_settings *settings, int hypothesis,
                           double time, gbt_real *mean, gbt_real *covariance);

GBT_END_C

#endif
