/* Symmetric matrices of the rows of a window and their Cholesky factors, as lower triangles row by row. */
#ifndef GBT_GP_TRIANGLE_H
#define GBT_GP_TRIANGLE_H

#include "gbt_bearing.h"
#include "gbt_linalg.h"
#include "gbt_pilot_settings.h"
#include "gbt_wide.h"

GBT_BEGIN_C

#define GBT_ROWS_OF_WINDOW (GBT_WINDOW * GBT_AXES + GBT_DIMENSION) /* two bearings in space have two rows; and the prior */
#define GBT_PACKED GBT_ROW_BEGIN(GBT_ROWS_OF_WINDOW) /* entries of the lower triangle of a matrix of the rows */

/* The lower Cholesky factor L of a symmetric matrix of n rows in its place, with the reciprocals of its pivots on the
   diagonal; 0 if there is none. */
int gbt_factor(gbt_wide *lower, int n);

/* L^-1 in the place of a factor. */
void gbt_invert_factor(gbt_wide *lower, int n);

/* a = L^-1 a L^-T in its place, and that of a number times the identity. */
void gbt_whiten_symmetric(const gbt_wide *inverse, int n, gbt_wide *a);
void gbt_whiten_identity(const gbt_wide *inverse, int n, gbt_real number, gbt_wide *a);

/* A symmetric matrix that is zero but for so many rows and columns from the first on. */
typedef struct {
    const gbt_wide *lower;
    int first, rows;
} gbt_block;

/* tr a, x' a x, and tr a b, where a has no rows that b has not. */
gbt_real gbt_trace(gbt_block a);
gbt_real gbt_form_of(gbt_block a, const gbt_wide *x);
gbt_real gbt_trace_of_product(gbt_block a, gbt_block b);

GBT_END_C

#endif
