/* From the moments of a forecast to the parameters of the objective and of the limits. */
#ifndef GBT_MOMENTS_H
#define GBT_MOMENTS_H

#include "gbt_solver.h"

GBT_BEGIN_C

/* Symmetric square root of a symmetric matrix, of which the lower triangle is read; negative eigenvalues, which
   round-off leaves in covariances, count as zero. Both are stored column by column. */
void gbt_symmetric_root(const gbt_real *matrix, gbt_real *root);

#if GBT_MOMENTS
/* All parameters, in the order of gbt_plan_parameters; the arguments are those of gbt_plan. */
void gbt_bind(const gbt_real *mean, const gbt_real *covariance, const gbt_real *desired, gbt_real *parameters);
#endif

GBT_END_C

#endif
