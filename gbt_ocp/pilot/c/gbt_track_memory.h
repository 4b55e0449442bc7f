/* What earlier estimates knew of position and velocity, as a prior for the bearings of the window:
   tracking/shape/memory.py in C, which says why. */
#ifndef GBT_TRACK_MEMORY_H
#define GBT_TRACK_MEMORY_H

#include "gbt_linalg.h"
#include "gbt_pilot_settings.h"
#include "gbt_problem.h"

GBT_BEGIN_C

#define GBT_BOTH (2 * GBT_DIMENSION) /* coordinates of two positions */

/* Positions that are known before any bearing of the window. */
typedef struct {
    int count;                         /* 0, 1 or 2 */
    double time[2];                    /* s */
    gbt_real position[2][GBT_DIMENSION]; /* m */
    gbt_real root[GBT_ROW_BEGIN(GBT_BOTH)];  /* lower triangle A with A'A the inverse of their joint covariance, 1/m */
} gbt_known;

typedef struct {
    int count; /* posteriors that are kept, the oldest first */
    struct {
        double now; /* time of the estimate; the positions are those at this time and a node before */
        gbt_real position[2][GBT_DIMENSION], root[GBT_ROW_BEGIN(GBT_BOTH)];
    } kept[GBT_MEMORIES];
} gbt_track_memory;

/* The root of the inverse of a covariance of n rows, n x n, over a factor on the deviations; 0 if there is none. */
int gbt_precision_root(const gbt_real *covariance, int n, gbt_real factor, gbt_real *root);

/* Keeps a posterior of an estimate: two positions and their joint covariance. */
void gbt_memory_keep(gbt_track_memory *memory, double now, gbt_real position[2][GBT_DIMENSION],
                     const gbt_real *covariance, gbt_real factor);

/* The latest posterior from before the window begins, unless it is older than a span; `between` is the time between its two
   positions. Those before it are forgotten. 0 if there is none. */
int gbt_memory_recall(gbt_track_memory *memory, double begins, double now, double span, double between, gbt_known *known);

GBT_END_C

#endif
