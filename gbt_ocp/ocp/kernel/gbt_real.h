/* The type of all numbers, double or (where GBT_SINGLE is defined) single precision, and the linkage of C from C++. */
#ifndef GBT_REAL_H
#define GBT_REAL_H

#ifdef GBT_SINGLE
typedef float gbt_real;
#define GBT_EPSILON ((gbt_real)1.1920929e-7)
#else
typedef double gbt_real;
#define GBT_EPSILON ((gbt_real)2.220446049250313e-16)
#endif

/* around the declarations of a header */
#ifdef __cplusplus
#define GBT_BEGIN_C extern "C" {
#define GBT_END_C }
#else
#define GBT_BEGIN_C
#define GBT_END_C
#endif

#endif
