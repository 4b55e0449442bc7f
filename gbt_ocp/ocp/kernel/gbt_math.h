/* The functions of <math.h> in the precision of gbt_real, for the sources of the planner. <tgmath.h> would do the same,
   but not every compiler for microcontrollers has one that works. */
#ifndef GBT_MATH_H
#define GBT_MATH_H

#include <math.h>

#include "gbt_real.h"

#if defined(__FAST_MATH__) || (defined(__FINITE_MATH_ONLY__) && __FINITE_MATH_ONLY__ > 0) || defined(_M_FP_FAST)
#error "found fast math, which removes the tests for NaN; allowed: this file without -ffast-math, -Ofast, /fp:fast"
#endif

#ifdef GBT_SINGLE
#define GBT_IN_PRECISION(name) name##f
#else
#define GBT_IN_PRECISION(name) name
#endif

/* Before a loop of few rounds that is worth its room without counting. */
#if defined(__GNUC__) && !defined(__clang__) && __GNUC__ >= 8
#define GBT_UNROLLED _Pragma("GCC unroll 16")
#else
#define GBT_UNROLLED
#endif

#define GBT_INFINITY ((gbt_real)HUGE_VAL)

#define GBT_TURN ((gbt_real)6.283185307179586) /* a full one, in radians */

#define gbt_acos GBT_IN_PRECISION(acos)
#define gbt_acosh GBT_IN_PRECISION(acosh)
#define gbt_asin GBT_IN_PRECISION(asin)
#define gbt_asinh GBT_IN_PRECISION(asinh)
#define gbt_atan GBT_IN_PRECISION(atan)
#define gbt_atan2 GBT_IN_PRECISION(atan2)
#define gbt_atanh GBT_IN_PRECISION(atanh)
#define gbt_ceil GBT_IN_PRECISION(ceil)
#define gbt_copysign GBT_IN_PRECISION(copysign)
#define gbt_cos GBT_IN_PRECISION(cos)
#define gbt_cosh GBT_IN_PRECISION(cosh)
#define gbt_erf GBT_IN_PRECISION(erf)
#define gbt_exp GBT_IN_PRECISION(exp)
#define gbt_expm1 GBT_IN_PRECISION(expm1)
#define gbt_fabs GBT_IN_PRECISION(fabs)
#define gbt_floor GBT_IN_PRECISION(floor)
#define gbt_fmax GBT_IN_PRECISION(fmax)
#define gbt_fmin GBT_IN_PRECISION(fmin)
#define gbt_fmod GBT_IN_PRECISION(fmod)
#define gbt_hypot GBT_IN_PRECISION(hypot)
#define gbt_log GBT_IN_PRECISION(log)
#define gbt_log1p GBT_IN_PRECISION(log1p)
#define gbt_pow GBT_IN_PRECISION(pow)
#define gbt_remainder GBT_IN_PRECISION(remainder)
#define gbt_sin GBT_IN_PRECISION(sin)
#define gbt_sinh GBT_IN_PRECISION(sinh)
#define gbt_sqrt GBT_IN_PRECISION(sqrt)
#define gbt_tan GBT_IN_PRECISION(tan)
#define gbt_tanh GBT_IN_PRECISION(tanh)

#endif
