/* From the moments of a forecast to the numbers of the objective and of the limits. */
#ifndef GBT_MOMENTS_H
#define GBT_MOMENTS_H

#include "gbt_solver.h"

GBT_BEGIN_C

/* Jacobi's method: leaves the eigenvalues of a symmetric matrix on its diagonal, and sets v to its eigenvectors, one a
   column. */
void gbt_diagonalise(gbt_real a[GBT_DIMENSION][GBT_DIMENSION], gbt_real v[GBT_DIMENSION][GBT_DIMENSION]);

/* Symmetric square root of a symmetric matrix, of which the lower triangle is read; negative eigenvalues, which
   round-off leaves in covariances, count as zero. Both are stored column by column. */
void gbt_symmetric_root(const gbt_real *matrix, gbt_real *root);

#if GBT_MOMENTS
/* All numbers of a solve, relative to an origin.

   base         origin of the coordinates of the means, GBT_DIMENSION
   origin       of the plan, GBT_DIMENSION; see gbt_places.h
   mean, covariance, desired   as of gbt_plan
   numbers      out: GBT_NUMBERS */
void gbt_bind(const double *base, const double *origin, const gbt_real *mean, const gbt_real *covariance,
              const gbt_real *desired, gbt_real *numbers);
#endif

GBT_END_C

#endif
