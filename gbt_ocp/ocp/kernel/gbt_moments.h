/* From the moments of a forecast to the parameters of the objective. */
#ifndef GBT_MOMENTS_H
#define GBT_MOMENTS_H

#include "gbt_solver.h"

/* Symmetric square root of a symmetric matrix, of which the lower triangle is read; negative eigenvalues, which
   round-off leaves in covariances, count as zero. Both are stored column by column. */
void gbt_symmetric_root(const gbt_real *matrix, gbt_real *root);

#if GBT_MOMENTS
/* Parameters of the objective at all endpoints, GBT_PIECES x GBT_PARAMETERS.

   mean, desired   GBT_PIECES x GBT_DIMENSION
   covariance      GBT_PIECES x GBT_DIMENSION x GBT_DIMENSION */
void gbt_bind(const gbt_real *mean, const gbt_real *covariance, const gbt_real *desired, gbt_real *parameters);
#endif

#endif
