/* The noise of binned bearings: tracking/noise.py in C. */
#ifndef GBT_NOISE_H
#define GBT_NOISE_H

#include "gbt_bins.h"

GBT_BEGIN_C

#define GBT_SCATTER_S 30.0 /* seconds of short bins from which the noise is estimated */

typedef struct {
    gbt_real std;            /* of the white part of a bearing, rad */
    gbt_real correlated_std; /* and of one that lasts */
    double correlation_time; /* in which that forgets itself, s */
    gbt_real own_std;        /* of the own position, m */
    int estimated;           /* whether the white part is estimated from the scatter in the bins */
} gbt_bearing_noise;

/* Variance of a single bearing in rad^2: that of an expected deviation, or pooled with the scatter in the bins. */
gbt_real gbt_white_variance(gbt_real std, int estimated, const gbt_bins *bins);

/* Variance of the mean of so many bearings in a bin of a width in s at a range in m, with that of the lasting part as white
   noise of the same effect. */
gbt_real gbt_noise_of_mean(const gbt_bearing_noise *noise, gbt_real count, double width, gbt_real range, gbt_real white);

GBT_END_C

#endif
