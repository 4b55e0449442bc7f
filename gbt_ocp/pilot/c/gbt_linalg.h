/* Small dense matrices, row by row. */
#ifndef GBT_LINALG_H
#define GBT_LINALG_H

#include "gbt_real.h"

GBT_BEGIN_C

#define GBT_LARGEST 9 /* rows of a matrix, at most */

/* Solves a x = b for so many right-hand sides, a n x n, b n x columns, which x replaces; a is spent. 0 if a is singular. */
int gbt_solve_square(gbt_real *a, int n, gbt_real *b, int columns);

/* The mean of a matrix and its transpose, in its place. */
void gbt_symmetric(gbt_real *a, int n);

/* out = a b a', a n x n, b n x n symmetric; made symmetric. */
void gbt_congruent(const gbt_real *a, const gbt_real *b, int n, gbt_real *out);

/* l with l l' the covariance: the Cholesky factor, or where there is none, one of which negative eigenvalues are taken
   for round-off. */
void gbt_covariance_root(const gbt_real *covariance, int n, gbt_real *l);

GBT_END_C

#endif
