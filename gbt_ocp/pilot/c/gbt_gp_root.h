/* A root of the squared exponential, and conditioning on it by QR decompositions: tracking/gp/root.py in C. */
#ifndef GBT_GP_ROOT_H
#define GBT_GP_ROOT_H

#include "gbt_gp_likelihood.h"

/* Whether the process has one: a squared exponential with a nugget that is tuned. In float the covariance of sums of two
   floats is as good. */
#if GBT_KERNEL == 0 && GBT_TUNED_NUGGET && !defined GBT_SINGLE
#define GBT_ROOTED 1
#else
#define GBT_ROOTED 0
#endif

#if GBT_ROOTED

GBT_BEGIN_C

#define GBT_FUNCTIONS 48 /* of a root at most: enough for windows of five length scales */
#define GBT_COEFFICIENTS (GBT_DIMENSION * GBT_FUNCTIONS)

/* A reflection, I - factor n n', and the entry of the upper triangle at which it ends. */
typedef struct {
    gbt_real factor, pivot;
} gbt_reflection;

/* Coefficients of d times so many functions, given the rows of a window: the reflections that bring what the rows say of the
   coefficients to a triangle, with their normals; those that bring the triangle and the noise of the rows to another, with
   their normals in the noise (their other entry is top); and the coefficients that were found. */
typedef struct {
    int functions, rows;
    gbt_real scale, middle, amplitude; /* of time in s, and in m */
    gbt_real process[GBT_ROWS_OF_WINDOW][GBT_COEFFICIENTS], noise[GBT_ROWS_OF_WINDOW][GBT_ROWS_OF_WINDOW];
    gbt_real upper[GBT_ROWS_OF_WINDOW][GBT_ROWS_OF_WINDOW], top[GBT_ROWS_OF_WINDOW];
    gbt_reflection of_process[GBT_ROWS_OF_WINDOW], of_noise[GBT_ROWS_OF_WINDOW];
    gbt_real found[GBT_COEFFICIENTS];
} gbt_gp_root;

/* Conditions on the rows under log theta, of which a nugget near the rounding of a covariance is replaced by the likeliest
   one at or below it; 0 where a root would need too many functions. */
int gbt_gp_root_condition(gbt_gp_root *root, const gbt_gp_rows *rows, const gbt_real *log_theta, gbt_real rounding);

/* The mean less that of the prior, and the covariance, at a time in seconds after that from which the rows count. */
void gbt_gp_root_predict(const gbt_gp_root *root, gbt_real time, gbt_real *mean, gbt_real *covariance);

GBT_END_C

#endif

#endif
