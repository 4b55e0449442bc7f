/* Covariance functions of time, of unit amplitude, with their derivatives: tracking/gp/kernels.py in C. */
#ifndef GBT_GP_KERNEL_H
#define GBT_GP_KERNEL_H

#include "gbt_math.h"
#include "gbt_pilot_settings.h"

GBT_BEGIN_C

enum { GBT_SE = 0, GBT_MATERN32 = 1, GBT_MATERN52 = 2, GBT_RQ = 3 };

/* k at a lag in seconds, and its derivatives by the logarithms of its GBT_SHAPES parameters; slopes may be 0. */
static inline gbt_real gbt_gp_kernel(gbt_real lag, const gbt_real *log_parameters, gbt_real *slopes)
{
    const gbt_real scaled = lag * gbt_exp(-log_parameters[0]), square = scaled * scaled;
    gbt_real value, slope;
#if GBT_KERNEL == 0
    value = gbt_exp((gbt_real)-0.5 * square);
    slope = value * square;
#elif GBT_KERNEL == 1
    const gbt_real s = gbt_sqrt((gbt_real)3) * gbt_fabs(scaled), decay = gbt_exp(-s);
    value = (1 + s) * decay;
    slope = s * s * decay;
#elif GBT_KERNEL == 2
    const gbt_real s = gbt_sqrt((gbt_real)5) * gbt_fabs(scaled), decay = gbt_exp(-s);
    value = (1 + s + s * s / 3) * decay;
    slope = s * s * (1 + s) / 3 * decay;
#else
    const gbt_real alpha = gbt_exp(log_parameters[1]), grown = square / (2 * alpha), log_base = gbt_log1p(grown);
    value = gbt_exp(-alpha * log_base);
    slope = value * square / (1 + grown);
    if (slopes) slopes[1] = value * alpha * (grown / (1 + grown) - log_base);
#endif
    if (slopes) slopes[0] = slope;
    return value;
}

GBT_END_C

#endif
