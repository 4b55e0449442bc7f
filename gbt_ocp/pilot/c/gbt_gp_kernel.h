/* Covariance functions of time, of unit amplitude, with their derivatives: tracking/gp/kernels.py in C. */
#ifndef GBT_GP_KERNEL_H
#define GBT_GP_KERNEL_H

#include "gbt_pilot_settings.h"
#include "gbt_wide.h"

GBT_BEGIN_C

enum { GBT_SE = 0, GBT_MATERN32 = 1, GBT_MATERN52 = 2, GBT_RQ = 3 };

/* 1 over the length scale, and alpha of the rational quadratic: once for all lags. */
typedef struct {
    gbt_wide number[GBT_SHAPES];
} gbt_gp_shape;

static inline gbt_gp_shape gbt_gp_shape_of(const gbt_real *log_parameters)
{
    gbt_gp_shape shape;
    for (int s = 0; s < GBT_SHAPES; s++) shape.number[s] = gbt_widen(gbt_exp(s == 0 ? -log_parameters[s] : log_parameters[s]));
    return shape;
}

/* k at a lag in seconds, and its derivatives by the logarithms of its GBT_SHAPES parameters; slopes may be 0. */
static inline gbt_wide gbt_gp_kernel(gbt_wide lag, const gbt_gp_shape *shape, gbt_wide *slopes)
{
    const gbt_wide scaled = gbt_times(lag, shape->number[0]), square = gbt_times(scaled, scaled);
    gbt_wide value, slope;
#if GBT_KERNEL == 0
    value = gbt_wide_exp(gbt_times(gbt_widen((gbt_real)-0.5), square));
    slope = gbt_times(value, square);
#elif GBT_KERNEL == 1
    const gbt_wide s = gbt_root(gbt_times(gbt_widen(3), square)), decay = gbt_wide_exp(gbt_negative(s));
    value = gbt_times(gbt_plus(gbt_widen(1), s), decay);
    slope = gbt_times(gbt_times(s, s), decay);
#elif GBT_KERNEL == 2
    const gbt_wide s = gbt_root(gbt_times(gbt_widen(5), square)), decay = gbt_wide_exp(gbt_negative(s));
    const gbt_wide third = gbt_over(gbt_times(s, s), gbt_widen(3)), grown = gbt_plus(gbt_widen(1), s);
    value = gbt_times(gbt_plus(grown, third), decay);
    slope = gbt_times(gbt_times(third, grown), decay);
#else
    const gbt_wide alpha = shape->number[1], one = gbt_widen(1);
    const gbt_wide grown = gbt_over(square, gbt_times(gbt_widen(2), alpha)), log_base = gbt_wide_log1p(grown);
    const gbt_wide share = gbt_over(grown, gbt_plus(one, grown));
    value = gbt_wide_exp(gbt_negative(gbt_times(alpha, log_base)));
    slope = gbt_over(gbt_times(value, square), gbt_plus(one, grown));
    if (slopes) slopes[1] = gbt_times(gbt_times(value, alpha), gbt_plus(share, gbt_negative(log_base)));
#endif
    if (slopes) slopes[0] = slope;
    return value;
}

GBT_END_C

#endif
