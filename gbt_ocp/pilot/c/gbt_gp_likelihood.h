/* Log likelihood of the measurements of a window, and its maximisation: tracking/gp/likelihood.py and tuning.py in C. */
#ifndef GBT_GP_LIKELIHOOD_H
#define GBT_GP_LIKELIHOOD_H

#include "gbt_gp_kernel.h"
#include "gbt_gp_triangle.h"

GBT_BEGIN_C

#define GBT_TUNABLE (GBT_SHAPES + 1 + GBT_TUNED_NUGGET) /* logarithms: the kernel's parameters, amplitude(, nugget) */

#define GBT_SLOPES (GBT_SHAPES + GBT_TUNED_NUGGET + 1) /* of the covariance: by shapes, nugget, the rows' own variances */

/* What a window says: rows direction . position = value + noise. */
typedef struct {
    int rows, noisy; /* noisy: whether a row has a variance of its own */
    double zero;                       /* from which times count */
    gbt_wide time[GBT_ROWS_OF_WINDOW]; /* s */
    gbt_real direction[GBT_ROWS_OF_WINDOW][GBT_DIMENSION];
    gbt_real value[GBT_ROWS_OF_WINDOW]; /* relative to the prior mean */
    gbt_real variance[GBT_ROWS_OF_WINDOW];
} gbt_gp_rows;

typedef struct {
    gbt_real nugget; /* where it is not tuned */
    gbt_real low[GBT_TUNABLE], high[GBT_TUNABLE];      /* bounds of the logarithms */
    gbt_real median[GBT_TUNABLE], spread[GBT_TUNABLE]; /* their priors; a spread of 0: none */
    gbt_real first[GBT_TUNABLE], smooth[GBT_TUNABLE];  /* where a search begins, and one for a smooth motion with noise */
    gbt_real exact;   /* logarithm of the nugget below which the second tells of no noise */
    gbt_real suspect; /* logarithm of the length scale below which it is suspected of telling noise */
    gbt_real telltale; /* logarithm of the nugget below which it is not, however short */
} gbt_tuning;

/* The lower triangle of the covariance of the rows under log theta, with the nugget that belongs to it, and where they are
   asked for its slopes by the logarithms of the kernel's parameters; slopes may be 0. */
void gbt_gp_covariance(const gbt_gp_rows *rows, const gbt_real *log_theta, gbt_real nugget, gbt_wide omega[GBT_PACKED],
                       gbt_wide slopes[GBT_SHAPES][GBT_PACKED]);

/* L^-1 times the values of the rows. */
void gbt_gp_whiten(const gbt_gp_rows *rows, const gbt_wide *factor, gbt_wide *whitened);

/* What tuning works on. Only the last rows have variances of their own, so that what comes of them is a small triangle. */
typedef struct {
    gbt_wide inverse[GBT_PACKED], slope[GBT_SLOPES - 1][GBT_PACKED], own[GBT_ROW_BEGIN(GBT_DIMENSION)];
} gbt_gp_tuning_work;

/* From the last log theta to that of the largest likelihood near it, or of a smooth motion with noise. */
void gbt_gp_tune(const gbt_tuning *tuning, const gbt_gp_rows *rows, gbt_gp_tuning_work *work, gbt_real *log_theta);

GBT_END_C

#endif
