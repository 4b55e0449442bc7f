/* Predicted positions of the target at GBT_AHEAD + 1 times, the first of them now. */
#ifndef GBT_FORECAST_H
#define GBT_FORECAST_H

#include "gbt_pilot_settings.h"
#include "gbt_problem.h"

GBT_BEGIN_C

typedef struct {
    double time; /* of the first; the others follow every gbt_pilot_numbers.forecast_period seconds */
    gbt_real mean[GBT_AHEAD + 1][GBT_DIMENSION];                      /* m */
    gbt_real covariance[GBT_AHEAD + 1][GBT_DIMENSION][GBT_DIMENSION]; /* m^2; not a number where there is none */
} gbt_forecast;

GBT_END_C

#endif
