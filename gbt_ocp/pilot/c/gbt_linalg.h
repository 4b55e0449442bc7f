/* Small dense matrices, row by row. */
#ifndef GBT_LINALG_H
#define GBT_LINALG_H

#include "gbt_real.h"

GBT_BEGIN_C

#define GBT_LARGEST 10 /* rows of a matrix that is given in full, at most: position, velocity, acceleration and size in space */
#define GBT_ROW_BEGIN(i) ((i) * ((i) + 1) / 2) /* where a row of a lower triangle begins that is given row by row; its size */

/* Solves a x = b for so many right-hand sides, a n x n, b n x columns, which x replaces; a is spent. 0 if a is singular. */
int gbt_solve_square(gbt_real *a, int n, gbt_real *b, int columns);

/* The mean of a matrix and its transpose, in its place. */
void gbt_symmetric(gbt_real *a, int n);

/* out = a b a', a n x n, b n x n symmetric; made symmetric. */
void gbt_congruent(const gbt_real *a, const gbt_real *b, int n, gbt_real *out);

/* Eigenvalues of a symmetric matrix, on its diagonal, and its eigenvectors, a column each; a is spent. */
void gbt_eigen(gbt_real *a, int n, gbt_real *vectors);

/* l with l l' the covariance: the Cholesky factor, or where there is none, one of which negative eigenvalues are taken
   for round-off. */
void gbt_covariance_root(const gbt_real *covariance, int n, gbt_real *l);

/* The lower Cholesky factor of a symmetric matrix of n rows, whose lower triangle is given, in its place; 0 if there is
   none. */
int gbt_factor_lower(gbt_real *lower, int n);

/* l^-1 x and l^-T x in the place of x, of a lower triangle l. */
void gbt_solve_lower(const gbt_real *lower, int n, gbt_real *x);
void gbt_solve_upper(const gbt_real *lower, int n, gbt_real *x);

GBT_END_C

#endif
