/* What an estimate sees, and its rows along a motion: tracking/shape/fit.py and further.py in C. Rows are added to the normal
   equations one by one, from now into the past. An error of the sensor that lasts is taken out of them as a filter would,
   which is a root of the same covariance. */
#ifndef GBT_SHAPE_ROWS_H
#define GBT_SHAPE_ROWS_H

#include "gbt_bins.h"
#include "gbt_motions.h"
#include "gbt_singles.h"
#include "gbt_track_memory.h"

GBT_BEGIN_C

/* Of the bearings, in angles. */
typedef struct {
    gbt_real std, correlated_std; /* of the white part of a bearing, and of one that lasts, rad */
    double correlation_time;      /* in which that forgets itself, s */
    gbt_real own_std;             /* of the own position, m; read where GBT_OWN_NOISE is 1 */
    gbt_real log_size, log_size_std; /* of the median of the true size in m, and the deviation of its logarithm */
} gbt_shape_noise;

typedef enum { GBT_SEES_BEARING = 0, GBT_SEES_OTHER = 1, GBT_SEES_KNOWN = 2 } gbt_what; /* other: of one number */

/* What stands at which place between the nodes of the past. */
typedef struct {
    int left;
    gbt_real share;
    gbt_what what;
    int number;
} gbt_spot;

/* What one estimate sees, relative to now and to the own position now. */
typedef struct {
    int bins, known, others, spots;
    gbt_real time[GBT_BINS], bearing[GBT_BINS][GBT_DIMENSION], own[GBT_BINS][GBT_DIMENSION], count[GBT_BINS];
    gbt_real white; /* variance of a single bearing, rad^2 */
    gbt_real position[2][GBT_DIMENSION];                /* known beforehand, m */
    gbt_real root[GBT_ROW_BEGIN(2 * GBT_DIMENSION)];          /* lower triangle, its square the inverse of their covariance */
    gbt_sighting other[GBT_OTHERS];
    gbt_real deviation[GBT_OTHERS], shared[GBT_OTHERS]; /* of logarithms and angles; shares of it that are the true size's */
    gbt_real shared_square, others_log_determinant;
    gbt_spot spot[GBT_BINS + GBT_OTHERS + 2]; /* in their order from now into the past */
} gbt_seen;

/* Normal equations of a motion. */
typedef struct {
    gbt_real precision[GBT_ROW_BEGIN(GBT_COORDINATES)]; /* lower triangle, or its factor */
    gbt_real gradient[GBT_COORDINATES];
} gbt_normal;

/* Takes an error that lasts out of the rows of bearings one after the other. */
typedef struct {
    int begun;
    gbt_real time, variance;
    gbt_real residual[GBT_AXES], slopes[GBT_AXES][GBT_COORDINATES];
} gbt_lasting;

/* A walk along a motion past all that is seen. */
typedef struct {
    const gbt_shape_noise *noise;
    const gbt_seen *seen;
    const gbt_real *range; /* of the bins, for the error of the own position; read where GBT_OWN_NOISE is 1 */
    gbt_normal *normal; /* 0 where only the objective is asked for */
    gbt_slopes slopes;
    gbt_lasting error;
    gbt_real objective, log_determinant;
    gbt_real angle[GBT_BINS][GBT_AXES];
    gbt_real known[GBT_BOTH], known_slopes[GBT_BOTH][GBT_COORDINATES];
    gbt_real shared, shared_slopes[GBT_COORDINATES];
} gbt_walk;

/* What an estimate at a time and an own position sees. */
void gbt_see(const gbt_shape_prior *prior, const gbt_shape_noise *noise, const gbt_bins *bins, gbt_real white,
             const gbt_singles *singles, const gbt_known *known, double now, const gbt_real *own, gbt_seen *seen);

/* Walks along a motion past all that is seen: the objective, and where they are asked for the normal equations. */
void gbt_walk_along(gbt_walk *on, const gbt_shape_prior *prior, const gbt_motion *motion);

/* Mean squared standardised residual of the latest bins, of the last walk. */
gbt_real gbt_recent_residual(const gbt_walk *on);

GBT_END_C

#endif
