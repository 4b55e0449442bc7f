/* Laplace's approximation of motions given what is seen, by damped Gauss-Newton steps, many motions at once:
   tracking/shape/fit.py in C. */
#ifndef GBT_SHAPE_FIT_H
#define GBT_SHAPE_FIT_H

#include "gbt_shape_rows.h"

GBT_BEGIN_C

/* A motion that is fitted. */
typedef struct {
    gbt_motion at;                     /* where it was linearised last, */
    gbt_real step[GBT_COORDINATES];    /* and the way from there to the mode */
    gbt_real objective, decrement;     /* there, and what a full step promises to take off */
    gbt_real log_determinant;          /* of the factor of the precision */
    gbt_real log_evidence, variance;   /* and of the first coordinate, the log range */
    gbt_real recent;                   /* mean squared standardised residual of the latest bins */
    int hypothesis;
#if GBT_OWN_NOISE
    gbt_real range[GBT_BINS]; /* where the fit began, m */
#endif
} gbt_fitted;

/* Fits `count` motions at once, until all have settled; each begins at `at`. Works on a walk. */
void gbt_shape_fit(const gbt_shape_prior *prior, const gbt_shape_noise *noise, const gbt_seen *seen, gbt_fitted *fitted,
                   int count, int iterations, gbt_walk *on, gbt_normal *normal);

/* The factor of the precision of a fitted motion. */
void gbt_shape_factor(const gbt_shape_prior *prior, const gbt_shape_noise *noise, const gbt_seen *seen,
                      const gbt_fitted *fitted, gbt_walk *on, gbt_normal *normal);

GBT_END_C

#endif
