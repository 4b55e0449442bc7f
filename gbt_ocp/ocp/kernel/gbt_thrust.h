/* The range of the inputs, whose limits may differ by sign. */
#ifndef GBT_THRUST_H
#define GBT_THRUST_H

#include "gbt_problem.h"

/* A thrust within a share of the range of that input; not a number stays what it is. */
static inline gbt_real gbt_within_thrust(int input, gbt_real thrust, gbt_real share)
{
    const gbt_real lower = share * gbt_thrust_min[input], upper = share * gbt_thrust_max[input];
    return thrust > upper ? upper : thrust < lower ? lower : thrust;
}

/* A thrust over the limit on its side: above 1 where the limit is exceeded. */
static inline gbt_real gbt_thrust_used(int input, gbt_real thrust)
{
    return thrust / (thrust < 0 ? gbt_thrust_min[input] : gbt_thrust_max[input]);
}

#endif
