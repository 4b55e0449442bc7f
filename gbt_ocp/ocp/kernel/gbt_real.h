/* The type of all numbers, double or (where GBT_SINGLE is defined) single precision, and the names of functions. */
#ifndef GBT_REAL_H
#define GBT_REAL_H

#include "gbt_identity.h"

#ifdef GBT_SINGLE
typedef float gbt_real;
#define GBT_EPSILON ((gbt_real)1.1920929e-7)
#define GBT_PRECISION _single
#else
typedef double gbt_real;
#define GBT_EPSILON ((gbt_real)2.220446049250313e-16)
#define GBT_PRECISION
#endif

/* The name of a function for the linker, with the problem and the precision in it. A caller that was compiled for another
   problem or in another precision then does not link, where it would otherwise pass a struct of a wrong size. */
#define GBT_NAME(name) GBT_NAME_OF(name, GBT_IDENTITY, GBT_PRECISION)
#define GBT_NAME_OF(name, identity, precision) GBT_NAME_JOINED(name, identity, precision)
#define GBT_NAME_JOINED(name, identity, precision) name##identity##precision

/* Around the declarations of a header: the linkage of C where it is read by a C++ compiler. */
#ifdef __cplusplus
#define GBT_BEGIN_C extern "C" {
#define GBT_END_C }
#else
#define GBT_BEGIN_C
#define GBT_END_C
#endif

#endif
