/* A measurement of any kind as rows in the direction of the target, its log range and the log of its size: the same as
   tracking/polar.py. */
#ifndef GBT_POLAR_H
#define GBT_POLAR_H

#include "gbt_bearing.h"
#include "gbt_sighting.h"

GBT_BEGIN_C

/* Rows: residual = across . direction + along log range + size log size + noise. */
typedef struct {
    int rows;
    gbt_real unit[GBT_DIMENSION];                  /* predicted direction */
    gbt_real range;                                /* predicted range, m */
    gbt_real across[GBT_DIMENSION][GBT_DIMENSION]; /* directions in the tangent plane; zero where no angle is measured */
    gbt_real along[GBT_DIMENSION], size[GBT_DIMENSION];
    gbt_real residuals[GBT_DIMENSION]; /* measured less predicted: radians, logarithms */
    gbt_real std[GBT_DIMENSION];
} gbt_polar_rows;

/* Whether a tracker of all kinds can take a measurement; a size only where it is estimated. */
int gbt_can_take(const gbt_sighting *sighting, int begun, double latest);

/* The rows of a measurement at a predicted position and log size; bearing_std is that of angles that do not state it. */
void gbt_polar_of(const gbt_sighting *sighting, const gbt_real *position, gbt_real bearing_std, gbt_real log_size,
                  gbt_polar_rows *rows);

GBT_END_C

#endif
